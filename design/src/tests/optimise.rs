//! Tests of decisions on small evidence: when a study ends, and what it then recommends.

use serde_json::{Value, json};

use crate::goals::{ConfirmationState, FIRST_CONFIRMATION, Obstacle, OptimiseAnswer, Recommendation};
use crate::{Decision, Evidence, Finding, Finished, Outcome, Point, Proposal, Question, Run, decide};

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
    let state = |point: &Recommendation| point.confirmation.as_ref().map(|found| found.state);
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

#[test]
fn front_search_over_few_points_continues_with_replicates() {
    let count = json!({"name": "/count", "low": 1, "high": 5, "is_whole": true});
    let goal = json!({"objectives": [{"minimise": {"mean": "one"}}, {"minimise": {"mean": "other"}}]});
    let document = json!({"factors": [count], "goal": {"optimise": goal}, "budget": {"max_runs": 400}});
    let question = Question::read(&document).unwrap();
    let decide = |noise: f64| {
        let runs = (1..=5_u32).flat_map(|count| {
            let point = Point::of_run(&question.factors, &[json!(count)]).unwrap();
            [-1.0, 1.0].into_iter().zip(0..).map(move |(sign, replicate)| {
                let (one, other) = (f64::from(count) / 5.0, f64::from(6 - count) / 5.0);
                let values = [("one", one + sign * noise), ("other", other - sign * noise)];
                Run { point: point.clone(), replicate, outcome: responses(&values) }
            })
        });
        decide(&question, &Evidence::new(runs), 4, 1)
    };
    // All points have runs, but their order is open.
    let decision = decide(0.3);
    let is_replicate = |proposal: &Proposal| (2..FIRST_CONFIRMATION).contains(&proposal.replicate);
    assert_eq!((decision.proposals.len(), decision.finished), (4, None));
    assert!(decision.proposals.iter().all(is_replicate), "{:?}", decision.proposals);
    assert!(finding(&decision).expected_improvement.unwrap() > 1e-3);
    // Without noise nothing is left to search, and the confirmation begins.
    let decision = decide(0.0);
    assert!(decision.proposals.iter().all(|proposal| proposal.replicate >= FIRST_CONFIRMATION));
    assert_eq!(decision.proposals.len(), 4);
}

/// Runs a study with ten workers to its end.
fn play(question: &Question, simulate: impl Fn(f64, u32) -> Outcome) -> (Vec<Run>, Decision) {
    let mut runs = Vec::new();
    loop {
        let decision = decide(question, &Evidence::new(runs.iter().cloned()), 10, 1);
        if decision.finished.is_some() {
            return (runs, decision);
        }
        assert!(!decision.proposals.is_empty(), "the study neither goes on nor ends");
        for proposal in decision.proposals {
            let x = proposal.point.coordinates()[0];
            runs.push(run(x, proposal.replicate, simulate(x, proposal.replicate)));
        }
    }
}

fn minimise_y(budget: &Value) -> Question {
    question(1, &json!({"objectives": [{"minimise": {"mean": "y"}}]}), budget)
}

#[test]
fn points_without_a_response_are_replaced() {
    // No response above 0.5, where the lowest value would be.
    let simulate = |x: f64, _| responses(&if x > 0.5 { vec![] } else { vec![("y", (x - 0.7).powi(2))] });
    let (runs, decision) = play(&minimise_y(&json!({"max_runs": 100})), simulate);
    assert_eq!(
        (states(&decision), decision.finished),
        (vec![Some(ConfirmationState::Confirmed)], Some(Finished::ByRule))
    );
    let best = finding(&decision).recommended[0].values[0].as_f64().unwrap();
    assert!((0.4..=0.5).contains(&best), "{best}");
    // The first design had to be made up for.
    let first: std::collections::BTreeSet<_> = runs[..20].iter().map(|run| &run.point).collect();
    assert!(first.iter().any(|point| point.coordinates()[0] > 0.5));
}

#[test]
fn a_study_without_any_response_names_the_obstacle() {
    let (runs, decision) = play(&minimise_y(&json!({"max_runs": 400})), |_, _| responses(&[]));
    assert_eq!(decision.finished, Some(Finished::NothingLeft));
    assert_eq!(finding(&decision).obstacle, Some(Obstacle::MissingResponses));
    assert!(runs.len() <= 80, "four times the first design");
}

#[test]
fn an_infeasible_study_recommends_nothing() {
    let goal = |confirmation_runs: Option<usize>| {
        json!({
            "objectives": [{"minimise": {"mean": "y"}}],
            "constraints": [{"of": {"probability": "jammed"}, "at_most": 0.2}],
            "confirmation_runs": confirmation_runs,
        })
    };
    // A share of the runs jams, as if by chance.
    let jams = |share: f64| {
        move |x: f64, replicate: u32| {
            let number = (977.0 * x + 0.618_033_988_7 * f64::from(replicate)).fract();
            responses(&[("y", x), ("jammed", f64::from(u8::from(number < share)))])
        }
    };
    let (runs, decision) = play(&question(1, &goal(None), &json!({"max_runs": 400})), jams(0.5));
    assert_eq!(decision.finished, Some(Finished::NothingLeft));
    let found = finding(&decision);
    assert!(found.recommended.is_empty(), "{:?}", states(&decision));
    assert_eq!(found.obstacle, Some(Obstacle::Nowhere));
    let nearest = found.nearest.as_ref().expect("a point that is nearest to hold");
    assert!(nearest.assurance < 0.05 && nearest.constraints[0].low > 0.2, "{nearest:?}");
    assert_eq!(found.attempts, 0);
    assert!(runs.len() > 200, "the search has the runs: {}", runs.len());
    // A little below the limit a confirmation is worth its runs.
    let (_, decision) = play(&question(1, &goal(Some(23)), &json!({"max_runs": 300})), jams(0.15));
    assert_eq!(decision.finished, Some(Finished::NothingLeft));
    let found = finding(&decision);
    assert_eq!((found.attempts, found.obstacle), (3, Some(Obstacle::ConfirmationRuns)));
}

#[test]
fn search_continues_until_it_finds_a_feasible_point() {
    // None of the first 20 points is in the corner where the constraint holds.
    let goal = json!({
        "objectives": [{"minimise": {"mean": "y"}}],
        "constraints": [{"of": {"mean": "load"}, "at_most": 0.2}],
    });
    let question = question(3, &goal, &json!({"max_runs": 400}));
    let mut runs: Vec<Run> = Vec::new();
    let decision = loop {
        let decision = decide(&question, &Evidence::new(runs.iter().cloned()), 10, 1);
        if decision.finished.is_some() {
            break decision;
        }
        runs.extend(decision.proposals.into_iter().map(|Proposal { point, replicate }| {
            let x = point.coordinates();
            let noise = 0.002 * (0.618_033_988_7 * f64::from(replicate)).fract();
            let (load, y) = (x.iter().sum::<f64>() + noise, -x[0]);
            Run { point, replicate, outcome: responses(&[("load", load), ("y", y)]) }
        }));
    };
    let load = |run: &Run| run.point.coordinates().iter().sum::<f64>();
    assert!(runs[..40].iter().all(|run| load(run) > 0.2));
    assert_eq!(states(&decision), [Some(ConfirmationState::Confirmed)]);
}

#[test]
fn the_search_keeps_to_the_maximum_of_replicates() {
    let simulate = |x: f64, replicate: u32| {
        if replicate == 0 { Outcome::Failed } else { responses(&[("y", (x - 0.7).powi(2))]) }
    };
    let (runs, _) = play(&minimise_y(&json!({"max_runs": 100, "max_replicates": 2})), simulate);
    let search = runs.iter().filter(|run| run.replicate < FIRST_CONFIRMATION);
    assert_eq!(search.map(|run| run.replicate).max(), Some(1));
}

#[test]
fn improvement_of_a_probability_is_a_difference_of_probabilities() {
    let goal = json!({"objectives": [{"minimise": {"probability": "jammed"}}]});
    let question = question(1, &goal, &json!({"max_runs": 1000}));
    let first = decide(&question, &Evidence::default(), 10, 1).proposals;
    // At most one run in 40 jams at the best points: the log odds there may be much lower, P can not.
    let runs = first.iter().flat_map(|proposal| {
        let x = proposal.point.coordinates()[0];
        let jams = if x < 0.5 { 40.0 * (0.5 - x) } else { 0.0 };
        (0..40).map(move |replicate| {
            run(x, replicate, responses(&[("jammed", f64::from(u8::from(f64::from(replicate) < jams)))]))
        })
    });
    let decision = decide(&question, &Evidence::new(runs), 10, 1);
    let improvement = finding(&decision).expected_improvement.unwrap();
    println!("{improvement}");
    assert!(improvement > 0.0 && improvement < 0.01, "{improvement}");
}

#[test]
fn more_factors_than_the_sequence_has_dimensions_are_a_fault() {
    let factor = |index: usize| json!({"name": format!("/x{index}"), "low": 0.0, "high": 1.0});
    let document = json!({
        "factors": (0..257).map(factor).collect::<Vec<_>>(),
        "goal": {"optimise": {"objectives": [{"minimise": {"mean": "y"}}], "confirmation_runs": 20_000}},
        "budget": {"max_runs": 2000},
    });
    let faults = Question::read(&document).unwrap_err();
    let pointers: Vec<_> =
        faults.iter().map(|fault| (fault.pointer.as_str(), fault.allowed.as_str())).collect();
    let expected = [
        ("/goal/optimise/confirmation_runs", "at most 10000"),
        ("/factors", "at most 256 factors with this goal"),
    ];
    assert_eq!(pointers, expected);
}
