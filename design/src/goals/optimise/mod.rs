//! Goal `optimise`: the best value of a response, or the best trade-offs of two, under constraints on other responses.
//!
//! The study begins with points of a Sobol' sequence. Models of all measures then choose each further run by expected improvement
//! times the probability that the constraints hold (`search`). When the search ends, the best point gets runs with fresh seeds
//! (`confirmation`). When they do not certify the constraints, the point is marked, and the search goes on within the budget.
//!
//! | file | content |
//! |---|---|
//! | `models` | a fitted model per measure, and one of runs that fail |
//! | `faults` | faults of the question |
//! | `first_design` | the points that come first |
//! | `search`, `surfaces`, `candidates` | the choice of runs |
//! | `normal`, `front` | expected improvement for one objective and two |
//! | `recommendation` | the best points that should pass a confirmation |
//! | `confirmation`, `bounds` | fresh runs, and their verdict |
//! | `chances` | the chances of a point to pass |

mod bounds;
mod candidates;
mod chances;
mod confirmation;
mod faults;
mod first_design;
mod front;
mod models;
mod normal;
mod recommendation;
mod search;
mod surfaces;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

pub use bounds::Bounds;
pub use confirmation::{ConfirmationState, FIRST_CONFIRMATION};
pub use recommendation::{Confirmation, Forecast, Recommendation};

use super::{Course, Finding, Study};
use crate::evidence::{Outcome, Point, PointRuns};
use crate::measure::Measure;
use crate::proposal::Proposal;
use chances::NextConfirmation;
use confirmation::{Confirming, Plan};
use models::Models;
use recommendation::Outlook;

/// Share of the budget beside the confirmation that the first search may use; the rest is for a search after a refuted one.
const FIRST_SEARCH: f64 = 0.7;

/// The fields of the goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Optimise {
    /// One objective, or two for a Pareto front.
    pub objectives: Vec<Objective>,
    /// Constraints that must hold together, with 95 % confidence.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub constraints: Vec<Constraint>,
    /// The search ends when the expected improvement of the best next run is below this one. For a mean it
    /// is a share of the standard deviation over the points so far, for a probability a difference of probabilities, and for two
    /// objectives a share of the area of the front.
    #[serde(default = "default_tolerance")]
    pub tolerance: f64,
    /// Maximum number of runs that confirm a point, beside `max_replicates`. By default twice the number that certifies
    /// the constraints in the best case, or 20 without constraints. Later attempts need more runs; the study ends when this
    /// maximum is too small for them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub confirmation_runs: Option<usize>,
    /// Maximum number of points of a Pareto front that are confirmed and recommended.
    #[serde(default = "default_front_points")]
    pub front_points: usize,
}

fn default_tolerance() -> f64 {
    1e-3
}

fn default_front_points() -> usize {
    5
}

/// An objective, for instance `{"minimise": {"mean": "power_w"}}`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Objective {
    /// The smallest value is the best.
    Minimise(Measure),
    /// The largest value is the best.
    Maximise(Measure),
}

/// A constraint, for instance `{"of": {"probability": "jammed"}, "at_most": 0.05}`. It has one of the two limits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Constraint {
    /// The measure.
    pub of: Measure,
    /// Upper limit, in the unit of the response.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_most: Option<f64>,
    /// Lower limit, in the unit of the response.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_least: Option<f64>,
}

/// The finding of the goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OptimiseAnswer {
    /// The recommended point; with two objectives those of the front, by the first objective.
    pub recommended: Vec<Recommendation>,
    /// Points whose confirmation failed.
    pub rejected: Vec<Recommendation>,
    /// The point without a confirmation that would most probably pass one, when none is worth it.
    #[serde(default)]
    pub nearest: Option<Recommendation>,
    /// Number of attempts at a confirmation. After all of them, each recommended point is wrong with a probability of at most 5 %.
    pub attempts: u32,
    /// Expected improvement of the best next run, in the unit of the tolerance; none outside the search.
    pub expected_improvement: Option<f64>,
    /// Why no run comes next, when the study ends without a confirmed point and within its budget.
    pub obstacle: Option<Obstacle>,
}

/// Why no run comes next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Obstacle {
    /// Too few points have values of all responses.
    MissingResponses,
    /// Every point that could be confirmed has failed, or lies beside one that has.
    NoCandidate,
    /// The search has no more runs, and no point is worth a confirmation: by the models each would pass with less than 5 %.
    Nowhere,
    /// The question's `confirmation_runs` are too few for a further attempt.
    ConfirmationRuns,
}

impl Objective {
    /// The measure.
    pub fn measure(&self) -> &Measure {
        match self {
            Self::Minimise(measure) | Self::Maximise(measure) => measure,
        }
    }

    /// 1 for an objective that is minimised, −1 for one that is maximised.
    fn sign(&self) -> f64 {
        if matches!(self, Self::Minimise(_)) { 1.0 } else { -1.0 }
    }
}

impl Constraint {
    fn limit(&self) -> f64 {
        self.at_most.or(self.at_least).expect("a constraint without faults has a limit")
    }
}

impl Optimise {
    /// Number of points that are recommended.
    fn targets(&self) -> usize {
        if self.objectives.len() == 1 { 1 } else { self.front_points }
    }

    /// Runs that are kept for the confirmation.
    fn reserve(&self, plan: &Plan) -> usize {
        // Without constraints only lost runs take a confirmation past its first look.
        let runs = if self.constraints.is_empty() { plan.first } else { plan.most };
        runs * self.targets()
    }

    /// Measures without repetition, those of the objectives first.
    pub(crate) fn measures(&self) -> Vec<&Measure> {
        let objectives = self.objectives.iter().map(Objective::measure);
        let mut measures: Vec<&Measure> = Vec::new();
        for measure in objectives.chain(self.constraints.iter().map(|constraint| &constraint.of)) {
            if !measures.contains(&measure) {
                measures.push(measure);
            }
        }
        measures
    }
}

/// Number of runs in the best case: the smallest first design, and confirmations that succeed at their first look.
pub(crate) fn least_runs(goal: &Optimise, factors: usize) -> usize {
    let first = goal.plan(1).map_or(0, |plan| plan.first);
    factors + 1 + first * goal.targets()
}

/// Whether a point has a value of every measure.
fn has_values(goal: &Optimise, point: &PointRuns) -> bool {
    goal.measures().iter().all(|measure| !point.values(measure).is_empty())
}

/// Runs of the search at a point, but for cancelled ones.
fn search_runs(point: &PointRuns) -> impl Iterator<Item = (&u32, &Outcome)> {
    point.runs.range(..FIRST_CONFIRMATION).filter(|(_, outcome)| **outcome != Outcome::Cancelled)
}

/// The first replicate of the search after all that exist.
fn next_replicate(point: Option<&PointRuns>) -> u32 {
    point
        .and_then(|point| point.runs.range(..FIRST_CONFIRMATION).next_back())
        .map_or(0, |(replicate, _)| replicate + 1)
}

/// The points whose confirmation has begun, with its state.
fn confirmations<'a>(
    goal: &Optimise,
    study: &Study<'a>,
) -> BTreeMap<&'a Point, (Confirming<'a>, ConfirmationState)> {
    let max_failures = study.budget.max_failures;
    let begun = study.evidence.points().iter().filter_map(|point| {
        let runs = Confirming::of(goal, point)?;
        let state = runs.state(goal, max_failures);
        Some((&point.point, (runs, state)))
    });
    begun.collect()
}

pub(super) fn decide(goal: &Optimise, study: &Study<'_>) -> Course {
    let begun = confirmations(goal, study);
    let attempts: Vec<_> = begun.values().map(|(runs, state)| (runs.attempt, *state)).collect();
    let (attempt, free) = goal.next_attempt(&attempts);
    // The forecasts need a plan even when there is no further attempt.
    let further = goal.plan(attempt);
    let plan = further.or(goal.plan(1)).expect("a question without faults has a plan");
    let next = NextConfirmation::of(goal, plan);
    let count = |state| begun.values().filter(|(_, other)| *other == state).count();
    let (open, confirmed) = (count(ConfirmationState::Open), count(ConfirmationState::Confirmed));
    let missing = goal.targets() - (open + confirmed).min(goal.targets());
    let models = Models::fit(goal, study);
    let outlook = Outlook::of(goal, &next, study, models.as_ref(), &begun);
    let mut course = Course {
        proposals: Vec::new(),
        is_met: missing == 0 && open == 0,
        is_spent: false,
        finding: Finding::Optimise(outlook.answer(study, &begun)),
    };
    for (point, (runs, _)) in begun.iter().filter(|(_, (_, state))| *state == ConfirmationState::Open) {
        let run = |replicate| Proposal { point: (*point).clone(), replicate };
        course.proposals.extend(runs.next().map(run));
    }
    // Without a point that is worth a confirmation, the search has its runs.
    let is_hopeless = models.is_some() && outlook.is_hopeless();
    let is_searching =
        further.is_some() && search_room(goal, &plan, study, is_hopeless) > 0 && open + confirmed == 0;
    let mut is_over = true;
    if is_searching {
        let improvement = search_step(goal, (&next, is_hopeless), study, models.as_ref(), &mut course);
        if let Finding::Optimise(answer) = &mut course.finding {
            answer.expected_improvement = improvement;
        }
        let is_small = improvement.is_some_and(|improvement| improvement < goal.tolerance);
        // Where no point is worth a confirmation, every improvement is small: the search goes on while it has runs.
        is_over = if is_hopeless { improvement.is_some() && course.proposals.is_empty() } else { is_small };
    }
    if is_over {
        if is_searching {
            course.proposals.clear();
        }
        let search_pending = study.evidence.points().iter().flat_map(search_runs);
        let is_waiting = search_pending.filter(|(_, outcome)| **outcome == Outcome::Pending).count() > 0;
        if missing > 0 && !is_waiting {
            let missing = if further.is_some() { missing.min(free) } else { 0 };
            begin_confirmations((attempt, &plan), study, &outlook, missing, (open, confirmed), &mut course);
        }
    }
    let is_unfinished = !course.is_met && !course.is_spent && study.evidence.pending() == 0;
    if let Finding::Optimise(answer) = &mut course.finding
        && is_unfinished
        && study.room > 0
        && course.proposals.is_empty()
    {
        answer.obstacle = Some(match (&models, further) {
            (Some(_), None) => Obstacle::ConfirmationRuns,
            (Some(_), Some(_)) if is_over && is_hopeless => Obstacle::Nowhere,
            (Some(_), Some(_)) if is_over => Obstacle::NoCandidate,
            _ => Obstacle::MissingResponses,
        });
    }
    course
}

/// Begins the confirmation of the next points, as far as the budget allows.
fn begin_confirmations(
    (attempt, plan): (u32, &Plan),
    study: &Study<'_>,
    outlook: &Outlook<'_>,
    missing: usize,
    (open, confirmed): (usize, usize),
    course: &mut Course,
) {
    let left = study.budget.max_runs.saturating_sub(study.evidence.spent() + course.proposals.len());
    let points = outlook.next_points(missing);
    let affordable = points.iter().take(left / plan.first);
    let runs = affordable.flat_map(|point| {
        (0..plan.first as u32)
            .map(|index| Proposal { point: point.clone(), replicate: attempt * FIRST_CONFIRMATION + index })
    });
    let before = course.proposals.len();
    course.proposals.extend(runs);
    if course.proposals.len() > before || open > 0 {
        return;
    }
    if confirmed == 0 {
        course.is_spent = !points.is_empty();
    } else {
        // The front has no more points, or the budget no more runs; those confirmed are the answer.
        course.is_met = true;
    }
}

/// Number of runs that the search may still begin.
fn search_room(goal: &Optimise, plan: &Plan, study: &Study<'_>, is_hopeless: bool) -> usize {
    let points = study.evidence.points();
    let searched: usize = points.iter().map(|point| search_runs(point).count()).sum();
    let confirming = study.evidence.runs() - searched;
    let free = study.budget.max_runs.saturating_sub(goal.reserve(plan) + confirming);
    let share = if confirming == 0 && !is_hopeless { FIRST_SEARCH } else { 1.0 };
    // Runs that the budget does not count belong to the search.
    ((share * free as f64) as usize).saturating_sub(searched - study.evidence.free().min(searched))
}

/// Proposes runs of the search. Returns the expected improvement of the best one; none while the first design is incomplete.
fn search_step(
    goal: &Optimise,
    (next, is_hopeless): (&NextConfirmation<'_>, bool),
    study: &Study<'_>,
    models: Option<&Models>,
    course: &mut Course,
) -> Option<f64> {
    let room = search_room(goal, &next.plan, study, is_hopeless).min(study.room);
    let (wanted, is_ready) = first_design::first_design(goal, study);
    let first = wanted.len();
    course.proposals.extend(wanted.into_iter().take(room));
    let models = models.filter(|_| is_ready)?;
    let rest = room.saturating_sub(first);
    let (further, improvement) = search::proposals(goal, next, study, models, rest);
    course.proposals.extend(further);
    // Without any point to choose nothing can be improved.
    (first == 0).then(|| improvement.unwrap_or(0.0))
}
