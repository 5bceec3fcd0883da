//! Studies of the goal `sensitivity` from the first run to the answer.

#[allow(dead_code, reason = "each test binary uses a part")]
mod drive;

use std::f64::consts::PI;

use drive::{generator, normal, question, responses, study};
use roost_design::goals::{Effects, Method, SensitivityAnswer, SobolIndices};
use roost_design::intervals::Estimated;
use roost_design::{Decision, Finding, Finished, Outcome, Question};
use serde_json::{Value, json};

fn factors(count: usize) -> Vec<Value> {
    (0..count).map(|index| json!({"name": format!("/x{index}"), "low": 0.0, "high": 1.0})).collect()
}

fn asked(count: usize, goal: Value, max_runs: usize) -> Question {
    question(
        &json!({"factors": factors(count), "goal": {"sensitivity": goal}, "budget": {"max_runs": max_runs}}),
    )
}

fn finding(decision: &Decision) -> &SensitivityAnswer {
    match &decision.answer.finding {
        Finding::Sensitivity(finding) => finding,
        other => panic!("{other:?}"),
    }
}

fn sobol(decision: &Decision) -> &[SobolIndices] {
    match finding(decision).measures[0].effects.as_ref() {
        Some(Effects::Sobol(indices)) => indices,
        other => panic!("{other:?}"),
    }
}

fn ishigami(point: &[f64]) -> f64 {
    let x: Vec<f64> = point.iter().map(|u| PI * (2.0 * u - 1.0)).collect();
    x[0].sin() + 7.0 * x[1].sin().powi(2) + 0.1 * x[2].powi(4) * x[0].sin()
}

const FIRST: [f64; 3] = [0.3139, 0.4424, 0.0];
const TOTAL: [f64; 3] = [0.5576, 0.4424, 0.2437];

/// Ishigami's function with noise of standard deviation 1.
fn noisy(seed: u64) -> impl Fn(&[f64], u32) -> Outcome {
    move |point, replicate| {
        responses(&[("y", ishigami(point) + normal(&mut generator(seed, point, replicate)))])
    }
}

#[test]
fn a_study_stops_when_its_intervals_are_as_narrow_as_asked() {
    let question = asked(3, json!({"of": [{"mean": "y"}], "width": 0.3}), 20_000);
    let (runs, decision) = study(&question, 3, 50, noisy(3));
    assert_eq!(decision.finished, Some(Finished::ByRule));
    assert!(runs.len() < 8000, "{}", runs.len());
    for (index, found) in sobol(&decision).iter().enumerate() {
        assert!(found.first_order.width().unwrap() <= 0.3 && found.total.width().unwrap() <= 0.3);
        assert!((found.first_order.value - FIRST[index]).abs() < 0.15, "{found:?}");
        assert!((found.total.value - TOTAL[index]).abs() < 0.15, "{found:?}");
    }
    let noise = finding(&decision).measures[0].noise_variance.unwrap();
    assert!((noise - 1.0).abs() < 0.4, "{noise}");
    drive::assert_order_is_irrelevant(&question, &runs, 10, 3);
    drive::assert_order_is_irrelevant(&question, &runs[..runs.len() / 3], 10, 3);
}

#[test]
fn a_study_ends_by_budget_with_whole_rows() {
    // 6 runs per row: 3 factors, a, b, and a again.
    let question = asked(3, json!({"of": [{"mean": "y"}], "width": 0.01}), 70 * 6 + 5);
    let (runs, decision) = study(&question, 1, 20, noisy(1));
    assert_eq!((decision.finished, runs.len()), (Some(Finished::ByBudget), 70 * 6));
    assert_eq!(finding(&decision).rows, 70);
}

/// Asserts that the indices of studies that stop by themselves are in their intervals often enough.
fn assert_coverage_at_the_end(repetitions: u64) {
    let question = asked(3, json!({"of": [{"mean": "y"}], "width": 0.5}), 20_000);
    let mut hits = [0.0; 6];
    for seed in 0..repetitions {
        let (_, decision) = study(&question, seed, 200, noisy(seed));
        for (index, found) in sobol(&decision).iter().enumerate() {
            let covers = |found: Estimated, truth| {
                f64::from(u8::from(found.low.unwrap() <= truth && truth <= found.high.unwrap()))
            };
            hits[index] += covers(found.first_order, FIRST[index]);
            hits[index + 3] += covers(found.total, TOTAL[index]);
        }
    }
    println!("{hits:?} of {repetitions}");
    let n = repetitions as f64;
    // 94 %, less twice the standard error of the simulation.
    let least = 0.94 - 2.0 * (0.94 * 0.06 / n).sqrt();
    assert!(hits.iter().all(|hits| *hits >= least * n), "{hits:?}");
}

#[test]
fn intervals_cover_the_truth_in_studies_that_stop_by_themselves() {
    assert_coverage_at_the_end(40);
}

#[test]
#[ignore = "a quarter of an hour; its figures are in docs/accuracy.md"]
fn intervals_cover_the_truth_in_many_studies_that_stop_by_themselves() {
    assert_coverage_at_the_end(1000);
}

#[test]
fn failed_runs_are_left_out_and_named() {
    let question = asked(3, json!({"of": [{"mean": "y"}], "width": 0.01}), 1800);
    let simulate = |point: &[f64], replicate: u32| {
        let lost = ((point[1] * 1000.0) as u32).is_multiple_of(50);
        if lost { Outcome::Failed } else { noisy(2)(point, replicate) }
    };
    let (runs, decision) = study(&question, 2, 64, simulate);
    let failed = runs.iter().filter(|run| run.outcome == Outcome::Failed).count();
    let finding = finding(&decision);
    assert!(failed > 10);
    assert_eq!((finding.lost.len(), finding.rows), (failed, 300));
    for (index, found) in sobol(&decision).iter().enumerate() {
        assert!(found.total.n < 300, "pairs with failed runs do not count");
        assert!((found.total.value - TOTAL[index]).abs() < 0.2, "{found:?}");
    }
}

#[test]
fn many_factors_are_screened() {
    let question = asked(12, json!({"of": [{"mean": "y"}], "width": 0.5}), 2000);
    let simulate = |point: &[f64], replicate: u32| {
        let y = 10.0 * point[0] - 5.0 * point[7] + 8.0 * (point[3] - 0.5) * (point[4] - 0.5);
        responses(&[("y", y + 0.1 * normal(&mut generator(9, point, replicate)))])
    };
    let (_, decision) = study(&question, 4, 40, simulate);
    assert_eq!(decision.finished, Some(Finished::ByRule));
    assert_eq!(finding(&decision).method, Method::Morris);
    let Some(Effects::Morris(effects)) = &finding(&decision).measures[0].effects else { panic!() };
    for (index, effect) in effects.iter().enumerate() {
        assert_eq!(effect.has_effect, Some([0, 3, 4, 7].contains(&index)), "{effect:?}");
    }
    assert!((effects[0].mu - 10.0).abs() < 0.3 && (effects[7].mu + 5.0).abs() < 0.3);
    assert!(effects[3].sigma > 5.0 * effects[0].sigma, "interaction");
}

#[test]
fn a_response_that_does_not_vary_ends_after_the_first_look() {
    for (count, first_look) in [(2, 64 * 5), (12, 16 * 14)] {
        let question = asked(count, json!({"of": [{"mean": "y"}], "width": 0.5}), 2000);
        let (runs, decision) = study(&question, 4, 40, |_, _| responses(&[("y", 3.0)]));
        let found = &finding(&decision).measures[0];
        assert_eq!(
            (decision.finished, &found.effects, found.is_constant),
            (Some(Finished::ByRule), &None, true)
        );
        assert!(runs.len() < 2 * first_look, "{} runs", runs.len());
    }
    // Another measure goes on.
    let question = asked(2, json!({"of": [{"mean": "y"}, {"mean": "x"}], "width": 0.001}), 400);
    let (_, decision) = study(&question, 4, 40, |point, _| responses(&[("y", 3.0), ("x", point[0])]));
    assert_eq!(decision.finished, Some(Finished::ByBudget));
}

#[test]
fn faults_name_field_value_and_allowed_range() {
    let document = json!({
        "factors": factors(3),
        "goal": {"sensitivity": {"of": [], "width": 0.0}},
        "budget": {"max_runs": 100},
    });
    let faults = Question::read(&document).unwrap_err();
    let pointers: Vec<_> = faults.iter().map(|fault| fault.pointer.as_str()).collect();
    assert_eq!(pointers, ["/goal/sensitivity/of", "/goal/sensitivity/width", "/budget/max_runs"]);
    assert_eq!(faults[2].allowed, "at least 384 for 3 factors");
}

#[test]
fn a_single_factor_proposes_no_run_twice_and_explains_all() {
    // a with the coordinate of b is b: its run is another replicate, and not the same run again.
    let question = asked(1, json!({"of": [{"mean": "y"}], "width": 0.001}), 256);
    let decision = roost_design::decide(&question, &roost_design::Evidence::default(), 1000, 3);
    let runs: std::collections::BTreeSet<_> = decision.proposals.iter().collect();
    assert_eq!((runs.len(), decision.proposals.len()), (256, 256));
    let simulate = |point: &[f64], replicate: u32| {
        responses(&[("y", 3.0 * point[0] + normal(&mut generator(4, point, replicate)))])
    };
    let (_, decision) = study(&question, 3, 20, simulate);
    for found in [sobol(&decision)[0].first_order, sobol(&decision)[0].total] {
        assert!(found.low.unwrap() <= 1.0 && 1.0 <= found.high.unwrap(), "{found:?}");
    }
}

#[test]
fn cancelled_runs_are_replaced_and_not_counted_as_lost() {
    let question = asked(2, json!({"of": [{"mean": "y"}], "width": 0.001}), 64 * 5);
    let is_cancelled =
        |replicate: u32, point: &[f64]| replicate < 2 && ((point[0] * 1000.0) as u32).is_multiple_of(9);
    let simulate = |point: &[f64], replicate: u32| {
        if is_cancelled(replicate, point) { Outcome::Cancelled } else { responses(&[("y", point[0])]) }
    };
    let (runs, decision) = study(&question, 5, 20, simulate);
    let cancelled = runs.iter().filter(|run| run.outcome == Outcome::Cancelled).count();
    assert!(cancelled > 10, "{cancelled}");
    let finding = finding(&decision);
    assert_eq!((decision.finished, finding.rows, &finding.lost), (Some(Finished::ByBudget), 64, &Vec::new()));
    assert_eq!(runs.len(), 64 * 5 + cancelled, "each cancelled run is replaced by one");
    assert!(sobol(&decision).iter().all(|found| found.total.n == 64 && found.first_order.n == 64));
}
