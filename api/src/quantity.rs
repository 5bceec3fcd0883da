//! Names and units of scenario fields and responses, as labels and values.

use roost_solver::experiments::all_responses;
use roost_solver::scenario::fields;

/// A quantity with its name and unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Quantity {
    /// Its name in words, without the unit.
    pub name: String,
    /// Its unit; empty for numbers without one.
    pub unit: String,
}

impl Quantity {
    /// The quantity of a scenario's field: `/equipment/gate_opening_m` is the gate opening in m. All parts of the pointer below its
    /// section are in the name, since several contacts have a `static_friction`.
    pub fn of_field(pointer: &str) -> Self {
        let unit = fields::find(pointer).map_or("", |field| field.unit);
        let name = pointer.trim_start_matches('/');
        Self::new(&name.split_once('/').map_or(name, |(_, below)| below).replace('/', " "), unit)
    }

    /// The quantity of a response: `mean_rate_kg_s` is the mean rate in kg/s.
    pub fn of_response(name: &str) -> Self {
        let row = all_responses().into_iter().find(|shared| shared.row.name == name);
        Self::new(name, row.map_or("", |shared| shared.row.unit))
    }

    fn new(name: &str, unit: &str) -> Self {
        let unit = if unit == "1" { "" } else { unit };
        let suffix = match unit {
            "°" => "_deg".to_owned(),
            unit => format!(
                "_{}",
                unit.to_lowercase().replace(['/', '·'], "_").replace('²', "2").replace('³', "3")
            ),
        };
        let stem = name.strip_suffix(&suffix).filter(|_| !unit.is_empty()).unwrap_or(name);
        Self { name: stem.replace('_', " "), unit: unit.to_owned() }
    }

    /// Name and unit, such as `gate opening (m)`.
    pub fn label(&self) -> String {
        if self.unit.is_empty() { self.name.clone() } else { format!("{} ({})", self.name, self.unit) }
    }

    /// A number as text with the unit, such as `0.052 m`.
    pub fn with_unit(&self, number: &str) -> String {
        if self.unit.is_empty() { number.to_owned() } else { format!("{number} {}", self.unit) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_have_name_and_unit() {
        let field = |pointer: &str| Quantity::of_field(pointer).label();
        assert_eq!(field("/equipment/gate_opening_m"), "gate opening (m)");
        assert_eq!(field("/equipment/belt_speed_m_s"), "belt speed (m/s)");
        assert_eq!(field("/contact/condition"), "condition");
        assert_eq!(field("/contact/fillet_belt/static_friction"), "fillet belt static friction");
        assert_eq!(field("/seed"), "seed");
        let response = |name: &str| Quantity::of_response(name).label();
        assert_eq!(response("mean_rate_kg_s"), "mean rate (kg/s)");
        assert_eq!(response("bulk_density_kg_m3"), "bulk density (kg/m³)");
        assert_eq!(response("curl_angle_deg"), "curl angle (°)");
        assert_eq!(response("rate_variation"), "rate variation");
        assert_eq!(Quantity::of_field("/equipment/gate_opening_m").with_unit("0.0523"), "0.0523 m");
    }
}
