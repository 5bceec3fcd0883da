//! Units in which people measure, as multiples of the units of responses and curves.

/// Spelling, unit of the table of results, and the factor from the first to the second.
const UNITS: &[(&str, &str, f64)] = &[
    ("kPa", "Pa", 1e3),
    ("MPa", "Pa", 1e6),
    ("N/mm²", "Pa", 1e6),
    ("N/cm²", "Pa", 1e4),
    ("mm", "m", 1e-3),
    ("cm", "m", 1e-2),
    ("deg", "°", 1.0),
    ("rad", "°", 180.0 / std::f64::consts::PI),
    ("ms", "s", 1e-3),
    ("min", "s", 60.0),
    ("g", "kg", 1e-3),
    ("g/s", "kg/s", 1e-3),
    ("kg/min", "kg/s", 1.0 / 60.0),
    ("kg/h", "kg/s", 1.0 / 3600.0),
    ("t/h", "kg/s", 1.0 / 3.6),
    ("kg/m3", "kg/m³", 1.0),
    ("kg/l", "kg/m³", 1e3),
    ("g/cm³", "kg/m³", 1e3),
    ("g/cm3", "kg/m³", 1e3),
    ("mJ", "J", 1e-3),
    ("mN", "N", 1e-3),
    ("kN", "N", 1e3),
    ("N m", "N·m", 1.0),
    ("kW", "W", 1e3),
    ("%", "", 1e-2),
    ("1", "", 1.0),
];

/// The factor from a unit to one of the table of results; none if it is no multiple of it.
pub(super) fn factor(from: &str, to: &str) -> Option<f64> {
    let known = UNITS.iter().find(|(spelling, unit, _)| (*spelling, *unit) == (from, to));
    if from == to { Some(1.0) } else { known.map(|(.., factor)| *factor) }
}

/// The units that are converted to one of the table of results, in words.
pub(super) fn allowed(to: &str) -> String {
    let own = if to.is_empty() { "no unit" } else { to };
    let others = UNITS.iter().filter(|(_, unit, _)| *unit == to).map(|(spelling, ..)| *spelling);
    std::iter::once(own).chain(others).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use roost_solver::experiments::{all_curves, all_responses, all_series};

    use super::*;

    #[test]
    fn units_are_converted_by_their_definitions() {
        let close = |from, to, expected: f64| {
            let found = factor(from, to).unwrap_or_else(|| panic!("{from} to {to}"));
            assert!((found / expected - 1.0).abs() < 1e-15, "{from} to {to}: {found}");
        };
        close("Pa", "Pa", 1.0);
        close("kPa", "Pa", 1000.0);
        close("N/mm²", "Pa", 1.0 / (1e-3 * 1e-3));
        close("N/cm²", "Pa", 1.0 / (1e-2 * 1e-2));
        close("cm", "m", 0.01);
        // A turn has 2π rad and 360°.
        close("rad", "°", 360.0 / std::f64::consts::TAU);
        close("t/h", "kg/s", 1000.0 / 3600.0);
        close("kg/min", "kg/s", 1.0 / 60.0);
        close("g/cm³", "kg/m³", 1e-3 / 1e-6);
        close("kg/l", "kg/m³", 1.0 / 1e-3);
        close("%", "", 0.01);
        assert_eq!(factor("kPa", "m"), None);
        assert_eq!(factor("Pa", "kPa"), None, "only to the units of the table");
        assert_eq!(factor("", "Pa"), None);
    }

    #[test]
    fn every_unit_of_the_table_belongs_to_results() {
        let mut own: Vec<&str> = all_responses().iter().map(|shared| shared.row.unit).collect();
        own.extend(all_curves().iter().flat_map(|shared| [shared.row.unit, shared.row.over_unit]));
        own.extend(all_series().iter().map(|shared| shared.row.unit));
        for (spelling, unit, _) in UNITS {
            assert!(own.contains(unit), "{spelling}: nothing is measured in {unit}");
        }
        assert_eq!(allowed("°"), "°, deg, rad");
        assert_eq!(allowed(""), "no unit, %, 1");
    }
}
