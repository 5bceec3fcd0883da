//! Factors: ranges of numbers or of whole numbers, and lists of levels, with their mapping to the unit interval.
//!
//! | factor | its part of the unit interval |
//! |---|---|
//! | numbers from `low` to `high` | 0 is `low`, 1 is `high` |
//! | whole numbers from `low` to `high` | 0 is `low` − ½, 1 is `high` + ½; every value has a cell around it |
//! | k levels | k cells of width 1/k, in the order of the list |
//!
//! Numbers that are uniform from 0 to 1 thus choose each whole number of a linear scale, and each level, equally often. The coordinate of
//! such a value is a fixed place in its cell, so that equal values are equal points.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::fault::{Fault, fault};

/// Decimal places of values, for a range of 1.
const DIGITS: i32 = 7;
/// Maximum number of levels: more are no list of kinds, and a search has to try each of them.
const MAX_LEVELS: usize = 32;
/// Maximum of the magnitude of a whole number: far more than any field takes, and exact in coordinates.
const MAX_WHOLE: f64 = 1e6;

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
#[serde(try_from = "Document", into = "Document")]
pub struct Factor {
    /// Its name: the JSON pointer of the scenario field.
    pub name: String,
    /// Lowest value, in the unit of the field; of a factor with levels 0, the index of the first.
    pub low: f64,
    /// Highest value, in the unit of the field; of a factor with levels the index of the last.
    pub high: f64,
    /// Scale between the two.
    pub scale: Scale,
    /// Whether its values are whole numbers; always so for the indices of levels.
    pub is_whole: bool,
    /// Its levels, which have no order: words, truth values or numbers. Empty for a range.
    pub levels: Vec<Value>,
}

/// A factor as a document has it.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    name: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    low: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    high: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    scale: Option<Scale>,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    is_whole: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    levels: Option<Vec<Value>>,
}

impl TryFrom<Document> for Factor {
    type Error = &'static str;

    fn try_from(document: Document) -> Result<Self, Self::Error> {
        let Document { name, low, high, scale, is_whole, levels } = document;
        match (low, high, scale, levels) {
            (Some(low), Some(high), scale, None) => {
                Ok(Self { scale: scale.unwrap_or_default(), is_whole, ..Self::range(name, low, high) })
            }
            (None, None, None, Some(levels)) if !levels.is_empty() => Ok(Self::of_levels(name, levels)),
            _ => Err("a factor has both `low` and `high`, or two or more `levels`"),
        }
    }
}

impl From<Factor> for Document {
    fn from(factor: Factor) -> Self {
        let Factor { name, low, high, scale, is_whole, levels } = factor;
        if levels.is_empty() {
            return Self {
                name,
                low: Some(low),
                high: Some(high),
                scale: Some(scale),
                is_whole,
                levels: None,
            };
        }
        Self { name, low: None, high: None, scale: None, is_whole: false, levels: Some(levels) }
    }
}

impl Factor {
    /// A range of numbers on a linear scale.
    pub fn range(name: String, low: f64, high: f64) -> Self {
        Self { name, low, high, scale: Scale::Linear, is_whole: false, levels: Vec::new() }
    }

    /// A list of levels.
    pub fn of_levels(name: String, levels: Vec<Value>) -> Self {
        let high = levels.len().saturating_sub(1) as f64;
        Self { name, low: 0.0, high, scale: Scale::Linear, is_whole: true, levels }
    }

    /// Whether its values are levels without an order.
    pub fn is_categorical(&self) -> bool {
        !self.levels.is_empty()
    }

    /// Number of its values; none for numbers that are not whole.
    pub fn count(&self) -> Option<usize> {
        self.is_whole.then(|| (self.high - self.low).max(0.0) as usize + 1)
    }

    /// The values at coordinates 0 and 1.
    fn ends(&self) -> (f64, f64) {
        if self.is_whole { (self.low - 0.5, self.high + 0.5) } else { (self.low, self.high) }
    }

    /// The number at a coordinate from 0 to 1 as its scale has it, without any rounding: where a picture draws it.
    pub fn place(&self, coordinate: f64) -> f64 {
        let (low, high) = self.ends();
        match self.scale {
            Scale::Linear => low + coordinate * (high - low),
            Scale::Log => low * (high / low).powf(coordinate),
        }
    }

    /// The number at a coordinate from 0 to 1, of a factor with levels the index of a level. A whole number where the factor has
    /// such; else rounded to about seven digits of the range, or of the value on a logarithmic scale. A value that a user typed is
    /// thus found again from its coordinate.
    pub fn value(&self, coordinate: f64) -> f64 {
        let value = self.place(coordinate);
        if self.is_whole {
            return value.round().clamp(self.low, self.high);
        }
        let size = match self.scale {
            Scale::Linear => self.high - self.low,
            Scale::Log => value,
        };
        let places = DIGITS - size.log10().floor() as i32;
        let scale = 10.0_f64.powi(places.abs());
        // Division by a power of ten, unlike multiplication by its inverse, gives the number nearest to the decimal one.
        let rounded =
            if places < 0 { (value / scale).round() * scale } else { (value * scale).round() / scale };
        rounded.clamp(self.low, self.high)
    }

    /// The coordinate from 0 to 1 of a number or index; none outside the range, or between whole numbers.
    pub fn coordinate(&self, value: f64) -> Option<f64> {
        let (low, high) = self.ends();
        let coordinate = match self.scale {
            Scale::Linear => (value - low) / (high - low),
            Scale::Log => (value / low).ln() / (high / low).ln(),
        };
        let is_value = (self.low..=self.high).contains(&value) && (!self.is_whole || value.fract() == 0.0);
        is_value.then(|| coordinate.clamp(0.0, 1.0))
    }

    /// The share of the way from `low` to `high` on the scale.
    pub(crate) fn share(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => (value - self.low) / (self.high - self.low),
            Scale::Log => (value / self.low).ln() / (self.high / self.low).ln(),
        }
    }

    /// The value of the field for a number or index: a level, a whole number, or a number.
    pub fn level(&self, number: f64) -> Value {
        if self.is_categorical() {
            return self.levels.get(number as usize).cloned().unwrap_or_default();
        }
        if self.is_whole { json!(number as i64) } else { json!(number) }
    }

    /// The number or index of a value of the field; none if it has another form, or is no level. It may be outside the range.
    pub fn number(&self, value: &Value) -> Option<f64> {
        if !self.is_categorical() {
            return value.as_f64();
        }
        let is_same = |level: &Value| {
            level == value || level.as_f64().is_some_and(|number| value.as_f64() == Some(number))
        };
        Some(self.levels.iter().position(is_same)? as f64)
    }

    /// The allowed values in words.
    pub fn allowed(&self) -> String {
        if self.is_categorical() {
            let levels: Vec<String> = self.levels.iter().map(Value::to_string).collect();
            return format!("one of {}", levels.join(", "));
        }
        let kind = if self.is_whole { "a whole number from " } else { "" };
        format!("{kind}{} to {}", self.low, self.high)
    }

    pub(crate) fn faults(&self, at: &str, faults: &mut Vec<Fault>) {
        if self.name.is_empty() {
            faults.push(fault(&format!("{at}/name"), &self.name, "the factor has no name", "a name"));
        }
        if self.is_categorical() {
            return self.faults_of_levels(at, faults);
        }
        if self.low >= self.high {
            let allowed = format!("more than {}", self.low);
            faults.push(fault(&format!("{at}/high"), self.high, "not above `low`", &allowed));
        }
        if self.scale == Scale::Log && self.low <= 0.0 {
            let message = "a logarithmic scale has positive numbers only";
            faults.push(fault(&format!("{at}/low"), self.low, message, "more than 0, or a linear scale"));
        }
        for (end, value) in [("low", self.low), ("high", self.high)] {
            if self.is_whole && (value.fract() != 0.0 || value.abs() > MAX_WHOLE) {
                let allowed = format!("a whole number from -{MAX_WHOLE} to {MAX_WHOLE}");
                faults.push(fault(&format!("{at}/{end}"), value, "the field has whole numbers", &allowed));
            }
        }
    }

    fn faults_of_levels(&self, at: &str, faults: &mut Vec<Fault>) {
        let at = format!("{at}/levels");
        if !(2..=MAX_LEVELS).contains(&self.levels.len()) {
            let detail = format!("{} levels", self.levels.len());
            faults.push(fault(&at, &self.levels, &detail, &format!("2 to {MAX_LEVELS} levels")));
        }
        for (index, level) in self.levels.iter().enumerate() {
            if level.is_null() || level.is_array() || level.is_object() {
                let allowed = "a word, a number, true or false";
                faults.push(fault(&format!("{at}/{index}"), level, "not a level", allowed));
            } else if self.number(level) != Some(index as f64) {
                faults.push(fault(
                    &format!("{at}/{index}"),
                    level,
                    "the level is listed twice",
                    "different levels",
                ));
            }
        }
    }
}

#[cfg(test)]
#[path = "tests/factor.rs"]
mod tests;
