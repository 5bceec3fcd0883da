//! Confirmation: fresh seeds at a recommended point, until its constraints are certified or refuted.
//!
//! The search has chosen the point because its runs looked good, so these runs are no evidence. A confirmation rests on replicates
//! from [`FIRST_CONFIRMATION`] on alone, and their order decides: quick runs have no advantage.
//!
//! | symbol | meaning |
//! |---|---|
//! | r | attempt, from 1 on. Replicates r·[`FIRST_CONFIRMATION`] and above belong to it |
//! | m | number of constraints |
//! | n₀ 2ᵏ | runs after which one looks, k = 0, 1, …; the last look has all runs |
//! | αₖ | probability with which a look may be wrong about a constraint: 0.05/(m 2ʳ 2ᵏ⁺¹), twice that at the last look |
//!
//! The αₖ of all looks and attempts together are 0.05/m: however often a study tries, a recommended point breaks a constraint
//! with a probability of at most 5 %. The points of a front share an attempt, because each of them is a claim of its own.
//!
//! | constraint | bounds at a look (`bounds`) |
//! |---|---|
//! | probability | one-sided binomial ones (Clopper and Pearson 1934); a run without a value counts as the worse case |
//! | mean | one-sided ones of Student's t, widened for the skewness of the values |
//!
//! The confidence sequence of `intervals` may be looked at after every run, but needs more runs without a jam to certify
//! P ≤ 0.05 at a first attempt; these looks need 86.

use serde::{Deserialize, Serialize};

use super::bounds::{Bounds, at_most};
use super::{Constraint, Optimise};
use crate::evidence::{Outcome, PointRuns};
use crate::intervals::CONFIDENCE;
use crate::measure::Measure;

/// The first replicate of a confirmation. The search uses lower ones.
pub const FIRST_CONFIRMATION: u32 = 1_000_000;
/// Minimum number of values of an objective in a confirmation.
const MIN_RUNS: usize = 10;
/// Minimum number of runs for a constraint on a mean: with fewer, a skewed response is certified wrongly too often.
const MIN_MEAN_RUNS: usize = 30;
/// Maximum of the number of runs of a confirmation in a question.
pub(super) const MAX_RUNS: usize = 10_000;
/// Maximum number of attempts.
const MAX_ATTEMPTS: u32 = 1000;
/// Probability with which a point at the limit of the search passes its confirmation.
pub(super) const ASSURANCE: f64 = 0.5;

/// The state of a confirmation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ConfirmationState {
    /// Runs are missing.
    Open,
    /// All constraints hold with 95 % confidence, and every objective has values.
    Confirmed,
    /// A constraint does not hold, with 95 % confidence, or the runs fail.
    Refuted,
    /// The maximum number of runs cannot certify the constraints, or leaves an objective without values.
    Undecided,
}

/// Numbers of runs of a confirmation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plan {
    /// Runs of the first look: the best case.
    pub(super) first: usize,
    /// Maximum.
    pub(super) most: usize,
    /// The probability with which each constraint may be certified wrongly.
    alpha: f64,
}

/// The confirmation runs at a point.
#[derive(Clone, Debug)]
pub(super) struct Confirming<'a> {
    /// The attempt, from 1 on.
    pub(super) attempt: u32,
    /// None when the question does not allow it any more.
    plan: Option<Plan>,
    runs: Vec<(u32, &'a Outcome)>,
}

impl Plan {
    /// The looks: numbers of runs.
    fn looks(&self) -> impl Iterator<Item = usize> + '_ {
        let before = (0..).map(|look| self.first << look).take_while(|runs| *runs < self.most);
        before.chain([self.most])
    }

    /// The looks with the probability α_k of each.
    pub(super) fn tails(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let tail = |(runs, power): (usize, i32)| {
            let power = if runs == self.most { power - 1 } else { power };
            (runs, self.alpha * 0.5_f64.powi(power))
        };
        self.looks().zip(1..).map(tail)
    }

    /// The last look with at most `runs` runs, and its α_k.
    fn last_look(&self, runs: usize) -> Option<(usize, f64)> {
        self.tails().take_while(|(look, _)| *look <= runs).last()
    }
}

impl Constraint {
    /// Number of runs that speak against a probability constraint, those without a value included.
    fn against(&self, values: &[Option<f64>]) -> usize {
        let is_against =
            |value: &Option<f64>| value.is_none_or(|value| (value != 0.0) == self.at_most.is_some());
        values.iter().filter(|value| is_against(value)).count()
    }

    /// The limit of the probability of runs that speak against it.
    pub(super) fn limit_against(&self) -> f64 {
        if self.at_most.is_some() { self.limit() } else { 1.0 - self.limit() }
    }

    /// The maximum number of runs against a probability constraint with which a look certifies it; none if none does.
    pub(super) fn allowed(&self, runs: usize, tail: f64) -> Option<usize> {
        (0..runs).take_while(|against| at_most(*against, runs, self.limit_against()) <= tail).last()
    }

    /// Whether the values of a look certify (true) or refute (false) the constraint.
    fn verdict(&self, tail: f64, values: &[Option<f64>]) -> Option<bool> {
        let bounds = Bounds::of(&self.of, tail, values)?;
        let (is_below, is_above) = (bounds.high <= self.limit(), bounds.low >= self.limit());
        (is_below || is_above).then_some(if self.at_most.is_some() { is_below } else { is_above })
    }

    /// The number of runs that certify the constraint in the best case, at a look that is wrong with probability `tail`.
    fn needed(&self, tail: f64) -> usize {
        match &self.of {
            // Without a run against it: (1 − limit)ⁿ ≤ tail.
            Measure::Probability(_) => (tail.ln() / (-self.limit_against()).ln_1p()).ceil() as usize,
            Measure::Mean(_) => MIN_MEAN_RUNS,
        }
    }
}

impl Optimise {
    /// The numbers of runs of an attempt, from 1 on; none when the maximum in the question certifies nothing.
    pub(super) fn plan(&self, attempt: u32) -> Option<Plan> {
        // Each constraint has its share of what may be wrong (Bonferroni).
        let alpha = (1.0 - CONFIDENCE) / self.constraints.len().max(1) as f64 * 0.5_f64.powi(attempt as i32);
        let needed = |tail: f64| {
            let runs = self.constraints.iter().map(|constraint| constraint.needed(tail));
            runs.fold(MIN_RUNS, usize::max)
        };
        let first = needed(0.5 * alpha);
        let most = self.confirmation_runs.unwrap_or(2 * first);
        // A single look may be wrong with all of α.
        let is_possible = attempt <= MAX_ATTEMPTS && most >= needed(alpha);
        is_possible.then_some(Plan { first: first.min(most), most, alpha })
    }

    /// The next attempt, and the number of points that may begin it. It is the last one as long as that has fewer points than are
    /// recommended in all: each recommended point has every attempt once.
    pub(super) fn next_attempt(&self, begun: &[(u32, ConfirmationState)]) -> (u32, usize) {
        let last = begun.iter().map(|(attempt, _)| *attempt).max().unwrap_or(1);
        let is_good = |state| matches!(state, ConfirmationState::Open | ConfirmationState::Confirmed);
        let free = |next: u32| {
            let taken = begun.iter().filter(|(attempt, state)| *attempt == next || is_good(*state));
            self.targets().saturating_sub(taken.count())
        };
        if free(last) > 0 { (last, free(last)) } else { (last + 1, free(last + 1)) }
    }
}

impl<'a> Confirming<'a> {
    /// The confirmation at a point; none if it has not begun.
    pub(super) fn of(goal: &Optimise, point: &'a PointRuns) -> Option<Self> {
        let runs = point.runs.range(FIRST_CONFIRMATION..);
        let runs: Vec<_> = runs.map(|(replicate, outcome)| (*replicate, outcome)).collect();
        let attempt = runs.first()?.0 / FIRST_CONFIRMATION;
        Some(Self { attempt, plan: goal.plan(attempt), runs })
    }

    /// Runs before the first that is in flight, but for cancelled ones.
    fn ended(&self) -> impl Iterator<Item = &'a Outcome> + '_ {
        let outcomes = self.runs.iter().map(|(_, outcome)| *outcome);
        let ended = outcomes.take_while(|outcome| **outcome != Outcome::Pending);
        ended.filter(|outcome| **outcome != Outcome::Cancelled)
    }

    /// The values of a measure by run, in the order of replicates; none where a run failed or lacks the response.
    fn outcomes(&self, measure: &Measure) -> Vec<Option<f64>> {
        let value = |outcome: &Outcome| match outcome {
            Outcome::Responses(values) => values.get(measure.response()).copied(),
            Outcome::Pending | Outcome::Cancelled | Outcome::Failed => None,
        };
        self.ended().map(|outcome| value(outcome).filter(|value| measure.accepts(*value))).collect()
    }

    /// The values of a measure.
    pub(super) fn values(&self, measure: &Measure) -> Vec<f64> {
        self.outcomes(measure).into_iter().flatten().collect()
    }

    pub(super) fn state(&self, goal: &Optimise, max_failures: usize) -> ConfirmationState {
        let ended = self.ended().count();
        let failed = self.ended().filter(|outcome| **outcome == Outcome::Failed).count();
        if failed >= max_failures && 2 * failed >= ended {
            return ConfirmationState::Refuted;
        }
        let Some(plan) = &self.plan else { return ConfirmationState::Undecided };
        let (look, last) = (plan.last_look(ended), plan.last_look(plan.most));
        let (mut is_certified, mut is_refuted, mut is_hopeless) = (look.is_some(), false, false);
        for constraint in &goal.constraints {
            let values = self.outcomes(&constraint.of);
            let verdict = look.and_then(|(runs, tail)| constraint.verdict(tail, &values[..runs]));
            is_certified &= verdict == Some(true);
            is_refuted |= verdict == Some(false);
            if matches!(constraint.of, Measure::Probability(_)) {
                let allowed = last.and_then(|(runs, tail)| constraint.allowed(runs, tail));
                is_hopeless |= allowed.is_none_or(|allowed| constraint.against(&values) > allowed);
            }
        }
        let has_values = |objective: &super::Objective| self.values(objective.measure()).len() >= MIN_RUNS;
        if is_certified && goal.objectives.iter().all(has_values) {
            ConfirmationState::Confirmed
        } else if is_refuted {
            ConfirmationState::Refuted
        } else if is_hopeless || ended >= plan.most {
            ConfirmationState::Undecided
        } else {
            ConfirmationState::Open
        }
    }

    /// Bounds of a measure at the last look so far.
    pub(super) fn bounds(&self, measure: &Measure) -> Option<Bounds> {
        let values = self.outcomes(measure);
        let (runs, tail) = self.plan.as_ref()?.last_look(values.len())?;
        Bounds::of(measure, tail, &values[..runs])
    }

    /// Replicates of an open confirmation that come next: up to the next look.
    pub(super) fn next(&self) -> std::ops::Range<u32> {
        let ended = self.ended().count();
        let next = self.plan.as_ref().and_then(|plan| plan.looks().find(|look| *look > ended)).unwrap_or(0);
        let from = self.runs.last().map_or(FIRST_CONFIRMATION, |(replicate, _)| replicate + 1);
        let cancelled = self.runs.iter().filter(|(_, outcome)| **outcome == Outcome::Cancelled).count();
        from..from + (next + cancelled).saturating_sub(self.runs.len()) as u32
    }
}
