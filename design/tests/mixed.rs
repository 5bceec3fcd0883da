//! Studies over whole numbers and levels, from the first run to the answer.

#[allow(dead_code, reason = "each test binary uses a part")]
mod drive;

use std::collections::BTreeSet;

use drive::{generator, normal, question, responses, study, uniform};
use roost_design::goals::{ConfirmationState, Effects, OptimiseAnswer, Place};
use roost_design::{Decision, Factor, Finding, Finished, Point, Question};
use serde_json::{Value, json};

const WALLS: [&str; 3] = ["rubber", "steel", "glass"];

fn asked(factors: &[Value], goal: Value, max_runs: usize) -> Question {
    question(&json!({"factors": factors, "goal": goal, "budget": {"max_runs": max_runs}}))
}

fn count(low: u32, high: u32) -> Value {
    json!({"name": "/count", "low": low, "high": high, "is_whole": true})
}

fn walls() -> Value {
    json!({"name": "/walls", "levels": WALLS})
}

/// The numbers of a point: values of ranges, indices of levels.
fn numbers(factors: &[Factor], coordinates: &[f64]) -> Vec<f64> {
    Point::new(coordinates).values(factors)
}

fn best(decision: &Decision) -> &OptimiseAnswer {
    match &decision.answer.finding {
        Finding::Optimise(finding) => finding,
        other => panic!("{other:?}"),
    }
}

#[test]
fn an_optimum_over_a_number_a_whole_number_and_levels_is_found_and_confirmed() {
    // The cost rises with the count; steel is the cheapest, but jams more than rubber. Jams fall with the count, and are rare from 10 on.
    let price = [0.3, 0.0, 0.6];
    let cost = |x: f64, count: f64, wall: usize| count / 20.0 + price[wall] + (x - 0.4).powi(2);
    let jams = |count: f64, wall: usize| 1.0 / (1.0 + (1.5 * (count - 8.0 + wall as f64 * 0.2)).exp());
    let goal = json!({"optimise": {
        "objectives": [{"minimise": {"mean": "cost"}}],
        "constraints": [{"of": {"probability": "jammed"}, "at_most": 0.1}],
        "tolerance": 0.01,
    }});
    let x = json!({"name": "/x", "low": 0.0, "high": 1.0});
    let question = asked(&[x, count(1, 20), walls()], goal, 500);
    let optimum = (1..=20).map(f64::from).filter(|count| jams(*count, 1) <= 0.1);
    let optimum = optimum.map(|count| cost(0.4, count, 1)).fold(f64::INFINITY, f64::min);
    for seed in 1..4 {
        let simulate = |coordinates: &[f64], replicate: u32| {
            let at = numbers(&question.factors, coordinates);
            let mut random = generator(seed, &at, replicate);
            let cost = cost(at[0], at[1], at[2] as usize) + 0.02 * normal(&mut random);
            let jammed = f64::from(u8::from(uniform(&mut random) < jams(at[1], at[2] as usize)));
            responses(&[("cost", cost), ("jammed", jammed)])
        };
        let (runs, decision) = study(&question, seed, 10, simulate);
        let found = &best(&decision).recommended[0];
        println!("seed {seed}: {} runs, {:?}", runs.len(), found.values);
        assert_eq!(decision.finished, Some(Finished::ByRule), "{found:?}");
        assert_eq!(found.confirmation.as_ref().unwrap().state, ConfirmationState::Confirmed);
        let [x, number, wall] = &found.values[..] else { panic!("three values") };
        assert_eq!((wall, number.is_i64()), (&json!("steel"), true), "{found:?}");
        let (x, number) = (x.as_f64().unwrap(), number.as_f64().unwrap());
        assert!(jams(number, 1) <= 0.1 && cost(x, number, 1) < optimum + 0.13, "{found:?}, not {optimum}");
        drive::assert_order_is_irrelevant(&question, &runs, 10, seed);
        drive::assert_order_is_irrelevant(&question, &runs[..runs.len() / 3], 10, seed);
    }
}

#[test]
fn the_best_of_a_few_noisy_points_is_found_by_replicates() {
    // Twelve points in all, and the noise is as large as the difference between the best two.
    let truth = |at: &[f64]| 0.3 * (at[0] - 4.0).abs() + [0.5, 0.0][at[1] as usize];
    let levels = json!({"name": "/walls", "levels": [false, true]});
    let goal = json!({"optimise": {"objectives": [{"minimise": {"mean": "y"}}], "tolerance": 0.01}});
    let question = asked(&[count(1, 6), levels], goal, 200);
    let (mut right, mut most) = (0, 0);
    for seed in 0..20 {
        let simulate = |coordinates: &[f64], replicate: u32| {
            let at = numbers(&question.factors, coordinates);
            responses(&[("y", truth(&at) + 0.3 * normal(&mut generator(seed, &at, replicate)))])
        };
        let (runs, decision) = study(&question, seed, 4, simulate);
        assert_eq!(decision.finished, Some(Finished::ByRule));
        assert!(runs.iter().map(|run| &run.point).collect::<BTreeSet<_>>().len() <= 12);
        right += usize::from(best(&decision).recommended[0].values == [json!(4), json!(true)]);
        most = most.max(runs.len());
    }
    println!("{right} of 20 right, at most {most} runs");
    // One look at each point with two runs would choose the best one in about half of the studies.
    assert!(right >= 17, "{right} of 20");
}

#[test]
fn the_front_of_a_few_noisy_points_is_found_by_replicates() {
    // Twelve points in all. On the front are the counts 2 to 5 without the level, and the noise is more than twice their distances.
    let truth = |at: &[f64]| [2.0, 5.0].map(|best| 0.3 * (at[0] - best).abs() + [0.0, 0.4][at[1] as usize]);
    let levels = json!({"name": "/walls", "levels": [false, true]});
    let objectives = json!([{"minimise": {"mean": "y"}}, {"minimise": {"mean": "z"}}]);
    let goal = json!({"optimise": {"objectives": objectives, "tolerance": 0.01, "front_points": 4}});
    let question = asked(&[count(1, 6), levels], goal, 400);
    let (mut right, mut recommended, mut most) = (0, 0, 0);
    for seed in 0..12 {
        let simulate = |coordinates: &[f64], replicate: u32| {
            let at = numbers(&question.factors, coordinates);
            let mut random = generator(seed, &at, replicate);
            let [y, z] = truth(&at).map(|value| value + 0.8 * normal(&mut random));
            responses(&[("y", y), ("z", z)])
        };
        let (runs, decision) = study(&question, seed, 4, simulate);
        assert!(decision.finished.is_some());
        let points = best(&decision).recommended.iter().map(|point| &point.values);
        let is_right = |values: &&Vec<Value>| (2..=5).any(|count| **values == [json!(count), json!(false)]);
        recommended += points.clone().count();
        right += points.filter(is_right).count();
        most = most.max(runs.len());
    }
    println!("{right} of {recommended} right, at most {most} runs");
    assert!(recommended >= 36 && 10 * right >= 9 * recommended, "{right} of {recommended}");
}

/// Variances of the parts of a function of a whole number from 1 to 4, a level of three, and a number from 0 to 1:
/// y = n + g(level) + 2 (n − 5/2) u(level) + 3 x, where u has mean 0.
const G: [f64; 3] = [0.0, 2.0, 4.0];
const U: [f64; 3] = [-0.5, 1.0, -0.5];

#[test]
fn sobol_indices_of_levels_and_whole_numbers_are_those_in_closed_form() {
    let value = |at: &[f64]| {
        let level = at[1] as usize;
        at[0] + G[level] + 2.0 * (at[0] - 2.5) * U[level] + 3.0 * at[2]
    };
    // Var n = 15/12, Var g = 8/3, of the product 4 · 15/12 · ½, Var 3x = 9/12.
    let parts = [1.25, 8.0 / 3.0, 0.75, 4.0 * 1.25 * 0.5];
    let all: f64 = parts.iter().sum();
    let first = [parts[0], parts[1], parts[2]].map(|part| part / all);
    let total = [parts[0] + parts[3], parts[1] + parts[3], parts[2]].map(|part| part / all);
    let x = json!({"name": "/x", "low": 0.0, "high": 1.0});
    let goal = json!({"sensitivity": {"of": [{"mean": "y"}], "width": 0.4}});
    let question = asked(&[count(1, 4), walls(), x], goal, 20_000);
    let mut hits = [0.0; 6];
    const REPETITIONS: u64 = 30;
    for seed in 0..REPETITIONS {
        let simulate = |coordinates: &[f64], replicate: u32| {
            let at = numbers(&question.factors, coordinates);
            responses(&[("y", value(&at) + normal(&mut generator(seed, &at, replicate)))])
        };
        let (runs, decision) = study(&question, seed, 100, simulate);
        assert_eq!(decision.finished, Some(Finished::ByRule));
        let Finding::Sensitivity(finding) = &decision.answer.finding else { panic!("a sensitivity") };
        let Some(Effects::Sobol(indices)) = &finding.measures[0].effects else { panic!("indices") };
        for (index, found) in indices.iter().enumerate() {
            for (place, found, truth) in
                [(index, found.first_order, first[index]), (index + 3, found.total, total[index])]
            {
                hits[place] +=
                    f64::from(u8::from(found.low.unwrap() <= truth && truth <= found.high.unwrap()));
            }
        }
        if seed == 0 {
            let noise = finding.measures[0].noise_variance.unwrap();
            assert!((noise - 1.0).abs() < 0.5, "{noise}");
            drive::assert_order_is_irrelevant(&question, &runs[..runs.len() / 2], 30, seed);
        }
    }
    println!("{hits:?} of {REPETITIONS}");
    let n = REPETITIONS as f64;
    let least = 0.94 - 2.0 * (0.94 * 0.06 / n).sqrt();
    assert!(hits.iter().all(|hits| *hits >= least * n), "{hits:?}");
}

#[test]
fn repeated_points_of_a_design_get_separate_runs() {
    // Of 12 points in all, every one comes many times; its runs are independent, so that noise is no sensitivity.
    let goal = json!({"sensitivity": {"of": [{"mean": "y"}], "width": 0.001}});
    let question = asked(&[count(1, 4), walls()], goal.clone(), 64 * 5);
    let simulate = |coordinates: &[f64], replicate: u32| {
        let at = numbers(&question.factors, coordinates);
        responses(&[("y", at[0] + 1.5 * normal(&mut generator(3, &at, replicate)))])
    };
    let (runs, decision) = study(&question, 1, 20, simulate);
    assert_eq!((runs.len(), decision.finished), (64 * 5, Some(Finished::ByBudget)));
    let Finding::Sensitivity(finding) = &decision.answer.finding else { panic!("a sensitivity") };
    assert_eq!(finding.rows, 64);
    let Some(Effects::Sobol(indices)) = &finding.measures[0].effects else { panic!("indices") };
    let none = &indices[1].total;
    assert!(none.low.unwrap() <= 0.0 && 0.0 <= none.high.unwrap(), "walls have no effect: {none:?}");
    // With one run for each point, runs are shared, and no row is free of charge: the design ends.
    let mut document = json!(question);
    document["budget"] = json!({"max_runs": 64 * 4, "max_replicates": 1});
    let (runs, decision) = study(&self::question(&document), 1, 20, simulate);
    assert_eq!((runs.len(), decision.finished), (12, Some(Finished::ByBudget)));
}

#[test]
fn a_boundary_over_whole_numbers_lies_between_two_of_them() {
    let goal = json!({"boundary": {"of": {"probability": "jammed"}, "level": 0.5}});
    for (low, high, middle) in [(24, 96, 47.5), (46, 49, 47.5), (1, 1000, 300.5)] {
        let width = f64::from(high - low) / 24.0;
        let jams = |count: f64| 1.0 / (1.0 + ((count - middle) / width).exp());
        let question = asked(&[count(low, high)], goal.clone(), 2000);
        let simulate = |coordinates: &[f64], replicate: u32| {
            let at = numbers(&question.factors, coordinates);
            let jammed = uniform(&mut generator(5, &at, replicate)) < jams(at[0]);
            responses(&[("jammed", f64::from(u8::from(jammed)))])
        };
        let (runs, decision) = study(&question, 2, 8, simulate);
        let Finding::Boundary(found) = &decision.answer.finding else { panic!("a boundary") };
        println!("{low} to {high}: {} runs, {:?}, {:?}", runs.len(), decision.finished, found.crossings);
        assert_eq!(
            (decision.finished, found.place),
            (Some(Finished::ByRule), Place::Inside),
            "{low} to {high}"
        );
        let values: Vec<f64> = found.map.iter().map(|point| point.values[0]).collect();
        assert!(values.iter().all(|value| value.fract() == 0.0) && values.is_sorted());
        assert!(values.windows(2).all(|pair| pair[0] < pair[1]), "each whole number is once on the map");
        assert_eq!((values[0], values[values.len() - 1]), (f64::from(low), f64::from(high)));
        assert!(high - low > 200 || values.len() == (high - low + 1) as usize);
        let crossing = found.crossings.iter().find(|crossing| crossing.is_certain).expect("a crossing");
        assert!(
            crossing.low < middle && middle < crossing.high && crossing.low.fract() == 0.0,
            "{crossing:?}"
        );
        assert!(crossing.estimates.iter().all(|at| (crossing.low..=crossing.high).contains(at)));
        drive::assert_order_is_irrelevant(&question, &runs, 8, 2);
        drive::assert_order_is_irrelevant(&question, &runs[..runs.len() / 3], 8, 2);
    }
}

#[test]
fn a_boundary_over_a_number_and_a_whole_number_is_a_map() {
    let goal = json!({"boundary": {"of": {"probability": "jammed"}, "level": 0.3, "misclassified": 0.05}});
    let x = json!({"name": "/x", "low": 0.0, "high": 1.0});
    let question = asked(&[x, count(1, 6)], goal, 1500);
    let truth = |at: &[f64]| 1.0 / (1.0 + (12.0 * (at[0] + at[1] / 10.0 - 0.8)).exp());
    let simulate = |coordinates: &[f64], replicate: u32| {
        let at = numbers(&question.factors, coordinates);
        let jammed = uniform(&mut generator(5, &at, replicate)) < truth(&at);
        responses(&[("jammed", f64::from(u8::from(jammed)))])
    };
    let (runs, decision) = study(&question, 4, 8, simulate);
    let Finding::Boundary(found) = &decision.answer.finding else { panic!("a boundary") };
    println!("{} runs", runs.len());
    assert_eq!((decision.finished, found.place), (Some(Finished::ByRule), Place::Inside));
    assert!(found.map.iter().all(|point| point.values[1].fract() == 0.0));
    let wrong = found.map.iter().filter(|point| (point.estimate > 0.3) != (truth(&point.values) > 0.3));
    let share = wrong.count() as f64 / found.map.len() as f64;
    assert!(share < 0.08, "{share}");
}

#[test]
fn effects_of_whole_numbers_are_those_over_the_whole_range() {
    let goal = json!({"sensitivity": {"of": [{"mean": "y"}], "width": 0.2, "method": "morris"}});
    let other =
        |high: u32| json!({"name": format!("/other{high}"), "low": 1, "high": high, "is_whole": true});
    let question = asked(&[count(1, 2), other(3), other(8)], goal, 2000);
    let simulate = |coordinates: &[f64], replicate: u32| {
        let at = numbers(&question.factors, coordinates);
        responses(&[("y", 3.0 * at[0] + at[1] + 0.01 * normal(&mut generator(5, &at, replicate)))])
    };
    let (_, decision) = study(&question, 4, 8, simulate);
    assert_eq!(decision.finished, Some(Finished::ByRule));
    let Finding::Sensitivity(finding) = &decision.answer.finding else { panic!("a sensitivity") };
    let Some(Effects::Morris(effects)) = &finding.measures[0].effects else { panic!("effects") };
    for (effect, truth) in effects.iter().zip([3.0, 2.0, 0.0]) {
        assert!((effect.mu - truth).abs() < 0.02, "{effect:?}, not {truth}");
        assert_eq!(effect.has_effect, Some(truth > 0.0), "{effect:?}");
    }
}

#[test]
fn estimates_are_made_at_levels() {
    let goal = json!({"estimate": {
        "points": [[3, "steel"], [3.0, "glass"]],
        "intervals": [{"of": {"probability": "jammed"}, "width": 0.3}],
    }});
    let question = asked(&[count(1, 6), walls()], goal, 400);
    let simulate = |coordinates: &[f64], _: u32| {
        let is_steel = numbers(&question.factors, coordinates) == [3.0, 1.0];
        responses(&[("jammed", f64::from(u8::from(is_steel)))])
    };
    let (_, decision) = study(&question, 4, 8, simulate);
    assert_eq!(decision.finished, Some(Finished::ByRule));
    let Finding::Estimate(found) = &decision.answer.finding else { panic!("an estimate") };
    let shares: Vec<f64> =
        found.points.iter().map(|point| point.measures[0].estimated.unwrap().value).collect();
    assert_eq!((shares, &found.points[0].values), (vec![1.0, 0.0], &vec![json!(3), json!("steel")]));
}

#[test]
fn faults_about_levels_say_how_to_fix_them() {
    let faults = |factors: &[Value], goal: Value| -> Vec<(String, String, String)> {
        let document = json!({"factors": factors, "goal": goal, "budget": {"max_runs": 1000}});
        let faults = Question::read(&document).unwrap_err().into_iter();
        faults.map(|fault| (fault.pointer, fault.detail, fault.allowed)).collect()
    };
    let boundary = json!({"boundary": {"of": {"probability": "jammed"}, "level": 0.05}});
    let [(pointer, detail, allowed)] = &faults(&[count(1, 9), walls()], boundary)[..] else {
        panic!("one fault")
    };
    assert_eq!(pointer, "/factors/1/levels");
    assert!(
        detail.starts_with("/walls has levels") && allowed.contains("a study for each level"),
        "{detail}: {allowed}"
    );
    let morris = json!({"sensitivity": {"of": [{"mean": "y"}], "width": 0.5, "method": "morris"}});
    let [(pointer, _, allowed)] = &faults(&[count(1, 9), walls()], morris)[..] else { panic!("one fault") };
    assert!(pointer == "/factors/1/levels" && allowed.contains("`sobol`"), "{allowed}");
    let estimate = json!({"estimate": {
        "points": [[2.5, "steel"], [2, "wood"], ["two", "steel"]],
        "intervals": [{"of": {"mean": "y"}, "width": 1.0}],
    }});
    let found = faults(&[count(1, 9), walls()], estimate);
    let pointers: Vec<(&str, &str)> =
        found.iter().map(|(pointer, _, allowed)| (pointer.as_str(), allowed.as_str())).collect();
    let whole = "a whole number from 1 to 9";
    let levels = r#"one of "rubber", "steel", "glass""#;
    assert_eq!(
        pointers,
        [
            ("/goal/estimate/points/0/0", whole),
            ("/goal/estimate/points/1/1", levels),
            ("/goal/estimate/points/2/0", whole)
        ]
    );
}
