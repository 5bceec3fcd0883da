//! The choice of runs: noisy expected improvement times the probability that the constraints hold.
//!
//! | symbol | meaning |
//! |---|---|
//! | I | incumbents: points with runs, or with runs in flight |
//! | f_I | values of all measures at I, drawn from the posterior |
//! | b | the best of f_I that meets the constraints |
//! | NEI(x) | mean over draws of the expectation of max(b − f(x), 0) given f_I |
//! | acquisition | ln NEI(x) + Σ ln P(constraint holds at x) + ln P(run succeeds at x) |
//!
//! Noisy runs leave open which point is the best so far; the draws average over that (Letham et al. 2019). With two objectives the
//! improvement is the gain of area below the Pareto front of each draw, which is known exactly (`front`). It was preferred to
//! Chebyshev scalarisation because it needs no random weights: every run of a large batch serves the whole front, and
//! its expectation is one number for the tolerance. Logarithms keep the order of tiny improvements (Ament et al. 2023).
//!
//! Runs in flight count as known with the posterior mean as their value. A choice that differs from an incumbent by far less
//! than the noise becomes a replicate there.

use std::collections::BTreeMap;

use nalgebra::DVector;
use statrs::distribution::{ContinuousCDF, Normal};

use super::chances::NextConfirmation;
use super::models::Models;
use super::normal::{LnSum, ln_cdf, ln_improvement};
use super::surfaces::{Conditional, Surface};
use super::{Optimise, candidates, front, has_values, next_replicate, search_runs};
use crate::evidence::{Outcome, Point};
use crate::goals::Study;
use crate::measure::Measure;
use crate::model::kernel::columns;
use crate::proposal::Proposal;
use crate::space::{mixed_seed, sobol};

/// Number of draws of the values at the incumbents.
const DRAWS: usize = 32;
/// Maximum number of incumbents.
const MAX_INCUMBENTS: usize = 40;
/// Maximum number of runs in flight that are taken into account point by point.
const MAX_PENDING: usize = 200;

/// Points under comparison, with the posteriors of all measures.
struct Field<'a> {
    goal: &'a Optimise,
    points: Vec<Point>,
    /// Of objectives, smaller is better; then of constraints, which hold below their limits.
    surfaces: Vec<Surface>,
    /// Limit of each constraint at each point.
    limits: Vec<Vec<f64>>,
    /// Logarithm of the probability that a run succeeds.
    success: Vec<f64>,
    incumbents: Vec<usize>,
    /// Whether the range has no more than some points, all of which may have runs.
    is_finite: bool,
}

/// The proposals of the search, and the expected improvement of the first in the unit of the tolerance.
pub(super) fn proposals(
    goal: &Optimise,
    next: &NextConfirmation<'_>,
    study: &Study<'_>,
    models: &Models<'_>,
    room: usize,
) -> (Vec<Proposal>, Option<f64>) {
    let factors = study.factors;
    // Other candidates after every result.
    let seed = mixed_seed(study.seed, study.evidence.runs() as u64);
    let old = old_points(goal, study);
    let spread = candidates::spread(200, factors.len(), seed);
    let mut wide = Field::of(goal, next, study, models, &old, &spread);
    let centres = wide.best_incumbents(6);
    let near = candidates::clouds(factors, &centres, 8, seed);
    wide = Field::of(goal, next, study, models, &old, &[spread, near].concat());
    let best = wide.best_new(60, seed);
    let around = candidates::clouds(factors, &best[..best.len().min(4)], 10, mixed_seed(seed, 1));
    let mut field = Field::of(goal, next, study, models, &old, &[best, around].concat());
    let (mut proposals, mut improvement) = (Vec::new(), None);
    let mut counts: BTreeMap<usize, u32> = BTreeMap::new();
    while proposals.len() < room.max(1) {
        let values = field.with_replicates(field.acquisition(seed));
        let is_old = |index: usize| field.incumbents.contains(&index);
        let is_allowed = |index| (field.is_finite || !is_old(index)) && field.has_room(index, study, &counts);
        let Some((chosen, ln)) = best_of(&values, is_allowed) else { break };
        if improvement.is_none() {
            improvement = Some(ln.exp() / field.scale());
        }
        let place = match is_old(chosen) {
            true => chosen,
            false => field.replicated_place(chosen, study, &counts).unwrap_or(chosen),
        };
        let count = counts.entry(place).or_default();
        let replicate = next_replicate(study.evidence.at(&field.points[place])) + *count;
        *count += 1;
        proposals.push(Proposal { point: field.points[place].clone(), replicate });
        field.condition(place);
    }
    proposals.truncate(room);
    (proposals, improvement)
}

/// Points with a value of every measure, or with runs of the search in flight, with the number in flight.
fn old_points(goal: &Optimise, study: &Study<'_>) -> Vec<(Point, usize)> {
    let mut left = MAX_PENDING;
    let mut points = Vec::new();
    for point in study.usable_points() {
        let pending =
            search_runs(point).filter(|(_, outcome)| **outcome == Outcome::Pending).count().min(left);
        left -= pending;
        if pending > 0 || has_values(goal, point) {
            points.push((point.point.clone(), pending));
        }
    }
    points
}

/// The index of the largest finite value among those allowed, with the value; the first of equal ones.
fn best_of(values: &[f64], is_allowed: impl Fn(usize) -> bool) -> Option<(usize, f64)> {
    let allowed =
        values.iter().copied().enumerate().filter(|(index, value)| value.is_finite() && is_allowed(*index));
    allowed.reduce(|best, other| if other.1 > best.1 { other } else { best })
}

impl<'a> Field<'a> {
    fn of(
        goal: &'a Optimise,
        next: &NextConfirmation<'_>,
        study: &Study<'_>,
        models: &Models<'_>,
        old: &[(Point, usize)],
        new: &[Vec<f64>],
    ) -> Self {
        let mut points: Vec<Point> = old.iter().map(|(point, _)| point.clone()).collect();
        for point in new {
            let point = Point::new(point).rounded(study.factors);
            if study.evidence.at(&point).is_none() && !points.contains(&point) {
                points.push(point);
            }
        }
        let coordinates: Vec<_> = points.iter().map(Point::coordinates).collect();
        let matrix = columns(study.factors.len(), &coordinates);
        let (mut surfaces, mut limits) = (Vec::new(), Vec::new());
        for objective in &goal.objectives {
            surfaces.push(Surface::of(models.of(objective.measure()), &matrix, objective.sign()));
        }
        for (constraint, chances) in goal.constraints.iter().zip(&next.chances) {
            let model = models.of(&constraint.of);
            let sign = if constraint.at_most.is_some() { 1.0 } else { -1.0 };
            let surface = Surface::of(model, &matrix, sign);
            let unit = model.value(1.0) - model.value(0.0);
            let limit = |noise: &f64| sign * model.latent(chances.search_limit(noise.sqrt() * unit));
            // The limit of a probability does not depend on the point.
            limits.push(match constraint.of {
                Measure::Probability(_) => vec![limit(&0.0); points.len()],
                Measure::Mean(_) => surface.noise.iter().map(limit).collect(),
            });
            surfaces.push(surface);
        }
        let success = match &models.success {
            None => vec![0.0; points.len()],
            Some(model) => model
                .posterior
                .predict(&matrix)
                .means
                .iter()
                .map(|latent| model.value(*latent).ln())
                .collect(),
        };
        let is_finite = study.factors.iter().all(|factor| factor.is_whole);
        let mut field = Self { goal, points, surfaces, limits, success, incumbents: Vec::new(), is_finite };
        for (index, (_, pending)) in old.iter().enumerate() {
            for _ in 0..*pending {
                field.surfaces.iter_mut().for_each(|surface| surface.condition(index));
            }
            field.add_incumbent(index);
        }
        field
    }

    fn objectives(&self) -> &[Surface] {
        &self.surfaces[..self.goal.objectives.len()]
    }

    /// A number that is the smaller, the better an incumbent seems.
    fn rank(&self, index: usize) -> f64 {
        let constraints = self.surfaces[self.goal.objectives.len()..].iter().zip(&self.limits);
        let excess = constraints.map(|(surface, limits)| {
            let deviation = surface.deviation(index).max(1e-12);
            // Two standard deviations on the allowed side are enough.
            (2.0 - (limits[index] - surface.means[index]) / deviation).clamp(0.0, 10.0)
        });
        let excess: f64 = excess.sum();
        let objectives = self.objectives();
        if let [one] = objectives {
            return one.means[index] + excess;
        }
        let at = |index: usize| [objectives[0].means[index], objectives[1].means[index]];
        let beaten = self.incumbents.iter().filter(|other| {
            let (mine, other) = (at(index), at(**other));
            other[0] < mine[0] && other[1] < mine[1]
        });
        beaten.count() as f64 + excess + 1e-3 * at(index).iter().sum::<f64>()
    }

    /// Adds an incumbent; when there are too many, the worst one leaves.
    fn add_incumbent(&mut self, index: usize) {
        if self.incumbents.contains(&index) {
            return;
        }
        self.incumbents.push(index);
        let dimensions = sobol_burley::NUM_DIMENSIONS as usize / self.surfaces.len();
        if self.incumbents.len() > MAX_INCUMBENTS.min(dimensions) {
            let ranks: Vec<f64> = self.incumbents.iter().map(|index| -self.rank(*index)).collect();
            if let Some((worst, _)) = best_of(&ranks, |_| true) {
                self.incumbents.remove(worst);
            }
        }
    }

    fn best_incumbents(&self, count: usize) -> Vec<Vec<f64>> {
        let mut order = self.incumbents.clone();
        order.sort_by(|one, other| self.rank(*one).total_cmp(&self.rank(*other)));
        order.iter().take(count).map(|index| self.points[*index].coordinates()).collect()
    }

    /// The new points with the best acquisition, the best first.
    fn best_new(&self, count: usize, seed: u64) -> Vec<Vec<f64>> {
        let values = self.acquisition(seed);
        let mut order: Vec<usize> =
            (0..values.len()).filter(|index| !self.incumbents.contains(index)).collect();
        order.sort_by(|one, other| values[*other].total_cmp(&values[*one]));
        order.iter().take(count).map(|index| self.points[*index].coordinates()).collect()
    }

    /// The acquisition at every point.
    fn acquisition(&self, seed: u64) -> Vec<f64> {
        let given: Vec<Conditional> =
            self.surfaces.iter().map(|surface| surface.given(&self.incumbents)).collect();
        let mut sums = vec![LnSum::EMPTY; self.points.len()];
        let reference = self.reference();
        let known = self.incumbents.len();
        for draw in 0..DRAWS {
            let numbers = normals(draw, known * self.surfaces.len(), mixed_seed(seed, 7));
            let numbers: Vec<DVector<f64>> =
                numbers.chunks(known.max(1)).map(DVector::from_column_slice).collect();
            let values: Vec<Vec<f64>> = (0..self.surfaces.len())
                .map(|k| given[k].values(&self.surfaces[k], &self.incumbents, &numbers[k]))
                .collect();
            let holds: Vec<usize> = (0..known).filter(|position| self.holds(&values, *position)).collect();
            let means: Vec<DVector<f64>> = (0..self.goal.objectives.len())
                .map(|k| given[k].means(&self.surfaces[k], &numbers[k]))
                .collect();
            if let [means] = means.as_slice() {
                // Without any point that meets the constraints, every such point would be an improvement.
                let best = if holds.is_empty() {
                    values[0].iter().copied().fold(f64::NEG_INFINITY, f64::max)
                } else {
                    holds.iter().map(|position| values[0][*position]).fold(f64::INFINITY, f64::min)
                };
                for (index, sum) in sums.iter_mut().enumerate() {
                    sum.add(ln_improvement(best - means[index], given[0].deviations[index]));
                }
            } else {
                let front: Vec<[f64; 2]> =
                    holds.iter().map(|position| [values[0][*position], values[1][*position]]).collect();
                let gain = front::ln_gain(&front, reference);
                for (index, sum) in sums.iter_mut().enumerate() {
                    let deviations = [given[0].deviations[index], given[1].deviations[index]];
                    sum.add(gain([means[0][index], means[1][index]], deviations));
                }
            }
        }
        let value = |(index, sum): (usize, &LnSum)| {
            sum.ln() - (DRAWS as f64).ln() + self.ln_feasible(index) + self.success[index]
        };
        sums.iter().enumerate().map(value).collect()
    }

    /// The acquisition with that of a replicate at each incumbent, where the range has no new points near it. The acquisition is 0 there, since
    /// draws know the values at incumbents. The gain of knowing one of them exactly is the expected amount by which it then changes sides with the
    /// best of the others, or with two objectives the area that it then adds to their front beside the area that it seems to add.
    fn with_replicates(&self, mut values: Vec<f64>) -> Vec<f64> {
        if !self.is_finite {
            return values;
        }
        let reference = self.reference();
        for index in &self.incumbents {
            let others = self.likely(self.incumbents.iter().filter(|other| *other != index));
            let gain = match self.objectives() {
                [surface] => {
                    let best = others.iter().map(|other| surface.means[*other]).fold(f64::INFINITY, f64::min);
                    ln_improvement(-(surface.means[*index] - best).abs(), surface.deviation(*index))
                }
                surfaces => {
                    let means = |index: usize| [surfaces[0].means[index], surfaces[1].means[index]];
                    let deviations = [surfaces[0].deviation(*index), surfaces[1].deviation(*index)];
                    let others: Vec<_> = others.into_iter().map(means).collect();
                    front::ln_gain_of_knowing(&others, reference, means(*index), deviations)
                }
            };
            values[*index] = gain + self.ln_feasible(*index) + self.success[*index];
        }
        values
    }

    /// Those of some points that seem to meet the constraints, or else all of them.
    fn likely<'b>(&self, points: impl Iterator<Item = &'b usize> + Clone) -> Vec<usize> {
        let likely: Vec<usize> =
            points.clone().copied().filter(|index| self.ln_feasible(*index) > 0.5_f64.ln()).collect();
        if likely.is_empty() { points.copied().collect() } else { likely }
    }

    /// Whether drawn values meet all constraints at an incumbent.
    fn holds(&self, values: &[Vec<f64>], position: usize) -> bool {
        let constraints = values[self.goal.objectives.len()..].iter().zip(&self.limits);
        constraints.into_iter().all(|(values, limits)| values[position] <= limits[self.incumbents[position]])
    }

    /// ln of the probability that all constraints hold at a point.
    fn ln_feasible(&self, index: usize) -> f64 {
        let constraints = self.surfaces[self.goal.objectives.len()..].iter().zip(&self.limits);
        let terms = constraints.map(|(surface, limits)| {
            ln_cdf((limits[index] - surface.means[index]) / surface.deviation(index).max(1e-9))
        });
        terms.sum()
    }

    /// The means of both objectives at incumbents that seem to meet the constraints, or at all.
    fn mean_values(&self) -> Vec<[f64; 2]> {
        let [one, other, ..] = self.surfaces.as_slice() else { return Vec::new() };
        let of = |index: usize| [one.means[index], other.means[index]];
        self.likely(self.incumbents.iter()).into_iter().map(of).collect()
    }

    fn reference(&self) -> [f64; 2] {
        if self.goal.objectives.len() == 2 { front::reference(&self.mean_values()) } else { [0.0; 2] }
    }

    /// The unit of the tolerance in latent units: one standard deviation of a mean, a probability of 1, or the area of the front.
    fn scale(&self) -> f64 {
        match self.goal.objectives.as_slice() {
            [one] if matches!(one.measure(), Measure::Mean(_)) => 1.0,
            [_] => {
                // Where the best point seems to be, a small change of the log odds is one of P by P(1 − P) of it.
                let ranks: Vec<f64> = self.incumbents.iter().map(|index| -self.rank(*index)).collect();
                let best = best_of(&ranks, |_| true)
                    .map_or(0.0, |(best, _)| self.surfaces[0].means[self.incumbents[best]]);
                let p = crate::model::binomial::probability(best);
                1.0 / (p * (1.0 - p)).max(1e-12)
            }
            _ => front::area(&self.mean_values(), self.reference()).max(1e-12),
        }
    }

    /// Whether a point may have another run, with `counts` new ones in this batch.
    fn has_room(&self, place: usize, study: &Study<'_>, counts: &BTreeMap<usize, u32>) -> bool {
        let runs = study.evidence.at(&self.points[place]).map_or(0, |point| search_runs(point).count());
        let more = counts.get(&place).map_or(0, |count| *count as usize);
        runs + more < study.budget.max_replicates
    }

    /// An incumbent at which a replicate serves as well as a run at a point.
    fn replicated_place(
        &self,
        index: usize,
        study: &Study<'_>,
        counts: &BTreeMap<usize, u32>,
    ) -> Option<usize> {
        let is_like = |place: &usize| self.surfaces.iter().all(|surface| surface.is_like(index, *place));
        self.incumbents
            .iter()
            .copied()
            .filter(|place| self.has_room(*place, study, counts) && is_like(place))
            .min_by(|one, other| self.rank(*one).total_cmp(&self.rank(*other)))
    }

    /// Takes a run at a point as known.
    fn condition(&mut self, index: usize) {
        self.surfaces.iter_mut().for_each(|surface| surface.condition(index));
        self.add_incumbent(index);
    }
}

/// Standard normal numbers of a draw: quantiles at a point of a Sobol' sequence.
fn normals(draw: usize, count: usize, seed: u64) -> Vec<f64> {
    let normal = Normal::standard();
    // Half a step of the sequence away from 0.
    sobol(draw, count, seed)
        .iter()
        .map(|number| normal.inverse_cdf(number + 0.5 / (1 << 24) as f64))
        .collect()
}
