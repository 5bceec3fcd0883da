//! Tests of the goal `boundary` on synthetic truths.

mod truths;

use serde_json::json;

use crate::goals::{BoundaryAnswer, MapPoint, Place, Side};
use crate::tests::truth::{Random, play, run};
use crate::{Decision, Evidence, Finding, Finished, Outcome, Point, Question, Run, decide};
use truths::{TRUTHS, Truth};

/// A question about the boundary of a truth.
fn question(truth: &Truth, max_runs: usize, misclassified: f64) -> Question {
    let factor = |index: usize| json!({ "name": format!("x{index}"), "low": 0.0, "high": 1.0 });
    let measure = if truth.noise.is_some() { "mean" } else { "probability" };
    let document = json!({
        "factors": (0..truth.factors).map(factor).collect::<Vec<_>>(),
        "goal": { "boundary": { "of": { measure: "y" }, "level": truth.level, "misclassified": misclassified } },
        "budget": { "max_runs": max_runs },
    });
    Question::read(&document).unwrap()
}

fn answer(decision: &Decision) -> &BoundaryAnswer {
    let Finding::Boundary(answer) = &decision.answer.finding else { panic!("a boundary") };
    answer
}

/// Whether no point of the map outside the band is on the wrong side.
fn holds(truth: &Truth, answer: &BoundaryAnswer) -> bool {
    answer.map.iter().all(|point| match point.side {
        Side::Band => true,
        Side::Above => truth.mean(&point.values) >= truth.level,
        Side::Below => truth.mean(&point.values) <= truth.level,
    })
}

/// Share of the map on the wrong side of the estimated boundary.
fn misclassified(truth: &Truth, map: &[MapPoint]) -> f64 {
    let is_wrong =
        |point: &&MapPoint| (point.estimate > truth.level) != (truth.mean(&point.values) > truth.level);
    map.iter().filter(is_wrong).count() as f64 / map.len() as f64
}

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
#[ignore = "an hour; its figures are in docs/proofs.md"]
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
