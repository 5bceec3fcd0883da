//! Comparison of studies, and of designs that know the boundary, with Latin hypercubes.

use super::limit::Known;
use super::oracle::DESIGNS;
use super::truths::{TRUTHS, Truth};
use super::{answer, misclassified, question};
use crate::tests::truth::{Random, play, run};
use crate::{Evidence, Point, Proposal, Run, decide};

/// Runs of a study, and those of the Latin hypercubes.
const RUNS: usize = 200;
const HYPERCUBES: [usize; 4] = [200, 400, 800, 1600];
/// Samples of the bootstrap.
const SAMPLES: usize = 2000;

/// Points and replicates of a Latin hypercube: ten replicates up to 200 points, then more replicates.
fn replicated(runs: usize) -> (usize, u32) {
    let points = (runs / 10).min(200);
    (points, (runs / points) as u32)
}

/// A Latin hypercube with `replicates` runs at each of `points` points.
fn latin_hypercube(truth: &Truth, (points, replicates): (usize, u32), random: &mut Random) -> Vec<Run> {
    let column = |random: &mut Random| {
        let mut strata: Vec<usize> = (0..points).collect();
        for index in (1..points).rev() {
            strata.swap(index, (random.uniform() * (index + 1) as f64) as usize);
        }
        strata.into_iter().map(|stratum| (stratum as f64 + random.uniform()) / points as f64).collect()
    };
    let columns: Vec<Vec<f64>> = (0..truth.factors).map(|_| column(random)).collect();
    let mut runs = Vec::new();
    for index in 0..points {
        let point = Point::new(&columns.iter().map(|column| column[index]).collect::<Vec<_>>());
        for replicate in 0..replicates {
            let value = truth.draw(&point.coordinates(), random);
            runs.push(run(&Proposal { point: point.clone(), replicate }, "y", value));
        }
    }
    runs
}

/// The number of runs at which Latin hypercubes have a share on the wrong side, between those of their shares on a scale of logarithms; an end
/// of the scale beyond it. Shares that rise with the number of runs are replaced by their mean.
fn equal_runs(hypercubes: &[f64], wrong: f64) -> f64 {
    let mut pools: Vec<(f64, usize)> = Vec::new();
    for share in hypercubes {
        pools.push((*share, 1));
        while let [.., (before, count), (after, more)] = pools[..]
            && before < after
        {
            pools.truncate(pools.len() - 2);
            pools.push(((before * count as f64 + after * more as f64) / (count + more) as f64, count + more));
        }
    }
    let shares: Vec<f64> =
        pools.iter().flat_map(|(share, count)| std::iter::repeat_n(*share, *count)).collect();
    let Some(next) = shares.iter().position(|share| *share <= wrong) else {
        return HYPERCUBES[HYPERCUBES.len() - 1] as f64;
    };
    let Some(last) = next.checked_sub(1) else { return HYPERCUBES[0] as f64 };
    let step = (shares[last] / wrong).ln() / (shares[last] / shares[next]).ln();
    HYPERCUBES[last] as f64 * (HYPERCUBES[next] as f64 / HYPERCUBES[last] as f64).powf(step)
}

/// Shares on the wrong side by design, a row per repetition.
struct Shares(Vec<Vec<f64>>);

impl Shares {
    /// The mean of a column over some repetitions.
    fn mean(&self, column: usize, rows: &[usize]) -> f64 {
        rows.iter().map(|row| self.0[*row][column]).sum::<f64>() / rows.len() as f64
    }

    /// Share of a column, and the runs of a Latin hypercube that equal it with a 95 % interval of the bootstrap. The first columns are those
    /// of the hypercubes.
    fn describe(&self, column: usize) -> String {
        let all: Vec<usize> = (0..self.0.len()).collect();
        let equal = |rows: &[usize]| {
            let hypercubes: Vec<f64> = (0..HYPERCUBES.len()).map(|column| self.mean(column, rows)).collect();
            equal_runs(&hypercubes, self.mean(column, rows))
        };
        let mut random = Random(1);
        let mut sample = || {
            let rows: Vec<usize> =
                all.iter().map(|_| (random.uniform() * all.len() as f64) as usize).collect();
            equal(&rows)
        };
        let mut samples: Vec<f64> = (0..SAMPLES).map(|_| sample()).collect();
        samples.sort_by(f64::total_cmp);
        let [low, high] = [0.025, 0.975].map(|share| samples[(share * SAMPLES as f64) as usize]);
        let wrong = percent(self.mean(column, &all));
        format!("{wrong} | {:.0} ({low:.0} to {high:.0})", equal(&all))
    }
}

#[test]
fn equal_accuracy_is_interpolated() {
    let near = |one: f64, other: f64| (one - other).abs() < 1e-9 * other;
    assert!(near(equal_runs(&[0.04, 0.02, 0.01, 0.005], 0.02), 400.0));
    assert!(near(equal_runs(&[0.04, 0.01, 0.01, 0.005], 0.02), 200.0 * 2_f64.sqrt()));
    // Shares that rise are replaced by their mean, 0.02; beyond the ends are the ends.
    assert!(near(equal_runs(&[0.04, 0.01, 0.03, 0.005], 0.02), 400.0));
    assert_eq!([0.05, 0.001].map(|share| equal_runs(&[0.04, 0.02, 0.01, 0.005], share)), [200.0, 1600.0]);
}

#[test]
#[ignore = "an hour; its figures are in docs/accuracy.md"]
fn a_latin_hypercube_needs_more_runs() {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse().ok());
    let repetitions = number("ROOST_REPETITIONS").unwrap_or(40);
    let designs = &DESIGNS[..number("ROOST_DESIGNS").map_or(DESIGNS.len(), |count| count as usize)];
    let only = std::env::var("ROOST_TRUTH").unwrap_or_default();
    for truth in TRUTHS.iter().filter(|truth| truth.factors == 2 && truth.name.contains(&only)) {
        let question = question(truth, RUNS, 1e-4);
        let known = Known::of(truth, &question);
        let row = |repetition: u64| {
            let mut random = Random(1000 * repetition + 29);
            let wrong = |runs: Vec<Run>| {
                let decision = decide(&question, &Evidence::new(runs), 0, repetition);
                misclassified(truth, &answer(&decision).map)
            };
            let (study, _) = play(&question, ("y", 20, repetition), |x| truth.draw(x, &mut random));
            let mut row: Vec<f64> = Vec::new();
            for runs in HYPERCUBES {
                row.push(wrong(latin_hypercube(truth, replicated(runs), &mut random)));
            }
            row.push(wrong(study));
            row.extend(designs.iter().map(|design| wrong(design.runs(truth, &question, &known, repetition))));
            row
        };
        let shares = Shares((0..repetitions).map(row).collect());
        let all: Vec<usize> = (0..shares.0.len()).collect();
        println!("{}", truth.name);
        for (column, runs) in HYPERCUBES.iter().enumerate() {
            println!("hypercube of {runs} runs | {}", percent(shares.mean(column, &all)));
        }
        println!("design | wrong side | runs of a hypercube for the same share, with a 95 % interval");
        println!("study | {}", shares.describe(HYPERCUBES.len()));
        let [hypercube, study] = [0, HYPERCUBES.len()].map(|column| shares.mean(column, &all));
        assert!(
            study < hypercube,
            "{}: {study}, and {hypercube} with a hypercube of as many runs",
            truth.name
        );
        for (index, design) in designs.iter().enumerate() {
            println!("{design:?} | {}", shares.describe(HYPERCUBES.len() + 1 + index));
        }
    }
}

#[test]
#[ignore = "minutes; its figures are in docs/accuracy.md"]
fn a_latin_hypercube_needs_more_runs_than_the_best_design() {
    println!(
        "truth | hypercubes | study | best design found | bound of all designs | runs of a hypercube for the three"
    );
    for truth in TRUTHS.iter().filter(|truth| truth.factors == 2) {
        let question = question(truth, RUNS, 1e-4);
        let known = Known::of(truth, &question);
        let mean = |repetitions: u64, design: &dyn Fn(u64) -> Vec<Run>| {
            (0..repetitions).map(|repetition| known.expected(&design(repetition))).sum::<f64>()
                / repetitions as f64
        };
        let hypercubes = HYPERCUBES.map(|runs| {
            mean(20, &|repetition| latin_hypercube(truth, replicated(runs), &mut Random(repetition)))
        });
        let study = mean(6, &|repetition| {
            let mut random = Random(1000 * repetition + 29);
            play(&question, ("y", 20, repetition), |x| truth.draw(x, &mut random)).0
        });
        let shares = [study, known.expected(&known.runs(truth, &mut Random(1))), known.least];
        assert!(shares[..2].iter().all(|share| *share >= known.least), "{}: {shares:?}", truth.name);
        println!(
            "{} | {} | {} | {}",
            truth.name,
            hypercubes.map(percent).join(", "),
            shares.map(percent).join(" | "),
            shares.map(|share| format!("{:.0}", equal_runs(&hypercubes, share))).join(", ")
        );
    }
}

fn percent(share: f64) -> String {
    format!("{:.2} %", 100.0 * share)
}
