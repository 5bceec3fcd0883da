//! Tests of expected improvement, of Pareto fronts and of the rules of confirmation.

use serde_json::Value;

use super::confirmation::{ConfirmationState, Confirming};
use super::normal::{LnSum, ln_cdf, ln_improvement};
use super::{Constraint, FIRST_CONFIRMATION, Objective, Optimise, front};
use crate::evidence::{Outcome, Point, PointRuns};
use crate::question::Measure;
use crate::tests::truth::Random;

fn reference() -> Value {
    serde_json::from_str(include_str!("../../../tests/data/improvement.json")).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn pair(value: &Value) -> [f64; 2] {
    [number(&value[0]), number(&value[1])]
}

fn assert_near(actual: f64, expected: f64, tolerance: f64) {
    assert!((actual - expected).abs() <= tolerance * expected.abs().max(1.0), "{actual}, not {expected}");
}

#[test]
fn logarithms_of_improvement_match_mpmath() {
    let reference = reference();
    for case in reference["improvements"].as_array().unwrap() {
        let actual = ln_improvement(number(&case["gap"]), number(&case["deviation"]));
        assert_near(actual, number(&case["ln"]), 1e-12);
    }
    for case in reference["tails"].as_array().unwrap() {
        assert_near(ln_cdf(number(&case["z"])), number(&case["ln"]), 1e-12);
    }
    assert_eq!((ln_improvement(2.0, 0.0), ln_improvement(-1.0, 0.0)), (2.0_f64.ln(), f64::NEG_INFINITY));
}

#[test]
fn expected_gains_of_area_match_numerical_integration() {
    let reference = reference();
    let points: Vec<[f64; 2]> = reference["front"].as_array().unwrap().iter().map(pair).collect();
    let gain = front::ln_gain(&points, pair(&reference["reference"]));
    for case in reference["gains"].as_array().unwrap() {
        assert_near(gain(pair(&case["means"]), pair(&case["deviations"])), number(&case["ln"]), 1e-10);
    }
}

#[test]
fn a_front_has_the_points_that_none_beats() {
    let points = [[0.5, 0.5], [0.2, 0.9], [0.6, 0.6], [0.2, 0.8], [0.9, 0.1], [0.5, 0.5]];
    assert_eq!(front::front(&points), [3, 0, 4]);
    // Boxes below (1, 1): 0.3 by 0.2, 0.4 by 0.5, 0.1 by 0.9.
    assert_near(front::area(&points, [1.0, 1.0]), 0.06 + 0.2 + 0.09, 1e-12);
    assert_eq!(front::area(&[[2.0, 0.0]], [1.0, 1.0]), 0.0);
    assert!(front::front(&[]).is_empty());
}

#[test]
fn sums_of_logarithms() {
    let mut sum = LnSum::EMPTY;
    assert_eq!(sum.ln(), f64::NEG_INFINITY);
    for ln in [-1000.0, -1001.0, f64::NEG_INFINITY, -999.0] {
        sum.add(ln);
    }
    assert_near(sum.ln(), -1000.0 + (1.0 + (-1.0_f64).exp() + 1.0_f64.exp()).ln(), 1e-14);
}

fn goal(constraints: Vec<Constraint>) -> Optimise {
    Optimise {
        objectives: vec![Objective::Minimise(Measure::Mean("cost".to_owned()))],
        constraints,
        tolerance: 0.01,
        confirmation_runs: None,
        front_points: 5,
    }
}

fn jam() -> Constraint {
    Constraint { of: Measure::Probability("jammed".to_owned()), at_most: Some(0.05), at_least: None }
}

fn load() -> Constraint {
    Constraint { of: Measure::Mean("load".to_owned()), at_most: None, at_least: Some(1.0) }
}

/// Confirmation runs with a probability of jams and a normal load of deviation 1, until the verdict.
fn verdict(goal: &Optimise, jams: f64, load: f64, random: &mut Random) -> (ConfirmationState, usize) {
    let plan = goal.plan().unwrap();
    let mut point = PointRuns { point: Point::new(&[0.5]), runs: [].into() };
    let mut next = FIRST_CONFIRMATION..FIRST_CONFIRMATION + plan.first as u32;
    loop {
        for replicate in next {
            let jammed = f64::from(u8::from(random.uniform() < jams));
            let load = load + random.normal();
            let values = [("jammed".to_owned(), jammed), ("load".to_owned(), load), ("cost".to_owned(), 1.0)];
            point.runs.insert(replicate, Outcome::Responses(values.into()));
        }
        let runs = Confirming::of(&point).unwrap();
        let state = runs.state(goal, &plan, 3);
        if state != ConfirmationState::Open {
            return (state, point.runs.len());
        }
        next = runs.next(&plan);
        assert!(!next.is_empty(), "an open confirmation goes on");
    }
}

#[test]
fn a_confirmation_seldom_certifies_what_does_not_hold() {
    let mut random = Random(1);
    for (constraints, jams, load) in [
        (vec![jam()], 0.05, 0.0),
        (vec![load()], 0.0, 1.0),
        (vec![jam(), load()], 0.0, 1.0),
        (vec![jam(), load()], 0.05, 2.0),
    ] {
        let goal = goal(constraints);
        let wrong =
            (0..2000).filter(|_| verdict(&goal, jams, load, &mut random).0 == ConfirmationState::Confirmed);
        let share = wrong.count() as f64 / 2000.0;
        println!("jams {jams}, load {load}: {share} certified");
        assert!(share <= 0.06, "{share} of points at a limit are certified");
    }
}

#[test]
fn a_confirmation_certifies_what_holds_clearly() {
    let mut random = Random(2);
    let goal = goal(vec![jam(), load()]);
    let plan = goal.plan().unwrap();
    let found: Vec<_> = (0..200).map(|_| verdict(&goal, 0.002, 2.0, &mut random)).collect();
    let passed = found.iter().filter(|(state, _)| *state == ConfirmationState::Confirmed).count();
    assert!(passed >= 190, "{passed} of 200");
    assert!(found.iter().any(|(_, runs)| *runs == plan.first), "the best case takes the first look");
    let (state, runs) = verdict(&goal, 0.5, 2.0, &mut random);
    assert_eq!(state, ConfirmationState::Refuted);
    assert!(runs <= plan.first);
}

#[test]
fn the_limit_of_the_search_passes_with_the_stated_probability() {
    let mut random = Random(3);
    let goal = goal(vec![jam()]);
    let plan = goal.plan().unwrap();
    let limit = jam().search_limit(&jam().looks(&plan, goal.alpha()), 0.0);
    let passed =
        (0..2000).filter(|_| verdict(&goal, limit, 0.0, &mut random).0 == ConfirmationState::Confirmed);
    let share = passed.count() as f64 / 2000.0;
    println!("limit {limit}: {share}");
    assert!((0.46..=0.54).contains(&share), "{share} at {limit}");
    let opposite = Constraint { at_most: None, at_least: Some(0.95), ..jam() };
    assert_near(opposite.search_limit(&opposite.looks(&plan, goal.alpha()), 0.0), 1.0 - limit, 1e-9);
}
