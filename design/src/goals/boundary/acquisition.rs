//! The choice of further runs.
//!
//! | symbol | meaning |
//! |---|---|
//! | s | posterior deviation of the latent function at x |
//! | u | its distance from the level in deviations: Φ(u) is the probability above the level |
//! | s₊ | deviation at x after one more run at c |
//! | gain of c | Σ φ(u) (1 − s₊/s) over points x that fill the range |
//!
//! The expected share of the range on the wrong side is ∫ Φ(−|u|) dx. Across the boundary this is s √(2/π) divided by the slope of
//! m, so that the gain, with weights φ(u)/s, is its reduction by a run at c. It is the integrated contour uncertainty of Lyu, Binois and
//! Ludkovski 2021 in the weights of Picheny et al. 2010. A run at an old point informs as a run at a new one does, but costs the
//! model no point: a replicate is chosen when its gain is almost that of the best new point (Binois et al. 2019). Runs in flight reduce s
//! and leave u s as it is.

use super::Boundary;
use crate::evidence::{Point, PointRuns};
use crate::goals::Study;
use crate::model::fantasy::Fantasies;
use crate::model::kernel::columns;
use crate::model::{MAX_POINTS, Model};
use crate::proposal::Proposal;
use crate::space::sobol;
use std::collections::BTreeSet;

/// Candidates that fill the range, by number of factors.
const CANDIDATES: [usize; super::MAX_FACTORS] = [128, 320, 400, 400];
/// Share of the best gain with which a replicate is preferred to a new point.
const REPLICATE_SHARE: f64 = 0.9;
/// Maximum number of known points outside the model that are taken into account: runs in flight, or without a value.
const MAX_OTHERS: usize = 200;
/// Candidates this close to an excluded point are left out, in widths of the range.
const EXCLUDED_RADIUS: f64 = 0.05;

/// A place where a run may come next.
#[derive(Debug)]
struct Candidate {
    point: Point,
    /// Number of further runs that the point may have.
    room: usize,
    next_replicate: u32,
    is_known: bool,
}

pub(super) fn proposals(goal: &Boundary, study: &Study<'_>, model: &Model) -> Vec<Proposal> {
    let (mut candidates, filling) = candidates(goal, study, model);
    let coordinates: Vec<Vec<f64>> =
        candidates.iter().map(|candidate| candidate.point.coordinates()).collect();
    let at = columns(study.factors.len(), &coordinates);
    let mut fantasies = Fantasies::new(model, &at);
    let prediction = model.posterior.predict(&at);
    let distances = model.distances(&model.posterior, &at, &prediction, model.latent(goal.level));
    let gap = |index: usize| distances[index] * fantasies.deviation(index);
    let gaps: Vec<f64> = (0..candidates.len()).map(gap).collect();
    for (index, candidate) in candidates.iter().enumerate().filter(|(_, candidate)| candidate.is_known) {
        let pending = study.evidence.at(&candidate.point).map_or(0, |runs| runs.pending());
        (0..pending).for_each(|_| fantasies.observe(index));
    }
    let mut points = candidates.iter().filter(|candidate| candidate.is_known).count();
    let mut proposals = Vec::new();
    while proposals.len() < study.room {
        let gains = gains(&fantasies, &gaps, &filling);
        let best = |is_known: bool| {
            let allowed =
                |index: &usize| candidates[*index].room > 0 && candidates[*index].is_known == is_known;
            (0..candidates.len()).filter(allowed).max_by(|one, other| {
                // Of equal gains the first candidate.
                gains[*one].total_cmp(&gains[*other]).then(other.cmp(one))
            })
        };
        // The model takes no more points: only replicates inform it.
        let new = best(false).filter(|_| points < MAX_POINTS);
        let chosen = match (best(true), new) {
            (Some(old), Some(new)) if gains[old] >= REPLICATE_SHARE * gains[new] => old,
            (_, Some(new)) => new,
            (Some(old), None) => old,
            (None, None) => break,
        };
        let candidate = &mut candidates[chosen];
        points += usize::from(!candidate.is_known);
        candidate.is_known = true;
        candidate.room -= 1;
        proposals.push(Proposal { point: candidate.point.clone(), replicate: candidate.next_replicate });
        candidate.next_replicate += 1;
        fantasies.observe(chosen);
    }
    proposals
}

/// Known points and points that fill the range, and the positions of those that do.
fn candidates(goal: &Boundary, study: &Study<'_>, model: &Model) -> (Vec<Candidate>, Vec<usize>) {
    let (factors, budget) = (study.factors, study.budget);
    let mut others = 0;
    let is_needed = |runs: &&PointRuns| {
        if model.has(&runs.point) {
            return true;
        }
        let is_other = runs.pending() > 0 || runs.values(&goal.of).is_empty();
        others += usize::from(is_other);
        is_other && others <= MAX_OTHERS
    };
    let known = study.usable_points().filter(is_needed).map(|runs| Candidate {
        point: runs.point.clone(),
        room: budget.max_replicates.saturating_sub(runs.count()),
        next_replicate: runs.next_replicate(),
        is_known: true,
    });
    let mut candidates: Vec<Candidate> = known.collect();
    let excluded: Vec<Vec<f64>> = study
        .evidence
        .points()
        .iter()
        .filter(|point| study.excludes(point))
        .map(|point| point.point.coordinates())
        .collect();
    let start = candidates.len();
    let mut seen = BTreeSet::new();
    for index in 0..CANDIDATES[factors.len() - 1] {
        let point = Point::new(&sobol(index, factors.len(), study.seed)).rounded(factors);
        let at = point.coordinates();
        let is_near = excluded
            .iter()
            .any(|other| at.iter().zip(other).all(|(one, other)| (one - other).abs() < EXCLUDED_RADIUS));
        // A point that is a candidate already fills the range as well: it stays, without runs of its own.
        let is_old = study.evidence.at(&point).is_some() || !seen.insert(point.clone());
        let room = if is_near || is_old { 0 } else { budget.max_replicates };
        candidates.push(Candidate { point, room, next_replicate: 0, is_known: false });
    }
    let filling = (start..candidates.len()).collect();
    (candidates, filling)
}

/// The gain of one run at each candidate; gaps are u s.
fn gains(fantasies: &Fantasies, gaps: &[f64], filling: &[usize]) -> Vec<f64> {
    let weighted = filling.iter().filter_map(|point| {
        let deviation = fantasies.deviation(*point);
        let u = gaps[*point] / deviation;
        let weight = (-0.5 * u * u).exp();
        (weight > 1e-6).then_some((*point, weight, 1.0 / (deviation * deviation)))
    });
    let weighted: Vec<(usize, f64, f64)> = weighted.collect();
    let gain = |candidate: usize| {
        let column = fantasies.covariances.column(candidate);
        let total = column[candidate].max(0.0) + fantasies.noise[candidate];
        let terms = weighted.iter().map(|(point, weight, precision)| {
            let share = column[*point] * column[*point] / total * precision;
            weight * (1.0 - (1.0 - share).max(0.0).sqrt())
        });
        terms.sum::<f64>()
    };
    (0..gaps.len()).map(gain).collect()
}
