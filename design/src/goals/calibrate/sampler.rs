//! Samples of the posterior by ensembles of walkers with stretch moves, which need no tuning (Goodman and Weare 2010).
//!
//! Independent ensembles begin at points of a Sobol' sequence over the ranges, chosen by a flattened density, so that none of several tops is
//! missed. How well they agree is R̂ (Gelman and Rubin 1992, with each ensemble split in two), and how much the samples are worth is the
//! effective number, by the autocorrelation time of the ensembles' means (Sokal 1997).

use nalgebra::DMatrix;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::density::Density;
use crate::space::{mixed_seed, sobol};

/// Number of independent ensembles.
const ENSEMBLES: usize = 4;
/// Fewest walkers of an ensemble.
const MIN_WALKERS: usize = 16;
/// Steps that count, of a decision about further runs.
pub(super) const QUICK: usize = 600;
/// Steps that count, of the answer at the end: a discrepancy near 0 needs hundreds for an independent sample.
pub(super) const THOROUGH: usize = 4000;
/// Number of steps that are kept as samples, at least.
const KEPT: usize = 120;
/// Points of the ranges that walkers may begin at.
const STARTS: usize = 2048;
/// The density is flattened until the starts are worth so many independent ones.
const MIN_STARTS: f64 = 256.0;
/// Largest stretch of a move.
const STRETCH: f64 = 2.0;
/// The window of autocorrelations ends at so many autocorrelation times.
const WINDOW: f64 = 5.0;

/// Samples of the posterior.
#[derive(Clone, Debug)]
pub(super) struct Samples {
    /// States in random order: coordinates of the parameters, and the discrepancy in units of its scale.
    pub(super) states: Vec<Vec<f64>>,
    /// The state with the highest density.
    pub(super) best: Vec<f64>,
    /// Largest R̂ of all numbers of a state.
    pub(super) r_hat: f64,
    /// Effective number of independent samples, of the slowest number.
    pub(super) effective: f64,
}

/// Samples the density by some steps, after half as many that are left out; none when it is nowhere positive.
pub(super) fn sample(density: &Density<'_>, seed: u64, steps: usize) -> Option<Samples> {
    let burn_in = steps / 2;
    let size = density.size();
    let walkers = MIN_WALKERS.max(2 * (size + 1));
    let mut random = ChaCha8Rng::seed_from_u64(mixed_seed(seed, 1));
    let (mut states, mut heights) = starts(density, ENSEMBLES * walkers, seed, &mut random)?;
    let mut kept = Vec::new();
    let mut best = (f64::NEG_INFINITY, Vec::new());
    // By ensemble and number of the state, the mean of the walkers at each step.
    let mut means = vec![vec![Vec::with_capacity(steps); size]; ENSEMBLES];
    let mut variance = vec![vec![Vec::with_capacity(steps); size]; ENSEMBLES];
    for step in 0..burn_in + steps {
        for half in 0..2 {
            stretch(density, &mut states, &mut heights, walkers, half, &mut random);
        }
        if step < burn_in {
            continue;
        }
        for (state, height) in states.iter().zip(&heights) {
            if *height > best.0 {
                best = (*height, state.clone());
            }
        }
        for ensemble in 0..ENSEMBLES {
            let members = &states[ensemble * walkers..(ensemble + 1) * walkers];
            for number in 0..size {
                let mean = members.iter().map(|state| state[number]).sum::<f64>() / walkers as f64;
                let squares = members.iter().map(|state| (state[number] - mean).powi(2)).sum::<f64>();
                means[ensemble][number].push(mean);
                variance[ensemble][number].push(squares / walkers as f64);
            }
        }
        if (step - burn_in).is_multiple_of((steps / KEPT).max(1)) {
            kept.extend(states.iter().cloned());
        }
    }
    // In random order, so that every k-th sample is of all walkers.
    for index in (1..kept.len()).rev() {
        kept.swap(index, (uniform(&mut random) * (index + 1) as f64) as usize);
    }
    let r_hat = (0..size).map(|number| r_hat(&means, &variance, number)).fold(1.0, f64::max);
    let time = (0..size).map(|number| autocorrelation_time(&means, number)).fold(1.0, f64::max);
    let effective = (ENSEMBLES * walkers * steps) as f64 / time;
    Some(Samples { states: kept, best: best.1, r_hat, effective })
}

/// A uniform number from 0 to 1, without 1.
fn uniform(random: &mut ChaCha8Rng) -> f64 {
    (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

/// States to begin with, with their log densities.
fn starts(
    density: &Density<'_>,
    count: usize,
    seed: u64,
    random: &mut ChaCha8Rng,
) -> Option<(Vec<Vec<f64>>, Vec<f64>)> {
    let size = density.size();
    let mut points = DMatrix::from_iterator(
        size,
        STARTS,
        (0..STARTS).flat_map(|index| sobol(index, size, mixed_seed(seed, 2))),
    );
    if size > density.parameters.len() {
        // Two scales hold 95 % of the discrepancy's prior.
        points.row_mut(size - 1).apply(|units| *units *= 2.0);
    }
    let heights = density.ln(&points);
    let largest = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        return None;
    }
    let mut power = 1.0;
    let weights = loop {
        let weights: Vec<f64> = heights.iter().map(|height| (power * (height - largest)).exp()).collect();
        let (sum, squares) = weights
            .iter()
            .fold((0.0, 0.0), |(sum, squares), weight| (sum + weight, squares + weight * weight));
        if sum * sum / squares >= MIN_STARTS || power < 1e-12 {
            break weights;
        }
        power *= 0.7;
    };
    // Without replacement, by exponential races: walkers at the same place would stay there.
    let race = |weight: f64, random: &mut ChaCha8Rng| -(1.0 - uniform(random)).ln() / weight;
    let mut order: Vec<(f64, usize)> =
        weights.iter().enumerate().map(|(index, weight)| (race(*weight, random), index)).collect();
    order.sort_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)));
    let chosen = order.into_iter().take(count).map(|(_, index)| index);
    let state = |index: usize| (points.column(index).iter().copied().collect::<Vec<f64>>(), heights[index]);
    Some(chosen.map(state).unzip())
}

/// Moves one half of the walkers of every ensemble along lines through walkers of the other half.
fn stretch(
    density: &Density<'_>,
    states: &mut [Vec<f64>],
    heights: &mut [f64],
    walkers: usize,
    half: usize,
    random: &mut ChaCha8Rng,
) {
    let size = density.size();
    let in_half = walkers / 2;
    let movers: Vec<usize> = (0..ENSEMBLES)
        .flat_map(|ensemble| (0..in_half).map(move |walker| ensemble * walkers + half * in_half + walker))
        .collect();
    let mut proposals = DMatrix::zeros(size, movers.len());
    let mut factors = Vec::with_capacity(movers.len());
    for (column, mover) in movers.iter().enumerate() {
        let ensemble = mover / walkers;
        let other = (uniform(random) * in_half as f64) as usize;
        let partner = &states[ensemble * walkers + (1 - half) * in_half + other];
        // Density 1/√z between 1/a and a.
        let root = ((STRETCH.sqrt() - 1.0 / STRETCH.sqrt()) * uniform(random)) + 1.0 / STRETCH.sqrt();
        let factor = root * root;
        for number in 0..size {
            proposals[(number, column)] =
                partner[number] + factor * (states[*mover][number] - partner[number]);
        }
        factors.push(factor);
    }
    let found = density.ln(&proposals);
    for (column, mover) in movers.into_iter().enumerate() {
        let gain = (size as f64 - 1.0) * factors[column].ln() + found[column] - heights[mover];
        if (1.0 - uniform(random)).ln() < gain {
            states[mover] = proposals.column(column).iter().copied().collect();
            heights[mover] = found[column];
        }
    }
}

/// R̂ of a number: ensembles, each split in two, against the variance within.
fn r_hat(means: &[Vec<Vec<f64>>], variance: &[Vec<Vec<f64>>], number: usize) -> f64 {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let mut centres = Vec::new();
    let mut within = Vec::new();
    for (means, variance) in means.iter().zip(variance) {
        let count = means[number].len();
        for half in 0..2 {
            let range = half * count / 2..(half + 1) * count / 2;
            let steps = &means[number][range.clone()];
            let centre = mean(steps);
            let between_steps = steps.iter().map(|step| (step - centre).powi(2)).sum::<f64>();
            centres.push(centre);
            within.push(mean(&variance[number][range]) + between_steps / steps.len() as f64);
        }
    }
    let middle = mean(&centres);
    let count = centres.len() as f64;
    let between = centres.iter().map(|centre| (centre - middle).powi(2)).sum::<f64>() / (count - 1.0);
    (1.0 + between / mean(&within).max(f64::MIN_POSITIVE)).sqrt()
}

/// Autocorrelation time of a number in steps, by the means of the ensembles.
fn autocorrelation_time(means: &[Vec<Vec<f64>>], number: usize) -> f64 {
    let series: Vec<&[f64]> = means.iter().map(|means| means[number].as_slice()).collect();
    let count = series[0].len();
    let covariance = |lag: usize| {
        let each = series.iter().map(|steps| {
            let middle = steps.iter().sum::<f64>() / count as f64;
            (0..count - lag).map(|step| (steps[step] - middle) * (steps[step + lag] - middle)).sum::<f64>()
        });
        each.sum::<f64>()
    };
    let variance = covariance(0);
    if variance <= 0.0 {
        return 1.0;
    }
    let mut time = 1.0;
    for lag in 1..count / 2 {
        time += 2.0 * covariance(lag) / variance;
        if lag as f64 >= WINDOW * time {
            break;
        }
    }
    time.max(1.0)
}
