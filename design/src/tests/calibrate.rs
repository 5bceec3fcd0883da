//! Calibrations of functions in place of simulations, against closed forms.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use crate::goals::CalibrateAnswer;
use crate::{Decision, Evidence, Finding, Finished, Outcome, Question, Run, decide};

/// The responses of a run of a test with some parameters; none for a failure.
type Simulation<'a> = &'a dyn Fn(&[f64], &str) -> Option<Vec<(&'static str, f64)>>;

fn question(parameters: &[&str], tests: &[&str], goal: Value, max_runs: usize) -> Question {
    let mut factors: Vec<Value> =
        parameters.iter().map(|name| json!({"name": name, "low": 0.0, "high": 1.0})).collect();
    if tests.len() > 1 {
        factors.push(json!({"name": "test", "levels": tests}));
    }
    let document = json!({"factors": factors, "goal": {"calibrate": goal}, "budget": {"max_runs": max_runs}});
    Question::read(&document).unwrap()
}

fn target(test: &str, response: &str, mean: f64, deviation: f64, n: u64) -> Value {
    json!({"test": test, "of": {"mean": response}, "mean": mean, "deviation": deviation, "n": n})
}

fn outcome(question: &Question, run: &Run, simulation: Simulation<'_>) -> Outcome {
    let levels = run.point.levels(&question.factors);
    let numbers: Vec<f64> = levels.iter().filter_map(Value::as_f64).collect();
    let test = levels.iter().find_map(Value::as_str).unwrap_or("only").to_owned();
    match simulation(&numbers, &test) {
        Some(responses) => {
            let named = responses.into_iter().map(|(name, value)| (name.to_owned(), value));
            Outcome::Responses(named.collect::<BTreeMap<_, _>>())
        }
        None => Outcome::Failed,
    }
}

/// Decides and runs in turns, `workers` runs at a time, until the study has ended.
fn conduct(
    question: &Question,
    workers: usize,
    seed: u64,
    simulation: Simulation<'_>,
) -> (Decision, Vec<Run>) {
    let mut runs: Vec<Run> = Vec::new();
    loop {
        let decision = decide(question, &Evidence::new(runs.clone()), workers, seed);
        if decision.finished.is_some() {
            return (decision, runs);
        }
        assert!(!decision.proposals.is_empty(), "idle and unfinished");
        for proposal in decision.proposals {
            let known =
                runs.iter().any(|run| (&run.point, run.replicate) == (&proposal.point, proposal.replicate));
            assert!(!known, "proposed twice: {proposal:?}");
            let run = Run { point: proposal.point, replicate: proposal.replicate, outcome: Outcome::Pending };
            let outcome = outcome(question, &run, simulation);
            runs.push(Run { outcome, ..run });
        }
    }
}

fn answer(decision: &Decision) -> &CalibrateAnswer {
    match &decision.answer.finding {
        Finding::Calibrate(answer) => answer,
        _ => panic!("a calibration"),
    }
}

#[test]
fn linear_response_gives_the_normal_posterior() {
    // y = 2 + 3 a with a mean of 3.5 and a standard error of 0.15: a is 0.5 with 0.05.
    let goal = json!({"targets": [target("only", "y", 3.5, 1.5, 100)]});
    let question = question(&["a"], &["only"], goal, 40);
    let (decision, runs) = conduct(&question, 3, 1, &|a, _| Some(vec![("y", 2.0 + 3.0 * a[0])]));
    assert_eq!(decision.finished, Some(Finished::ByRule));
    assert!(runs.len() < 20, "{}", runs.len());
    let found = answer(&decision);
    let a = &found.parameters[0];
    assert!((a.estimate.mean - 0.5).abs() < 0.005, "{a:?}");
    assert!((a.estimate.low - 0.401).abs() < 0.012 && (a.estimate.high - 0.599).abs() < 0.012, "{a:?}");
    assert!((a.best - 0.5).abs() < 0.01, "{a:?}");
    assert!((a.remaining - 0.05 * 12.0_f64.sqrt()).abs() < 0.02, "{a:?}");
    assert!(found.r_hat.unwrap() < 1.05 && found.effective_samples.unwrap() > 500.0, "{found:?}");
    let agreement = &found.targets[0];
    assert!(agreement.distance.unwrap().abs() < 0.2 && !agreement.is_contradicted(), "{agreement:?}");
}

#[test]
fn few_replicates_have_the_tails_of_students_t() {
    let interval = |n: u64| {
        let deviation = 0.02 * (n as f64).sqrt();
        let goal = json!({"targets": [target("only", "y", 0.5, deviation, n)]});
        let question = question(&["a"], &["only"], goal, 40);
        let (decision, _) = conduct(&question, 1, 1, &|a, _| Some(vec![("y", a[0])]));
        let estimate = answer(&decision).parameters[0].estimate;
        estimate.high - estimate.low
    };
    // Student's t at 97.5 %: 4.30 for two degrees of freedom, 1.97 for 199.
    let ratio = interval(3) / interval(200);
    assert!((1.9..2.5).contains(&ratio), "{ratio}");
}

#[test]
fn normal_prior_is_combined_with_the_measurement() {
    let normal = json!({"parameter": "a", "normal": {"mean": 0.3, "deviation": 0.05}});
    let goal = json!({"targets": [target("only", "y", 0.5, 0.5, 100)], "priors": [normal]});
    let question = question(&["a"], &["only"], goal, 40);
    let (decision, _) = conduct(&question, 1, 1, &|a, _| Some(vec![("y", a[0])]));
    // Two normal densities of the same width: the product has its mean between, and 1/√2 of the width.
    let estimate = answer(&decision).parameters[0].estimate;
    assert!((estimate.mean - 0.4).abs() < 0.005, "{estimate:?}");
    assert!(
        (estimate.high - estimate.low - 2.0 * 1.96 * 0.05 / 2.0_f64.sqrt()).abs() < 0.015,
        "{estimate:?}"
    );
}

#[test]
fn unidentifiable_parameter_pair_is_reported_with_a_helpful_measurement() {
    let simulation: Simulation<'_> = &|x, test| {
        Some(match test {
            "one" => vec![("sum", x[0] + x[1]), ("difference", x[0] - x[1])],
            _ => vec![("third", x[2])],
        })
    };
    let targets = json!([target("one", "sum", 1.0, 0.1, 25), target("two", "third", 0.4, 0.1, 25)]);
    let question = question(&["a", "b", "c"], &["one", "two"], json!({"targets": targets}), 120);
    let (decision, runs) = conduct(&question, 4, 7, simulation);
    assert!(runs.len() < 100, "{}", runs.len());
    let found = answer(&decision);
    assert_eq!(found.pairs.len(), 1, "{:?}", found.pairs);
    assert_eq!(found.pairs[0].parameters, ["a".to_owned(), "b".to_owned()]);
    assert!(found.pairs[0].correlation < -0.9, "{:?}", found.pairs);
    let narrowing = &found.further[0];
    assert_eq!((narrowing.response.as_str(), narrowing.test.as_deref()), ("difference", Some("one")));
    assert!(narrowing.leaves < 0.3, "{narrowing:?}");
    let c = &found.parameters[2];
    assert!((c.estimate.mean - 0.4).abs() < 0.01 && c.remaining < 0.1, "{c:?}");
}

#[test]
fn parameters_whose_runs_fail_are_improbable() {
    let goal = json!({"targets": [target("only", "y", 0.5, 5.0, 25)]});
    let question = question(&["a"], &["only"], goal, 40);
    let simulation: Simulation<'_> = &|a, _| (a[0] < 0.6).then(|| vec![("y", a[0])]);
    let (decision, _) = conduct(&question, 2, 3, simulation);
    let found = answer(&decision);
    let a = &found.parameters[0].estimate;
    assert!(a.high < 0.75 && a.low < 0.05, "{a:?}");
    assert!(found.targets[0].without > 0);
}

#[test]
fn share_of_yes_is_binomial() {
    // 3 of 10 jammed; the log odds are linear in a. The posterior of p with a flat prior of the log odds is a beta distribution.
    let goal = json!({"targets": [
        {"test": "only", "of": {"probability": "jammed"}, "mean": 0.3, "deviation": 0.48, "n": 10}]});
    let question = question(&["a"], &["only"], goal, 300);
    let count = std::cell::Cell::new(0_u64);
    let simulation: Simulation<'_> = &|a, _| {
        count.set(count.get() + 1);
        let p = 1.0 / (1.0 + (6.0 * (a[0] - 0.5)).exp());
        // A low-discrepancy sequence in place of chance.
        let uniform = (count.get() as f64 * 0.618_033_988_749_895).fract();
        Some(vec![("jammed", f64::from(u8::from(uniform < p)))])
    };
    let (decision, _) = conduct(&question, 24, 5, simulation);
    let found = answer(&decision);
    let simulated = found.targets[0].simulated.unwrap();
    assert!((simulated.mean - 0.31).abs() < 0.07, "{simulated:?}");
    assert!(simulated.low < 0.15 && simulated.high > 0.5, "{simulated:?}");
}

#[test]
fn discrepancy_widens_intervals_and_curves_count_as_one_specimen() {
    let curve = |at: f64| {
        json!({"test": "only", "of": {"mean": format!("y@x={at}")}, "curve": {"name": "y", "at": at},
               "mean": 0.5, "deviation": 0.1, "n": 25})
    };
    let width = |goal: Value| {
        let question = question(&["a"], &["only"], goal, 60);
        let simulation: Simulation<'_> =
            &|a, _| Some(vec![("y@x=0", a[0]), ("y@x=0.5", a[0]), ("y@x=1", a[0])]);
        let (decision, _) = conduct(&question, 2, 2, simulation);
        let found = answer(&decision);
        let estimate = found.parameters[0].estimate;
        (estimate.high - estimate.low, found.discrepancy)
    };
    let (single, _) = width(json!({"targets": [curve(0.0)], "emulator_share": 0.01}));
    let (three, none) =
        width(json!({"targets": [curve(0.0), curve(0.5), curve(1.0)], "emulator_share": 0.01}));
    let (with, share) = width(json!({"targets": [curve(0.0)], "discrepancy": 0.1}));
    // Independent points would give 1/√3 = 0.58; the correlated ones give √(1/(1ᵀC⁻¹1)) = 0.82.
    assert!((three / single - 0.82).abs() < 0.06, "{three} {single}");
    assert!(with > 1.5 * single && none.is_none() && share.unwrap().mean > 0.03, "{with} {single} {share:?}");
}

#[test]
fn number_of_workers_changes_no_answer_beyond_the_emulators() {
    let goal = json!({"targets": [target("one", "y", 0.8, 0.1, 9), target("two", "z", 0.2, 0.05, 4)]});
    let question = question(&["a", "b"], &["one", "two"], goal, 80);
    let simulation: Simulation<'_> = &|x, test| {
        Some(if test == "one" { vec![("y", x[0] + 0.5 * x[1])] } else { vec![("z", x[0] * x[1])] })
    };
    let (one, _) = conduct(&question, 1, 11, simulation);
    let (many, _) = conduct(&question, 7, 11, simulation);
    for (one, other) in answer(&one).parameters.iter().zip(&answer(&many).parameters) {
        let width = one.estimate.high - one.estimate.low;
        assert!((one.estimate.mean - other.estimate.mean).abs() < 0.15 * width, "{one:?} {other:?}");
        assert!((other.estimate.high - other.estimate.low - width).abs() < 0.3 * width, "{one:?} {other:?}");
    }
}

#[test]
fn test_without_results_takes_no_runs_from_others_and_ends_the_study() {
    let goal = json!({"targets": [target("one", "y", 0.5, 0.1, 25), target("two", "z", 0.5, 0.1, 25)]});
    let question = question(&["a"], &["one", "two"], goal, 200);
    let simulation: Simulation<'_> = &|x, test| (test == "one").then(|| vec![("y", x[0])]);
    let (decision, runs) = conduct(&question, 3, 1, simulation);
    let found = answer(&decision);
    assert_eq!(decision.finished, Some(Finished::ByRule));
    assert!(runs.len() < 60, "{}", runs.len());
    assert!(found.targets[1].simulated.is_none() && found.targets[1].without >= 8, "{found:?}");
}

#[test]
fn equal_answers_of_yes_or_no_do_not_settle_a_share() {
    let goal = json!({"targets": [
        {"test": "only", "of": {"probability": "jammed"}, "mean": 0.3, "deviation": 0.48, "n": 10}]});
    let question = question(&["a"], &["only"], goal, 120);
    let (decision, _) = conduct(&question, 8, 5, &|_, _| Some(vec![("jammed", 0.0)]));
    let agreement = &answer(&decision).targets[0];
    // No run jams, and three of ten fillings did.
    assert!(agreement.simulated.unwrap().high < 0.2 && agreement.distance.unwrap() > 1.5, "{agreement:?}");
}

#[test]
fn calibration_works_with_a_measured_zero_and_single_replicates() {
    let goal = json!({"targets": [target("only", "y", 0.0, 0.0, 3)]});
    let document = json!({"factors": [{"name": "a", "low": -1.0, "high": 1.0}], "goal": {"calibrate": goal},
                          "budget": {"max_runs": 60, "max_replicates": 1}});
    let question = Question::read(&document).unwrap();
    let (decision, runs) = conduct(&question, 2, 1, &|a, _| Some(vec![("y", a[0])]));
    assert!(runs.iter().all(|run| run.replicate == 0));
    let estimate = answer(&decision).parameters[0].estimate;
    assert!(estimate.low < 0.0 && estimate.high > 0.0 && estimate.high - estimate.low < 0.1, "{estimate:?}");
}

#[test]
fn narrow_priors_of_many_parameters_keep_their_deviations() {
    let names = ["a", "b", "c", "d", "e"];
    let prior = |name: &&str| json!({"parameter": name, "normal": {"mean": 0.5, "deviation": 0.02}});
    let priors: Vec<Value> = names.iter().map(prior).collect();
    let goal = json!({"targets": [target("only", "y", 0.5, 0.5, 25)], "priors": priors});
    let question = question(&names, &["only"], goal, 60);
    let (decision, _) = conduct(&question, 8, 1, &|x, _| Some(vec![("y", x[0])]));
    for parameter in &answer(&decision).parameters {
        assert!((0.8..1.2).contains(&parameter.remaining), "{parameter:?}");
    }
}

#[test]
fn faults_name_field_and_allowed_values() {
    let document = json!({
        "factors": [{"name": "a", "low": 0.0, "high": 1.0}, {"name": "k", "low": 1, "high": 4, "is_whole": true}],
        "goal": {"calibrate": {
            "targets": [], "discrepancy": 2.0, "emulator_share": 0.0,
            "priors": [{"parameter": "b", "normal": {"mean": 1.0, "deviation": -1.0}},
                       {"parameter": "a", "log_normal": {"median": 1.0, "factor": 0.5}}]}},
        "budget": {"max_runs": 3}});
    let faults = Question::read(&document).unwrap_err();
    let pointers: Vec<&str> = faults.iter().map(|fault| fault.pointer.as_str()).collect();
    for expected in [
        "/factors/1",
        "/goal/calibrate/targets",
        "/goal/calibrate/priors/0/parameter",
        "/goal/calibrate/priors/0/normal/deviation",
        "/goal/calibrate/priors/1/log_normal/factor",
        "/goal/calibrate/discrepancy",
        "/goal/calibrate/emulator_share",
        "/budget/max_runs",
    ] {
        assert!(pointers.contains(&expected), "{expected}: {pointers:?}");
    }
    let below_zero = json!({
        "factors": [{"name": "a", "low": -0.1, "high": 1.0}], "budget": {"max_runs": 30},
        "goal": {"calibrate": {
            "targets": [target("only", "y", 1.0, 1.0, 2)],
            "priors": [{"parameter": "a", "log_normal": {"median": 1.0, "factor": 2.0}}]}}});
    let faults = Question::read(&below_zero).unwrap_err();
    assert_eq!(faults[0].pointer, "/goal/calibrate/priors/0/log_normal");
}
