//! Coverage of the intervals of contrasts, by simulation with correlated or independent seeds: the share of intervals that contain the
//! true contrast.

use roost_stats::{Interval, Pairing, PointTable, Values};
use statrs::distribution::{ContinuousCDF, Normal};

/// Repetitions: the standard error of a coverage of 95 % is 0.35 %.
const REPETITIONS: usize = 4000;

/// Random numbers of the normal distribution (SplitMix64).
struct Random(u64);

impl Random {
    fn normal(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^= bits >> 31;
        Normal::standard().inverse_cdf(((bits >> 11) as f64 + 0.5) / (1u64 << 53) as f64)
    }
}

/// Points whose values with one seed have this correlation; `value` makes the value of a point from a standard normal number.
struct Design<'a> {
    weights: &'a [f64],
    seeds: usize,
    correlation: f64,
    kind: Values,
    truth: f64,
    value: &'a dyn Fn(usize, f64) -> f64,
}

impl Design<'_> {
    /// A table of random values. `is_paired`: all points have the same seeds; otherwise the correlation must be 0.
    fn table(&self, random: &mut Random, is_paired: bool) -> PointTable {
        let seeds = self.seeds as u64;
        let (own, common) = ((1.0 - self.correlation).sqrt(), self.correlation.sqrt());
        let shared: Vec<f64> = (0..seeds).map(|_| random.normal()).collect();
        let mut table = PointTable::default();
        for point in 0..self.weights.len() {
            let values: Vec<f64> = shared
                .iter()
                .map(|shared| (self.value)(point, common * shared + own * random.normal()))
                .collect();
            let first = if is_paired { 0 } else { point as u64 * seeds };
            table.push(&(first..first + seeds).collect::<Vec<_>>(), &values);
        }
        assert_eq!(table.pairing(self.kind) != Pairing::Unpaired, is_paired);
        table
    }

    fn is_covered(&self, interval: Option<Interval>) -> bool {
        let interval = interval.expect("several seeds");
        (interval.low..=interval.high).contains(&self.truth)
    }
}

/// Coverage of the paired interval, and the mean of its width over that of the unpaired one.
fn coverage(design: &Design<'_>) -> (f64, f64) {
    let mut random = Random(20260);
    let (mut covered, mut ratios) = (0, 0.0);
    for _ in 0..REPETITIONS {
        let contrast = design.table(&mut random, true).contrast(design.weights, design.kind);
        covered += usize::from(design.is_covered(contrast.interval));
        ratios += contrast.width_ratio.expect("values that vary");
    }
    (covered as f64 / REPETITIONS as f64, ratios / REPETITIONS as f64)
}

#[test]
fn paired_intervals_of_numbers_cover_95_percent() {
    let difference: (&[f64], &[f64]) = (&[-1.0, 1.0], &[0.0, 2.0]);
    let levels: (&[f64], &[f64]) = (&[-0.5, -0.5, 0.0, 0.0, 0.5, 0.5], &[0.0, 0.0, 1.0, 1.0, 4.0, 4.0]);
    for (weights, means) in [difference, levels] {
        let truth = weights.iter().zip(means).map(|(weight, mean)| weight * mean).sum();
        let value = |point: usize, random: f64| means[point] + random;
        for seeds in [3, 4, 5, 20] {
            for correlation in [0.0, 0.5, 0.9] {
                let (coverage, ratio) = coverage(&Design {
                    weights,
                    seeds,
                    correlation,
                    kind: Values::Numbers,
                    truth,
                    value: &value,
                });
                let case = format!(
                    "{} points, {seeds} seeds, correlation {correlation}: {coverage}, {ratio}",
                    weights.len()
                );
                assert!((0.94..0.96).contains(&coverage), "{case}");
                println!("{case}");
                // With many seeds the width falls as √(1 − correlation). Without a correlation pairing does not help.
                let expected = (1.0 - correlation).sqrt();
                assert!(seeds < 20 || (ratio - expected).abs() < 0.05, "{case}");
                // The additive model has more degrees of freedom than the unpaired interval, which makes up for few seeds.
                let lowest = if seeds < 5 { 0.85 } else { 0.99 };
                assert!(correlation > 0.0 || ratio > lowest, "{case}");
            }
        }
    }
}

#[test]
fn unequal_variances_need_five_seeds() {
    let value = |point: usize, random: f64| [1.0, 1.0, 4.0][point] * random;
    let of = |seeds| {
        let weights = &[-1.0, 0.0, 1.0];
        coverage(&Design {
            weights,
            seeds,
            correlation: 0.7,
            kind: Values::Numbers,
            truth: 0.0,
            value: &value,
        })
        .0
    };
    for seeds in [5, 20] {
        assert!((0.94..0.96).contains(&of(seeds)), "{seeds} seeds: {}", of(seeds));
    }
    // The additive model assumes one variance; the documentation names this coverage.
    assert!((0.85..0.90).contains(&of(4)), "{}", of(4));
}

#[test]
fn paired_intervals_of_shares_cover_about_95_percent() {
    let normal = Normal::standard();
    let mut coverages = Vec::new();
    for (shares, weights) in [
        (vec![0.05, 0.1], vec![-1.0, 1.0]),
        (vec![0.1, 0.3], vec![-1.0, 1.0]),
        (vec![0.5, 0.5], vec![-1.0, 1.0]),
        (vec![0.02, 0.9], vec![-1.0, 1.0]),
        (vec![0.05, 0.2, 0.8], vec![-1.0, 0.0, 1.0]),
        (vec![0.6, 0.3, 0.1, 0.05, 0.01], vec![-0.8, -0.4, 0.0, 0.4, 0.8]),
    ] {
        let truth = shares.iter().zip(&weights).map(|(share, weight)| share * weight).sum();
        let limits: Vec<f64> = shares.iter().map(|share| normal.inverse_cdf(*share)).collect();
        let value = |point: usize, random: f64| f64::from(u8::from(random < limits[point]));
        for seeds in [5, 10, 20, 59] {
            for correlation in [0.0, 0.7] {
                let (coverage, ratio) = coverage(&Design {
                    weights: &weights,
                    seeds,
                    correlation,
                    kind: Values::Events,
                    truth,
                    value: &value,
                });
                println!("{shares:?}, {seeds} seeds, correlation {correlation}: {coverage}, {ratio:.2}");
                coverages.push(coverage);
            }
        }
    }
    // Few trials take few values, so single coverages scatter.
    let minimum = coverages.iter().copied().reduce(f64::min).unwrap();
    let mean = coverages.iter().sum::<f64>() / coverages.len() as f64;
    println!("minimum {minimum}, mean {mean}");
    assert!(minimum >= 0.91 && mean >= 0.95, "minimum {minimum}, mean {mean}");
}

/// Weights of the slope over the range, and of the mean of the first points minus the mean of all points.
fn slope(points: usize) -> Vec<f64> {
    let x = |point: usize| point as f64 / (points - 1) as f64 - 0.5;
    let squares = (0..points).map(|point| x(point).powi(2)).sum::<f64>();
    (0..points).map(|point| x(point) / squares).collect()
}

fn level(points: usize, first: usize) -> Vec<f64> {
    let share = |point: usize| if point < first { 1.0 / first as f64 } else { 0.0 };
    (0..points).map(|point| share(point) - 1.0 / points as f64).collect()
}

/// Coverage of the interval of shares of up to 100 points, and whether the estimate was always inside.
fn coverage_of_shares(
    shares: &[f64],
    weights: &[f64],
    seeds: usize,
    correlation: Option<f64>,
) -> (f64, bool) {
    // The standard error of a coverage of 95 % is 0.7 %.
    const REPETITIONS: usize = 1000;
    let truth = shares.iter().zip(weights).map(|(share, weight)| share * weight).sum();
    let limits: Vec<f64> = shares.iter().map(|share| Normal::standard().inverse_cdf(*share)).collect();
    let value = |point: usize, random: f64| f64::from(u8::from(random < limits[point]));
    let design = Design {
        weights,
        seeds,
        correlation: correlation.unwrap_or(0.0),
        kind: Values::Events,
        truth,
        value: &value,
    };
    let mut random = Random(20261);
    let (mut covered, mut contains_estimate) = (0, true);
    for _ in 0..REPETITIONS {
        let contrast = design.table(&mut random, correlation.is_some()).contrast(weights, Values::Events);
        covered += usize::from(design.is_covered(contrast.interval));
        let interval = contrast.interval.expect("several seeds");
        contains_estimate &=
            interval.low <= contrast.value + 1e-12 && interval.high >= contrast.value - 1e-12;
    }
    (covered as f64 / REPETITIONS as f64, contains_estimate)
}

#[test]
fn intervals_of_shares_cover_about_95_percent_for_many_points() {
    // Unpaired, and paired by seed without and with a correlation.
    for correlation in [None, Some(0.0), Some(0.7)] {
        let mut coverages = Vec::new();
        for points in [2, 9, 30, 100] {
            let along = |share: &dyn Fn(f64) -> f64| -> Vec<f64> {
                (0..points).map(|point| share(point as f64 / (points - 1) as f64)).collect()
            };
            let step = along(&|x| if x < 0.45 { 0.999 } else { 0.001 });
            let steep = along(&|x| 1.0 / (1.0 + (20.0 * (x - 0.5)).exp()));
            let gentle = along(&|x| 0.02 + 0.9 / (1.0 + (8.0 * (x - 0.3)).exp()));
            let rare = vec![0.02; points];
            let one_low = along(&|x| if x == 0.0 { 0.1 } else { 0.3 });
            let third = (points / 3).max(1);
            for (name, shares, weights) in [
                ("slope of a step", &step, slope(points)),
                ("slope of a steep curve", &steep, slope(points)),
                ("slope of a gentle curve", &gentle, slope(points)),
                ("slope of 2 %", &rare, slope(points)),
                ("first third of a gentle curve", &gentle, level(points, third)),
                ("first of equal 2 %", &rare, level(points, 1)),
                ("first with 10 of 30 %", &one_low, level(points, 1)),
            ] {
                for seeds in [4, 10] {
                    let (coverage, contains_estimate) =
                        coverage_of_shares(shares, &weights, seeds, correlation);
                    let case = format!("{points} points, {name}, {seeds} seeds, {correlation:?}: {coverage}");
                    println!("{case}");
                    assert!(contains_estimate || points > 30, "{case}");
                    coverages.push(coverage);
                }
            }
        }
        let minimum = coverages.iter().copied().reduce(f64::min).unwrap();
        let mean = coverages.iter().sum::<f64>() / coverages.len() as f64;
        println!("{correlation:?}: minimum {minimum}, mean {mean}");
        assert!(minimum >= 0.9 && mean >= 0.95, "{correlation:?}: minimum {minimum}, mean {mean}");
    }
}
