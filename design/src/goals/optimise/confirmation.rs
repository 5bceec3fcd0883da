//! Confirmation: fresh seeds at a recommended point, until its constraints are certified or refuted.
//!
//! The search has chosen the point because its runs looked good, so these runs are no evidence. A confirmation rests on replicates
//! from [`FIRST_CONFIRMATION`] on alone, and their order decides: quick runs have no advantage. It is looked at after n₀ 2ᵏ runs,
//! k = 0, 1, … With m constraints a look may be wrong about each with probability αₖ = 0.05/(m 2ᵏ⁺¹), which is 0.05 in all.
//!
//! | constraint | bounds at a look |
//! |---|---|
//! | probability | one-sided binomial ones (Clopper and Pearson 1934) with confidence 1 − αₖ |
//! | mean | one-sided ones of Student's t with confidence 1 − αₖ |
//!
//! The confidence sequence of `intervals` may be looked at after every run, but needs 116 runs without a jam to certify
//! P ≤ 0.05; these looks need 72.

use serde::{Deserialize, Serialize};
use statrs::distribution::{Binomial, ContinuousCDF, Discrete, DiscreteCDF, StudentsT};

use super::{Constraint, Optimise};
use crate::evidence::{Outcome, PointRuns};
use crate::intervals::CONFIDENCE;
use crate::question::Measure;

/// The first replicate of a confirmation. The search uses lower ones.
pub const FIRST_CONFIRMATION: u32 = 1_000_000;
/// Minimum number of runs of a confirmation.
const MIN_RUNS: usize = 10;
/// Probability with which a point at the limit of the search passes its confirmation.
pub(super) const ASSURANCE: f64 = 0.5;

/// The state of a confirmation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ConfirmationState {
    /// Runs are missing.
    Open,
    /// All constraints hold with 95 % confidence.
    Confirmed,
    /// A constraint does not hold, with 95 % confidence, or the runs fail.
    Refuted,
    /// The maximum number of runs cannot certify the constraints.
    Undecided,
}

/// Numbers of runs of a confirmation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Plan {
    /// Runs of the first look: the best case.
    pub(super) first: usize,
    /// Maximum.
    pub(super) most: usize,
}

/// The confirmation runs at a point.
#[derive(Clone, Debug)]
pub(super) struct Confirming<'a> {
    runs: Vec<(u32, &'a Outcome)>,
}

/// A look of a confirmation at a constraint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look {
    runs: usize,
    /// The maximum number of runs against a probability constraint with which it is certified.
    allowed: Option<usize>,
    /// The quantile of Student's t for the bounds of a mean.
    quantile: f64,
}

impl Plan {
    /// The looks: numbers of runs.
    fn looks(&self) -> impl Iterator<Item = usize> + '_ {
        (0..).map(|look| self.first << look).take_while(|runs| *runs <= self.most)
    }

    /// The looks with the probability α_k of each.
    fn tails(&self, alpha: f64) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.looks().zip(1..).map(move |(runs, power)| (runs, alpha * 0.5_f64.powi(power)))
    }

    /// The last look with at most `runs` runs, and its α_k.
    fn last_look(&self, runs: usize, alpha: f64) -> Option<(usize, f64)> {
        self.tails(alpha).take_while(|(look, _)| *look <= runs).last()
    }
}

/// One-sided bounds of a measure at a look.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bounds {
    /// Number of values.
    pub n: usize,
    /// Share or mean of the values.
    pub value: f64,
    /// The measure is above this bound with at least 95 % confidence.
    pub low: f64,
    /// The measure is below this bound with at least 95 % confidence.
    pub high: f64,
}

impl Bounds {
    /// Bounds at the last look that values allow; none before the first.
    fn of(measure: &Measure, plan: &Plan, alpha: f64, values: &[f64]) -> Option<Self> {
        let (n, tail) = plan.last_look(values.len(), alpha)?;
        let sample = roost_stats::Sample::of(&values[..n])?;
        let (low, high) = match measure {
            Measure::Probability(_) => {
                let count = values[..n].iter().filter(|value| **value != 0.0).count();
                (1.0 - upper(n - count, n, tail), upper(count, n, tail))
            }
            Measure::Mean(_) => {
                let half = t_quantile(n, tail) * sample.deviation? / (n as f64).sqrt();
                (sample.mean - half, sample.mean + half)
            }
        };
        Some(Self { n, value: sample.mean, low, high })
    }
}

/// The upper bound of a probability: `count` events or fewer of `n` then have the probability `tail`.
fn upper(count: usize, n: usize, tail: f64) -> f64 {
    bisect(|p| at_most(count, n, p) > tail)
}

/// The end of the range from 0 on in which a condition on a probability holds.
fn bisect(holds: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        *(if holds(middle) { &mut low } else { &mut high }) = middle;
    }
    high
}

/// Probability of at most `count` events in `n` runs.
fn at_most(count: usize, n: usize, p: f64) -> f64 {
    Binomial::new(p, n as u64).expect("a probability").cdf(count as u64)
}

/// The one-sided quantile of Student's t for the mean of `n` values.
fn t_quantile(n: usize, tail: f64) -> f64 {
    StudentsT::new(0.0, 1.0, n as f64 - 1.0).expect("at least two runs").inverse_cdf(1.0 - tail)
}

impl Constraint {
    /// Number of runs that speak against a probability constraint.
    fn against(&self, values: &[f64]) -> usize {
        let count = values.iter().filter(|value| **value != 0.0).count();
        if self.at_most.is_some() { count } else { values.len() - count }
    }

    /// The limit of the probability of runs that speak against it.
    fn limit_against(&self) -> f64 {
        if self.at_most.is_some() { self.limit() } else { 1.0 - self.limit() }
    }

    /// The maximum number of runs against a probability constraint with which a look certifies it; none if none does.
    fn allowed(&self, runs: usize, tail: f64) -> Option<usize> {
        (0..runs).take_while(|against| at_most(*against, runs, self.limit_against()) <= tail).last()
    }

    /// The looks of a plan.
    pub(super) fn looks(&self, plan: &Plan, alpha: f64) -> Vec<Look> {
        let look = |(runs, tail)| Look {
            runs,
            allowed: match self.of {
                Measure::Probability(_) => self.allowed(runs, tail),
                Measure::Mean(_) => None,
            },
            quantile: t_quantile(runs, tail),
        };
        plan.tails(alpha).map(look).collect()
    }

    /// The limit for the search: a point there passes its confirmation with probability [`ASSURANCE`]. `deviation` is that of
    /// single runs, in the unit of the response.
    pub(super) fn search_limit(&self, looks: &[Look], deviation: f64) -> f64 {
        match &self.of {
            Measure::Probability(_) => {
                let limit = bisect(|p| passes(looks, p) >= ASSURANCE).min(self.limit_against());
                if self.at_most.is_some() { limit } else { 1.0 - limit }
            }
            Measure::Mean(_) => {
                let margin = margin(looks, deviation);
                if self.at_most.is_some() { self.limit() - margin } else { self.limit() + margin }
            }
        }
    }

    /// Probability that a confirmation passes for a measure known by quantiles of equal probability.
    pub(super) fn assurance(&self, looks: &[Look], quantiles: &[f64], deviation: f64) -> f64 {
        let sign = if self.at_most.is_some() { 1.0 } else { -1.0 };
        let error = looks.last().map_or(0.0, |look| deviation / (look.runs as f64).sqrt()).max(1e-300);
        let pass = |value: &f64| match &self.of {
            Measure::Probability(_) => passes(looks, if sign > 0.0 { *value } else { 1.0 - value }),
            Measure::Mean(_) => {
                super::normal::cdf((sign * (self.limit() - value) - margin(looks, deviation)) / error)
            }
        };
        quantiles.iter().map(pass).sum::<f64>() / quantiles.len() as f64
    }

    /// Whether values certify (true) or refute (false) the constraint at their last look.
    fn verdict(&self, plan: &Plan, alpha: f64, values: &[f64]) -> Option<bool> {
        let bounds = Bounds::of(&self.of, plan, alpha, values)?;
        let (is_below, is_above) = (bounds.high <= self.limit(), bounds.low >= self.limit());
        (is_below || is_above).then_some(if self.at_most.is_some() { is_below } else { is_above })
    }
}

/// Probability that a confirmation certifies a probability constraint, if a run speaks against it with probability `p`.
fn passes(looks: &[Look], p: f64) -> f64 {
    let most = looks.iter().filter_map(|look| look.allowed).max().unwrap_or(0);
    // Probability of each number of runs against it, while no look has certified it.
    let mut open = vec![0.0; most + 1];
    open[0] = 1.0;
    let (mut passed, mut before) = (0.0, 0);
    for look in looks {
        let step = Binomial::new(p.clamp(0.0, 1.0), (look.runs - before) as u64).expect("a probability");
        let steps: Vec<f64> = (0..=most).map(|count| step.pmf(count as u64)).collect();
        let next = |count: usize| (0..=count).map(|old| open[old] * steps[count - old]).sum();
        open = (0..=most).map(next).collect();
        let certified = look.allowed.map_or(0, |allowed| allowed + 1);
        passed += open[..certified].iter().sum::<f64>();
        open[..certified].fill(0.0);
        before = look.runs;
    }
    passed
}

/// Half the width of the interval of a mean at the last look.
fn margin(looks: &[Look], deviation: f64) -> f64 {
    looks.last().map_or(0.0, |look| look.quantile * deviation / (look.runs as f64).sqrt())
}

impl Optimise {
    /// The probability with which each constraint may be certified wrongly (Bonferroni).
    pub(super) fn alpha(&self) -> f64 {
        (1.0 - CONFIDENCE) / self.constraints.len().max(1) as f64
    }

    /// The numbers of runs of a confirmation; none when the maximum in the question certifies nothing.
    pub(super) fn plan(&self) -> Option<Plan> {
        let needed = |constraint: &Constraint| match &constraint.of {
            // Without a run against it: (1 − limit)ⁿ ≤ α₀.
            Measure::Probability(_) => {
                ((0.5 * self.alpha()).ln() / (-constraint.limit_against()).ln_1p()).ceil() as usize
            }
            Measure::Mean(_) => MIN_RUNS,
        };
        let first = self.constraints.iter().map(needed).fold(MIN_RUNS, usize::max);
        let by_default = if self.constraints.is_empty() { first } else { 2 * first };
        let most = self.confirmation_runs.unwrap_or(by_default);
        (most >= first).then_some(Plan { first, most })
    }
}

impl<'a> Confirming<'a> {
    /// The confirmation at a point; none if it has not begun.
    pub(super) fn of(point: &'a PointRuns) -> Option<Self> {
        let runs: Vec<_> = point
            .runs
            .range(FIRST_CONFIRMATION..)
            .map(|(replicate, outcome)| (*replicate, outcome))
            .collect();
        (!runs.is_empty()).then_some(Self { runs })
    }

    /// Runs before the first that is in flight, but for cancelled ones.
    fn ended(&self) -> impl Iterator<Item = &'a Outcome> + '_ {
        let outcomes = self.runs.iter().map(|(_, outcome)| *outcome);
        let ended = outcomes.take_while(|outcome| **outcome != Outcome::Pending);
        ended.filter(|outcome| **outcome != Outcome::Cancelled)
    }

    /// The values of a measure, in the order of replicates.
    pub(super) fn values(&self, measure: &Measure) -> Vec<f64> {
        let values = self.ended().filter_map(|outcome| match outcome {
            Outcome::Responses(values) => values.get(measure.response()).copied(),
            Outcome::Pending | Outcome::Cancelled | Outcome::Failed => None,
        });
        values.filter(|value| value.is_finite()).collect()
    }

    /// Number of runs that have ended, and how many of them failed.
    fn counts(&self) -> (usize, usize) {
        self.ended().fold((0, 0), |(ended, failed), outcome| {
            (ended + 1, failed + usize::from(*outcome == Outcome::Failed))
        })
    }

    pub(super) fn state(&self, goal: &Optimise, plan: &Plan, max_failures: usize) -> ConfirmationState {
        let (ended, failed) = self.counts();
        if failed >= max_failures && 2 * failed >= ended {
            return ConfirmationState::Refuted;
        }
        let alpha = goal.alpha();
        let last = plan.last_look(plan.most, alpha);
        let (mut is_certified, mut is_refuted, mut is_hopeless) = (ended >= plan.first, false, false);
        for constraint in &goal.constraints {
            let values = self.values(&constraint.of);
            let verdict = constraint.verdict(plan, alpha, &values);
            is_certified &= verdict == Some(true);
            is_refuted |= verdict == Some(false);
            if matches!(constraint.of, Measure::Probability(_)) {
                let allowed = last.and_then(|(runs, tail)| constraint.allowed(runs, tail));
                is_hopeless |= constraint.against(&values) > allowed.unwrap_or(0);
            }
        }
        if is_certified {
            ConfirmationState::Confirmed
        } else if is_refuted {
            ConfirmationState::Refuted
        } else if is_hopeless || ended >= last.map_or(0, |(runs, _)| runs) + failed {
            ConfirmationState::Undecided
        } else {
            ConfirmationState::Open
        }
    }

    /// Bounds of a measure at the last look so far.
    pub(super) fn bounds(&self, goal: &Optimise, plan: &Plan, measure: &Measure) -> Option<Bounds> {
        Bounds::of(measure, plan, goal.alpha(), &self.values(measure))
    }

    /// Replicates of an open confirmation that come next: up to the next look.
    pub(super) fn next(&self, plan: &Plan) -> std::ops::Range<u32> {
        let (ended, failed) = self.counts();
        let next = plan.looks().find(|look| look + failed > ended).unwrap_or(plan.most);
        let cancelled = self.runs.iter().filter(|(_, outcome)| **outcome == Outcome::Cancelled).count();
        let from = self.runs.last().map_or(FIRST_CONFIRMATION, |(replicate, _)| replicate + 1);
        from..from.max(FIRST_CONFIRMATION + (next + failed + cancelled) as u32)
    }
}
