//! Tests of expected improvement, of Pareto fronts and of the rules of confirmation.

use serde_json::Value;
use statrs::distribution::{ContinuousCDF, Normal};

use super::bounds::Bounds;
use super::chances::Chances;
use super::confirmation::{ConfirmationState, Confirming};
use super::normal::{LnSum, ln_cdf, ln_improvement};
use super::{Constraint, FIRST_CONFIRMATION, Objective, Optimise, front};
use crate::evidence::{Outcome, Point, PointRuns};
use crate::measure::Measure;
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
fn gain_of_knowing_a_point_matches_numerical_integration() {
    let (points, reference) = ([[0.2, 0.8], [0.6, 0.3]], [1.0, 1.0]);
    // On the front, beaten by it, equal to one of its points.
    for means in [[0.4, 0.4], [0.7, 0.7], [0.6, 0.3]] {
        let deviations = [0.2, 0.1];
        let found = front::ln_gain_of_knowing(&points, reference, means, deviations).exp();
        let area = |at: [f64; 2]| {
            front::area(&[points[0], points[1], at], reference) - front::area(&points, reference)
        };
        const STEPS: usize = 400;
        let numbers: Vec<f64> = (0..STEPS)
            .map(|step| Normal::standard().inverse_cdf((step as f64 + 0.5) / STEPS as f64))
            .collect();
        let place = |x: f64, y: f64| [means[0] + deviations[0] * x, means[1] + deviations[1] * y];
        let sum: f64 = numbers.iter().flat_map(|x| numbers.iter().map(move |y| area(place(*x, *y)))).sum();
        let expected = sum / (STEPS * STEPS) as f64 - area(means);
        assert!(
            (found - expected).abs() < 0.01 * expected && expected > 1e-4,
            "{means:?}: {found}, not {expected}"
        );
        let known = front::ln_gain_of_knowing(&points, reference, means, [0.0; 2]);
        assert_eq!(known, f64::NEG_INFINITY, "a known point has nothing to gain");
    }
}

#[test]
fn front_has_the_non_dominated_points() {
    let points = [[0.5, 0.5], [0.2, 0.9], [0.6, 0.6], [0.2, 0.8], [0.9, 0.1], [0.5, 0.5]];
    assert_eq!(front::front(&points), [3, 0, 4]);
    // Boxes below (1, 1): 0.3 by 0.2, 0.4 by 0.5, 0.1 by 0.9.
    assert_near(front::area(&points, [1.0, 1.0]), 0.06 + 0.2 + 0.09, 1e-12);
    assert_eq!(front::area(&[[2.0, 0.0]], [1.0, 1.0]), 0.0);
    assert!(front::front(&[]).is_empty());
}

#[test]
fn ln_sum_adds_numbers_by_their_logarithms() {
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

/// Attempts at a confirmation with a probability of jams and drawn loads: the last state, and its number of runs.
fn attempts(
    goal: &Optimise,
    attempts: std::ops::RangeInclusive<u32>,
    jams: f64,
    random: &mut Random,
    load: impl Fn(&mut Random) -> f64,
) -> (ConfirmationState, usize) {
    let mut last = (ConfirmationState::Open, 0);
    for attempt in attempts {
        let first = attempt * FIRST_CONFIRMATION;
        let mut point = PointRuns { point: Point::new(&[0.5]), runs: [].into(), impossible: None };
        let mut next = first..first + goal.plan(attempt).unwrap().first as u32;
        loop {
            for replicate in next {
                let jammed = f64::from(u8::from(random.uniform() < jams));
                let values = [("jammed", jammed), ("load", load(random)), ("cost", 1.0)];
                point.runs.insert(replicate, outcome(&values));
            }
            let runs = Confirming::of(goal, &point).unwrap();
            last = (runs.state(goal, 3), point.runs.len());
            if last.0 != ConfirmationState::Open {
                break;
            }
            next = runs.next();
            assert!(!next.is_empty(), "an open confirmation goes on");
        }
        if last.0 == ConfirmationState::Confirmed {
            break;
        }
    }
    last
}

fn outcome(values: &[(&str, f64)]) -> Outcome {
    Outcome::Responses(values.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect())
}

/// A first attempt with a normal load of deviation 1.
fn verdict(goal: &Optimise, jams: f64, load: f64, random: &mut Random) -> (ConfirmationState, usize) {
    attempts(goal, 1..=1, jams, random, |random| load + random.normal())
}

#[test]
fn confirmation_seldom_certifies_points_at_a_limit() {
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
fn confirmation_certifies_points_far_from_a_limit() {
    let mut random = Random(2);
    let goal = goal(vec![jam(), load()]);
    let plan = goal.plan(1).unwrap();
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
    let plan = goal.plan(1).unwrap();
    let limit = Chances::of(&jam(), &plan).search_limit(0.0);
    let passed =
        (0..2000).filter(|_| verdict(&goal, limit, 0.0, &mut random).0 == ConfirmationState::Confirmed);
    let share = passed.count() as f64 / 2000.0;
    println!("limit {limit}: {share}");
    assert!((0.46..=0.54).contains(&share), "{share} at {limit}");
    let opposite = Constraint { at_most: None, at_least: Some(0.95), ..jam() };
    assert_near(Chances::of(&opposite, &plan).search_limit(0.0), 1.0 - limit, 1e-9);
}

/// Share of 2,000 studies that certify what does not hold, with a number of attempts.
fn wrong(goal: &Optimise, most: u32, jams: f64, load: impl Fn(&mut Random) -> f64) -> f64 {
    let mut random = Random(4);
    let is_wrong =
        |_: &i32| attempts(goal, 1..=most, jams, &mut random, &load).0 == ConfirmationState::Confirmed;
    (0..2000).filter(is_wrong).count() as f64 / 2000.0
}

#[test]
fn familywise_error_of_20_confirmation_attempts_is_at_most_5_percent() {
    let share = wrong(&goal(vec![jam()]), 20, 0.05, |_| 0.0);
    println!("20 attempts: {share} certified");
    assert!(share <= 0.05, "{share}");
}

#[test]
fn skewed_loads_at_their_limit_are_seldom_certified() {
    let exponential = |random: &mut Random| -(1.0 - random.uniform()).ln();
    let lognormal = |random: &mut Random| random.normal().exp();
    let below = |limit| Constraint { of: load().of, at_most: Some(limit), at_least: None };
    let above = |limit| Constraint { at_least: Some(limit), at_most: None, ..below(limit) };
    let mean = 0.5_f64.exp();
    for (name, share) in [
        ("exponential, at most", wrong(&goal(vec![below(1.0)]), 4, 0.0, exponential)),
        ("exponential, at least", wrong(&goal(vec![above(1.0)]), 4, 0.0, exponential)),
        ("lognormal, at most", wrong(&goal(vec![below(mean)]), 4, 0.0, lognormal)),
        ("lognormal, at least", wrong(&goal(vec![above(mean)]), 4, 0.0, lognormal)),
    ] {
        println!("{name}: {share} certified");
        assert!(share <= 0.06, "{name}: {share}");
    }
}

#[test]
fn equal_values_certify_no_mean() {
    let goal = goal(vec![load()]);
    let (state, runs) = attempts(&goal, 1..=1, 0.0, &mut Random(5), |_| 2.0);
    assert_eq!((state, runs), (ConfirmationState::Undecided, goal.plan(1).unwrap().most));
    assert_eq!(Bounds::of(&load().of, 0.01, &[Some(2.0); 30]), None);
}

/// The state of a first attempt with all its runs, where `outcome` says what a run gives.
fn state_of(goal: &Optimise, runs: u32, outcome: impl Fn(u32) -> Outcome) -> ConfirmationState {
    let runs = (0..runs).map(|index| (FIRST_CONFIRMATION + index, outcome(index)));
    let point = PointRuns { point: Point::new(&[0.5]), runs: runs.collect(), impossible: None };
    Confirming::of(goal, &point).unwrap().state(goal, 20)
}

#[test]
fn an_objective_without_values_is_not_confirmed() {
    let goal = goal(Vec::new());
    let costly = outcome(&[("cost", 1.0)]);
    let failing = |lost: u32| {
        let costly = costly.clone();
        move |index: u32| if index < lost { Outcome::Failed } else { costly.clone() }
    };
    assert_eq!(state_of(&goal, 10, failing(0)), ConfirmationState::Confirmed);
    assert_eq!(state_of(&goal, 10, failing(10)), ConfirmationState::Open);
    assert_eq!(state_of(&goal, 20, failing(10)), ConfirmationState::Confirmed);
    assert_eq!(state_of(&goal, 20, failing(11)), ConfirmationState::Undecided);
    assert_eq!(state_of(&goal, 20, |_| outcome(&[("load", 1.0)])), ConfirmationState::Undecided);
}

#[test]
fn lost_runs_count_against_a_probability_constraint() {
    let goal = goal(vec![jam()]);
    let plan = goal.plan(1).unwrap();
    let lost = |share: u32, lost: Outcome| {
        move |index: u32| {
            let is_lost = index.is_multiple_of(share);
            if is_lost { lost.clone() } else { outcome(&[("jammed", 0.0), ("cost", 1.0)]) }
        }
    };
    let most = plan.most as u32;
    assert_eq!(state_of(&goal, most, lost(1000, Outcome::Failed)), ConfirmationState::Confirmed);
    for kind in [Outcome::Failed, outcome(&[("cost", 1.0)])] {
        assert_eq!(state_of(&goal, most, lost(10, kind)), ConfirmationState::Undecided);
    }
    let mut values = [Some(0.0); 100];
    values[..4].fill(None);
    let with_lost = Bounds::of(&jam().of, 0.01, &values).unwrap();
    values[..4].fill(Some(1.0));
    let jammed = Bounds::of(&jam().of, 0.01, &values).unwrap();
    assert_eq!((with_lost.n, with_lost.lost, with_lost.low), (96, 4, 0.0));
    assert_near(with_lost.high, jammed.high, 1e-12);
}

#[test]
fn last_look_of_a_confirmation_includes_all_of_its_runs() {
    let limited = |runs| Optimise { confirmation_runs: Some(runs), ..goal(vec![jam()]) };
    // One jam in 100 runs cannot pass at 86, but may with the rest of α at the end.
    let looks = |runs| limited(runs).plan(1).unwrap().tails().collect::<Vec<_>>();
    for (runs, expected) in [
        (100, vec![(86, 0.0125), (100, 0.0125)]),
        (72, vec![(72, 0.025)]),
        (400, vec![(86, 0.0125), (172, 0.00625), (344, 0.003_125), (400, 0.003_125)]),
    ] {
        let looks = looks(runs);
        assert_eq!(looks.len(), expected.len());
        for (look, expected) in looks.iter().zip(expected) {
            assert_eq!(look.0, expected.0);
            assert_near(look.1, expected.1, 1e-12);
        }
    }
    assert_eq!(limited(71).plan(1), None);
    assert_eq!(limited(100).plan(4), None, "a fourth attempt needs 112");
}

#[test]
fn attempts_are_counted_by_recommended_point() {
    use ConfirmationState::{Confirmed, Open, Refuted};
    let next = |targets, begun: &[(u32, ConfirmationState)]| {
        let two = goal(Vec::new()).objectives[0].clone();
        let objectives = if targets == 1 { vec![two] } else { vec![two.clone(), two] };
        let goal = Optimise { objectives, front_points: targets, ..goal(Vec::new()) };
        goal.next_attempt(begun)
    };
    assert_eq!((next(1, &[]), next(1, &[(1, Refuted)])), ((1, 1), (2, 1)));
    assert_eq!(next(1, &[(1, Refuted), (2, Refuted)]), (3, 1));
    assert_eq!(next(3, &[(1, Open), (1, Refuted)]), (1, 1), "a third point has its first attempt");
    let first = [(1, Confirmed), (1, Refuted), (1, Refuted)];
    assert_eq!(next(3, &first), (2, 2));
    assert_eq!(next(3, &[&first[..], &[(2, Open)]].concat()), (2, 1));
    assert_eq!(next(3, &[&first[..], &[(2, Refuted), (2, Confirmed)]].concat()), (3, 1));
    assert_eq!(next(3, &[(1, Confirmed), (1, Open), (1, Confirmed)]), (2, 0));
}

#[test]
fn tabulated_chances_are_accurate_and_faster_than_exact_ones() {
    let half = Constraint { of: jam().of, at_most: Some(0.3), at_least: None };
    for (constraint, runs) in [(jam(), None), (half, Some(1000))] {
        let goal = Optimise { confirmation_runs: runs, ..goal(vec![constraint.clone()]) };
        let time = std::time::Instant::now();
        let chances = Chances::of(&constraint, &goal.plan(1).unwrap());
        let at = |index: u32| f64::from(index) / 5000.0 * constraint.limit();
        let sum: f64 = (0..5000).map(|index| chances.at(at(index))).sum();
        let tables = time.elapsed();
        let time = std::time::Instant::now();
        for index in (0..5000).step_by(50) {
            let exact = chances.exactly_at(at(index));
            assert!(
                (chances.at(at(index)) - exact).abs() < 1e-3,
                "{} not {exact} at {}",
                chances.at(at(index)),
                at(index)
            );
        }
        // A hundred exact chances took this time.
        assert!(sum > 0.0 && tables < 10 * time.elapsed(), "{tables:?}");
    }
}
