//! Tests of estimators and designs: numbers by SALib, coverage of the intervals, noise.

use std::f64::consts::PI;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde_json::Value;

use super::jansen::{Row, Terms};
use super::{intervals, morris, saltelli};
use crate::Factor;

/// Share of intervals that must contain the truth. Nominal are 95 %.
const MIN_COVERAGE: f64 = 0.94;
const REPETITIONS: u64 = 2000;

fn uniform(generator: &mut ChaCha8Rng) -> f64 {
    (generator.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

fn normal(generator: &mut ChaCha8Rng) -> f64 {
    let radius = (-2.0 * (1.0 - uniform(generator)).ln()).sqrt();
    radius * (2.0 * PI * uniform(generator)).cos()
}

/// A function of the unit cube with its first-order indices, then its total ones.
struct Known {
    name: &'static str,
    factors: usize,
    value: fn(&[f64]) -> f64,
    indices: Vec<f64>,
}

fn ishigami() -> Known {
    let value = |point: &[f64]| {
        let x: Vec<f64> = point.iter().map(|u| PI * (2.0 * u - 1.0)).collect();
        x[0].sin() + 7.0 * x[1].sin().powi(2) + 0.1 * x[2].powi(4) * x[0].sin()
    };
    let (first, second) = (0.5 * (1.0 + 0.1 * PI.powi(4) / 5.0).powi(2), 49.0 / 8.0);
    let both = 0.01 * PI.powi(8) * (1.0 / 18.0 - 1.0 / 50.0);
    let variance = first + second + both;
    let indices = [first, second, 0.0, first + both, second, both].map(|part| part / variance).to_vec();
    Known { name: "Ishigami", factors: 3, value, indices }
}

const G: [f64; 4] = [0.0, 1.0, 4.5, 9.0];

/// Sobol's g function.
fn sobol_g() -> Known {
    let value = |point: &[f64]| {
        point.iter().zip(G).map(|(u, a)| ((4.0 * u - 2.0).abs() + a) / (1.0 + a)).product::<f64>()
    };
    let parts = G.map(|a| 1.0 / (3.0 * (1.0 + a).powi(2)));
    let all: f64 = parts.iter().map(|part| 1.0 + part).product();
    let first = parts.iter().map(|part| part / (all - 1.0));
    let total = parts.iter().map(|part| part * all / (1.0 + part) / (all - 1.0));
    Known { name: "Sobol g", factors: 4, value, indices: first.chain(total).collect() }
}

/// The rows of a design with noise of some standard deviation.
fn rows(known: &Known, count: u32, seed: u64, noise: f64) -> Vec<Row> {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    let row = |row| {
        let mut points = saltelli::points(row, known.factors, seed);
        points.push(points[0].clone());
        let mut values: Vec<Option<f64>> =
            points.iter().map(|point| Some((known.value)(point) + noise * normal(&mut generator))).collect();
        if noise == 0.0 {
            values.pop();
        }
        Row::of(&values, known.factors).unwrap()
    };
    (0..count).map(row).collect()
}

/// Share of intervals that contain the truth, for each index.
fn coverage(known: &Known, count: u32, noise: f64, repetitions: u64) -> Vec<f64> {
    let mut hits = vec![0.0; known.indices.len()];
    for seed in 0..repetitions {
        let terms = Terms::of(&rows(known, count, seed, noise));
        let indices = terms.indices(None).unwrap();
        for ((hit, (low, high)), truth) in
            hits.iter_mut().zip(intervals::of(&terms, &indices, seed)).zip(&known.indices)
        {
            *hit += f64::from(u8::from((low..=high).contains(truth)));
        }
    }
    hits.iter().map(|hit| hit / repetitions as f64).collect()
}

fn numbers(document: &Value) -> Vec<f64> {
    document.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

fn table(document: &Value) -> Vec<Vec<f64>> {
    document.as_array().unwrap().iter().map(numbers).collect()
}

fn salib() -> Value {
    serde_json::from_str(include_str!("../../../tests/data/sobol_indices.json")).unwrap()
}

fn assert_near(actual: f64, expected: f64) {
    assert!((actual - expected).abs() < 1e-10 * expected.abs().max(1.0), "{actual}, not {expected}");
}

#[test]
fn indices_match_salib() {
    let document = &salib()["sobol"];
    let (a, b, mixed) = (numbers(&document["a"]), numbers(&document["b"]), table(&document["mixed"]));
    let row = |row: usize| {
        let values: Vec<_> = [a[row], b[row]].iter().chain(&mixed[row]).map(|value| Some(*value)).collect();
        Row::of(&values, 3).unwrap()
    };
    let terms = Terms::of(&(0..a.len()).map(row).collect::<Vec<_>>());
    let expected = [numbers(&document["first"]), numbers(&document["total"])].concat();
    for (actual, expected) in terms.indices(None).unwrap().into_iter().zip(expected) {
        assert_near(actual, expected);
    }
}

/// The changes of factors with ranges.
fn changes(start: &[f64]) -> Vec<f64> {
    let factors: Vec<Factor> = start.iter().map(|_| Factor::range("x".into(), 0.0, 1.0)).collect();
    morris::changes(&factors, start)
}

#[test]
fn elementary_effects_match_salib() {
    let document = &salib()["morris"];
    let (starts, orders, values) =
        (table(&document["start"]), table(&document["order"]), table(&document["values"]));
    let mut by_factor = vec![Vec::new(); starts[0].len()];
    for ((start, order), values) in starts.iter().zip(&orders).zip(&values) {
        let order: Vec<usize> = order.iter().map(|factor| *factor as usize).collect();
        let values: Vec<_> = values.iter().map(|value| Some(*value)).collect();
        let changes = changes(start);
        for (all, effect) in by_factor.iter_mut().zip(morris::effects(&changes, &order, &values)) {
            all.extend(effect);
        }
    }
    for (factor, effects) in by_factor.iter().enumerate() {
        let (mu, mu_star, sigma) = morris::summary(effects).unwrap();
        assert_near(mu, numbers(&document["mu"])[factor]);
        assert_near(mu_star.value, numbers(&document["mu_star"])[factor]);
        assert_near(sigma, numbers(&document["sigma"])[factor]);
    }
}

#[test]
fn intervals_of_sobol_indices_cover_the_truth() {
    for known in [ishigami(), sobol_g()] {
        for noise in [0.0, 0.3] {
            let shares = coverage(&known, 64, noise, REPETITIONS);
            println!("{}, noise {noise}, 64 rows: {shares:?}", known.name);
            for (index, share) in shares.iter().enumerate() {
                assert!(*share >= MIN_COVERAGE, "{} {index}, noise {noise}: {share}", known.name);
            }
        }
    }
}

#[test]
#[ignore = "longer designs; their figures are in docs/accuracy.md"]
fn intervals_of_longer_designs_cover_the_truth() {
    for known in [ishigami(), sobol_g()] {
        for (count, noise) in [(96, 0.0), (128, 0.3), (256, 0.0), (256, 1.0)] {
            let shares = coverage(&known, count, noise, REPETITIONS);
            println!("{}, noise {noise}, {count} rows: {shares:?}", known.name);
            assert!(shares.iter().all(|share| *share >= MIN_COVERAGE));
        }
    }
}

#[test]
fn noise_of_seeds_is_no_sensitivity() {
    let known = sobol_g();
    let terms = Terms::of(&rows(&known, 4096, 5, 0.5));
    assert!((terms.noise_variance(None).unwrap() - 0.25).abs() < 0.02);
    for (index, expected) in terms.indices(None).unwrap().iter().zip(&known.indices) {
        assert!((index - expected).abs() < 0.08, "{index}, not {expected}");
    }
    // Without the second replicates, the noise counts as part of every total index.
    let without: Vec<Row> = rows(&known, 4096, 5, 0.5).into_iter().map(Row::without_noise).collect();
    let total = Terms::of(&without).indices(None).unwrap()[7];
    assert!(total > known.indices[7] + 0.3, "{total}");
}

#[test]
fn intervals_of_absolute_effects_cover_the_truth() {
    // The effect of factor 0 of g is a skewed quantity: product of the other terms. Its mean over many trajectories is the truth.
    let known = sobol_g();
    let effects = |row, seed| -> Vec<Option<f64>> {
        let points = morris::points(row, 4, seed);
        let values: Vec<_> = points.iter().map(|point| Some((known.value)(point))).collect();
        morris::effects(&changes(&points[0]), &morris::order(row, 4, seed), &values)
    };
    let mut truth = [0.0; 4];
    for row in 0..1 << 16 {
        for (sum, effect) in truth.iter_mut().zip(effects(row, 999_999)) {
            *sum += effect.unwrap().abs() / f64::from(1 << 16);
        }
    }
    let mut hits = [0.0; 4];
    for seed in 0..REPETITIONS {
        let all: Vec<Vec<Option<f64>>> =
            (0..morris::FIRST_LOOK as u32).map(|row| effects(row, seed)).collect();
        for (factor, hit) in hits.iter_mut().enumerate() {
            let column: Vec<f64> = all.iter().filter_map(|row| row[factor]).collect();
            let (_, mu_star, _) = morris::summary(&column).unwrap();
            let is_hit = mu_star.low <= Some(truth[factor]) && Some(truth[factor]) <= mu_star.high;
            *hit += f64::from(u8::from(is_hit)) / REPETITIONS as f64;
        }
    }
    println!("mu*, 16 trajectories: {hits:?}");
    assert!(hits.iter().all(|share| *share >= MIN_COVERAGE), "{hits:?}");
}
