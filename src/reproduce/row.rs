//! A row of the report: a quantity, what the paper says of it, what was measured, and whether that meets a demand.

use std::fmt;

use serde::Serialize;
use serde_json::Value;

use super::stats::{Difference, Sample, Seeds};
use crate::ui::format::significant;

/// One line of `report.json`, and of a table of `report.html`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Row {
    /// Figure or table of the paper.
    pub(super) figure: String,
    pub(super) quantity: String,
    /// Empty for what has none.
    pub(super) unit: String,
    /// What the paper quotes: a number, words, or null where its text gives nothing.
    pub(super) paper: Value,
    /// What came out: a number (the mean over seeds), words, or null where there was nothing to measure.
    pub(super) measured: Value,
    /// Half the width of the 95 % interval of `measured`; null for a single value.
    pub(super) half_width_95: Option<f64>,
    /// Simulations that `measured` comes from.
    pub(super) n: usize,
    /// What an honest test demands; null where it is reported as it comes out.
    pub(super) demand: Option<String>,
    /// Whether the demand is met; null without one. What could not be measured, or not under every seed, meets none.
    pub(super) holds: Option<bool>,
    /// Whether some of the seeds have no value.
    #[serde(skip)]
    is_partial: bool,
    pub(super) note: String,
}

/// What is demanded of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Demand {
    /// Up to rounding.
    Exactly(f64),
    AtLeast(f64),
    AtMost(f64),
    Below(f64),
    Above(f64),
    Between(f64, f64),
    /// Within so much to either side.
    Near(f64, f64),
}

impl Demand {
    fn is_met_by(self, value: f64) -> bool {
        match self {
            Self::Exactly(expected) => (value - expected).abs() <= 1e-9 * expected.abs(),
            Self::AtLeast(least) => value >= least,
            Self::AtMost(most) => value <= most,
            Self::Below(limit) => value < limit,
            Self::Above(limit) => value > limit,
            Self::Between(least, most) => (least..=most).contains(&value),
            Self::Near(middle, off) => (value - middle).abs() <= off,
        }
    }
}

impl fmt::Display for Demand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let s = significant;
        match *self {
            Self::Exactly(expected) => write!(f, "= {}", s(expected)),
            Self::AtLeast(least) => write!(f, "≥ {}", s(least)),
            Self::AtMost(most) => write!(f, "≤ {}", s(most)),
            Self::Below(limit) => write!(f, "< {}", s(limit)),
            Self::Above(limit) => write!(f, "> {}", s(limit)),
            Self::Between(least, most) => write!(f, "{} to {}", s(least), s(most)),
            Self::Near(middle, off) => write!(f, "{} ± {}", s(middle), s(off)),
        }
    }
}

impl Row {
    /// A row that nothing was measured for yet.
    pub(super) fn new(figure: &str, quantity: impl Into<String>, unit: &str) -> Self {
        Self {
            figure: figure.to_owned(),
            quantity: quantity.into(),
            unit: unit.to_owned(),
            paper: Value::Null,
            measured: Value::Null,
            half_width_95: None,
            n: 0,
            demand: None,
            holds: None,
            is_partial: false,
            note: String::new(),
        }
    }

    /// What the paper's text quotes.
    pub(super) fn paper(self, paper: impl Into<Value>) -> Self {
        Self { paper: paper.into(), ..self }
    }

    /// One value; none where it was not reached.
    pub(super) fn one(self, value: Option<f64>) -> Self {
        self.many(value.as_slice())
    }

    /// Values of several seeds.
    pub(super) fn many(self, values: &[f64]) -> Self {
        self.sample(Sample::of(values))
    }

    pub(super) fn sample(self, sample: Option<Sample>) -> Self {
        Self {
            measured: sample.map(|sample| sample.mean).into(),
            half_width_95: sample.and_then(|sample| sample.half_width()),
            n: sample.map_or(0, |sample| sample.n),
            ..self
        }
    }

    /// Values of the seeds that were planned; says so where some of them have none.
    pub(super) fn seeds(self, seeds: &Seeds) -> Self {
        let (reached, planned) = (seeds.values.len(), seeds.planned);
        let row = Self { is_partial: reached < planned, ..self.many(&seeds.values) };
        if row.is_partial { row.note(format!("{reached} of {planned} runs reached it")) } else { row }
    }

    /// A difference or a ratio of the means of so many simulations.
    pub(super) fn difference_of(self, difference: Option<Difference>, n: usize) -> Self {
        let row = self.overall(difference.map(|difference| difference.mean), n);
        Self { half_width_95: difference.map(|difference| difference.half_width), ..row }
    }

    /// A value that several simulations together make.
    pub(super) fn overall(self, value: Option<f64>, n: usize) -> Self {
        Self { n, ..self.one(value) }
    }

    /// Something that is told in words.
    pub(super) fn words(self, words: impl Into<String>, n: usize) -> Self {
        Self { measured: words.into().into(), n, ..self }
    }

    /// Demands something of the number measured, a mean where there are several; says so where the interval leaves it open.
    pub(super) fn demand(self, demand: Demand) -> Self {
        let measured = self.measured.as_f64();
        let met = measured.is_some_and(|value| demand.is_met_by(value)) && !self.is_partial;
        let ends = measured.zip(self.half_width_95).map(|(mean, half)| [mean - half, mean + half]);
        let is_open = ends.is_some_and(|ends| ends.into_iter().any(|end| demand.is_met_by(end) != met));
        let row = self.demand_in_words(demand.to_string(), met);
        if is_open { row.note("the 95 % interval goes past the demand") } else { row }
    }

    /// A demand that is met or not.
    pub(super) fn demand_in_words(self, demand: impl Into<String>, is_met: bool) -> Self {
        Self { demand: Some(demand.into()), holds: Some(is_met), ..self }
    }

    /// Adds to what else there is to know.
    pub(super) fn note(mut self, note: impl AsRef<str>) -> Self {
        if !self.note.is_empty() && !note.as_ref().is_empty() {
            self.note.push_str("; ");
        }
        self.note.push_str(note.as_ref());
        self
    }

    /// Difference of what was measured to the paper's number, as a share of that.
    pub(super) fn difference(&self) -> Option<f64> {
        let paper = self.paper.as_f64().filter(|paper| *paper != 0.0)?;
        Some((self.measured.as_f64()? - paper) / paper)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row() -> Row {
        Row::new("Fig. 14", "mass out at 4 s", "kg").paper(33.2)
    }

    #[test]
    fn a_demand_that_is_not_met_says_so() {
        let demand = Demand::Near(33.2, 2.3);
        assert_eq!(row().many(&[31.0, 33.0]).demand(demand).holds, Some(true));
        assert_eq!(row().many(&[25.0, 26.0]).demand(demand).holds, Some(false));
        assert_eq!(row().one(None).demand(demand).holds, Some(false), "nothing was measured");
        assert_eq!(row().one(Some(25.0)).holds, None, "nothing was demanded");
        assert_eq!(row().one(Some(f64::NAN)).demand(Demand::AtMost(1.0)).holds, Some(false));
    }

    #[test]
    fn an_interval_that_leaves_a_demand_open_is_noted() {
        let of = |values: &[f64]| row().many(values).demand(Demand::AtMost(33.0));
        assert_eq!(of(&[32.0, 32.1, 32.2]).note, "");
        let open = of(&[32.0, 33.5]);
        assert_eq!((open.holds, &*open.note), (Some(true), "the 95 % interval goes past the demand"));
    }

    #[test]
    fn what_some_seeds_did_not_reach_is_noted() {
        let seeds = |planned| Seeds { values: vec![1.0, 2.0], planned };
        assert_eq!(row().seeds(&seeds(2)).note, "");
        let row = row().seeds(&seeds(3)).note("and more");
        assert_eq!((row.n, &*row.note), (2, "2 of 3 runs reached it; and more"));
        assert_eq!(row.demand(Demand::AtMost(9.0)).holds, Some(false), "those that reached it are not all");
    }

    #[test]
    fn every_kind_of_demand_can_fail() {
        let cases = [
            (Demand::Exactly(0.1 + 0.2), 0.3, 0.3001),
            (Demand::AtLeast(1.0), 1.0, 0.9),
            (Demand::AtMost(1.0), 1.0, 1.1),
            (Demand::Below(1.0), 0.9, 1.0),
            (Demand::Above(1.0), 1.1, 1.0),
            (Demand::Between(1.0, 2.0), 2.0, 2.1),
            (Demand::Near(1.0, 0.5), 1.5, 0.4),
        ];
        for (demand, good, bad) in cases {
            assert!(demand.is_met_by(good) && !demand.is_met_by(bad), "{demand}");
        }
    }

    #[test]
    fn difference_is_a_share_of_the_papers_number() {
        assert_eq!(row().one(Some(16.6)).difference(), Some(-0.5));
        assert_eq!(row().paper("linear").one(Some(16.6)).difference(), None);
        assert_eq!(row().one(None).difference(), None);
    }
}
