//! Observables: numbers of a run that a laboratory can measure as well.
//!
//! An observable is a response, such as `critical_angle_deg`, or a quantity at a place of a curve or series, such as
//! `stress_pa@strain=0.02`. Every line can be read in both directions: `strain@stress_pa=500` is the first strain with that
//! stress, and `time_s@discharged_mass_kg=20` the time at which 20 kg were out.

mod line;
#[cfg(test)]
mod tests;

use std::fmt;

use crate::experiments::{Outputs, ResponseDefinition, ResponseType};
use crate::result::{EndReason, RunResult};
use crate::scenario::field::unit_suffix;
pub use line::{Axis, Line, lines};

/// Masses that stay the same after a hopper has emptied or jammed.
const FINAL_MASSES: &[&str] = &["discharged_mass", "inside_mass"];

/// A number of a run.
#[derive(Clone, Debug, PartialEq)]
pub enum Observable {
    /// A response that is a number, an indicator, or true or false.
    Response(&'static ResponseDefinition),
    /// A quantity at a place of a curve or series.
    Point {
        /// The curve or series.
        line: Line,
        /// Value of the quantity along it, in that quantity's unit.
        at: f64,
    },
}

impl Observable {
    /// The response of that name; none if the experiment has no such response, or if it is a word.
    pub fn response(outputs: &'static Outputs, name: &str) -> Option<Self> {
        let is_number =
            |response: &&ResponseDefinition| response.name == name && response.kind != ResponseType::Word;
        outputs.responses.iter().find(is_number).map(Self::Response)
    }

    /// Reads a name, as [`fmt::Display`] writes it; none if the experiment has no such observable.
    pub fn parse(outputs: &'static Outputs, name: &str) -> Option<Self> {
        let Some((of, place)) = name.split_once('@') else { return Self::response(outputs, name) };
        let (along, at) = place.split_once('=')?;
        let at = at.parse().ok().filter(|at: &f64| at.is_finite())?;
        let line = lines(outputs)
            .into_iter()
            .find(|line| line.of.suffixed() == of && line.along.suffixed() == along)?;
        Some(Self::Point { line, at })
    }

    /// Its unit; empty without one.
    pub fn unit(&self) -> &'static str {
        match self {
            Self::Response(response) => response.unit,
            Self::Point { line, .. } => line.of.unit,
        }
    }

    /// Its value in a run; none where the run has not reached it. True is 1, and false is 0.
    ///
    /// Between two samples it is interpolated linearly. Of several places with the same value, the first counts.
    pub fn value(&self, result: &RunResult) -> Option<f64> {
        match self {
            Self::Response(response) => {
                let value = result.responses.get(response.name)?;
                value.as_f64().or_else(|| value.as_bool().map(|is_true| f64::from(u8::from(is_true))))
            }
            Self::Point { line, at } => {
                let (along, of) = line.samples(result)?;
                interpolated(along, of, *at).or_else(|| final_mass(line, along, of, *at, result.end_reason))
            }
        }
    }
}

/// The value at the first place `at`, by linear interpolation; none outside the samples.
fn interpolated(along: &[f64], of: &[f64], at: f64) -> Option<f64> {
    if along.first() == Some(&at) {
        return of.first().copied();
    }
    let pairs = along.windows(2).zip(of.windows(2));
    let mut around = pairs.filter(|(x, _)| (x[0].min(x[1])..=x[0].max(x[1])).contains(&at));
    let (x, y) = around.next()?;
    let share = if x[1] == x[0] { 0.0 } else { (at - x[0]) / (x[1] - x[0]) };
    Some(y[0] + share * (y[1] - y[0]))
}

/// The last mass, after the end of a run whose hopper was empty or jammed.
fn final_mass(line: &Line, along: &[f64], of: &[f64], at: f64, end: EndReason) -> Option<f64> {
    let is_over = matches!(end, EndReason::Empty | EndReason::Jammed);
    let stays = line.is_series() && FINAL_MASSES.contains(&line.of.name);
    let is_later = along.last().is_some_and(|last| at > *last);
    of.last().copied().filter(|_| is_over && stays && is_later)
}

impl fmt::Display for Observable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Response(response) => f.write_str(response.name),
            Self::Point { line, at } => write!(f, "{}@{}={at}", line.of.suffixed(), line.along.suffixed()),
        }
    }
}

/// A name with the suffix of its unit.
fn suffixed(name: &str, unit: &str) -> String {
    let suffix = unit_suffix(unit);
    if name.ends_with(&suffix) { name.to_owned() } else { format!("{name}{suffix}") }
}
