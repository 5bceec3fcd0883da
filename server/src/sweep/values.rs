//! The values of a factor: from a share of its range to a number that people can read.

use roost_api::design::Scale;
use serde_json::{Value, json};

/// What values a factor takes.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    /// These.
    Levels(Vec<Value>),
    /// The numbers between two.
    Between(Between),
    /// Those that the rows of a list give it.
    Listed,
}

/// The numbers from `low` to `high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Between {
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) scale: Scale,
    /// Whole numbers only; both ends are.
    pub(super) is_whole: bool,
}

impl Values {
    /// The value at a number from 0 to 1 (excluded) that was drawn; every level, and every whole number on a linear scale, has an
    /// equal part of it.
    pub(super) fn drawn(&self, unit: f64) -> Value {
        match self {
            Self::Levels(levels) => {
                let index = (unit * levels.len() as f64) as usize;
                levels[index.min(levels.len() - 1)].clone()
            }
            Self::Between(between) if between.is_whole => {
                let wider = Between { high: between.high + 1.0, ..*between };
                json!(wider.number(unit).floor().min(between.high) as i64)
            }
            Self::Between(between) => json!(between.number(unit)),
            Self::Listed => Value::Null,
        }
    }
}

impl Between {
    /// So many values from the lowest to the highest, at equal distances; whole numbers may coincide.
    pub(super) fn spread(&self, count: u32) -> Vec<Value> {
        let value = |index| {
            let number = self.number(f64::from(index) / f64::from(count.max(2) - 1));
            if self.is_whole { json!(number.round() as i64) } else { json!(number) }
        };
        (0..count).map(value).collect()
    }

    /// The number at a share of the way, to twelve digits: 0.25 and not 0.25000000000000006, and the same on all machines
    /// whatever their logarithms do with the last bit.
    fn number(&self, share: f64) -> f64 {
        let number = match self.scale {
            Scale::Linear => self.low + share * (self.high - self.low),
            Scale::Log => self.low * (self.high / self.low).powf(share),
        };
        let short: f64 = format!("{number:.11e}").parse().unwrap_or(number);
        short.clamp(self.low, self.high)
    }
}
