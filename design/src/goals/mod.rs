//! Goals: a module per goal with its fields, its decision and its answer.

pub(crate) mod boundary;
pub mod calibrate;
mod estimate;
pub(crate) mod optimise;
pub(crate) mod sensitivity;

pub use boundary::{Boundary, BoundaryAnswer, Crossing, MapPoint, ObservedPoint, Place, Side};
pub use calibrate::{Calibrate, CalibrateAnswer};
pub use estimate::{Estimate, EstimateAnswer, MAX_EQUAL, MeasureEstimate, MeasureWidth, PointEstimate};
pub use optimise::{
    Bounds, Confirmation, ConfirmationState, Constraint, FIRST_CONFIRMATION, Forecast, Objective, Obstacle,
    Optimise, OptimiseAnswer, Recommendation,
};
pub use sensitivity::{
    Effects, LostRun, MeasureSensitivity, Method, MorrisEffects, Sensitivity, SensitivityAnswer, SobolIndices,
};

use serde::{Deserialize, Serialize};

use crate::budget::Budget;
use crate::evidence::{Evidence, PointRuns};
use crate::factor::Factor;
use crate::measure::Measure;
use crate::proposal::Proposal;

/// Number of results without a usable response after which a point is excluded. A response that four runs in ten have, for
/// instance the time of a jam, is missing in all of them by chance in 0.6 % of the points.
const MAX_WITHOUT_VALUE: usize = 10;

/// The goal of a study. In JSON an object with one member, for instance `{"boundary": {…}}`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Goal {
    /// Replicates at given points until intervals are narrow enough.
    Estimate(Estimate),
    /// The level set of a probability or mean.
    Boundary(Boundary),
    /// The best value of a response, or trade-offs of two.
    Optimise(Optimise),
    /// Shares of the factors in the variance of a response.
    Sensitivity(Sensitivity),
    /// Parameters by measurements, with their uncertainty.
    Calibrate(Calibrate),
}

impl Goal {
    /// The measures of the goal that every run is to have, without repetition. A calibration has none: the tests differ, and a run without a
    /// measured number tells something.
    pub(crate) fn measures(&self) -> Vec<&Measure> {
        let mut measures = match self {
            Self::Estimate(goal) => goal.intervals.iter().map(|interval| &interval.of).collect(),
            Self::Boundary(goal) => vec![&goal.of],
            Self::Optimise(goal) => goal.measures(),
            Self::Sensitivity(goal) => goal.of.iter().collect(),
            Self::Calibrate(_) => Vec::new(),
        };
        measures.sort();
        measures.dedup();
        measures
    }

    /// Whether a point is excluded: its runs fail or cannot be made, or ten of them have a result and none a response that a
    /// measure of the goal accepts.
    pub(crate) fn excludes(&self, point: &PointRuns, budget: &Budget) -> bool {
        let results = point.count() - point.failed() - point.pending();
        let lacks = |measure: &&Measure| point.values(measure).is_empty();
        budget.excludes(point) || (results >= MAX_WITHOUT_VALUE && self.measures().iter().any(lacks))
    }
}

/// The finding of a goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Finding {
    /// Goal `estimate`.
    Estimate(EstimateAnswer),
    /// Goal `boundary`.
    Boundary(BoundaryAnswer),
    /// Goal `optimise`.
    Optimise(OptimiseAnswer),
    /// Goal `sensitivity`.
    Sensitivity(SensitivityAnswer),
    /// Goal `calibrate`.
    Calibrate(CalibrateAnswer),
}

/// The state of a study, as every goal's decision needs it.
#[derive(Debug)]
pub(crate) struct Study<'a> {
    pub(crate) factors: &'a [Factor],
    pub(crate) goal: &'a Goal,
    pub(crate) budget: &'a Budget,
    pub(crate) evidence: &'a Evidence,
    /// Maximum number of proposals: as wanted, within the budget.
    pub(crate) room: usize,
    pub(crate) seed: u64,
}

/// The decision of a goal, before it is bounded by the budget.
#[derive(Debug)]
pub(crate) struct Course {
    /// Proposals, the most useful first; at most the study's room are used.
    pub(crate) proposals: Vec<Proposal>,
    /// Whether the goal's stopping rule is met.
    pub(crate) is_met: bool,
    /// Whether the budget has no room for the goal's next step, which may be several runs.
    pub(crate) is_spent: bool,
    pub(crate) finding: Finding,
}

impl Study<'_> {
    /// Whether a point is excluded.
    pub(crate) fn excludes(&self, point: &PointRuns) -> bool {
        self.goal.excludes(point, self.budget)
    }

    /// Points of the evidence that are not excluded.
    pub(crate) fn usable_points(&self) -> impl Iterator<Item = &PointRuns> {
        self.evidence.points().iter().filter(|point| !self.excludes(point))
    }

    /// The decision of the goal.
    pub(crate) fn decide(&self) -> Course {
        match self.goal {
            Goal::Estimate(goal) => estimate::decide(goal, self),
            Goal::Boundary(goal) => boundary::decide(goal, self),
            Goal::Optimise(goal) => optimise::decide(goal, self),
            Goal::Sensitivity(goal) => sensitivity::decide(goal, self),
            Goal::Calibrate(goal) => calibrate::decide(goal, self),
        }
    }
}
