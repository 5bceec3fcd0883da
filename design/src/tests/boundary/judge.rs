//! Repeated studies of synthetic truths: how often the band holds the true boundary.

use super::truths::{TRUTHS, Truth};
use super::{answer, holds, misclassified, question};
use crate::Finished;
use crate::goals::Side;
use crate::tests::truth::{Random, play};

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
    // Another budget, and another rule that ends a study.
    let max_runs = std::env::var("ROOST_RUNS").ok().and_then(|text| text.parse().ok()).unwrap_or(600);
    let share = std::env::var("ROOST_SHARE").ok().and_then(|text| text.parse().ok()).unwrap_or(0.02);
    println!("truth | band holds | runs | points | wrong side | band | by rule");
    let mut missed = Vec::new();
    for truth in TRUTHS.iter().filter(|truth| truth.name.contains(&only)) {
        let figures = repeat(truth, repetitions, (max_runs, share));
        if (figures.held as f64) < 0.93 * repetitions as f64 {
            missed.push(truth.name);
        }
    }
    assert!(missed.is_empty(), "{missed:?}");
}
