//! Evidence: the runs of a study, grouped by point, in canonical order.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::factor::Factor;
use crate::measure::Measure;

/// Steps of a coordinate from 0 to 1. Fine enough for any factor, and coarse enough that a coordinate survives
/// the way to the factor's value and back.
const STEPS: f64 = (1_u32 << 30) as f64;

/// A point of the unit cube: a coordinate from 0 to 1 per factor, in whole steps of 2⁻³⁰, so that points compare exactly.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(from = "Vec<f64>", into = "Vec<f64>")]
pub struct Point(Vec<u32>);

impl Point {
    /// The point nearest to some coordinates; coordinates outside the cube are moved to its surface.
    pub fn new(coordinates: &[f64]) -> Self {
        Self(
            coordinates
                .iter()
                .map(|coordinate| (coordinate.clamp(0.0, 1.0) * STEPS).round() as u32)
                .collect(),
        )
    }

    /// The point of numbers of the factors; none outside their ranges.
    pub fn of_values(factors: &[Factor], values: &[f64]) -> Option<Self> {
        let coordinates = factors.iter().zip(values).map(|(factor, value)| factor.coordinate(*value));
        Some(Self::new(&coordinates.collect::<Option<Vec<f64>>>()?))
    }

    /// The point of a run with some levels and numbers of the factors; none outside their ranges. Its values are rounded, so that runs from before
    /// a change of the ranges, or from elsewhere, belong to a point that can be proposed.
    pub fn of_run(factors: &[Factor], levels: &[Value]) -> Option<Self> {
        Some(Self::of_levels(factors, levels)?.rounded(factors))
    }

    /// The numbers of the factors, in their units; of a factor with levels the index of a level.
    pub fn values(&self, factors: &[Factor]) -> Vec<f64> {
        factors.iter().zip(self.coordinates()).map(|(factor, coordinate)| factor.value(coordinate)).collect()
    }

    /// The values of the factors: numbers in their units, or levels.
    pub fn levels(&self, factors: &[Factor]) -> Vec<Value> {
        factors.iter().zip(self.values(factors)).map(|(factor, number)| factor.level(number)).collect()
    }

    /// The point of levels and numbers; none outside their ranges.
    pub fn of_levels(factors: &[Factor], levels: &[Value]) -> Option<Self> {
        let numbers = factors.iter().zip(levels).map(|(factor, level)| factor.number(level));
        Self::of_values(factors, &numbers.collect::<Option<Vec<f64>>>()?)
    }

    /// The nearest point whose values are rounded as [`Factor::value`] rounds them. Proposals are such points, so that the
    /// values of a run lead back to its point.
    pub fn rounded(&self, factors: &[Factor]) -> Self {
        Self::of_values(factors, &self.values(factors)).unwrap_or_else(|| self.clone())
    }

    /// Its coordinates, from 0 to 1.
    pub fn coordinates(&self) -> Vec<f64> {
        self.0.iter().map(|steps| f64::from(*steps) / STEPS).collect()
    }
}

impl From<Vec<f64>> for Point {
    fn from(coordinates: Vec<f64>) -> Self {
        Self::new(&coordinates)
    }
}

impl From<Point> for Vec<f64> {
    fn from(point: Point) -> Self {
        point.coordinates()
    }
}

/// The state of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// In flight.
    Pending,
    /// It ended without a usable result.
    Failed,
    /// A user has cancelled it: neither a result nor a failure, and outside the budget. Its replicate is used up.
    Cancelled,
    /// Its responses by name. A response may be missing, for instance the time of a jam that did not occur.
    Responses(BTreeMap<String, f64>),
}

/// A run of a study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Its point.
    pub point: Point,
    /// Its replicate, from 0 on; it chooses the seed of the simulation.
    pub replicate: u32,
    /// Its state.
    pub outcome: Outcome,
}

/// The runs at one point, in the order of replicates.
#[derive(Clone, Debug, PartialEq)]
pub struct PointRuns {
    /// The point.
    pub point: Point,
    /// Its runs by replicate.
    pub runs: BTreeMap<u32, Outcome>,
    /// Why nothing can be run here, if so: the values of the factors do not go together.
    pub impossible: Option<String>,
}

impl PointRuns {
    /// The values of a measure's response that it accepts, in the order of replicates.
    pub fn values(&self, measure: &Measure) -> Vec<f64> {
        let responses = self.runs.values().filter_map(|outcome| match outcome {
            Outcome::Responses(responses) => responses.get(measure.response()).copied(),
            Outcome::Pending | Outcome::Cancelled | Outcome::Failed => None,
        });
        responses.filter(|value| measure.accepts(*value)).collect()
    }

    /// Number of runs but for cancelled ones.
    pub fn count(&self) -> usize {
        self.runs.values().filter(|outcome| **outcome != Outcome::Cancelled).count()
    }

    /// Number of runs in flight.
    pub fn pending(&self) -> usize {
        self.runs.values().filter(|outcome| **outcome == Outcome::Pending).count()
    }

    /// Number of failed runs.
    pub fn failed(&self) -> usize {
        self.runs.values().filter(|outcome| **outcome == Outcome::Failed).count()
    }

    /// The first replicate after all that exist.
    pub fn next_replicate(&self) -> u32 {
        self.runs.keys().next_back().map_or(0, |last| last + 1)
    }
}

/// All runs of a study. Construction puts them into canonical order, so that the order of results does not matter.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Evidence {
    points: Vec<PointRuns>,
    /// Number of runs that the budget does not count.
    free: usize,
}

impl Evidence {
    /// Groups runs by point. Of runs of the same point and replicate the one with responses counts, then the failed one, then
    /// the cancelled one.
    pub fn new(runs: impl IntoIterator<Item = Run>) -> Self {
        let mut by_point: BTreeMap<Point, BTreeMap<u32, Outcome>> = BTreeMap::new();
        for Run { point, replicate, outcome } in runs {
            let known = by_point.entry(point).or_default().entry(replicate).or_insert(Outcome::Pending);
            let replaces = match (&*known, &outcome) {
                (Outcome::Pending, _)
                | (Outcome::Cancelled, Outcome::Failed | Outcome::Responses(_))
                | (Outcome::Failed, Outcome::Responses(_)) => true,
                (Outcome::Responses(old), Outcome::Responses(new)) => is_below(new, old),
                _ => false,
            };
            if replaces {
                *known = outcome;
            }
        }
        let points = by_point.into_iter().map(|(point, runs)| PointRuns { point, runs, impossible: None });
        Self { points: points.collect(), free: 0 }
    }

    /// The same evidence, of which the budget does not count some ended runs: they were made for another purpose.
    pub fn with_free(self, runs: usize) -> Self {
        Self { free: runs, ..self }
    }

    /// The same evidence, in which nothing can be run at some points, each with the reason.
    pub fn with_impossible(mut self, points: BTreeMap<Point, String>) -> Self {
        for (point, reason) in points {
            match self.points.binary_search_by(|runs| runs.point.cmp(&point)) {
                Ok(index) => self.points[index].impossible = Some(reason),
                Err(index) => {
                    let runs = PointRuns { point, runs: BTreeMap::new(), impossible: Some(reason) };
                    self.points.insert(index, runs);
                }
            }
        }
        self
    }

    /// Number of runs that the budget does not count.
    pub(crate) fn free(&self) -> usize {
        self.free
    }

    /// Its points in canonical order.
    pub fn points(&self) -> &[PointRuns] {
        &self.points
    }

    /// The runs at a point.
    pub fn at(&self, point: &Point) -> Option<&PointRuns> {
        self.points.binary_search_by(|runs| runs.point.cmp(point)).ok().map(|index| &self.points[index])
    }

    /// Number of runs but for cancelled ones.
    pub fn runs(&self) -> usize {
        self.points.iter().map(PointRuns::count).sum()
    }

    /// Number of runs that the budget counts.
    pub fn spent(&self) -> usize {
        self.runs().saturating_sub(self.free)
    }

    /// Number of runs in flight.
    pub fn pending(&self) -> usize {
        self.points.iter().map(PointRuns::pending).sum()
    }

    /// Number of failed runs.
    pub fn failed(&self) -> usize {
        self.points.iter().map(PointRuns::failed).sum()
    }
}

/// An order of responses, for two different results of the same run.
fn is_below(one: &BTreeMap<String, f64>, other: &BTreeMap<String, f64>) -> bool {
    let bits = |responses: &BTreeMap<String, f64>| -> Vec<(String, u64)> {
        responses.iter().map(|(name, value)| (name.clone(), value.to_bits())).collect()
    };
    bits(one) < bits(other)
}
