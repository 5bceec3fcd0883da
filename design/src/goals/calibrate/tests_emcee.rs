//! Samples against emcee, which has its own walkers and computes the density itself, on the same table of emulators.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::Calibrate;
use super::density::Density;
use super::sampler::{THOROUGH, sample};
use super::{Setup, TEST};
use crate::evidence::{Evidence, Outcome, Point, Run};
use crate::factor::Factor;
use crate::space::sobol;

/// Steps of the table for each parameter.
const STEPS: usize = 31;

/// Emulators on a grid, written here, and what emcee finds with them, added by `design/tests/data/calibration.py`.
#[derive(Serialize, Deserialize)]
struct Table {
    targets: Value,
    /// Mean and variance of each target at each point of the grid, the second parameter varying fastest.
    grid: Vec<(Vec<f64>, Vec<f64>)>,
    /// Mean, standard deviation, and quantiles at 2.5, 50 and 97.5 % of each parameter and of the discrepancy's share.
    #[serde(default)]
    emcee: Vec<[f64; 5]>,
}

fn targets() -> Value {
    let curve = |at: f64, mean: f64| {
        json!({"test": "bend", "of": {"mean": format!("z@x={at}")}, "curve": {"name": "z", "at": at},
               "mean": mean, "deviation": 0.08, "n": 5})
    };
    json!([{"test": "plate", "of": {"mean": "y"}, "mean": 2.4, "deviation": 0.3, "n": 3},
           curve(0.0, 0.55), curve(0.5, 0.75), curve(1.0, 0.95)])
}

/// Functions in place of simulations, at thirty sets of parameters.
fn evidence(factors: &[Factor]) -> Evidence {
    let setup = Setup::of(factors);
    let runs = (0..30).flat_map(|index| {
        let set = sobol(index, 2, 5);
        let (a, b) = (set[0], set[1]);
        let of_test = [
            vec![("y", (1.0 + a).powi(2) * (0.8 + 0.4 * b))],
            [0.0, 0.5, 1.0]
                .map(|x| (["z@x=0", "z@x=0.5", "z@x=1"][(2.0 * x) as usize], b + x * (a - 0.2 * b)))
                .to_vec(),
        ];
        let point = |test: usize| -> Point { setup.point(&set, test) };
        let outcome = |responses: Vec<(&str, f64)>| {
            Outcome::Responses(responses.into_iter().map(|(name, value)| (name.to_owned(), value)).collect())
        };
        let run = |(test, responses)| Run { point: point(test), replicate: 0, outcome: outcome(responses) };
        of_test.into_iter().enumerate().map(run).collect::<Vec<_>>()
    });
    Evidence::new(runs)
}

fn with_density<T>(use_it: impl FnOnce(&Density<'_>) -> T) -> T {
    let factors = json!([{"name": "a", "low": 0.0, "high": 1.0}, {"name": "b", "low": 0.0, "high": 1.0},
                         {"name": TEST, "levels": ["plate", "bend"]}]);
    let factors: Vec<Factor> = serde_json::from_value(factors).unwrap();
    let goal: Calibrate = serde_json::from_value(json!({"targets": targets(), "discrepancy": 0.1})).unwrap();
    let setup = Setup::of(&factors);
    let evidence = evidence(&factors);
    let by_test = setup.runs_by_test(evidence.points().iter());
    use_it(&Density::of(&goal, &setup, &by_test).unwrap())
}

fn grid(density: &Density<'_>) -> Vec<(Vec<f64>, Vec<f64>)> {
    let points = DMatrix::from_fn(2, STEPS * STEPS, |row, column| {
        let index = if row == 0 { column / STEPS } else { column % STEPS };
        index as f64 / (STEPS - 1) as f64
    });
    let each = density.emulators.iter().map(|emulator| emulator.at(&points));
    each.map(|emulated| (emulated.means, emulated.variances)).collect()
}

#[test]
fn samples_agree_with_emcee() {
    let table: Table = serde_json::from_str(include_str!("../../../tests/data/calibration.json")).unwrap();
    assert_eq!(table.targets, targets());
    with_density(|density| {
        for ((means, variances), (known, known_variances)) in grid(density).iter().zip(&table.grid) {
            let near = |one: &f64, other: &f64| (one - other).abs() <= 1e-4 * (1.0 + other.abs());
            let is_same = means.iter().zip(known).all(|(one, other)| near(one, other))
                && variances.iter().zip(known_variances).all(|(one, other)| near(one, other));
            assert!(is_same, "the emulators have changed: write the table again, and run calibration.py");
        }
        let samples = sample(density, 3, THOROUGH).unwrap();
        assert_eq!(table.emcee.len(), 3, "run calibration.py");
        for (number, [mean, deviation, low, middle, high]) in table.emcee.iter().enumerate() {
            let scale = if number == 2 { 0.1 } else { 1.0 };
            let mut values: Vec<f64> = samples.states.iter().map(|state| scale * state[number]).collect();
            values.sort_by(f64::total_cmp);
            let count = values.len() as f64;
            let found = values.iter().sum::<f64>() / count;
            let spread = (values.iter().map(|value| (value - found).powi(2)).sum::<f64>() / count).sqrt();
            let quantile = |share: f64| values[((count - 1.0) * share).round() as usize];
            let near = |name: &str, value: f64, expected: f64, tolerance: f64| {
                let distance = (value - expected).abs() / deviation;
                assert!(
                    distance < tolerance,
                    "{name} of {number}: {value}, emcee {expected}: {distance} deviations"
                );
            };
            near("mean", found, *mean, 0.1);
            near("deviation", spread, *deviation, 0.1);
            near("low end", quantile(0.025), *low, 0.2);
            near("median", quantile(0.5), *middle, 0.1);
            near("high end", quantile(0.975), *high, 0.2);
        }
    });
}

/// Writes the table; emcee's numbers are then missing until `calibration.py` has run.
#[test]
#[ignore = "writes design/tests/data/calibration.json"]
fn write_table() {
    let table = with_density(|density| Table { targets: targets(), grid: grid(density), emcee: Vec::new() });
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/calibration.json");
    std::fs::write(path, serde_json::to_string(&table).unwrap()).unwrap();
}
