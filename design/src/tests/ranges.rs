//! Tests of wider ranges: old runs are evidence in the new unit cube, and the study goes on. Runs that the budget does not count.

use serde_json::{Value, json};

use crate::goals::Place;
use crate::tests::truth::{Random, play, run};
use crate::{Evidence, Finding, Finished, Outcome, Point, Question, Run, decide};

fn question(range: (f64, f64), scale: &str, goal: &Value, max_runs: usize) -> Question {
    let document = json!({
        "factors": [{ "name": "x", "low": range.0, "high": range.1, "scale": scale }],
        "goal": goal,
        "budget": { "max_runs": max_runs },
    });
    Question::read(&document).unwrap()
}

fn boundary() -> Value {
    json!({ "boundary": { "of": { "probability": "y" }, "level": 0.5, "misclassified": 0.03 } })
}

/// The same runs in the unit cube of another question.
fn moved(runs: &[Run], from: &Question, to: &Question) -> Vec<Run> {
    let moved = runs.iter().map(|run| {
        let point = Point::of_run(&to.factors, &run.point.levels(&from.factors));
        Run { point: point.expect("inside the wider range"), ..run.clone() }
    });
    moved.collect()
}

/// The value of the factor at the level ½.
const CROSSING: f64 = 0.7;

fn draw(value: f64, random: &mut Random) -> f64 {
    f64::from(u8::from(random.uniform() < 1.0 / (1.0 + ((value - CROSSING) / 0.04).exp())))
}

#[test]
fn a_boundary_outside_the_first_range_is_found_in_a_wider_one() {
    for (scale, narrow, wide) in [("linear", (0.11, 0.51), (0.1, 1.9)), ("log", (0.11, 0.51), (0.1, 1.9))] {
        let (narrow, wide) =
            (question(narrow, scale, &boundary(), 400), question(wide, scale, &boundary(), 400));
        let mut random = Random(5);
        let value = |question: &Question, coordinates: &[f64]| question.factors[0].value(coordinates[0]);
        let (first, decision) =
            play(&narrow, ("y", 10, 1), |coordinates| draw(value(&narrow, coordinates), &mut random));
        let Finding::Boundary(answer) = &decision.answer.finding else { panic!("a boundary") };
        assert_eq!(decision.finished, Some(Finished::ByRule), "{scale}");
        assert_ne!(answer.place, Place::Inside, "{scale}");
        let mut runs = moved(&first, &narrow, &wide);
        let mut decision = decide(&wide, &Evidence::new(runs.clone()), 10, 1);
        assert_eq!(decision.finished, None, "the wider range has unknown parts");
        assert_eq!(decision.answer.runs.done, first.len(), "every run is kept");
        while decision.finished.is_none() {
            for next in &decision.proposals {
                let is_known = |known: &Run| known.point == next.point && known.replicate == next.replicate;
                assert!(!runs.iter().any(is_known), "{next:?}");
                // A run knows the values of its factors alone.
                let values = next.point.levels(&wide.factors);
                assert_eq!(Point::of_run(&wide.factors, &values).as_ref(), Some(&next.point));
                runs.push(run(next, "y", draw(values[0].as_f64().unwrap(), &mut random)));
            }
            decision = decide(&wide, &Evidence::new(runs.clone()), 10, 1);
        }
        let Finding::Boundary(answer) = &decision.answer.finding else { panic!("a boundary") };
        assert_eq!((decision.finished, answer.place), (Some(Finished::ByRule), Place::Inside), "{scale}");
        let mut crossings = answer.crossings.iter();
        let holds = crossings.any(|crossing| crossing.low <= CROSSING && CROSSING <= crossing.high);
        assert!(holds, "{scale}: {:?}", answer.crossings);
    }
}

#[test]
fn given_points_keep_their_runs_in_a_wider_range() {
    let goal = json!({ "estimate": {
        "points": [[0.2], [0.333], [0.512345]],
        "intervals": [{ "of": { "probability": "y" }, "width": 0.4 }],
    } });
    let narrow = question((0.11, 0.61), "linear", &goal, 300);
    let mut random = Random(2);
    let (runs, decision) = play(&narrow, ("y", 10, 1), |_| f64::from(u8::from(random.uniform() < 0.3)));
    assert_eq!(decision.finished, Some(Finished::ByRule));
    for wide in [(0.1, 0.7), (-3.0, 123.0)] {
        let wide = question(wide, "linear", &goal, 300);
        let again = decide(&wide, &Evidence::new(moved(&runs, &narrow, &wide)), 10, 1);
        assert_eq!(
            (again.finished, &again.answer.finding),
            (Some(Finished::ByRule), &decision.answer.finding)
        );
    }
}

#[test]
fn the_budget_does_not_count_free_runs() {
    let goals = [
        boundary(),
        json!({ "optimise": { "objectives": [{ "minimise": { "mean": "y" } }] } }),
        json!({ "estimate": { "points": [[0.5]], "intervals": [{ "of": { "mean": "y" }, "width": 1e-9 }] } }),
    ];
    for goal in goals {
        let question = question((0.0, 1.0), "linear", &goal, 60);
        let free = (0..100).map(|index| Run {
            point: Point::new(&[f64::from(index % 50) / 50.0]),
            replicate: index / 50,
            outcome: Outcome::Responses([("y".to_owned(), f64::from((index + index / 50) % 2))].into()),
        });
        let free: Vec<Run> = free.collect();
        // All of them would have spent the budget.
        assert!(decide(&question, &Evidence::new(free.clone()), 60, 1).proposals.is_empty(), "{goal}");
        let mut random = Random(4);
        let mut own: Vec<Run> = Vec::new();
        let decision = loop {
            let evidence = Evidence::new(free.iter().chain(&own).cloned()).with_free(free.len());
            let decision = decide(&question, &evidence, 10, 1);
            if decision.finished.is_some() {
                break decision;
            }
            assert!(!decision.proposals.is_empty(), "{goal}: {} own runs", own.len());
            let results =
                decision.proposals.iter().map(|next| run(next, "y", (random.uniform() * 2.0).floor()));
            own.extend(results);
        };
        assert!(!own.is_empty() && own.len() <= 60, "{goal}: {}", own.len());
        if decision.finished == Some(Finished::ByBudget) && goal.get("optimise").is_none() {
            assert_eq!(own.len(), 60, "{goal}");
        }
    }
}
