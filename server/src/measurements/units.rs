//! Units in which people measure, as multiples of the units of responses and curves.

use Conversion::{Over, Times};

/// How a number is converted. Decimal parts have whole divisors: 35 % is then 0.35 exactly, which 35 × 0.01 is not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Conversion {
    /// Multiply by a number.
    Times(f64),
    /// Divide by a number.
    Over(f64),
}

impl Conversion {
    /// A number in the other unit; infinite if it overflows.
    pub(super) fn of(self, number: f64) -> f64 {
        match self {
            Times(factor) => number * factor,
            Over(divisor) => number / divisor,
        }
    }
}

/// Spelling, unit of the table of results, and the conversion from the first to the second.
const UNITS: &[(&str, &str, Conversion)] = &[
    ("kPa", "Pa", Times(1e3)),
    ("MPa", "Pa", Times(1e6)),
    ("N/mm²", "Pa", Times(1e6)),
    ("N/cm²", "Pa", Times(1e4)),
    ("mm", "m", Over(1e3)),
    ("cm", "m", Over(100.0)),
    ("deg", "°", Times(1.0)),
    ("rad", "°", Times(180.0 / std::f64::consts::PI)),
    ("ms", "s", Over(1e3)),
    ("min", "s", Times(60.0)),
    ("g", "kg", Over(1e3)),
    ("g/s", "kg/s", Over(1e3)),
    ("kg/min", "kg/s", Over(60.0)),
    ("kg/h", "kg/s", Over(3600.0)),
    ("t/h", "kg/s", Over(3.6)),
    ("kg/m3", "kg/m³", Times(1.0)),
    ("kg/l", "kg/m³", Times(1e3)),
    ("g/cm³", "kg/m³", Times(1e3)),
    ("g/cm3", "kg/m³", Times(1e3)),
    ("mJ", "J", Over(1e3)),
    ("mN", "N", Over(1e3)),
    ("kN", "N", Times(1e3)),
    ("N m", "N·m", Times(1.0)),
    ("kW", "W", Times(1e3)),
    ("%", "", Over(100.0)),
    ("1", "", Times(1.0)),
];

/// The conversion from a unit to one of the table of results; none if it is no multiple of it.
pub(super) fn conversion(from: &str, to: &str) -> Option<Conversion> {
    let known = UNITS.iter().find(|(spelling, unit, _)| (*spelling, *unit) == (from, to));
    if from == to { Some(Times(1.0)) } else { known.map(|(.., conversion)| *conversion) }
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
            let found = conversion(from, to).unwrap_or_else(|| panic!("{from} to {to}")).of(1.0);
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
        assert_eq!(conversion("kPa", "m"), None);
        assert_eq!(conversion("Pa", "kPa"), None, "only to the units of the table");
        assert_eq!(conversion("", "Pa"), None);
    }

    #[test]
    fn converted_decimal_values_are_the_nearest_numbers() {
        for (from, to, number, expected) in
            [("%", "", 35.0, 0.35), ("mm", "m", 9.0, 0.009), ("kg/min", "kg/s", 3.0, 0.05)]
        {
            assert_eq!(conversion(from, to).unwrap().of(number), expected, "{number} {from}");
        }
        assert_eq!(conversion("kPa", "Pa").unwrap().of(1e308), f64::INFINITY);
    }

    #[test]
    fn every_unit_of_the_table_is_used_by_results() {
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
