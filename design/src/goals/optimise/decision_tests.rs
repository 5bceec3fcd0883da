//! Tests of decisions on small evidence: when a study ends, and what it then recommends.

use serde_json::{Value, json};

use super::{ConfirmationState, FIRST_CONFIRMATION, OptimiseAnswer};
use crate::{Decision, Evidence, Finding, Finished, Outcome, Point, Question, Run, decide};

fn question(factors: usize, goal: &Value, budget: &Value) -> Question {
    let factor = |index: usize| json!({"name": format!("/x{index}"), "low": 0.0, "high": 1.0});
    let factors: Vec<Value> = (0..factors).map(factor).collect();
    let document = json!({"factors": factors, "goal": {"optimise": goal}, "budget": budget});
    Question::read(&document).unwrap_or_else(|faults| panic!("{faults:?}"))
}

fn responses(values: &[(&str, f64)]) -> Outcome {
    Outcome::Responses(values.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect())
}

fn run(x: f64, replicate: u32, outcome: Outcome) -> Run {
    Run { point: Point::new(&[x]), replicate, outcome }
}

fn finding(decision: &Decision) -> &OptimiseAnswer {
    match &decision.answer.finding {
        Finding::Optimise(finding) => finding,
        other => panic!("{other:?}"),
    }
}

fn states(decision: &Decision) -> Vec<Option<ConfirmationState>> {
    let state = |point: &super::Recommendation| point.confirmation.as_ref().map(|found| found.state);
    finding(decision).recommended.iter().map(state).collect()
}

#[test]
fn a_front_is_not_finished_while_its_confirmations_run() {
    let goal = json!({"objectives": [{"minimise": {"mean": "one"}}, {"minimise": {"mean": "other"}}]});
    let question = question(1, &goal, &json!({"max_runs": 200}));
    // Two points that none beats, and two that both beat: the front has no third point.
    let values = [(0.1, 0.0, 1.0), (0.9, 1.0, 0.0), (0.4, 3.0, 3.0), (0.6, 4.0, 4.0)];
    let searched = values.iter().flat_map(|(x, one, other)| {
        (0..2).map(|replicate| run(*x, replicate, responses(&[("one", *one), ("other", *other)])))
    });
    let confirming = |outcome: Outcome| {
        [0.1, 0.9].into_iter().flat_map(move |x| {
            let outcome = outcome.clone();
            (0..10).map(move |index| run(x, FIRST_CONFIRMATION + index, outcome.clone()))
        })
    };
    let decide =
        |outcome| decide(&question, &Evidence::new(searched.clone().chain(confirming(outcome))), 10, 1);
    let decision = decide(Outcome::Pending);
    assert_eq!((states(&decision), decision.finished), (vec![Some(ConfirmationState::Open); 2], None));
    let decision = decide(responses(&[("one", 0.5), ("other", 0.5)]));
    let confirmed = vec![Some(ConfirmationState::Confirmed); 2];
    assert_eq!((states(&decision), decision.finished), (confirmed, Some(Finished::ByRule)));
}
