//! The runs that come next: those that most reduce what the emulators do not know, where the posterior is.
//!
//! The gain of a run of test t at parameters c is the sum over the test's measured numbers, and the mean over samples i of the posterior, of
//! C_ic² / (C_cc + r) / (ε² + C_ii): the part of the variance of the emulator that the run removes, relative to the variance with which
//! the number is compared. Runs in flight count as fantasies.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::DMatrix;

use super::density::Density;
use super::sampler::Samples;
use super::{Setup, first_sets};
use crate::evidence::Point;
use crate::goals::Study;
use crate::model::fantasy::Fantasies;
use crate::model::kernel::columns;
use crate::proposal::Proposal;
use crate::space::{distinct, mixed_seed};

/// Number of samples that stand for the posterior; every one is a candidate.
const SAMPLES: usize = 96;
/// Number of further candidates, from all of the ranges.
const ELSEWHERE: usize = 32;

/// The joint posterior of a measured number at the candidates of a test.
struct Watched {
    fantasies: Fantasies,
    /// Square of the error of the measurement, in latent units.
    error: f64,
}

impl Watched {
    /// The gain of a run at a candidate.
    fn gain(&self, candidate: usize, samples: usize) -> f64 {
        let covariances = &self.fantasies.covariances;
        let total = covariances[(candidate, candidate)].max(0.0) + self.fantasies.noise[candidate];
        let each = (0..samples).map(|sample| {
            let variance = covariances[(sample, sample)].max(0.0);
            covariances[(sample, candidate)].powi(2) / total / (self.error + variance)
        });
        each.sum::<f64>() / samples as f64
    }
}

/// Runs of tests that have too few values of a measured number: each test at samples of the posterior by the other numbers, as long as it has
/// had fewer than twice the runs of the first design.
pub(super) fn of_unknown(
    study: &Study<'_>,
    setup: &Setup<'_>,
    density: &Density<'_>,
    samples: &Samples,
    tests: &[usize],
) -> Vec<Proposal> {
    let most = 2 * first_sets(study.factors, study.budget);
    let mut proposals = Vec::new();
    for test in tests {
        let of_test = study.evidence.points().iter().filter(|runs| setup.split(&runs.point).1 == *test);
        let had: usize = of_test.map(|runs| runs.count()).sum();
        let sets = samples.states.iter().map(|state| setup.point(&state[..density.parameters.len()], *test));
        let new = sets.filter(|point| study.evidence.at(point).is_none());
        proposals.extend(new.take(most.saturating_sub(had)).map(|point| Proposal { point, replicate: 0 }));
    }
    let mut seen = BTreeSet::new();
    proposals.retain(|proposal| seen.insert(proposal.point.clone()));
    proposals
}

/// A test with its candidates and what is known at them.
struct Candidates {
    points: Vec<Point>,
    watched: Vec<Watched>,
}

/// Up to `study.room` runs, the most useful first.
pub(super) fn proposals(
    study: &Study<'_>,
    setup: &Setup<'_>,
    density: &Density<'_>,
    samples: &Samples,
) -> Vec<Proposal> {
    let parameters = density.parameters.len();
    let step = (samples.states.len() / SAMPLES).max(1);
    let chosen: Vec<&Vec<f64>> = samples.states.iter().step_by(step).take(SAMPLES).collect();
    let seed = mixed_seed(study.seed, 3);
    let elsewhere: Vec<Vec<f64>> =
        distinct(density.parameters, 0..ELSEWHERE, seed).map(|point| point.coordinates()).collect();
    let mut sets: Vec<Vec<f64>> = chosen.iter().map(|state| state[..parameters].to_vec()).collect();
    let posterior = sets.len();
    let share = chosen.iter().map(|state| density.share(state)).sum::<f64>() / posterior as f64;
    sets.extend(elsewhere);
    let mut tests: Vec<Candidates> = (0..setup.tests())
        .map(|test| candidates(study, setup, density, (&sets, posterior), share, test))
        .collect();
    let mut next: BTreeMap<Point, u32> = BTreeMap::new();
    let mut proposals = Vec::new();
    let budget = study.budget;
    while proposals.len() < study.room {
        let mut best: Option<(f64, usize, usize)> = None;
        for (test, candidates) in tests.iter().enumerate() {
            for (index, point) in candidates.points.iter().enumerate() {
                let known = study.evidence.at(point);
                let planned = next.get(point).copied();
                let replicate = planned.unwrap_or_else(|| known.map_or(0, |known| known.next_replicate()));
                let is_full = replicate as usize >= budget.max_replicates;
                if is_full || known.is_some_and(|known| study.excludes(known)) {
                    continue;
                }
                let gain =
                    candidates.watched.iter().map(|watched| watched.gain(index, posterior)).sum::<f64>();
                if gain > 0.0 && best.is_none_or(|(most, ..)| gain > most) {
                    best = Some((gain, test, index));
                }
            }
        }
        let Some((_, test, index)) = best else { break };
        let point = tests[test].points[index].clone();
        let known = study.evidence.at(&point);
        let replicate =
            next.entry(point.clone()).or_insert_with(|| known.map_or(0, |known| known.next_replicate()));
        proposals.push(Proposal { point: point.clone(), replicate: *replicate });
        *replicate += 1;
        for watched in &mut tests[test].watched {
            watched.fantasies.observe(index);
        }
    }
    proposals
}

/// The candidates of a test: the given sets of parameters, the first `count` of them samples, then those of its runs in flight, whose results count as known.
fn candidates(
    study: &Study<'_>,
    setup: &Setup<'_>,
    density: &Density<'_>,
    (sets, count): (&[Vec<f64>], usize),
    share: f64,
    test: usize,
) -> Candidates {
    let mut points: Vec<Point> = sets.iter().map(|set| setup.point(set, test)).collect();
    let in_flight = study.evidence.points().iter().filter(|runs| setup.split(&runs.point).1 == test);
    let in_flight: Vec<(&Point, usize)> =
        in_flight.map(|runs| (&runs.point, runs.pending())).filter(|(_, pending)| *pending > 0).collect();
    points.extend(in_flight.iter().map(|(point, _)| (*point).clone()));
    let coordinates: Vec<Vec<f64>> = points.iter().map(|point| setup.split(point).0).collect();
    let matrix: DMatrix<f64> = columns(density.parameters.len(), &coordinates);
    let of_test = density.targets.iter().zip(&density.emulators);
    let of_test = of_test.filter(|((_, target), _)| setup.test(&target.test) == Some(test));
    let watched = of_test.map(|((_, target), emulator)| {
        let mut fantasies = Fantasies::new(emulator.model(), &matrix);
        for (place, (_, pending)) in in_flight.iter().enumerate() {
            for _ in 0..*pending {
                fantasies.observe(sets.len() + place);
            }
        }
        let error = if target.is_share() {
            target.log_odds().1
        } else {
            let emulated = emulator.at(&matrix).means;
            let mean = emulated[..count].iter().sum::<f64>() / count as f64;
            emulator.latent_error(mean, target.error().hypot(share * target.mean)).powi(2)
        };
        Watched { fantasies, error }
    });
    let watched = watched.collect();
    points.truncate(sets.len());
    Candidates { points, watched }
}
