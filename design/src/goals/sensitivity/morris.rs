//! Morris screening: trajectories that change one factor after the other, and the elementary effects along them.
//!
//! | symbol | meaning |
//! |---|---|
//! | dᵢ | elementary effect of factor i in a trajectory: difference of the response over that of the coordinate, Δᵢ |
//! | Δᵢ | ±½; of whole numbers the difference between two of them, as a share of that from the lowest to the highest |
//! | μ, μ* | mean of dᵢ, and of its absolute value, over trajectories |
//! | σ | standard deviation of dᵢ: interaction or curvature |
//! | noise floor | μ* of a factor without effect: 2σ₁/√π ⟨1/Δᵢ⟩, σ₁ the standard deviation of single runs at one point |
//!
//! Source: Morris 1991, Technometrics 33, 161; Campolongo et al. 2007, Environmental Modelling & Software 22, 1509. A
//! trajectory starts at a point of a Sobol' sequence and moves each coordinate by half the range, towards the other half.
//! All coordinates are then uniform over the range, where a grid of levels visits its levels only.

use roost_stats::Sample;
use serde::{Deserialize, Serialize};

use super::rows::{Design, Progress};
use super::saltelli::sobol_point;
use super::{Effects, MeasureSensitivity};
use crate::factor::Factor;
use crate::goals::Study;
use crate::intervals::Estimated;
use crate::measure::Measure;

/// Number of factors that the sequence has numbers for.
pub(super) const MAX_FACTORS: usize = sobol_burley::NUM_DIMENSIONS as usize;
/// Number of trajectories from which on there are intervals.
pub(super) const FIRST_LOOK: usize = 16;
/// Step of a coordinate.
const STEP: f64 = 0.5;

/// Elementary effects of a factor, in the unit of the response, for a change over the whole range.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MorrisEffects {
    /// Name of the factor.
    pub factor: String,
    /// Mean effect.
    pub mu: f64,
    /// Mean absolute effect, noise included, with its 95 % interval.
    pub mu_star: Estimated,
    /// Standard deviation of the effect, noise included.
    pub sigma: f64,
    /// The μ* that noise alone would give; none when noise was not measured.
    pub noise_floor: Option<f64>,
    /// Whether the factor has an effect: the interval of μ* is above the noise floor. None when noise was not measured.
    pub has_effect: Option<bool>,
}

/// The points of a trajectory.
pub(super) fn points(row: u32, factors: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut point = sobol_point(row, factors, seed, 0);
    let mut points = vec![point.clone()];
    for factor in order(row, factors, seed) {
        point[factor] += if point[factor] < STEP { STEP } else { -STEP };
        points.push(point.clone());
    }
    points
}

/// The order in which a trajectory changes the factors.
pub(super) fn order(row: u32, factors: usize, seed: u64) -> Vec<usize> {
    let keys = sobol_point(row, factors, seed, 1);
    let mut order: Vec<usize> = (0..factors).collect();
    order.sort_by(|one, other| keys[*one].total_cmp(&keys[*other]));
    order
}

/// The change Δ of each factor in the trajectory from a start.
pub(super) fn changes(factors: &[Factor], start: &[f64]) -> Vec<f64> {
    let change = |(factor, start): (&Factor, &f64)| {
        let step = if *start < STEP { STEP } else { -STEP };
        let share = |coordinate| factor.share(factor.value(coordinate));
        if factor.is_whole { share(start + step) - share(*start) } else { step }
    };
    factors.iter().zip(start).map(change).collect()
}

/// Elementary effects of each factor from a trajectory's changes, order and values; none beside a lost run.
pub(super) fn effects(changes: &[f64], order: &[usize], values: &[Option<f64>]) -> Vec<Option<f64>> {
    let mut effects = vec![None; order.len()];
    for (step, factor) in order.iter().enumerate() {
        effects[*factor] =
            values[step].zip(values[step + 1]).map(|(before, after)| (after - before) / changes[*factor]);
    }
    effects
}

/// μ, μ* with its interval of Student's t, and σ of some effects; none for fewer than two.
pub(super) fn summary(effects: &[f64]) -> Option<(f64, Estimated, f64)> {
    let signed = Sample::of(effects)?;
    let absolute = Sample::of(&effects.iter().map(|effect| effect.abs()).collect::<Vec<_>>())?;
    let half = absolute.half_width()?;
    let (low, high) = (Some((absolute.mean - half).max(0.0)), Some(absolute.mean + half));
    Some((signed.mean, Estimated { n: absolute.n, value: absolute.mean, low, high }, signed.deviation?))
}

/// The elementary effects of a measure.
pub(super) fn sensitivity(
    measure: &Measure,
    design: &Design<'_>,
    progress: &Progress,
    study: &Study<'_>,
    names: &[&str],
) -> MeasureSensitivity {
    let factors = names.len();
    let mut by_factor = vec![Vec::new(); factors];
    let (mut noise, mut inverses) = (Vec::new(), vec![0.0; factors]);
    for (row, values) in progress.values(measure, study).enumerate() {
        let changes = changes(design.factors, &sobol_point(row as u32, factors, design.seed, 0));
        let found = effects(&changes, &order(row as u32, factors, design.seed), &values);
        for (sum, change) in inverses.iter_mut().zip(&changes) {
            *sum += 1.0 / change.abs();
        }
        for (all, effect) in by_factor.iter_mut().zip(found) {
            all.extend(effect);
        }
        let again = values.get(factors + 1).copied().flatten();
        noise.extend(values[0].zip(again).map(|(one, other)| 0.5 * (one - other).powi(2)));
    }
    let noise_variance = Sample::of(&noise).map(|sample| sample.mean);
    let floor = noise_variance.map(|variance| 2.0 * (variance / std::f64::consts::PI).sqrt());
    let of_factor = |((effects, inverses), name): ((&Vec<f64>, &f64), &&str)| {
        let (mu, mu_star, sigma) = summary(effects)?;
        let floor = floor.map(|floor| floor * inverses / progress.rows as f64);
        Some(MorrisEffects {
            factor: (*name).to_owned(),
            has_effect: floor.zip(mu_star.low).map(|(floor, low)| low > floor),
            noise_floor: floor,
            mu,
            mu_star,
            sigma,
        })
    };
    let effects: Option<Vec<_>> = by_factor.iter().zip(&inverses).zip(names).map(of_factor).collect();
    let effects = effects.filter(|effects| {
        progress.rows >= FIRST_LOOK && effects.iter().any(|effect| effect.mu_star.value > 0.0)
    });
    MeasureSensitivity {
        of: measure.clone(),
        noise_variance,
        effects: effects.map(Effects::Morris),
        is_constant: false,
    }
}
