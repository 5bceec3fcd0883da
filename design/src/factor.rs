//! Factors: named ranges, and their mapping to the unit interval.

use serde::{Deserialize, Serialize};

use crate::fault::{Fault, fault};

/// Decimal places of values, for a range of 1.
const DIGITS: i32 = 7;

/// The scale of a factor between `low` and `high`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// Linear.
    #[default]
    Linear,
    /// Logarithmic; `low` is positive.
    Log,
}

/// A factor of a study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Factor {
    /// Its name: the JSON pointer of the scenario field.
    pub name: String,
    /// Lowest value, in the unit of the field.
    pub low: f64,
    /// Highest value, in the unit of the field.
    pub high: f64,
    /// Scale between the two.
    #[serde(default)]
    pub scale: Scale,
}

impl Factor {
    /// The value at a coordinate from 0 (`low`) to 1 (`high`), rounded to about seven digits of the range, or of the value on a
    /// logarithmic scale. A value that a user typed is thus found again from its coordinate.
    pub fn value(&self, coordinate: f64) -> f64 {
        let (value, size) = match self.scale {
            Scale::Linear => (self.low + coordinate * (self.high - self.low), self.high - self.low),
            Scale::Log => {
                let value = self.low * (self.high / self.low).powf(coordinate);
                (value, value)
            }
        };
        let places = DIGITS - size.log10().floor() as i32;
        let scale = 10.0_f64.powi(places.abs());
        // Division by a power of ten, unlike multiplication by its inverse, gives the number nearest to the decimal one.
        let rounded =
            if places < 0 { (value / scale).round() * scale } else { (value * scale).round() / scale };
        rounded.clamp(self.low, self.high)
    }

    /// The coordinate from 0 to 1 of a value; none outside the range.
    pub fn coordinate(&self, value: f64) -> Option<f64> {
        let coordinate = match self.scale {
            Scale::Linear => (value - self.low) / (self.high - self.low),
            Scale::Log => (value / self.low).ln() / (self.high / self.low).ln(),
        };
        (self.low..=self.high).contains(&value).then(|| coordinate.clamp(0.0, 1.0))
    }

    pub(crate) fn faults(&self, at: &str, faults: &mut Vec<Fault>) {
        if self.name.is_empty() {
            faults.push(fault(&format!("{at}/name"), &self.name, "the factor has no name", "a name"));
        }
        if self.low >= self.high {
            let allowed = format!("more than {}", self.low);
            faults.push(fault(&format!("{at}/high"), self.high, "not above `low`", &allowed));
        }
        if self.scale == Scale::Log && self.low <= 0.0 {
            let message = "a logarithmic scale has positive numbers only";
            faults.push(fault(&format!("{at}/low"), self.low, message, "more than 0, or a linear scale"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_and_coordinates_are_inverse() {
        for scale in [Scale::Linear, Scale::Log] {
            let factor = Factor { name: "/gate/height_m".into(), low: 0.02, high: 0.2, scale };
            assert_eq!((factor.value(0.0), factor.value(1.0)), (0.02, 0.2));
            for step in 0..=10 {
                let coordinate = f64::from(step) / 10.0;
                let back = factor.coordinate(factor.value(coordinate)).unwrap();
                assert!((back - coordinate).abs() < 1e-7, "{scale:?}: {back}, not {coordinate}");
            }
            assert_eq!(factor.coordinate(0.21), None);
        }
        let log = Factor { name: "x".into(), low: 1.0, high: 100.0, scale: Scale::Log };
        assert!((log.value(0.5) - 10.0).abs() < 1e-12);
    }
}
