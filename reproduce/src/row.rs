//! A row of the report: a quantity, its value in the paper, its measured value, and whether that meets a demand.

use std::fmt;

use roost_stats::{Difference, ReplicateValues, Sample};
use roost_terminal::format::significant;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// One line of `report.json`, and of a table of `report.html`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Row {
    /// Figure or table of the paper.
    pub(crate) figure: String,
    pub(crate) quantity: String,
    /// Empty for a quantity without a unit.
    pub(crate) unit: String,
    /// The value in the paper's text: a number, a text, or null if it gives none.
    pub(crate) paper: Value,
    /// The value in the simulations: a number (the mean over seeds), a text, or null if there is none.
    pub(crate) measured: Value,
    /// Half the width of the 95 % interval of `measured`; null for a single value.
    pub(crate) half_width_95: Option<f64>,
    /// Number of simulations behind `measured`.
    pub(crate) n: usize,
    /// A fair test of the model; null if the value is only reported.
    pub(crate) demand: Option<String>,
    /// Whether the demand is met; null without a demand. A value that some seeds did not reach meets none.
    pub(crate) holds: Option<bool>,
    /// Whether some of the seeds have no value.
    #[serde(skip)]
    is_partial: bool,
    /// Remarks on the row.
    pub(crate) note: String,
}

/// Numbers of demands on simulations that hold and that do not. Demands on given shapes and parameters do not count.
pub(crate) fn counts<'a>(rows: impl Iterator<Item = &'a Row>) -> (usize, usize) {
    let rows = rows.filter(|row| row.n > 0 || row.holds == Some(false));
    rows.fold((0, 0), |(holds, fails), row| match row.holds {
        Some(true) => (holds + 1, fails),
        Some(false) => (holds, fails + 1),
        None => (holds, fails),
    })
}

/// A demand on a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Demand {
    /// Equal up to rounding.
    Exactly(f64),
    AtLeast(f64),
    AtMost(f64),
    Below(f64),
    Above(f64),
    Between(f64, f64),
    /// At most the second number away from the first.
    Near(f64, f64),
}

impl Demand {
    fn is_met_by(self, value: f64) -> bool {
        match self {
            Self::Exactly(expected) => (value - expected).abs() <= 1e-9 * expected.abs(),
            Self::AtLeast(limit) => value >= limit,
            Self::AtMost(limit) => value <= limit,
            Self::Below(limit) => value < limit,
            Self::Above(limit) => value > limit,
            Self::Between(minimum, maximum) => (minimum..=maximum).contains(&value),
            Self::Near(middle, tolerance) => (value - middle).abs() <= tolerance,
        }
    }
}

impl fmt::Display for Demand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let s = significant;
        match *self {
            Self::Exactly(expected) => write!(f, "= {}", s(expected)),
            Self::AtLeast(limit) => write!(f, "≥ {}", s(limit)),
            Self::AtMost(limit) => write!(f, "≤ {}", s(limit)),
            Self::Below(limit) => write!(f, "< {}", s(limit)),
            Self::Above(limit) => write!(f, "> {}", s(limit)),
            Self::Between(minimum, maximum) => write!(f, "{} to {}", s(minimum), s(maximum)),
            Self::Near(middle, tolerance) => write!(f, "{} ± {}", s(middle), s(tolerance)),
        }
    }
}

impl Row {
    /// A row without values.
    pub(crate) fn new(figure: &str, quantity: impl Into<String>, unit: &str) -> Self {
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

    /// Sets the paper's value.
    pub(crate) fn paper(self, paper: impl Into<Value>) -> Self {
        Self { paper: paper.into(), ..self }
    }

    /// Sets the value of one simulation; none if it did not reach the quantity.
    pub(crate) fn single(self, value: Option<f64>) -> Self {
        self.values(value.as_slice())
    }

    /// Sets the mean of values of several seeds.
    pub(crate) fn values(self, values: &[f64]) -> Self {
        self.sample(Sample::of(values))
    }

    /// Sets the mean and interval of a sample.
    pub(crate) fn sample(self, sample: Option<Sample>) -> Self {
        Self {
            measured: sample.map(|sample| sample.mean).into(),
            half_width_95: sample.and_then(|sample| sample.half_width()),
            n: sample.map_or(0, |sample| sample.n),
            ..self
        }
    }

    /// Sets the mean over replicates, with a note if some of them have no value.
    pub(crate) fn replicates(self, replicates: &ReplicateValues) -> Self {
        let (reached, planned) = (replicates.values.len(), replicates.planned);
        let row = Self { is_partial: reached < planned, ..self.values(&replicates.values) };
        if row.is_partial {
            row.note(format!("only {reached} of {planned} simulations have a value"))
        } else {
            row
        }
    }

    /// Sets a difference or a ratio of means over n simulations.
    pub(crate) fn difference_of(self, difference: Option<Difference>, n: usize) -> Self {
        let row = self.value(difference.map(|difference| difference.mean), n);
        Self { half_width_95: difference.map(|difference| difference.half_width), ..row }
    }

    /// Sets one value that n simulations give together.
    pub(crate) fn value(self, value: Option<f64>, n: usize) -> Self {
        Self { n, ..self.single(value) }
    }

    /// Sets a text over n simulations.
    pub(crate) fn text(self, text: impl Into<String>, n: usize) -> Self {
        Self { measured: text.into().into(), n, ..self }
    }

    /// Sets a demand on the measured number, with a note if the 95 % interval leaves the answer open.
    pub(crate) fn demand(self, demand: Demand) -> Self {
        let measured = self.measured.as_f64();
        let met = measured.is_some_and(|value| demand.is_met_by(value)) && !self.is_partial;
        let ends = measured.zip(self.half_width_95).map(|(mean, half)| [mean - half, mean + half]);
        let is_open = ends.is_some_and(|ends| ends.into_iter().any(|end| demand.is_met_by(end) != met));
        let row = self.demand_text(demand.to_string(), met);
        if is_open { row.note("the 95 % interval contains a limit of the demand") } else { row }
    }

    /// Sets a demand in words, and whether it is met.
    pub(crate) fn demand_text(self, demand: impl Into<String>, is_met: bool) -> Self {
        Self { demand: Some(demand.into()), holds: Some(is_met), ..self }
    }

    /// Adds a remark.
    pub(crate) fn note(mut self, note: impl AsRef<str>) -> Self {
        if !self.note.is_empty() && !note.as_ref().is_empty() {
            self.note.push_str("; ");
        }
        self.note.push_str(note.as_ref());
        self
    }

    /// Measured value less the paper's number, as a share of the latter.
    pub(crate) fn relative_difference(&self) -> Option<f64> {
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
    fn demand_holds_only_if_the_mean_meets_it() {
        let demand = Demand::Near(33.2, 2.3);
        assert_eq!(row().values(&[31.0, 33.0]).demand(demand).holds, Some(true));
        assert_eq!(row().values(&[25.0, 26.0]).demand(demand).holds, Some(false));
        assert_eq!(row().single(None).demand(demand).holds, Some(false), "no measured value");
        assert_eq!(row().single(Some(25.0)).holds, None, "no demand");
        assert_eq!(row().single(Some(f64::NAN)).demand(Demand::AtMost(1.0)).holds, Some(false));
    }

    #[test]
    fn interval_across_the_limit_of_a_demand_is_noted() {
        let judged = |values: &[f64]| row().values(values).demand(Demand::AtMost(33.0));
        assert_eq!(judged(&[32.0, 32.1, 32.2]).note, "");
        let open = judged(&[32.0, 33.5]);
        assert_eq!(
            (open.holds, &*open.note),
            (Some(true), "the 95 % interval contains a limit of the demand")
        );
    }

    #[test]
    fn replicates_without_a_value_are_noted_and_meet_no_demand() {
        let replicates = |planned| ReplicateValues { values: vec![1.0, 2.0], planned };
        assert_eq!(row().replicates(&replicates(2)).note, "");
        let row = row().replicates(&replicates(3)).note("and more");
        assert_eq!((row.n, &*row.note), (2, "only 2 of 3 simulations have a value; and more"));
        assert_eq!(row.demand(Demand::AtMost(9.0)).holds, Some(false), "two of three replicates");
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
    fn relative_difference_is_a_share_of_the_papers_number() {
        assert_eq!(row().single(Some(16.6)).relative_difference(), Some(-0.5));
        assert_eq!(row().paper("linear").single(Some(16.6)).relative_difference(), None);
        assert_eq!(row().single(None).relative_difference(), None);
    }
}
