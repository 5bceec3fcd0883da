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

use crate::decision::{Answer, Decision, ExcludedPoint, Finding, Finished, Proposal, RunCounts};
use crate::evidence::{Evidence, PointRuns};
use crate::question::{Goal, Question};
use crate::usable::UnusableResponses;

/// The state of a study, as every goal's decision needs it.
#[derive(Debug)]
pub(crate) struct Study<'a> {
    pub(crate) question: &'a Question,
    pub(crate) evidence: &'a Evidence,
    /// Maximum number of proposals: as wanted, within the budget.
    pub(crate) room: usize,
    pub(crate) seed: u64,
}

/// What a goal decides.
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
    /// Points of the evidence that are not excluded.
    pub(crate) fn usable_points(&self) -> impl Iterator<Item = &PointRuns> {
        self.evidence.points().iter().filter(|point| !self.question.excludes(point))
    }
}

/// The decision, whatever the goal: budget, exclusions and reasons to stop are handled here.
pub(crate) fn decide(question: &Question, evidence: &Evidence, wanted: usize, seed: u64) -> Decision {
    let left = question.budget.max_runs.saturating_sub(evidence.spent());
    let study = Study { question, evidence, room: wanted.min(left), seed };
    let mut course = match &question.goal {
        Goal::Estimate(goal) => estimate::decide(goal, &study),
        Goal::Boundary(goal) => boundary::decide(goal, &study),
        Goal::Optimise(goal) => optimise::decide(goal, &study),
        Goal::Sensitivity(goal) => sensitivity::decide(goal, &study),
        Goal::Calibrate(goal) => calibrate::decide(goal, &study),
    };
    course.proposals.truncate(study.room);
    if course.is_met {
        course.proposals.clear();
    }
    // Runs with some outcomes end earlier than others: only all the runs that have begun are a fair sample.
    let finished = match () {
        () if evidence.pending() > 0 => None,
        () if course.is_met => Some(Finished::ByRule),
        () if left == 0 || course.is_spent => Some(Finished::ByBudget),
        () if study.room > 0 && course.proposals.is_empty() => Some(Finished::NothingLeft),
        () => None,
    };
    if finished.is_some() {
        course.proposals.clear();
    }
    let excluded = evidence.points().iter().filter(|point| question.excludes(point));
    let excluded = excluded.map(|point| ExcludedPoint {
        values: point.point.levels(&question.factors),
        failed: point.failed(),
        done: point.count() - point.failed() - point.pending(),
        impossible: point.impossible.clone(),
    });
    let measures = question.goal.measures().into_iter();
    let unusable = measures.filter_map(|measure| UnusableResponses::of(measure, evidence.points()));
    let answer = Answer {
        runs: RunCounts::of(evidence),
        excluded: excluded.collect(),
        unusable: unusable.collect(),
        finding: course.finding,
    };
    Decision { proposals: course.proposals, is_met: course.is_met, finished, answer }
}
