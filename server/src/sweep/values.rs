//! The values of a factor.

use roost_api::design::Scale;
use serde_json::{Value, json};

/// The values that a factor takes.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum FactorValues {
    /// Listed levels.
    Levels(Vec<Value>),
    /// The numbers of a range.
    Range(NumberRange),
    /// The values in the rows of the design.
    Rows,
}

/// The numbers from `low` to `high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct NumberRange {
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) scale: Scale,
    /// Only whole numbers; both ends are whole.
    pub(super) is_whole: bool,
}

impl FactorValues {
    /// The value at a share of 0 to 1 (excluded). Every level, and every whole number on a linear scale, has an equal part.
    pub(super) fn at(&self, share: f64) -> Value {
        match self {
            Self::Levels(levels) => {
                let index = (share * levels.len() as f64) as usize;
                levels[index.min(levels.len() - 1)].clone()
            }
            Self::Range(range) if range.is_whole => {
                let wider = NumberRange { high: range.high + 1.0, ..*range };
                json!(wider.number(share).floor().min(range.high) as i64)
            }
            Self::Range(range) => json!(range.number(share)),
            Self::Rows => Value::Null,
        }
    }
}

impl NumberRange {
    /// This many values from the lowest to the highest, at equal distances; whole numbers may coincide.
    pub(super) fn levels(&self, count: u32) -> Vec<Value> {
        let value = |index| {
            let number = self.number(f64::from(index) / f64::from(count.max(2) - 1));
            if self.is_whole { json!(number.round() as i64) } else { json!(number) }
        };
        (0..count).map(value).collect()
    }

    /// The number at a share of the range, to twelve digits: 0.25 and not 0.25000000000000006. The rounding also makes it the
    /// same on all machines, whose logarithms differ in the last bit.
    fn number(&self, share: f64) -> f64 {
        let number = match self.scale {
            Scale::Linear => self.low + share * (self.high - self.low),
            Scale::Log => self.low * (self.high / self.low).powf(share),
        };
        let short: f64 = format!("{number:.11e}").parse().unwrap_or(number);
        short.clamp(self.low, self.high)
    }
}

/// The source of the values of factors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ValueSource {
    /// Levels, listed or spread over a range.
    Levels {
        /// How many there are, or by default where they are spread over a range.
        count: u32,
        /// Whether every factor has exactly this number.
        is_fixed: bool,
    },
    /// Levels, or any number of a range.
    LevelsOrRange,
    /// The rows of the design.
    Rows,
}
