//! Decisions: proposals, the reason to stop, and the answer as data.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::evidence::Evidence;
use crate::goals::{Finding, Study};
use crate::proposal::Proposal;
use crate::question::Question;
use crate::usable::UnusableResponses;

/// The reason why a study is finished.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Finished {
    /// The goal's stopping rule is met and no run is in flight.
    ByRule,
    /// The budget is spent and no run is in flight.
    ByBudget,
    /// No further run would help: points are excluded, have their maximum of replicates, or lack responses. The answer of the goal
    /// `optimise` names its obstacle.
    NothingLeft,
}

/// The decision about a study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// Runs that come next, the most useful first.
    pub proposals: Vec<Proposal>,
    /// Whether the goal's stopping rule is met. The study then only waits for runs in flight, which may change this.
    pub is_met: bool,
    /// Why the study is finished; none while it goes on.
    pub finished: Option<Finished>,
    /// The answer so far.
    pub answer: Answer,
}

/// Number of runs by state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunCounts {
    /// Runs with a result.
    pub done: usize,
    /// Failed runs.
    pub failed: usize,
    /// Runs in flight.
    pub pending: usize,
}

impl RunCounts {
    /// The runs of some evidence.
    pub fn of(evidence: &Evidence) -> Self {
        let (failed, pending) = (evidence.failed(), evidence.pending());
        Self { done: evidence.runs() - failed - pending, failed, pending }
    }
}

/// A point that is left out because its runs fail, cannot be made, or have no response that a measure can use.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExcludedPoint {
    /// Values of the factors: numbers in their units, or levels.
    pub values: Vec<Value>,
    /// Number of failed runs.
    pub failed: usize,
    /// Number of runs with a result.
    pub done: usize,
    /// Why no run can be made here, if so: the values of the factors do not go together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub impossible: Option<String>,
}

/// The answer of a study so far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// Runs it rests on.
    pub runs: RunCounts,
    /// Points that were left out because their runs fail, cannot be made, or have no response that a measure can use.
    pub excluded: Vec<ExcludedPoint>,
    /// Responses of finished runs that were of no use, for each measure with such responses.
    pub unusable: Vec<UnusableResponses>,
    /// The finding of the goal.
    pub finding: Finding,
}

/// The decision, whatever the goal: budget, exclusions and reasons to stop are handled here.
pub(crate) fn decide(question: &Question, evidence: &Evidence, wanted: usize, seed: u64) -> Decision {
    let left = question.budget.max_runs.saturating_sub(evidence.spent());
    let study = Study {
        factors: &question.factors,
        goal: &question.goal,
        budget: &question.budget,
        evidence,
        room: wanted.min(left),
        seed,
    };
    let mut course = study.decide();
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
