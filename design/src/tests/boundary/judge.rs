//! Repeated studies of synthetic truths: how often the band holds the true boundary, and how many runs other designs need.

use super::truths::{TRUTHS, Truth};
use super::{answer, holds, misclassified, question};
use crate::goals::Side;
use crate::tests::truth::{Random, play, run};
use crate::{Evidence, Finished, Point, Proposal, Run, decide};

/// Figures of repeated studies.
#[derive(Default)]
struct Figures {
    held: usize,
    by_rule: usize,
    runs: usize,
    points: usize,
    wrong: f64,
    band: f64,
}

fn repeat(truth: &Truth, repetitions: u64, (max_runs, share): (usize, f64)) -> Figures {
    let mut figures = Figures::default();
    let question = question(truth, max_runs, share);
    for repetition in 0..repetitions {
        let mut random = Random(1000 * repetition + 17);
        let (runs, decision) = play(&question, ("y", 20, repetition), |x| truth.draw(x, &mut random));
        let answer = answer(&decision);
        figures.held += usize::from(holds(truth, answer));
        figures.by_rule += usize::from(decision.finished == Some(Finished::ByRule));
        figures.runs += runs.len();
        figures.points += answer.observed.len();
        figures.wrong += misclassified(truth, &answer.map);
        let in_band = answer.map.iter().filter(|point| point.side == Side::Band).count();
        figures.band += in_band as f64 / answer.map.len() as f64;
    }
    let n = repetitions as f64;
    println!(
        "{} | {:.1} % | {:.0} | {:.0} | {:.2} % | {:.1} % | {:.0} %",
        truth.name,
        100.0 * figures.held as f64 / n,
        figures.runs as f64 / n,
        figures.points as f64 / n,
        100.0 * figures.wrong / n,
        100.0 * figures.band / n,
        100.0 * figures.by_rule as f64 / n,
    );
    figures
}

#[test]
#[ignore = "an hour; its figures are in docs/accuracy.md"]
fn band_holds_the_true_boundary() {
    let repetitions =
        std::env::var("ROOST_REPETITIONS").ok().and_then(|text| text.parse().ok()).unwrap_or(200);
    let only = std::env::var("ROOST_TRUTH").unwrap_or_default();
    println!("truth | band holds | runs | points | wrong side | band | by rule");
    let mut missed = Vec::new();
    for truth in TRUTHS.iter().filter(|truth| truth.name.contains(&only)) {
        let figures = repeat(truth, repetitions, (600, 0.02));
        if (figures.held as f64) < 0.93 * repetitions as f64 {
            missed.push(truth.name);
        }
    }
    assert!(missed.is_empty(), "{missed:?}");
}

/// A Latin hypercube with `replicates` runs at each of `points` points.
fn latin_hypercube(truth: &Truth, points: usize, replicates: u32, random: &mut Random) -> Vec<Run> {
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

#[test]
#[ignore = "half an hour; its figures are in docs/accuracy.md"]
fn a_latin_hypercube_needs_more_runs() {
    let repetitions =
        std::env::var("ROOST_REPETITIONS").ok().and_then(|text| text.parse().ok()).unwrap_or(40);
    let only = std::env::var("ROOST_TRUTH").unwrap_or_default();
    println!(
        "truth | runs of the study | wrong side | wrong side with 1, 2, 4 and 8 times the runs in a Latin hypercube"
    );
    for truth in TRUTHS.iter().filter(|truth| truth.factors == 2 && truth.name.contains(&only)) {
        const RUNS: usize = 200;
        let question = question(truth, RUNS, 1e-4);
        let mut wrong = [0.0; 5];
        for repetition in 0..repetitions {
            let mut random = Random(1000 * repetition + 29);
            let (_, decision) = play(&question, ("y", 20, repetition), |x| truth.draw(x, &mut random));
            wrong[0] += misclassified(truth, &answer(&decision).map);
            for (index, times) in [1, 2, 4, 8].into_iter().enumerate() {
                // Ten replicates up to 200 points, then more replicates.
                let points = (times * RUNS / 10).min(200);
                let runs = latin_hypercube(truth, points, (times * RUNS / points) as u32, &mut random);
                let decision = decide(&question, &Evidence::new(runs), 0, repetition);
                wrong[index + 1] += misclassified(truth, &answer(&decision).map);
            }
        }
        let share = |index: usize| format!("{:.2} %", 100.0 * wrong[index] / repetitions as f64);
        println!("{} | {RUNS} | {} | {}", truth.name, share(0), [1, 2, 3, 4].map(share).join(", "));
    }
}
