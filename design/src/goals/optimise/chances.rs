//! The chances of a point to pass its next confirmation, by constraint: what the search and the choice of points aim at.

use statrs::distribution::{Binomial, Discrete};

use super::bounds::{bisect, mean_quantile};
use super::confirmation::{ASSURANCE, Plan};
use super::{Constraint, Optimise};
use crate::measure::Measure;

/// Number of cells of a table of chances. Interpolation errs by less than a thousandth.
const CELLS: usize = 256;

/// The next confirmation.
#[derive(Clone, Debug)]
pub(super) struct NextConfirmation<'a> {
    pub(super) plan: Plan,
    /// In the order of the constraints.
    pub(super) chances: Vec<Chances<'a>>,
}

/// The chances of a constraint to be certified.
#[derive(Clone, Debug)]
pub(super) struct Chances<'a> {
    constraint: &'a Constraint,
    looks: Vec<Look>,
    /// Of a probability constraint: the chance by the probability that a run speaks against it, in equal steps from 0 to `end`.
    table: Vec<f64>,
    end: f64,
}

/// A look of a confirmation at a constraint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look {
    runs: usize,
    /// The maximum number of runs against a probability constraint with which it is certified.
    allowed: Option<usize>,
    /// The distance of the bounds from the mean of values without skewness, in units of its standard error.
    quantile: f64,
}

impl<'a> NextConfirmation<'a> {
    pub(super) fn of(goal: &'a Optimise, plan: Plan) -> Self {
        let chances = goal.constraints.iter().map(|constraint| Chances::of(constraint, &plan));
        Self { chances: chances.collect(), plan }
    }
}

impl<'a> Chances<'a> {
    pub(super) fn of(constraint: &'a Constraint, plan: &Plan) -> Self {
        let is_probability = matches!(constraint.of, Measure::Probability(_));
        let look = |(runs, tail)| Look {
            runs,
            allowed: if is_probability { constraint.allowed(runs, tail) } else { None },
            quantile: mean_quantile(runs, tail, 0.0),
        };
        let looks: Vec<Look> = plan.tails().map(look).collect();
        // Beyond twice the limit the chance is nil.
        let end = if is_probability { (2.0 * constraint.limit_against()).min(1.0) } else { 0.0 };
        let cells = if is_probability { 0..CELLS + 1 } else { 0..0 };
        let table = cells.map(|cell| passes(&looks, end * cell as f64 / CELLS as f64)).collect();
        Self { constraint, looks, table, end }
    }

    /// The chance to certify a probability constraint, if a run speaks against it with probability `p`.
    pub(super) fn at(&self, p: f64) -> f64 {
        let place = p / self.end * CELLS as f64;
        let cell = place as usize;
        if cell >= CELLS {
            return 0.0;
        }
        let (before, after) = (self.table[cell], self.table[cell + 1]);
        before + (place - cell as f64) * (after - before)
    }

    /// The limit for the search: a point there passes its confirmation with probability [`ASSURANCE`]. `deviation` is that of
    /// single runs, in the unit of the response.
    pub(super) fn search_limit(&self, deviation: f64) -> f64 {
        let (limit, is_upper) = (self.constraint.limit(), self.constraint.at_most.is_some());
        match &self.constraint.of {
            Measure::Probability(_) => {
                let against = bisect(|p| self.at(p) >= ASSURANCE).min(self.constraint.limit_against());
                if is_upper { against } else { 1.0 - against }
            }
            Measure::Mean(_) if is_upper => limit - self.margin(deviation),
            Measure::Mean(_) => limit + self.margin(deviation),
        }
    }

    /// Probability that a confirmation passes, for a measure known by quantiles of equal probability, where a run has a value
    /// with probability `success`.
    pub(super) fn assurance(&self, quantiles: &[f64], deviation: f64, success: f64) -> f64 {
        let sign = if self.constraint.at_most.is_some() { 1.0 } else { -1.0 };
        let error = self.looks.last().map_or(0.0, |look| deviation / (look.runs as f64).sqrt()).max(1e-300);
        let pass = |value: &f64| match &self.constraint.of {
            Measure::Probability(_) => {
                let holds = if sign > 0.0 { 1.0 - value } else { *value };
                self.at(1.0 - holds * success)
            }
            Measure::Mean(_) => {
                let gap = sign * (self.constraint.limit() - value);
                super::normal::cdf((gap - self.margin(deviation)) / error)
            }
        };
        quantiles.iter().map(pass).sum::<f64>() / quantiles.len() as f64
    }

    /// The exact chance.
    #[cfg(test)]
    pub(super) fn exactly_at(&self, p: f64) -> f64 {
        passes(&self.looks, p)
    }

    /// Half the width of the interval of a mean at the last look.
    fn margin(&self, deviation: f64) -> f64 {
        self.looks.last().map_or(0.0, |look| look.quantile * deviation / (look.runs as f64).sqrt())
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
