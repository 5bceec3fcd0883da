//! Lines: the curves and series of an experiment, each in both directions.

use super::suffixed;
use crate::experiments::Outputs;
use crate::result::RunResult;

/// The quantity along a series.
const TIME: Axis = Axis { name: "time", unit: "s" };
/// Quantities that only number bodies: nothing lies between two of them.
const NUMBERS_OF_BODIES: &[&str] = &["body", "fillet"];

/// A quantity of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Axis {
    /// Name, such as `stress`.
    pub name: &'static str,
    /// Unit; empty without one.
    pub unit: &'static str,
}

impl Axis {
    fn new(name: &'static str, unit: &'static str) -> Self {
        Self { name, unit: if unit == "1" { "" } else { unit } }
    }

    /// The name with the unit last, such as `stress_pa`.
    pub fn suffixed(&self) -> String {
        suffixed(self.name, self.unit)
    }
}

/// The part of a result that holds a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    Series(&'static str),
    Curve { name: &'static str, over: &'static str },
}

/// One quantity along another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Line {
    /// The quantity.
    pub of: Axis,
    /// The quantity along the line.
    pub along: Axis,
    source: Source,
    /// Whether the result has it in the other direction.
    is_turned: bool,
}

impl Line {
    fn turned(self) -> Self {
        Self { of: self.along, along: self.of, is_turned: !self.is_turned, ..self }
    }

    /// Whether it is a series over time, in the direction of the result.
    pub(super) fn is_series(&self) -> bool {
        matches!(self.source, Source::Series(_)) && !self.is_turned
    }

    /// The samples in a result: the quantity along the line, and the other one.
    pub(super) fn samples<'a>(&self, result: &'a RunResult) -> Option<(&'a [f64], &'a [f64])> {
        let (along, of): (&[f64], &[f64]) = match self.source {
            Source::Series(name) => {
                let series = result.series(name)?;
                (&series.t_s, &series.values)
            }
            Source::Curve { name, over } => {
                let curve = result.curves.iter().find(|curve| curve.name == name && curve.over == over)?;
                (&curve.x, &curve.values)
            }
        };
        Some(if self.is_turned { (of, along) } else { (along, of) })
    }
}

/// The lines of an experiment, each in both directions. Series of single surfaces are left out: their names are the scenario's.
pub fn lines(outputs: &Outputs) -> Vec<Line> {
    let curves = outputs.curves.iter().filter(|row| !NUMBERS_OF_BODIES.contains(&row.over)).map(|row| Line {
        of: Axis::new(row.name, row.unit),
        along: Axis::new(row.over, row.over_unit),
        source: Source::Curve { name: row.name, over: row.over },
        is_turned: false,
    });
    let series = outputs.series.iter().filter(|row| !row.name.contains('<')).map(|row| Line {
        of: Axis::new(row.name, row.unit),
        along: TIME,
        source: Source::Series(row.name),
        is_turned: false,
    });
    curves.chain(series).flat_map(|line| [line, line.turned()]).collect()
}
