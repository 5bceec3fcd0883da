//! Tests of the goal `estimate`.

use serde_json::json;

use crate::goals::{EstimateAnswer, PointEstimate};
use crate::tests::truth::{Random, play, run};
use crate::{Decision, Evidence, Finding, Finished, Outcome, Point, Proposal, Question, Run, decide};

fn question(max_runs: usize, width: f64) -> Question {
    let document = json!({
        "factors": [{ "name": "gate", "low": 0.0, "high": 10.0 }],
        "goal": { "estimate": {
            "points": [[2.0], [8.0]],
            "intervals": [{ "of": { "probability": "jammed" }, "width": width }],
        } },
        "budget": { "max_runs": max_runs, "max_replicates": 500 },
    });
    Question::read(&document).unwrap()
}

fn points(decision: &Decision) -> &[PointEstimate] {
    let Finding::Estimate(EstimateAnswer { points }) = &decision.answer.finding else {
        panic!("an estimate")
    };
    points
}

/// Jams at 2 in half of the runs, at 8 never.
fn simulate(random: &mut Random) -> impl FnMut(&[f64]) -> f64 + '_ {
    |coordinates| f64::from(u8::from(coordinates[0] < 0.5 && random.uniform() < 0.5))
}

#[test]
fn points_are_replicated_until_their_intervals_are_narrow() {
    let (runs, decision) = play(&question(10_000, 0.3), ("jammed", 20, 1), simulate(&mut Random(3)));
    assert_eq!(decision.finished, Some(Finished::ByRule));
    let estimates: Vec<_> = points(&decision).iter().map(|point| &point.measures[0]).collect();
    assert!(estimates.iter().all(|measure| measure.is_narrow));
    let n: Vec<usize> = estimates.iter().map(|measure| measure.estimated.unwrap().n).collect();
    assert!(n[0] > 4 * n[1], "a share of one half needs more runs: {n:?}");
    let point = Point::new(&[0.2]);
    let known = runs.iter().filter(|run| run.point == point).count();
    let evidence = |without: usize| {
        let left: Vec<Run> = runs
            .iter()
            .filter(|run| run.point != point || (run.replicate as usize) < known - without)
            .cloned()
            .collect();
        decide(&question(10_000, 0.3), &Evidence::new(left), 20, 1)
    };
    assert!(evidence(25).finished.is_none(), "replicates of a batch at most are more than needed");
    // It waits for a run in flight, without further ones.
    let replicate = known as u32;
    let pending = Run { point, replicate, outcome: Outcome::Pending };
    let waits = decide(&question(10_000, 0.3), &Evidence::new(runs.into_iter().chain([pending])), 20, 1);
    assert_eq!((waits.is_met, waits.finished, waits.proposals), (true, None, Vec::new()));
}

/// Plays a study whose jams end early: each of `workers` workers runs the oldest proposal for 2 units of time if it jams, for 6 otherwise,
/// and the study decides after every end. Returns whether its interval holds the share of jams.
fn holds_where_jams_end_early(jams: f64, workers: usize, seed: u64) -> bool {
    let document = json!({
        "factors": [{ "name": "gate", "low": 0.0, "high": 10.0 }],
        "goal": { "estimate": { "points": [[2.0]], "intervals": [{ "of": { "probability": "jammed" }, "width": 0.3 }] } },
        "budget": { "max_runs": 10_000 },
    });
    let question = Question::read(&document).unwrap();
    let mut random = Random(seed);
    let mut runs: Vec<Run> = Vec::new();
    // Ends of the runs that workers have, with their index and their value.
    let mut busy: Vec<(u32, usize, f64)> = Vec::new();
    let (mut now, mut begun) = (0, 0);
    loop {
        let waiting = runs.len() - begun;
        let wanted = workers.saturating_sub(waiting);
        let decision = decide(&question, &Evidence::new(runs.iter().cloned()), wanted, seed);
        if decision.finished.is_some() {
            let found = points(&decision)[0].measures[0].estimated.unwrap();
            return found.low.unwrap() <= jams && jams <= found.high.unwrap();
        }
        runs.extend(decision.proposals.into_iter().map(|Proposal { point, replicate }| Run {
            point,
            replicate,
            outcome: Outcome::Pending,
        }));
        while busy.len() < workers && begun < runs.len() {
            let is_jam = random.uniform() < jams;
            busy.push((now + if is_jam { 2 } else { 6 }, begun, f64::from(u8::from(is_jam))));
            begun += 1;
        }
        busy.sort_by_key(|(end, index, _)| std::cmp::Reverse((*end, *index)));
        let (end, index, value) = busy.pop().expect("an unfinished study has runs in flight");
        now = end;
        let proposal = Proposal { point: runs[index].point.clone(), replicate: runs[index].replicate };
        runs[index] = run(&proposal, "jammed", value);
    }
}

#[test]
fn intervals_hold_where_runs_with_one_outcome_end_early() {
    for (jams, workers) in [(0.5, 64), (0.2, 64), (0.5, 8)] {
        let held = (0..200).filter(|seed| holds_where_jams_end_early(jams, workers, *seed)).count();
        assert!(held >= 190, "{held} of 200 with {workers} workers at {jams}");
    }
}

#[test]
fn the_budget_ends_a_study_when_nothing_is_in_flight() {
    let question = question(30, 0.01);
    let (mut runs, decision) = play(&question, ("jammed", 7, 1), simulate(&mut Random(3)));
    assert_eq!((decision.finished, decision.answer.runs.done), (Some(Finished::ByBudget), 30));
    runs[3].outcome = Outcome::Pending;
    let decision = decide(&question, &Evidence::new(runs), 7, 1);
    assert_eq!((decision.finished, decision.proposals.len(), decision.answer.runs.pending), (None, 0, 1));
}

#[test]
fn nothing_is_proposed_twice() {
    let question = question(1000, 0.1);
    let mut runs: Vec<Run> = Vec::new();
    for _ in 0..10 {
        let decision = decide(&question, &Evidence::new(runs.clone()), 6, 1);
        for Proposal { point, replicate } in decision.proposals {
            assert!(!runs.iter().any(|run| run.point == point && run.replicate == replicate));
            runs.push(Run { point, replicate, outcome: Outcome::Pending });
        }
    }
    assert_eq!(runs.len(), 10, "five runs of each point, before more is known");
}

#[test]
fn a_point_whose_runs_fail_is_excluded_and_named() {
    let question = question(1000, 0.3);
    let mut runs: Vec<Run> = Vec::new();
    let decision = loop {
        let decision = decide(&question, &Evidence::new(runs.clone()), 10, 1);
        if decision.finished.is_some() {
            break decision;
        }
        for proposal in &decision.proposals {
            let mut run = run(proposal, "jammed", 0.0);
            if proposal.point == Point::new(&[0.2]) {
                run.outcome = Outcome::Failed;
            }
            runs.push(run);
        }
    };
    assert_eq!(decision.finished, Some(Finished::ByRule));
    assert_eq!((decision.answer.excluded.len(), &decision.answer.excluded[0].values), (1, &vec![json!(2.0)]));
    assert!(points(&decision)[0].is_excluded && !points(&decision)[1].is_excluded);
    runs.retain(|run| run.outcome == Outcome::Failed);
    runs.extend(runs.clone().into_iter().map(|run| Run { point: Point::new(&[0.8]), ..run }));
    let decision = decide(&question, &Evidence::new(runs), 10, 1);
    assert_eq!(decision.finished, Some(Finished::NothingLeft));
}

#[test]
fn a_point_with_many_digits_finds_its_runs() {
    let document = json!({
        "factors": [{ "name": "gate", "low": 0.03, "high": 0.09 }],
        "goal": { "estimate": {
            "points": [[1.0 / 30.0]],
            "intervals": [{ "of": { "probability": "jammed" }, "width": 0.3 }],
        } },
        "budget": { "max_runs": 200 },
    });
    let question = Question::read(&document).unwrap();
    let mut runs: Vec<Run> = Vec::new();
    let decision = loop {
        let decision = decide(&question, &Evidence::new(runs.clone()), 5, 1);
        if decision.finished.is_some() {
            break decision;
        }
        assert!(runs.len() < 50, "the point does not find its runs");
        // A run knows the values of its factors alone.
        runs.extend(decision.proposals.iter().map(|next| {
            let values = next.point.values(&question.factors);
            let point = Point::of_values(&question.factors, &values).unwrap();
            run(&Proposal { point, ..next.clone() }, "jammed", 0.0)
        }));
    };
    assert_eq!(decision.finished, Some(Finished::ByRule));
}

#[test]
fn cancelled_run_is_replaced_by_another_replicate() {
    let question = question(10, 0.1);
    let first = decide(&question, &Evidence::default(), 10, 1).proposals;
    let mut runs: Vec<Run> = first.iter().map(|next| run(next, "jammed", 0.0)).collect();
    let cancelled = Run { outcome: Outcome::Cancelled, ..runs[0].clone() };
    runs[0] = cancelled.clone();
    let decision = decide(&question, &Evidence::new(runs.clone()), 10, 1);
    let counts = decision.answer.runs;
    assert_eq!((counts.done, counts.failed, counts.pending), (9, 0, 0));
    let [next] = &decision.proposals[..] else { panic!("one run is left: {:?}", decision.proposals) };
    assert!(runs.iter().all(|run| (&run.point, run.replicate) != (&next.point, next.replicate)));
    let point = Evidence::new(runs).at(&cancelled.point).cloned().unwrap();
    assert_eq!((point.count(), point.failed(), point.next_replicate()), (4, 0, 5));
    assert!(!question.budget.excludes(&point));
}

#[test]
fn responses_of_a_probability_other_than_0_and_1_are_excluded_and_reported() {
    let (runs, decision) = play(&question(100, 0.1), ("jammed", 5, 1), |_| 3.2);
    assert_eq!(decision.finished, Some(Finished::NothingLeft));
    let [unusable] = &decision.answer.unusable[..] else { panic!("a row") };
    assert_eq!((unusable.not_binary, unusable.missing, unusable.outliers), (runs.len(), 0, 0));
    assert!(points(&decision).iter().all(|point| point.measures[0].estimated.is_none()));
}

#[test]
fn a_response_that_never_appears_ends_its_point() {
    let question = question(1000, 0.3);
    let mut runs: Vec<Run> = Vec::new();
    let decision = loop {
        let decision = decide(&question, &Evidence::new(runs.clone()), 10, 1);
        if decision.finished.is_some() {
            break decision;
        }
        let at = |next: &Proposal| next.point == Point::new(&[0.2]);
        runs.extend(
            decision.proposals.iter().map(|next| run(next, if at(next) { "other" } else { "jammed" }, 0.0)),
        );
    };
    assert_eq!(decision.finished, Some(Finished::ByRule));
    let [excluded] = &decision.answer.excluded[..] else { panic!("one point") };
    assert_eq!((&excluded.values, excluded.failed), (&vec![json!(2.0)], 0));
    assert!(excluded.done < 20 && points(&decision)[0].is_excluded, "{excluded:?}");
    assert_eq!(decision.answer.unusable[0].missing, excluded.done);
}

#[test]
fn equal_values_of_a_mean_end_after_a_stated_number() {
    let document = json!({
        "factors": [{ "name": "gate", "low": 0.0, "high": 10.0 }],
        "goal": { "estimate": {
            "points": [[2.0], [8.0]],
            "intervals": [{ "of": { "mean": "rate" }, "width": 0.5 }],
        } },
        "budget": { "max_runs": 10_000 },
    });
    let question = Question::read(&document).unwrap();
    let mut random = Random(3);
    // At 2 all values are equal, at 8 they vary.
    let (runs, decision) =
        play(&question, ("rate", 10, 1), |at| if at[0] < 0.5 { 0.2 } else { 3.0 + random.normal() });
    assert_eq!(decision.finished, Some(Finished::ByRule));
    let found: Vec<_> = points(&decision).iter().map(|point| &point.measures[0]).collect();
    assert_eq!((found[0].is_constant, found[0].is_narrow, found[1].is_constant), (true, false, false));
    assert!(found[1].is_narrow);
    let equal = runs.iter().filter(|run| run.point == Point::new(&[0.2])).count();
    assert_eq!(equal, crate::goals::MAX_EQUAL);
    // One value that differs is a spread again.
    let mut runs = runs;
    let index = runs.iter().position(|run| run.point == Point::new(&[0.2])).unwrap();
    runs[index] = run(&Proposal { point: Point::new(&[0.2]), replicate: runs[index].replicate }, "rate", 9.0);
    let decision = decide(&question, &Evidence::new(runs), 10, 1);
    assert!(decision.finished.is_none() && !points(&decision)[0].measures[0].is_constant);
}
