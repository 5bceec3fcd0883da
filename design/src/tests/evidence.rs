//! Tests of evidence: canonical order, and points that survive the way to values and back.

use serde_json::json;

use crate::tests::truth::{Random, play, run};
use crate::{Evidence, Factor, Finding, Measure, Outcome, Point, Proposal, Question, Run, Scale, decide};

#[test]
fn order_of_results_does_not_matter() {
    let mut random = Random(1);
    let mut runs = Vec::new();
    for index in 0..40 {
        let point = Point::new(&[f64::from(index % 7) / 7.0, f64::from(index % 3) / 3.0]);
        runs.push(run(&Proposal { point, replicate: index / 5 }, "y", random.normal()));
    }
    let expected = Evidence::new(runs.clone());
    assert!(expected.points().is_sorted_by(|one, other| one.point < other.point));
    for _ in 0..20 {
        for index in (1..runs.len()).rev() {
            runs.swap(index, (random.uniform() * (index + 1) as f64) as usize);
        }
        assert_eq!(Evidence::new(runs.clone()), expected);
    }
}

#[test]
fn a_result_replaces_a_failure_and_a_run_in_flight() {
    let proposal = Proposal { point: Point::new(&[0.5]), replicate: 0 };
    let with = |outcome| Run { point: proposal.point.clone(), replicate: 0, outcome };
    let done = run(&proposal, "y", 2.0);
    for order in [[0, 1, 2], [2, 1, 0], [1, 2, 0]] {
        let states = [with(Outcome::Pending), with(Outcome::Failed), done.clone()];
        let evidence = Evidence::new(order.map(|index: usize| states[index].clone()));
        assert_eq!((evidence.runs(), evidence.failed(), evidence.pending()), (1, 0, 0));
        assert_eq!(evidence.points()[0].values(&Measure::Mean("y".into())), [2.0]);
    }
}

#[test]
fn proposed_point_round_trips_through_its_values() {
    let mut random = Random(2);
    for scale in [Scale::Linear, Scale::Log] {
        let factors = [Factor { scale, ..Factor::range("x".into(), 0.003, 7.0) }];
        for _ in 0..1000 {
            let point = Point::new(&[random.uniform()]).rounded(&factors);
            assert_eq!(Point::of_values(&factors, &point.values(&factors)), Some(point));
        }
        for value in [0.003, 0.0052, 0.333, 1.0, 6.123] {
            let point = Point::of_values(&factors, &[value]).unwrap();
            assert_eq!(point.values(&factors), [value], "typed values are found again");
        }
    }
    assert_eq!(Point::of_values(&[Factor::range("x".into(), 0.0, 1.0)], &[1.1]), None);
}

#[test]
fn cancelled_run_of_a_first_design_is_replaced_by_another_replicate() {
    for goal in [
        json!({ "boundary": { "of": { "mean": "y" }, "level": 0.5 } }),
        json!({ "optimise": { "objectives": [{ "minimise": { "mean": "y" } }] } }),
    ] {
        let document = json!({
            "factors": [{ "name": "gate", "low": 0.0, "high": 1.0 }],
            "goal": goal,
            "budget": { "max_runs": 100 },
        });
        let question = Question::read(&document).unwrap();
        let first = decide(&question, &Evidence::default(), 100, 1).proposals;
        let mut runs: Vec<Run> = first.iter().map(|next| run(next, "y", 0.0)).collect();
        runs.iter_mut().for_each(|run| run.outcome = Outcome::Pending);
        // The last replicate of its point.
        let index = runs.iter().rposition(|run| run.replicate == 1).unwrap();
        runs[index].outcome = Outcome::Cancelled;
        let expected = Proposal { point: runs[index].point.clone(), replicate: 2 };
        let decision = decide(&question, &Evidence::new(runs), 100, 1);
        assert!(decision.proposals.contains(&expected), "{document}");
        assert_eq!(decision.answer.runs.pending, first.len() - 1);
    }
    let proposal = Proposal { point: Point::new(&[0.5]), replicate: 0 };
    let done = run(&proposal, "y", 2.0);
    let cancelled = Run { outcome: Outcome::Cancelled, ..done.clone() };
    let failed = Run { outcome: Outcome::Failed, ..done.clone() };
    for (better, worse) in [(&done, &cancelled), (&failed, &cancelled)] {
        let of = |runs: [&Run; 2]| Evidence::new(runs.map(Clone::clone));
        assert_eq!(of([better, worse]), of([better, better]));
        assert_eq!(of([worse, better]), of([better, better]));
    }
}

#[test]
fn sensitivity_excludes_responses_other_than_0_and_1_of_a_probability() {
    let document = json!({
        "factors": [
            { "name": "gate", "low": 0.0, "high": 1.0 },
            { "name": "belt", "low": 0.0, "high": 1.0 },
        ],
        "goal": { "sensitivity": { "of": [{ "probability": "y" }], "width": 0.5, "method": "sobol" } },
        "budget": { "max_runs": 320 },
    });
    let question = Question::read(&document).unwrap();
    let (runs, decision) = play(&question, ("y", 100, 1), |_| 3.2);
    let Finding::Sensitivity(answer) = &decision.answer.finding else { panic!("a sensitivity") };
    assert_eq!(answer.lost.len(), runs.len());
}
