//! Contrasts against numbers computed by hand, and by SciPy and statsmodels.

use super::*;

#[test]
fn contrasts_of_drawn_parameters_include_parameter_uncertainty() {
    // The difference is 1 with the first sample, 5 with the second and 9 with the third, with ±1 of chance.
    let mut table = PointTable::default();
    let seeds: Vec<u64> = (0..6).collect();
    table.push(&seeds, &[0.0; 6]);
    table.push(&seeds, &[0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
    let table = table.with_samples(2);
    let interval = table.interval(&[-1.0, 1.0], Values::Numbers).unwrap();
    // MSB = 32, σ² = 2, τ² = 15; t(2) √(15 + 32/6).
    let half = 4.302_652_729_9 * (15.0 + 32.0 / 6.0_f64).sqrt();
    assert!((interval.high - 5.0 - half).abs() < 1e-6, "{interval:?}");
    assert_eq!(table.contrast(&[-1.0, 1.0], Values::Numbers).width_ratio, None);
    let mut other = PointTable::default();
    other.push(&[0, 1], &[0.0, 1.0]);
    other.push(&[2, 3], &[0.0, 1.0]);
    assert_eq!(other.with_samples(2).interval(&[-1.0, 1.0], Values::Numbers), None);
}
use crate::welch;

fn table(points: &[&[f64]]) -> PointTable {
    let mut table = PointTable::default();
    for values in points {
        let seeds: Vec<u64> = (1..=values.len() as u64).collect();
        table.push(&seeds, values);
    }
    table
}

fn assert_near(interval: Option<Interval>, low: f64, high: f64) {
    let found = interval.unwrap();
    assert!(
        (found.low - low).abs() < 1e-9 && (found.high - high).abs() < 1e-9,
        "{found:?}, not {low} to {high}"
    );
}

#[test]
fn two_points_have_the_interval_of_the_differences_by_seed() {
    let (a, b) = ([3.0, 5.5, 4.0, 9.0], [2.0, 3.5, 3.5, 7.0]);
    let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    let paired = Sample::of(&differences).unwrap();
    let half = paired.half_width().unwrap();
    let (seeds, values) = (table(&[&a, &b]), Values::Numbers);
    let found = seeds.contrast(&[1.0, -1.0], values);
    assert_near(found.interval, paired.mean - half, paired.mean + half);
    assert_eq!((seeds.pairing(values), found.value), (Pairing::BySeed, paired.mean));
    // The additive model has the same residuals.
    assert_near(seeds.additive_model(&[1.0, -1.0]), paired.mean - half, paired.mean + half);
    let unpaired = welch(&Sample::of(&a).unwrap(), &Sample::of(&b).unwrap()).unwrap();
    assert_near(
        seeds.unpaired(&[1.0, -1.0], values),
        paired.mean - unpaired.half_width,
        paired.mean + unpaired.half_width,
    );
    assert!((found.width_ratio.unwrap() - half / unpaired.half_width).abs() < 1e-12, "{found:?}");
}

#[test]
fn additive_model_agrees_with_a_worked_example() {
    // Means 2, 4, 9; seeds add −1, 0, 1; residuals ±0.5 in two points: Σ ε² = 1 with ν = 4.
    let rows: [&[f64]; 3] = [&[1.5, 2.0, 2.5], &[2.5, 4.0, 5.5], &[8.0, 9.0, 10.0]];
    let found = table(&rows).contrast(&[-1.0, 0.0, 1.0], Values::Numbers);
    let half = t_quantile_95(4.0) * (1.0f64 / 4.0 * 2.0 / 3.0).sqrt();
    assert_near(found.interval, 7.0 - half, 7.0 + half);
    assert_eq!(table(&rows).pairing(Values::Numbers), Pairing::AdditiveModel);
}

#[test]
fn other_seeds_or_a_single_one_leave_points_unpaired() {
    let mut other = PointTable::default();
    other.push(&[1, 2, 3], &[1.0, 2.0, 4.0]);
    other.push(&[1, 2, 4], &[1.5, 2.5, 4.5]);
    assert_eq!((other.pairing(Values::Numbers), other.common_seeds()), (Pairing::Unpaired, None));
    let found = other.contrast(&[1.0, -1.0], Values::Numbers);
    let expected =
        welch(&Sample::of(&[1.0, 2.0, 4.0]).unwrap(), &Sample::of(&[1.5, 2.5, 4.5]).unwrap()).unwrap();
    assert_near(found.interval, -0.5 - expected.half_width, -0.5 + expected.half_width);
    assert_eq!(found.width_ratio, None);
    let single = table(&[&[1.0], &[2.0]]);
    assert_eq!(single.pairing(Values::Numbers), Pairing::Unpaired);
    assert_eq!(
        single.contrast(&[-1.0, 1.0], Values::Numbers),
        Contrast { value: 1.0, interval: None, width_ratio: None }
    );
    // A point without a weight may have a single value.
    let three = table(&[&[1.0, 2.0, 4.0], &[1.5, 2.5, 4.5], &[7.0]]);
    assert_near(
        three.contrast(&[1.0, -1.0, 0.0], Values::Numbers).interval,
        -0.5 - expected.half_width,
        -0.5 + expected.half_width,
    );
}

#[test]
fn perfect_correlation_gives_zero_width_and_constants_no_width_ratio() {
    let a = [0.1, 0.7, 0.4];
    let shifted = |by: f64| a.map(|value| value + by);
    let found = table(&[&a, &shifted(0.3), &shifted(1.1)]).contrast(&[-1.0, 0.0, 1.0], Values::Numbers);
    assert_near(found.interval, 1.1, 1.1);
    assert_eq!(found.width_ratio, Some(0.0));
    let constant = table(&[&[0.1; 6], &[0.7; 6]]).contrast(&[-1.0, 1.0], Values::Numbers);
    assert_near(constant.interval, 0.6, 0.6);
    assert_eq!(constant.width_ratio, None);
}

#[test]
fn contrasts_of_events_add_two_trials() {
    // Of 10 seeds, 4 have the event at the first point alone and 1 at the second alone: Agresti and Min add ½ to each of the four cells.
    let first = [1.0, 1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0];
    let second = [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0];
    let found = table(&[&first, &second]).contrast(&[1.0, -1.0], Values::Events);
    let mean = 3.0 / 12.0;
    let half = t_quantile_95(11.0) * ((4.5 + 1.5 - 12.0 * mean * mean) / 11.0 / 12.0f64).sqrt();
    assert_near(found.interval, mean - half, mean + half);
    assert!((found.value - 0.3).abs() < 1e-12, "the value has no more replicates");
    // No event at all leaves an uncertainty.
    let none = table(&[&[0.0; 4], &[0.0; 4]]).contrast(&[1.0, -1.0], Values::Events);
    assert!(none.interval.unwrap().high > 0.2, "{none:?}");
    // No difference of shares is above 1.
    let all = table(&[&[1.0; 4], &[0.0; 4]]).contrast(&[1.0, -1.0], Values::Events);
    assert_eq!((all.value, all.interval.unwrap().high), (1.0, 1.0));
    // Unpaired: 2 of 3 and 0 of 2 become 3 of 5 and 1 of 4 (Agresti and Caffo).
    let unpaired = table(&[&[1.0, 1.0, 0.0], &[0.0, 0.0]]).contrast(&[1.0, -1.0], Values::Events);
    let (a, b) =
        (Sample::of(&[1.0, 1.0, 1.0, 0.0, 0.0]).unwrap(), Sample::of(&[1.0, 0.0, 0.0, 0.0]).unwrap());
    let expected = welch(&a, &b).unwrap();
    assert_near(unpaired.interval, expected.mean - expected.half_width, 1.0);
}

#[test]
fn additional_trials_are_shared_among_many_points() {
    // Nine points with 4 trials each, of which the first four always have the event: the line falls by 4/3 over the range.
    let weights: Vec<f64> = (0..9).map(|point| f64::from(point - 4) * 8.0 / 60.0).collect();
    let table = |first_seed: &dyn Fn(u64) -> u64| {
        let mut table = PointTable::default();
        for point in 0..9 {
            let from = first_seed(point);
            table.push(&[from, from + 1, from + 2, from + 3], &[f64::from(u8::from(point < 4)); 4]);
        }
        table
    };
    let paired = table(&|_| 0).contrast(&weights, Values::Events);
    let unpaired = table(&|point| 4 * point).contrast(&weights, Values::Events);
    // k = 20² / 60, so each point has 0.6 more trials: 0.3 or 4.3 events of 4.6, and the means shrink by 4/4.6 towards ½.
    let (mean, squares) = (-4.0 / 3.0 * 4.0 / 4.6, 64.0 / 60.0);
    let by_seed = 4.0 * 0.6 / 4.6 * (16.0 / 9.0) + 0.6 / 4.0 * squares;
    let high = mean + t_quantile_95(3.6) * (by_seed / 3.6 / 4.6f64).sqrt();
    assert_near(paired.interval, -4.0 / 3.0, high);
    let error = (squares * 0.3 * 4.3 / (4.6 * 4.6) / 3.6f64).sqrt();
    let high = mean + t_quantile_95(3.6 * 60.0 * 60.0 / 708.0) * error;
    assert_near(unpaired.interval, -4.0 / 3.0, high);
    // Points without a weight add none.
    assert_eq!(additional_trials(&[1.0, 0.0, -1.0]), 2.0);
    assert_eq!(additional_trials(&[0.5, 0.5, -0.5, -0.5]), 1.0);
}
