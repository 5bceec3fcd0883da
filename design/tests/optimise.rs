//! Studies of the goal `optimise` from the first run to the confirmed answer.

#[allow(dead_code, reason = "each test binary uses a part")]
mod drive;

use std::collections::BTreeSet;
use std::f64::consts::PI;

use drive::{generator, normal, numbers, question, responses, study, uniform};
use roost_design::goals::{ConfirmationState, FIRST_CONFIRMATION, OptimiseAnswer};
use roost_design::{Decision, Finding, Finished, Outcome, Question};
use serde_json::{Value, json};

fn factors(count: usize) -> Vec<Value> {
    (0..count).map(|index| json!({"name": format!("/x{index}"), "low": 0.0, "high": 1.0})).collect()
}

fn asked(count: usize, goal: Value, max_runs: usize) -> Question {
    question(
        &json!({"factors": factors(count), "goal": {"optimise": goal}, "budget": {"max_runs": max_runs}}),
    )
}

fn finding(decision: &Decision) -> &OptimiseAnswer {
    match &decision.answer.finding {
        Finding::Optimise(finding) => finding,
        other => panic!("{other:?}"),
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Branin's function over the unit square; its minimum is 0.397887.
fn branin(point: &[f64]) -> f64 {
    let (x, y) = (15.0 * point[0] - 5.0, 15.0 * point[1]);
    let bend = y - 5.1 / (4.0 * PI * PI) * x * x + 5.0 / PI * x - 6.0;
    bend * bend + 10.0 * (1.0 - 1.0 / (8.0 * PI)) * x.cos() + 10.0
}

const BRANIN: f64 = 0.397_887;

/// Asserts that Branin's function is minimised far better than by random search with the same runs.
fn assert_branin(repetitions: u64) {
    let budget = 80;
    let question = asked(2, json!({"objectives": [{"minimise": {"mean": "y"}}], "tolerance": 1e-4}), budget);
    let (mut regrets, mut random) = (Vec::new(), Vec::new());
    for seed in 0..repetitions {
        let (runs, decision) = study(&question, seed, 4, |point, _| responses(&[("y", branin(point))]));
        assert!(runs.len() <= budget);
        assert_eq!(decision.finished, Some(Finished::ByRule), "{:?}", finding(&decision));
        regrets.push(branin(&numbers(&finding(&decision).recommended[0].values)) - BRANIN);
        let mut generator = generator(seed, &[], 1);
        let values = (0..budget).map(|_| branin(&[uniform(&mut generator), uniform(&mut generator)]));
        random.push(values.fold(f64::INFINITY, f64::min) - BRANIN);
    }
    let (regret, by_chance) = (median(regrets), median(random));
    println!("median regret {regret:.5}, random search {by_chance:.5}");
    assert!(regret < 0.05 && regret < 0.1 * by_chance, "{regret}, random search {by_chance}");
}

#[test]
fn branin_is_minimised_with_few_runs() {
    assert_branin(5);
}

#[test]
#[ignore = "20 repetitions; their figures are in docs/accuracy.md"]
fn branin_is_minimised_in_many_studies() {
    assert_branin(20);
}

/// Cost and jam probability of a toy. Cost rises with both factors, jams fall with them.
fn toy(point: &[f64]) -> (f64, f64) {
    let cost = point[0] + 0.5 * point[1] + 0.3 * (point[0] - point[1]).powi(2);
    let jams = 1.0 / (1.0 + (30.0 * (0.7 * point[0] + point[1] - 0.75)).exp());
    (cost, jams)
}

/// The lowest cost where the jam probability is at most `limit`.
fn toy_optimum(limit: f64) -> f64 {
    let points = (0..=400).flat_map(|x| (0..=400).map(move |y| [f64::from(x) / 400.0, f64::from(y) / 400.0]));
    points
        .map(|point| toy(&point))
        .filter(|(_, jams)| *jams <= limit)
        .fold(f64::INFINITY, |best, (cost, _)| best.min(cost))
}

fn simulate_toy(seed: u64) -> impl Fn(&[f64], u32) -> Outcome {
    move |point, replicate| {
        let mut generator = generator(seed, point, replicate);
        let (cost, jams) = toy(point);
        let cost = cost + 0.05 * normal(&mut generator);
        responses(&[("cost", cost), ("jammed", f64::from(u8::from(uniform(&mut generator) < jams)))])
    }
}

fn toy_question(max_runs: usize) -> Question {
    let goal = json!({
        "objectives": [{"minimise": {"mean": "cost"}}],
        "constraints": [{"of": {"probability": "jammed"}, "at_most": 0.05}],
    });
    asked(2, goal, max_runs)
}

/// Random search with the same runs: 20 replicates at each point, and 172 runs for a confirmation of the cheapest point without
/// jams. Its cost; infinite when these runs do not certify it.
fn random_toy(seed: u64, runs: usize) -> f64 {
    let mut places = generator(seed, &[], 2);
    let mut best = (f64::INFINITY, f64::INFINITY);
    for _ in 0..(runs - 172) / 20 {
        let point = [uniform(&mut places), uniform(&mut places)];
        let (cost, jams) = toy(&point);
        let has_jammed = (0..20).any(|_| uniform(&mut places) < jams);
        if !has_jammed && cost < best.0 {
            best = (cost, jams);
        }
    }
    let mut jams = |runs: usize| (0..runs).filter(|_| uniform(&mut places) < best.1).count();
    let first = jams(86);
    let is_confirmed = first == 0 || (first <= 2 && first + jams(86) <= 2);
    if is_confirmed { best.0 } else { f64::INFINITY }
}

/// Asserts that the toy is minimised better than by random search with the same runs, and that few answers break the constraint.
fn assert_toy(repetitions: u64) {
    let question = toy_question(500);
    let optimum = toy_optimum(0.05);
    let (mut regrets, mut random, mut wrong, mut confirmed) = (Vec::new(), Vec::new(), 0, 0);
    for seed in 0..repetitions {
        let (runs, decision) = study(&question, seed, 40, simulate_toy(seed));
        assert!(runs.len() <= 500);
        let finding = finding(&decision);
        let Some(best) = finding.recommended.first() else {
            regrets.push(f64::INFINITY);
            random.push(random_toy(seed, 500) - optimum);
            continue;
        };
        let is_confirmed =
            best.confirmation.as_ref().is_some_and(|found| found.state == ConfirmationState::Confirmed);
        assert_eq!(is_confirmed, decision.finished == Some(Finished::ByRule));
        let (cost, jams) = toy(&numbers(&best.values));
        println!(
            "seed {seed}: {} runs, {:?}, regret {:.3}, P(jam) {jams:.4}, {} rejected, {:?}",
            runs.len(),
            best.values,
            cost - optimum,
            finding.rejected.len(),
            decision.finished
        );
        confirmed += u64::from(is_confirmed);
        wrong += u64::from(is_confirmed && jams > 0.05);
        regrets.push(cost - optimum);
        random.push(random_toy(seed, 500) - optimum);
    }
    let (regret, by_chance) = (median(regrets), median(random));
    println!(
        "median regret {regret:.4}, random search {by_chance:.4}; {confirmed} confirmed, {wrong} wrongly"
    );
    let least = repetitions * 9 / 10;
    assert!(regret < 0.15 && regret < 0.8 * by_chance, "{regret}, random search {by_chance}");
    assert!(confirmed >= least && wrong <= repetitions / 10, "{confirmed} confirmed, {wrong} wrongly");
}

#[test]
fn a_noisy_constrained_toy_is_minimised_and_confirmed() {
    assert_toy(5);
}

#[test]
#[ignore = "20 repetitions; their figures are in docs/accuracy.md"]
fn a_noisy_constrained_toy_is_minimised_in_many_studies() {
    assert_toy(20);
}

#[test]
fn confirmations_use_seeds_that_the_search_has_not_used() {
    let (runs, decision) = study(&toy_question(400), 5, 10, simulate_toy(5));
    let confirming: Vec<_> = runs.iter().filter(|run| run.replicate >= FIRST_CONFIRMATION).collect();
    assert!(confirming.len() >= 86, "0.95^86 is 0.0125");
    let best = &finding(&decision).recommended[0];
    let found = best.confirmation.as_ref().unwrap().constraints[0].unwrap();
    assert!(found.n >= 86 && found.high <= 0.05, "{found:?}");
    drive::assert_order_is_irrelevant(&toy_question(400), &runs, 10, 5);
    drive::assert_order_is_irrelevant(&toy_question(400), &runs[..runs.len() / 3], 10, 5);
}

#[test]
fn failed_confirmation_marks_its_point_and_the_search_continues() {
    // Runs jam in confirmations near the optimum alone: the search cannot know it before.
    let simulate = |point: &[f64], replicate: u32| {
        let is_trap = replicate >= FIRST_CONFIRMATION && (point[0] - 0.3).abs() < 0.02;
        responses(&[
            ("cost", (point[0] - 0.3).powi(2) + 0.01 * normal(&mut generator(1, point, replicate))),
            ("jammed", f64::from(u8::from(is_trap))),
        ])
    };
    let goal = json!({
        "objectives": [{"minimise": {"mean": "cost"}}],
        "constraints": [{"of": {"probability": "jammed"}, "at_most": 0.1}],
        "tolerance": 0.01,
    });
    let (_, decision) = study(&asked(1, goal, 600), 3, 20, simulate);
    let finding = finding(&decision);
    assert!(!finding.rejected.is_empty() && (numbers(&finding.rejected[0].values)[0] - 0.3).abs() < 0.02);
    assert_eq!(decision.finished, Some(Finished::ByRule), "{finding:?}");
    let distance = (numbers(&finding.recommended[0].values)[0] - 0.3).abs();
    assert!((0.02..0.15).contains(&distance), "{distance}");
}

#[test]
fn constraints_on_means_and_probabilities_hold_together() {
    // The cost rises with x; the load reaches 1 at x = 0.5, and jams are rare from 0.55 on.
    let simulate = |point: &[f64], replicate: u32| {
        let mut generator = generator(6, point, replicate);
        let jams = 1.0 / (1.0 + (40.0 * (point[0] - 0.45)).exp());
        responses(&[
            ("cost", point[0] + 0.02 * normal(&mut generator)),
            ("load", 2.0 * point[0] + 0.1 * normal(&mut generator)),
            ("free", f64::from(u8::from(uniform(&mut generator) >= jams))),
        ])
    };
    let goal = |load| {
        json!({
            "objectives": [{"minimise": {"mean": "cost"}}],
            "constraints": [
                {"of": {"mean": "load"}, "at_least": load},
                {"of": {"probability": "free"}, "at_least": 0.9},
            ],
        })
    };
    // The active constraint changes with the limit of the load.
    for (load, lowest, highest) in [(1.0, 0.5, 0.7), (1.6, 0.8, 0.85)] {
        let (_, decision) = study(&asked(1, goal(load), 700), 8, 20, simulate);
        let best = &finding(&decision).recommended[0];
        println!("load {load}: {best:?}");
        assert_eq!(decision.finished, Some(Finished::ByRule));
        assert!((lowest..highest).contains(&numbers(&best.values)[0]), "{:?}", best.values);
        let confirmation = best.confirmation.as_ref().unwrap();
        let bounds: Vec<_> = confirmation.constraints.iter().map(|bounds| bounds.unwrap()).collect();
        assert!(bounds[0].low >= load && bounds[1].low >= 0.9, "{bounds:?}");
    }
}

#[test]
fn two_quadratics_have_a_front_of_points_between_their_minima() {
    // |x − a|² and |x − b|²: the front is the straight line from a to b; f₂ = (d − √f₁)², d the distance of a and b.
    let squares = |point: &[f64]| {
        let of = |x: f64, y: f64| (point[0] - x).powi(2) + (point[1] - y).powi(2);
        [of(0.2, 0.3), of(0.8, 0.7)]
    };
    let simulate = |point: &[f64], replicate: u32| {
        let mut generator = generator(7, point, replicate);
        let [one, other] = squares(point);
        responses(&[
            ("one", one + 0.01 * normal(&mut generator)),
            ("other", 1.0 - other + 0.01 * normal(&mut generator)),
        ])
    };
    let goal = json!({
        "objectives": [{"minimise": {"mean": "one"}}, {"maximise": {"mean": "other"}}],
        "front_points": 6,
    });
    let question = asked(2, goal, 200);
    let (runs, decision) = study(&question, 2, 8, simulate);
    assert_eq!(decision.finished, Some(Finished::ByRule));
    let front = &finding(&decision).recommended;
    assert_eq!(front.len(), 6);
    let distance = (0.36_f64 + 0.16).sqrt();
    for point in front {
        let [one, other] = squares(&numbers(&point.values));
        // Distance of the sum of roots from that on the front.
        let excess = one.sqrt() + other.sqrt() - distance;
        println!("{:?}: {one:.3}, {other:.3}, excess {excess:.4}", point.values);
        assert!(excess < 0.03, "{:?} is {excess} from the front", point.values);
    }
    let firsts: Vec<f64> = front.iter().map(|point| squares(&numbers(&point.values))[0]).collect();
    assert!(firsts.is_sorted_by(|one, other| *one <= other + 0.02), "{firsts:?}");
    assert!(firsts[0] < 0.03 && firsts[5] > 0.3, "the front is covered: {firsts:?}");
    drive::assert_order_is_irrelevant(&question, &runs[..100], 8, 2);
}

#[test]
fn search_avoids_regions_where_runs_fail() {
    // The optimum lies where all runs fail; the best of the rest is at 0.5.
    let simulate = |point: &[f64], _| {
        if point[0] > 0.5 { Outcome::Failed } else { responses(&[("y", (point[0] - 0.8).powi(2))]) }
    };
    let question = asked(1, json!({"objectives": [{"minimise": {"mean": "y"}}]}), 80);
    let (runs, decision) = study(&question, 1, 4, simulate);
    let best = numbers(&finding(&decision).recommended[0].values)[0];
    let failed = runs.iter().filter(|run| run.outcome == Outcome::Failed).count();
    println!("{best}, {failed} failed of {}", runs.len());
    assert!((0.45..=0.5).contains(&best), "{best}");
    assert!(!decision.answer.excluded.is_empty() && failed < 40, "{failed} of {} failed", runs.len());
}

#[test]
fn large_batch_is_spread_over_several_points() {
    let question = toy_question(2000);
    let (runs, _) = study(&toy_question(400), 3, 40, simulate_toy(3));
    let evidence = roost_design::Evidence::new(runs[..100].iter().cloned());
    let start = std::time::Instant::now();
    let decision = roost_design::decide(&question, &evidence, 200, 3);
    println!("200 proposals: {:?}", start.elapsed());
    assert_eq!(decision.proposals.len(), 200);
    let points: BTreeSet<_> = decision.proposals.iter().map(|proposal| &proposal.point).collect();
    assert!(points.len() >= 5, "{} points", points.len());
}

fn pointers(document: &Value) -> Vec<String> {
    Question::read(document).unwrap_err().into_iter().map(|fault| fault.pointer).collect()
}

#[test]
fn faults_name_field_value_and_allowed_range() {
    let mut document = json!({
        "factors": factors(2),
        "goal": {"optimise": {
            "objectives": [],
            "constraints": [
                {"of": {"probability": "jammed"}, "at_most": 1.5},
                {"of": {"mean": "y"}},
            ],
            "tolerance": 0.0,
        }},
        "budget": {"max_runs": 100},
    });
    assert_eq!(
        pointers(&document),
        [
            "/goal/optimise/objectives",
            "/goal/optimise/constraints/0/at_most",
            "/goal/optimise/constraints/1",
            "/goal/optimise/tolerance",
        ]
    );
    document["goal"]["optimise"] = json!({
        "objectives": [{"minimise": {"mean": "y"}}],
        "constraints": [{"of": {"probability": "jammed"}, "at_most": 0.05}],
    });
    assert_eq!(pointers(&document), ["/budget/max_runs"]);
    document["goal"]["optimise"]["confirmation_runs"] = json!(20);
    assert_eq!(pointers(&document), ["/goal/optimise/confirmation_runs"]);
}

#[test]
fn limits_and_objectives_of_one_measure_suit_each_other() {
    let document = |goal: Value| json!({"factors": factors(2), "goal": {"optimise": goal}, "budget": {"max_runs": 2000}});
    let limited = |constraints: Value| {
        document(json!({"objectives": [{"minimise": {"mean": "y"}}], "constraints": constraints}))
    };
    let (jam, load) = (json!({"probability": "jammed"}), json!({"mean": "load"}));
    for (constraints, index, allowed) in [
        (json!([{"of": jam, "at_most": 0.05}, {"of": jam, "at_least": 0.5}]), 1, "`at_least` below 0.05"),
        (
            json!([{"of": jam, "at_least": 0.5}, {"of": load, "at_most": 1}, {"of": jam, "at_most": 0.05}]),
            2,
            "`at_most` above 0.5",
        ),
        (json!([{"of": load, "at_least": 2.5}, {"of": load, "at_most": 2.5}]), 1, "`at_most` above 2.5"),
        (
            json!([{"of": load, "at_most": 2}, {"of": load, "at_most": 3}]),
            1,
            "one `at_most` and one `at_least` for each measure",
        ),
    ] {
        let faults = Question::read(&limited(constraints)).unwrap_err();
        let [fault] = faults.as_slice() else { panic!("{faults:?}") };
        let at = format!("/goal/optimise/constraints/{index}");
        assert_eq!((&fault.pointer, fault.allowed.as_str()), (&at, allowed));
    }
    let band = json!([{"of": load, "at_least": 1}, {"of": load, "at_most": 2}, {"of": jam, "at_most": 0.05}]);
    assert!(Question::read(&limited(band)).is_ok());
    for second in [json!({"maximise": {"mean": "y"}}), json!({"minimise": {"mean": "y"}})] {
        let goal = json!({"objectives": [{"minimise": {"mean": "y"}}, second]});
        assert_eq!(pointers(&document(goal)), ["/goal/optimise/objectives/1"]);
    }
}
