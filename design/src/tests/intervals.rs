//! Tests of intervals: against numbers computed elsewhere, and their coverage when one looks after every run.

use super::*;
use crate::tests::truth::Random;

fn probability() -> Measure {
    Measure::Probability("jammed".into())
}

fn mean() -> Measure {
    Measure::Mean("rate".into())
}

#[test]
fn confidence_sequence_agrees_with_scipy() {
    // tests/data/intervals.py: scipy.special.betaln and scipy.optimize.brentq, SciPy 1.17.1.
    for (count, n, low, high) in INTERVALS {
        let (found_low, found_high) = confidence_sequence(f64::from(count), f64::from(n), 0.95);
        assert!((found_low - low).abs() < 1e-10 && (found_high - high).abs() < 1e-10, "{count} of {n}");
    }
    assert_eq!(confidence_sequence(0.0, 0.0, 0.95), (0.0, 1.0));
}

/// Share of sequences of `length` runs in which no interval, looked at after every run, misses the true `p`.
fn coverage(p: f64, length: usize, repetitions: u64, interval: impl Fn(usize, usize) -> (f64, f64)) -> f64 {
    let holds = |repetition: &u64| {
        let mut random = Random(*repetition);
        let mut count = 0;
        (1..=length).all(|n| {
            count += usize::from(random.uniform() < p);
            let (low, high) = interval(count, n);
            low <= p && p <= high
        })
    };
    (0..repetitions).filter(holds).count() as f64 / repetitions as f64
}

#[test]
fn no_interval_of_a_sequence_misses_the_probability() {
    let sequence = |count: usize, n: usize| confidence_sequence(count as f64, n as f64, 0.95);
    let fixed = |count: usize, n: usize| {
        let interval = roost_stats::share_interval(count as u64, n as u64).unwrap();
        (interval.low, interval.high)
    };
    // Ends are the same for all repetitions: compute them once.
    let table: Vec<Vec<(f64, f64)>> = (0..=300).map(|n| (0..=n).map(|s| sequence(s, n)).collect()).collect();
    for p in [0.05, 0.5, 0.8] {
        let held = coverage(p, 300, 2000, |count, n| table[n][count]);
        println!("p = {p}: the sequence holds {held} of 2,000 times");
        assert!(held >= 0.94, "{held} at {p}");
    }
    let held = coverage(0.5, 300, 2000, fixed);
    assert!(
        held < 0.8,
        "intervals for a fixed number of runs hold {held} of the times when looked at each time"
    );
}

#[test]
fn intervals_of_means_agree_with_scipy() {
    assert_eq!(Estimated::of(&mean(), &[]), None);
    let few = Estimated::of(&mean(), &[1.0, 2.0, 3.0, 4.0]).unwrap();
    assert_eq!((few.n, few.value, few.width()), (4, 2.5, None));
    // tests/data/intervals.py: the mixture of noncentral t densities by scipy.integrate.quad.
    for (n, expected) in MEANS {
        let sample = Sample { n, mean: 0.0, deviation: Some(1.0) };
        let half = mean_half_width(&sample).unwrap();
        assert!((half / expected - 1.0).abs() < 1e-12, "{n}: {half}, not {expected}");
    }
}

#[test]
fn equal_values_have_no_interval_of_their_mean() {
    let equal = Estimated::of(&mean(), &[3.0; 40]).unwrap();
    assert_eq!((equal.value, equal.width()), (3.0, None));
}

#[test]
fn forecast_is_the_first_number_of_values_with_a_narrow_interval() {
    let values = [0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
    let n = values_needed(&probability(), &values, 0.2, 10_000);
    let share = 2.5 / 9.0;
    let width = |n: usize| {
        let (low, high) = confidence_sequence(2.0 + share * (n - 8) as f64, n as f64, 0.95);
        high - low
    };
    assert!(width(n) <= 0.2 && width(n - 1) > 0.2, "{n}");
    assert_eq!(values_needed(&probability(), &values, 0.2, 50), 50);
    // Equal values say nothing of the spread.
    assert_eq!(values_needed(&mean(), &[3.0], 0.1, 1000), 5);
    assert_eq!(values_needed(&mean(), &[3.0; 8], 0.1, 1000), 16);
}

#[test]
fn stopping_by_width_keeps_the_coverage_of_mean_intervals() {
    for (name, least, draw) in DISTRIBUTIONS {
        for width in [2.0, 1.0, 0.5, 0.25] {
            let (mut at_end, mut always, mut runs) = (0_u32, 0_u32, 0);
            for repetition in 0..2000 {
                let mut random = Random(repetition);
                let mut values: Vec<f64> = Vec::new();
                let measure = Measure::Mean("y".to_owned());
                let mut all_hold = true;
                let holds = loop {
                    values.push(draw(&mut random));
                    // Looking costs the square of the number of values: of many, at every tenth.
                    if values.len() > 100 && !values.len().is_multiple_of(10) {
                        continue;
                    }
                    let found = Estimated::of(&measure, &values).unwrap();
                    let holds =
                        found.low.is_none_or(|low| low <= 0.0) && found.high.is_none_or(|high| high >= 0.0);
                    all_hold &= holds;
                    if found.width().is_some_and(|found| found <= width) {
                        break holds;
                    }
                };
                at_end += u32::from(holds);
                always += u32::from(all_hold);
                runs += values.len();
            }
            let [at_end, always] = [at_end, always].map(|held| f64::from(held) / 2000.0);
            println!(
                "{name}, width {width}: {at_end} at the end, {always} at all looks, with {} runs",
                runs / 2000
            );
            assert!(at_end >= least, "{name}, width {width}: {at_end}");
            // The correction for skewness is too small for so many looks at so skewed a response.
            let least = if name == "lognormal" { 0.91 } else { 0.95 };
            assert!(always >= least, "{name}, width {width}: {always} at all looks");
        }
    }
}

/// Count, n, lower and upper end.
const INTERVALS: [(u32, u32, f64, f64); 6] = [
    (0, 5, 0.0, 0.5850324681542767),
    (4, 10, 0.06890294281839282, 0.821607205678341),
    (29, 40, 0.47691994996913467, 0.9027236728161567),
    (5, 5, 0.4149675318457232, 1.0),
    (1, 1000, 4.4639740467864527e-07, 0.009974747264749962),
    (500, 1000, 0.4424183856766253, 0.5575816143233748),
];

/// Number of values, and half the width of the interval of their mean in standard deviations.
const MEANS: [(usize, f64); 4] =
    [(5, 3.780380235572408), (10, 1.2237340155529761), (60, 0.42882185659232125), (150, 0.2760202910643082)];

/// Distributions of mean 0 and variance 1, with the least share of intervals that must hold the mean.
type Draw = fn(&mut Random) -> f64;
const DISTRIBUTIONS: [(&str, f64, Draw); 4] = [
    ("normal", 0.95, |random| random.normal()),
    ("uniform", 0.95, |random| 12.0f64.sqrt() * (random.uniform() - 0.5)),
    ("exponential", 0.95, |random| -(1.0 - random.uniform()).ln() - 1.0),
    ("lognormal", 0.95, |random| {
        // ln of the response has deviation 1.
        let e = std::f64::consts::E;
        (random.normal().exp() - e.sqrt()) / ((e - 1.0) * e).sqrt()
    }),
];
