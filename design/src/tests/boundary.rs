//! Tests of the goal `boundary` on synthetic truths.

mod hopper;
mod hypercube;
mod judge;
mod limit;
mod oracle;
mod truths;

use serde_json::{Value, json};

use crate::goals::{BoundaryAnswer, MapPoint, Place, Side};
use crate::tests::truth::{Random, play, run};
use crate::{Decision, Evidence, Finding, Finished, Outcome, Point, Proposal, Question, Run, decide};
use truths::{TRUTHS, Truth};

/// A question about the boundary of a truth.
fn question(truth: &Truth, max_runs: usize, misclassified: f64) -> Question {
    let factor = |index: usize| json!({ "name": format!("x{index}"), "low": 0.0, "high": 1.0 });
    let measure = if truth.noise.is_some() { "mean" } else { "probability" };
    let document = json!({
        "factors": (0..truth.factors).map(factor).collect::<Vec<_>>(),
        "goal": { "boundary": { "of": { measure: "y" }, "level": truth.level, "misclassified": misclassified } },
        "budget": { "max_runs": max_runs },
    });
    Question::read(&document).unwrap()
}

fn answer(decision: &Decision) -> &BoundaryAnswer {
    let Finding::Boundary(answer) = &decision.answer.finding else { panic!("a boundary") };
    answer
}

/// Whether no point of the map outside the band is on the wrong side.
fn holds(truth: &Truth, answer: &BoundaryAnswer) -> bool {
    answer.map.iter().all(|point| match point.side {
        Side::Band => true,
        Side::Above => truth.mean(&point.values) >= truth.level,
        Side::Below => truth.mean(&point.values) <= truth.level,
    })
}

/// Share of the map on the wrong side of the estimated boundary.
fn misclassified(truth: &Truth, map: &[MapPoint]) -> f64 {
    let is_wrong =
        |point: &&MapPoint| (point.estimate > truth.level) != (truth.mean(&point.values) > truth.level);
    map.iter().filter(is_wrong).count() as f64 / map.len() as f64
}

/// Results of a truth for proposals.
fn results(truth: &Truth, proposals: &[Proposal], random: &mut Random) -> Vec<Run> {
    proposals.iter().map(|next| run(next, "y", truth.draw(&next.point.coordinates(), random))).collect()
}

fn truth(name: &str) -> &'static Truth {
    TRUTHS.iter().find(|truth| truth.name.contains(name)).expect("a truth")
}

#[test]
fn a_crossing_of_one_factor_has_an_interval() {
    let truth = truth("1 factor, probability 0.5");
    let question = question(truth, 2000, 0.01);
    let mut held = 0;
    for repetition in 0..10 {
        let mut random = Random(repetition);
        let (_, decision) = play(&question, ("y", 20, repetition), |x| truth.draw(x, &mut random));
        assert_eq!(decision.finished, Some(Finished::ByRule));
        let answer = answer(&decision);
        assert_eq!((answer.place, answer.crossings.len()), (Place::Inside, 1), "{:?}", answer.crossings);
        let crossing = &answer.crossings[0];
        assert!(crossing.is_certain && crossing.high - crossing.low < 0.2, "{crossing:?}");
        let [estimate] = crossing.estimates[..] else { panic!("{crossing:?}") };
        assert!(crossing.low < estimate && estimate < crossing.high);
        held += usize::from(crossing.low <= 0.62 && 0.62 <= crossing.high);
    }
    assert!(held >= 9, "{held} of 10 intervals hold the true crossing");
}

#[test]
fn the_band_holds_the_boundary_of_two_factors() {
    let mut held = 0;
    for name in ["2 factors, curved", "2 factors, wavy"] {
        let truth = truth(name);
        for repetition in 0..4 {
            let mut random = Random(repetition);
            let (runs, decision) =
                play(&question(truth, 600, 0.03), ("y", 40, repetition), |x| truth.draw(x, &mut random));
            let answer = answer(&decision);
            assert_eq!((decision.finished, answer.place), (Some(Finished::ByRule), Place::Inside));
            assert!(answer.misclassified.unwrap() <= 0.03);
            assert!(2 * answer.observed.len() < runs.len(), "replicates of noisy points");
            held += usize::from(holds(truth, answer));
        }
    }
    assert!(held >= 7, "{held} of 8 bands hold the true boundary");
}

#[test]
fn level_that_is_never_reached_has_no_boundary() {
    for (level, place) in [(3.0, Place::NowhereAllBelow), (-5.0, Place::NowhereAllAbove)] {
        let truth = Truth { level, ..*truth("2 factors, closed") };
        let (runs, decision) = play(&question(&truth, 500, 0.02), ("y", 20, 1), {
            let mut random = Random(5);
            let truth = &truth;
            move |x| truth.draw(x, &mut random)
        });
        let answer = answer(&decision);
        assert_eq!((decision.finished, answer.place), (Some(Finished::ByRule), place));
        assert!(answer.map.iter().all(|point| point.low > level || point.high < level));
        assert!(runs.len() <= 100, "{}", runs.len());
    }
}

#[test]
fn order_of_results_does_not_matter_and_nothing_is_proposed_twice() {
    let truth = truth("2 factors, tilted");
    let question = question(truth, 600, 0.001);
    let mut random = Random(3);
    let mut runs: Vec<Run> = Vec::new();
    for batch in [32, 60, 200, 200] {
        let decision = decide(&question, &Evidence::new(runs.clone()), batch, 9);
        assert!(!decision.proposals.is_empty() && decision.proposals.len() <= batch);
        for next in &decision.proposals {
            assert!(!runs.iter().any(|run| (&run.point, run.replicate) == (&next.point, next.replicate)));
            assert_eq!(next.point.rounded(&question.factors), next.point, "values lead back to the point");
        }
        let found = results(truth, &decision.proposals, &mut random);
        // The second half of each batch is still in flight.
        let half = found.len() / 2;
        runs.extend(
            found.into_iter().enumerate().map(|(index, run)| {
                if index < half { run } else { Run { outcome: Outcome::Pending, ..run } }
            }),
        );
    }
    let expected = decide(&question, &Evidence::new(runs.clone()), 40, 9);
    assert_eq!(expected.proposals.len(), 40);
    for _ in 0..3 {
        for index in (1..runs.len()).rev() {
            runs.swap(index, (random.uniform() * (index + 1) as f64) as usize);
        }
        assert_eq!(decide(&question, &Evidence::new(runs.clone()), 40, 9), expected);
    }
    let landed = runs.iter().filter(|run| run.outcome != Outcome::Pending).cloned();
    let other = decide(&question, &Evidence::new(landed), 40, 9);
    assert_ne!(other.proposals, expected.proposals, "runs in flight count");
    assert_eq!(other.answer.finding, expected.answer.finding, "but are no evidence");
}

#[test]
fn two_half_batches_propose_the_same_runs_as_one_batch() {
    for name in ["2 factors, curved", "2 factors, wavy"] {
        let truth = truth(name);
        let question = question(truth, 600, 0.001);
        let mut random = Random(6);
        let mut runs: Vec<Run> = Vec::new();
        for _ in 0..3 {
            let decision = decide(&question, &Evidence::new(runs.clone()), 32, 2);
            runs.extend(results(truth, &decision.proposals, &mut random));
        }
        let whole = decide(&question, &Evidence::new(runs.clone()), 60, 2).proposals;
        let first = decide(&question, &Evidence::new(runs.clone()), 30, 2).proposals;
        assert_eq!(first, whole[..30]);
        // Runs in flight count as the choices before them in a batch do.
        runs.extend(first.into_iter().map(|Proposal { point, replicate }| Run {
            point,
            replicate,
            outcome: Outcome::Pending,
        }));
        assert_eq!(decide(&question, &Evidence::new(runs), 30, 2).proposals, whole[30..], "{name}");
    }
}

#[test]
fn runs_are_proposed_while_all_others_are_pending() {
    let question = question(truth("2 factors, tilted"), 2000, 0.02);
    let mut runs: Vec<Run> = Vec::new();
    for _ in 0..2 {
        let decision = decide(&question, &Evidence::new(runs.clone()), 100, 1);
        assert!(!decision.proposals.is_empty());
        runs.extend(decision.proposals.into_iter().map(|Proposal { point, replicate }| Run {
            point,
            replicate,
            outcome: Outcome::Pending,
        }));
    }
    assert_eq!(runs.len(), 132, "the first design, then 100 points more");
    assert_eq!(Evidence::new(runs.clone()).runs(), runs.len(), "all different");
}

#[test]
fn failures_in_a_corner_do_not_stop_a_study() {
    let truth = truth("2 factors, tilted");
    let question = question(truth, 400, 0.03);
    let mut random = Random(8);
    let mut runs: Vec<Run> = Vec::new();
    let decision = loop {
        let decision = decide(&question, &Evidence::new(runs.clone()), 20, 4);
        if decision.finished.is_some() {
            break decision;
        }
        for mut run in results(truth, &decision.proposals, &mut random) {
            let x = run.point.coordinates();
            if x[0] + x[1] < 0.5 {
                run.outcome = Outcome::Failed;
            }
            runs.push(run);
        }
    };
    assert!(!decision.answer.excluded.is_empty());
    assert!(
        decision.answer.excluded.iter().all(|point| point
            .values
            .iter()
            .filter_map(serde_json::Value::as_f64)
            .sum::<f64>()
            < 0.5
            && point.failed >= 3)
    );
    assert!(decision.answer.runs.failed < 100, "{:?}", decision.answer.runs);
    assert_eq!(answer(&decision).place, Place::Inside);
}

#[test]
fn constant_missing_and_huge_responses_do_not_stop_a_study() {
    type Response = fn(&[f64], usize) -> f64;
    let responses: [(&str, Response); 4] = [
        ("always the same", |_, _| 3.0),
        ("missing in every third run", |x, run| if run % 3 == 0 { f64::NAN } else { x[0] }),
        ("missing always", |_, _| f64::NAN),
        ("enormous", |x, _| (x[0] - 0.5) * 1e300),
    ];
    for name in ["2 factors, wavy", "2 factors, tilted"] {
        let question = question(truth(name), 50, 0.001);
        for (response, value) in responses {
            let mut runs = 0;
            let (runs, decision) = play(&question, ("y", 3, 1), |x| {
                runs += 1;
                value(x, runs)
            });
            assert!(decision.finished == Some(Finished::ByRule) || runs.len() == 50, "{name}, {response}");
        }
    }
}

#[test]
fn faults_of_a_boundary_have_their_pointers() {
    let pointers = |change: &dyn Fn(&mut Value)| -> Vec<String> {
        let mut document = serde_json::to_value(question(truth("3 factors, tilted"), 100, 0.02)).unwrap();
        change(&mut document);
        Question::read(&document).unwrap_err().into_iter().map(|fault| fault.pointer).collect()
    };
    let found = pointers(&|document| {
        document["goal"]["boundary"]["level"] = json!(1.0);
        document["goal"]["boundary"]["misclassified"] = json!(0.7);
    });
    assert_eq!(found, ["/goal/boundary/level", "/goal/boundary/misclassified"]);
    let found = pointers(&|document| {
        document["factors"].as_array_mut().unwrap().extend([
            json!({ "name": "a", "low": 0, "high": 1 }),
            json!({ "name": "b", "low": 0, "high": 1 }),
        ]);
    });
    assert_eq!(found, ["/factors"]);
}

/// Time that this thread has computed; other work of the machine does not count.
fn processor_seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// A decision about these runs, and the seconds that it takes.
fn timed_decision(truth: &Truth, runs: Vec<Run>) -> (Decision, f64) {
    let (evidence, question) = (Evidence::new(runs), question(truth, 10_000, 0.0001));
    let start = processor_seconds();
    let decision = decide(&question, &evidence, 200, 3);
    (decision, processor_seconds() - start)
}

/// The times are compared with each other, since machines differ. A model of all points would take the cube of their number.
const MOST_TIMES_AS_LONG: f64 = 3.0;

/// A decision takes about a second. A limit far above it finds those that became slow for any number of runs.
const MOST_SECONDS: f64 = 20.0;

#[test]
fn a_decision_about_five_times_as_many_replicates_takes_less_than_3_times_as_long() {
    for name in ["2 factors, curved", "2 factors, wavy"] {
        let truth = truth(name);
        let [few, many] = [2, 10].map(|replicates| {
            let points = (0..200).map(|index| Point::new(&crate::space::sobol(index, 2, 5)));
            let proposals: Vec<Proposal> = points
                .flat_map(|point| {
                    (0..replicates).map(move |replicate| Proposal { point: point.clone(), replicate })
                })
                .collect();
            let (decision, seconds) = timed_decision(truth, results(truth, &proposals, &mut Random(1)));
            assert_eq!(decision.proposals.len(), 200);
            seconds
        });
        println!("{name}: {few:.2} s for 400 runs, {many:.2} s for 2,000");
        assert!(many < (MOST_TIMES_AS_LONG * few).min(MOST_SECONDS), "{name}: {few} s and {many} s");
    }
}

#[test]
fn a_decision_about_four_times_as_many_points_takes_less_than_3_times_as_long() {
    for name in ["2 factors, curved", "2 factors, wavy"] {
        let truth = truth(name);
        let at = |index: usize| Point::new(&crate::space::sobol(index, 2, 5));
        let [few, many] = [500, 2000].map(|points| {
            let proposals: Vec<Proposal> =
                (0..points + 200).map(|index| Proposal { point: at(index), replicate: 0 }).collect();
            let mut runs = results(truth, &proposals, &mut Random(1));
            runs[points..].iter_mut().for_each(|run| run.outcome = Outcome::Pending);
            let (decision, seconds) = timed_decision(truth, runs);
            assert_eq!(decision.proposals.len(), 200);
            assert!(holds(truth, answer(&decision)), "{name}");
            seconds
        });
        println!("{name}: {few:.2} s for 500 points, {many:.2} s for 2,000");
        assert!(many < (MOST_TIMES_AS_LONG * few).min(MOST_SECONDS), "{name}: {few} s and {many} s");
    }
}

#[test]
fn misclassified_share_is_estimated_over_the_whole_range() {
    let truth = truth("4 factors");
    let question = question(truth, 10_000, 0.0001);
    let mut random = Random(2);
    let proposals: Vec<Proposal> = (0..150)
        .map(|index| Proposal { point: Point::new(&crate::space::sobol(index, 4, 5)), replicate: 0 })
        .collect();
    let evidence = Evidence::new(results(truth, &proposals, &mut random));
    let decision = decide(&question, &evidence, 0, 3);
    let model =
        crate::model::Model::fit(&question.factors, &crate::Measure::Mean("y".into()), evidence.points())
            .expect("a model");
    let points: Vec<Vec<f64>> = (0..4000).map(|_| (0..4).map(|_| random.uniform()).collect()).collect();
    let points = crate::model::kernel::columns(4, &points);
    let level = model.latent(truth.level);
    let predictions: Vec<_> = model.posteriors().map(|posterior| posterior.predict(&points)).collect();
    let share = (0..4000).map(|point| {
        let n = predictions.len() as f64;
        let mean = predictions.iter().map(|found| found.means[point]).sum::<f64>() / n;
        let square =
            predictions.iter().map(|found| found.variances[point] + found.means[point].powi(2)).sum::<f64>()
                / n;
        let distance = (mean - level).abs() / (square - mean * mean).sqrt();
        0.5 * statrs::function::erf::erfc(distance / std::f64::consts::SQRT_2)
    });
    let expected = share.sum::<f64>() / 4000.0;
    let found = answer(&decision).misclassified.unwrap();
    println!("wrong side: {found}, by 4,000 random points {expected}");
    assert!((found / expected - 1.0).abs() < 0.1, "{found}, not {expected}");
}

#[test]
fn proposals_without_results_are_limited_by_the_sobol_sequence() {
    let question = question(truth("2 factors, tilted"), 100_000, 0.02);
    let first = decide(&question, &Evidence::default(), 100, 1).proposals;
    let runs = first.into_iter().map(|Proposal { point, replicate }| Run {
        point,
        replicate,
        outcome: Outcome::Pending,
    });
    let evidence = Evidence::new(runs);
    let decision = decide(&question, &evidence, 70_000, 1);
    assert_eq!(decision.finished, None);
    let proposals = decision.proposals.len();
    assert!((60_000..65_536).contains(&proposals), "{proposals}");
}

#[test]
fn single_huge_outlier_is_excluded_and_reported() {
    let truth = truth("2 factors, wavy");
    let question = question(truth, 400, 0.03);
    let mut random = Random(4);
    let mut first = true;
    let (_, decision) = play(&question, ("y", 20, 2), |x| {
        if std::mem::take(&mut first) { 1e200 } else { truth.draw(x, &mut random) }
    });
    assert_eq!(decision.finished, Some(Finished::ByRule));
    assert!(holds(truth, answer(&decision)));
    assert_eq!(decision.answer.unusable[0].outliers, 1);
}
