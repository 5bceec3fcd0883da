//! Names and units of scenario fields and responses, as labels and values.

use roost_solver::experiments::{ALL, all_responses};
use roost_solver::observable::lines;
use roost_solver::scenario::field::FieldKind;
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
    /// section are in the name, since several contacts have a `static_friction`. `/equipment/surfaces/1/position_m/2` is the position z.
    pub fn of_field(pointer: &str) -> Self {
        if let Some((list, index)) = pointer.rsplit_once('/')
            && let Some(field) = fields::find(list)
        {
            let parts = match field.kind {
                FieldKind::Vector(_) => ["x", "y", "z"],
                FieldKind::Sizes(_) => ["length", "width", "thickness"],
                _ => ["0", "1", "2"],
            };
            let part = index.parse().ok().and_then(|index: usize| parts.get(index)).copied();
            let Self { name, unit } = Self::of_field(list);
            return Self { name: format!("{name} {}", part.unwrap_or(index)), unit };
        }
        let unit = fields::find(pointer).map_or("", |field| field.unit);
        let name = pointer.trim_start_matches('/');
        Self::new(&name.split_once('/').map_or(name, |(_, below)| below).replace('/', " "), unit)
    }

    /// The quantity of a response: `mean_rate_kg_s` is the mean rate in kg/s. Also that of a place of a curve or series:
    /// `stress_pa@strain=0.02` is the stress at strain 0.02, in Pa.
    pub fn of_response(name: &str) -> Self {
        if let Some((of, place)) = name.split_once('@') {
            let of = Self::of_axis(of);
            let place = match place.split_once('=') {
                Some((along, at)) => {
                    let along = Self::of_axis(along);
                    format!("{} {}", along.name, along.with_unit(at))
                }
                None => Self::of_axis(place).name,
            };
            return Self { name: format!("{} at {place}", of.name), unit: of.unit };
        }
        let row = all_responses().into_iter().find(|shared| shared.row.name == name);
        Self::new(name, row.map_or("", |shared| shared.row.unit))
    }

    /// The quantity of an axis of a curve or series, such as `stress_pa`.
    pub fn of_axis(name: &str) -> Self {
        let mut lines = ALL.iter().flat_map(|(_, outputs)| lines(outputs));
        match lines.find(|line| line.of.suffixed() == name) {
            Some(line) => Self { name: line.of.name.replace('_', " "), unit: line.of.unit.to_owned() },
            None => Self::new(name, ""),
        }
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
        assert_eq!(field("/equipment/surfaces/1/position_m/2"), "surfaces 1 position z (m)");
        assert_eq!(field("/compress/lattice/0"), "lattice 0");
        let response = |name: &str| Quantity::of_response(name).label();
        assert_eq!(response("mean_rate_kg_s"), "mean rate (kg/s)");
        assert_eq!(response("bulk_density_kg_m3"), "bulk density (kg/m³)");
        assert_eq!(response("curl_angle_deg"), "curl angle (°)");
        assert_eq!(response("rate_variation"), "rate variation");
        assert_eq!(response("stress_pa@strain=0.02"), "stress at strain 0.02 (Pa)");
        assert_eq!(response("discharged_mass_kg@time_s=4"), "discharged mass at time 4 s (kg)");
        assert_eq!(Quantity::of_field("/equipment/gate_opening_m").with_unit("0.0523"), "0.0523 m");
    }
}
