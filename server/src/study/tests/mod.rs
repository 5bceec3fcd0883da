//! Evidence, trials and sentences of studies.

mod calibration;
mod factors;
mod impossible;
mod seeding;

use std::collections::BTreeSet;

use roost_api::ids::{JobId, SweepId};
use roost_api::job::{FailureClass, JobState};
use roost_api::study::StudyEnd;
use roost_api::table::TrialRow;
use roost_solver::Limits;
use roost_solver::mesh::Meshes;
use serde_json::{Map, Value, json};

use super::{Copied, Observation, Present, Ranges, Source, Study, SweepRun, read};
use crate::sweep::SweepLimits;

const GATE: &str = "/equipment/gate_opening_m";
const SPEED: &str = "/equipment/belt_speed_m_s";

fn document(goal: Value) -> Value {
    json!({"name": "a study",
           "base": {"experiment": "hopper", "seed": 7, "product": {"count": 6, "subparticle_radius_m": 0.008}},
           "factors": [{"pointer": GATE, "low": 0.03, "high": 0.09}, {"pointer": SPEED, "low": 0.1, "high": 1.0, "scale": "log"}],
           "goal": goal, "budget": {"max_runs": 60}})
}

fn study(goal: Value) -> Study {
    let limits = SweepLimits { max_jobs: 1000, scenario: Limits::NONE };
    read(document(goal), &Meshes::default(), limits).unwrap().0
}

fn boundary() -> Value {
    json!({"boundary": {"of": {"probability": "jammed"}, "level": 0.05}})
}

/// A study as the store has it, with other ranges.
fn present(study: &Study, ranges: Option<Ranges>) -> Present {
    let (submitted, seeding) = (study.spec.clone(), study.seeding.clone());
    Present { submitted, max_runs: 60, ranges, past_attempts: 0, seeding, impossible: Vec::new() }
}

/// Trials of a decision in a state, with a response.
fn trials(
    study: &Study,
    before: &[TrialRow],
    wanted: usize,
    state: JobState,
    jammed: &dyn Fn(f64) -> u8,
) -> Vec<TrialRow> {
    let mut levels: Vec<(u32, Map<String, Value>)> =
        before.iter().map(|row| (row.point, row.factors.clone())).collect();
    let decided = study.decide(before, &[], wanted).unwrap();
    let rows = decided.trials.into_iter().map(|trial| {
        if let Some(new) = trial.levels {
            levels.push((trial.point, new));
        }
        let factors = levels.iter().find(|(point, _)| *point == trial.point).unwrap().1.clone();
        let gate = factors[GATE].as_f64().unwrap();
        let responses = json!({"jammed": jammed(gate), "regime": "constant", "time_to_jam_s": null});
        TrialRow {
            job_id: JobId::new(),
            point: trial.point,
            replicate: trial.replicate,
            seed: trial.scenario.seed,
            factors,
            parameters: Map::new(),
            state,
            failure_class: (state == JobState::Failed).then_some(FailureClass::Unstable),
            backend: None,
            solver_revision: None,
            responses: if state == JobState::Succeeded {
                responses.as_object().unwrap().clone()
            } else {
                Map::new()
            },
        }
    });
    rows.collect()
}

#[test]
fn runs_have_seeds_of_their_own_and_the_values_of_their_point() {
    let study = study(boundary());
    let rows = trials(&study, &[], 40, JobState::Succeeded, &|_| 0);
    assert!(rows.len() >= 16, "{}", rows.len());
    let seeds: BTreeSet<u64> = rows.iter().map(|row| row.seed).collect();
    assert_eq!(seeds.len(), rows.len());
    let again = trials(&study, &[], 40, JobState::Succeeded, &|_| 0);
    assert!(
        rows.iter().zip(&again).all(|(one, other)| (one.seed, &one.factors) == (other.seed, &other.factors))
    );
    for row in &rows {
        let (gate, speed) = (row.factors[GATE].as_f64().unwrap(), row.factors[SPEED].as_f64().unwrap());
        assert!((0.03..=0.09).contains(&gate) && (0.1..=1.0).contains(&speed), "{gate} {speed}");
    }
}

#[test]
fn a_stored_study_decides_as_the_submitted_one() {
    let submitted = study(boundary());
    let stored = Study::stored(present(&submitted, None)).unwrap();
    let rows = trials(&submitted, &[], 12, JobState::Succeeded, &|gate| u8::from(gate < 0.05));
    let (one, other) = (submitted.decide(&rows, &[], 5).unwrap(), stored.decide(&rows, &[], 5).unwrap());
    let runs = |decided: &super::Decided| -> Vec<(u32, u32, u64)> {
        decided.trials.iter().map(|trial| (trial.point, trial.replicate, trial.scenario.seed)).collect()
    };
    assert_eq!(runs(&one), runs(&other));
    assert_eq!((one.answer, one.sentences), (other.answer, other.sentences));
    // Another order of results changes nothing.
    let reversed: Vec<TrialRow> = rows.iter().rev().cloned().collect();
    assert_eq!(
        runs(&stored.decide(&reversed, &[], 5).unwrap()),
        runs(&stored.decide(&rows, &[], 5).unwrap())
    );
}

#[test]
fn states_of_jobs_are_evidence() {
    let study = study(boundary());
    for (state, counts) in [
        (JobState::Queued, (0, 0, 4)),
        (JobState::Running, (0, 0, 4)),
        (JobState::Failed, (0, 4, 0)),
        (JobState::Succeeded, (4, 0, 0)),
        (JobState::Cancelled, (0, 0, 0)),
    ] {
        let rows = trials(&study, &[], 4, state, &|_| 1);
        let runs = study.decide(&rows, &[], 0).unwrap().answer.runs;
        assert_eq!((runs.done, runs.failed, runs.pending), counts, "{state}");
    }
    // A cancelled run has no response, and its replicate is not used again.
    let rows = trials(&study, &[], 40, JobState::Cancelled, &|_| 1);
    let more = trials(&study, &rows, 10, JobState::Queued, &|_| 1);
    let place = |row: &TrialRow| (row.point, row.replicate);
    let places: BTreeSet<(u32, u32)> = rows.iter().chain(&more).map(place).collect();
    assert_eq!(places.len(), rows.len() + more.len());
}

#[test]
fn questions_and_answers_are_sentences() {
    let study = study(boundary());
    assert_eq!(
        study.question_sentence(),
        "Where is the probability of `jammed` equal to 0.05, for gate opening from 0.03 to 0.09 m and belt speed from 0.1 to 1 m/s?"
    );
    let rows = trials(&study, &[], 60, JobState::Succeeded, &|_| 0);
    let sentences = study.decide(&rows, &[], 0).unwrap().sentences;
    assert!(
        sentences
            .iter()
            .any(|sentence| sentence.ends_with("8 mm radius, dry surfaces and nothing outside the ranges.")),
        "{sentences:?}"
    );
    let optimise = self::study(json!({"optimise": {
        "objectives": [{"maximise": {"mean": "mean_rate_kg_s"}}],
        "constraints": [{"of": {"probability": "jammed"}, "at_most": 0.2}]}}));
    let asked = optimise.question_sentence();
    assert!(asked.starts_with("What maximises the mean rate"), "{asked}");
    assert!(asked.ends_with("so that the probability of `jammed` is at most 0.2?"), "{asked}");
    let decided = study.decide(&rows, &[], 0).unwrap();
    assert_ne!(decided.finished, Some(StudyEnd::NothingLeft));
}

#[test]
fn runs_that_could_still_have_jammed_are_counted() {
    let study = study(boundary());
    let mut rows = trials(&study, &[], 12, JobState::Succeeded, &|gate| u8::from(gate < 0.05));
    let unfinished = "without a jam ended with at least 5 % of the filled mass inside";
    let stated = |study: &Study, rows: &[TrialRow]| {
        let sentences = study.decide(rows, &[], 0).unwrap().sentences;
        sentences.into_iter().find(|sentence| sentence.contains(unfinished))
    };
    let end_with = |row: &mut TrialRow, inside_kg: f64| {
        row.responses.insert("inside_kg".to_owned(), json!(inside_kg));
        row.responses.insert("filled_kg".to_owned(), json!(1.0));
    };
    // Neither those that jammed nor those that emptied.
    rows.iter_mut().for_each(|row| end_with(row, 0.05));
    let open = rows.iter().filter(|row| row.responses["jammed"] == 0).count();
    assert!((2..rows.len()).contains(&open), "{open} of {}", rows.len());
    let sentence = stated(&study, &rows).expect("a sentence");
    assert!(sentence.starts_with(&format!("{open} runs {unfinished}")), "{sentence}");
    rows.iter_mut().for_each(|row| end_with(row, 0.049));
    assert_eq!(stated(&study, &rows), None);
    // A question about something else is not concerned.
    let rate = self::study(
        json!({"boundary": {"of": {"mean": "mean_rate_kg_s"}, "level": 2.0, "misclassified": 0.1}}),
    );
    for row in &mut rows {
        end_with(row, 0.5);
        row.responses.insert("mean_rate_kg_s".to_owned(), json!(2.5));
    }
    assert_eq!(stated(&rate, &rows), None);
}

/// A finished run of a sweep, at some values and with a seed.
fn sweep_run(gate: f64, speed: f64, seed: u64, change: &dyn Fn(&mut Value)) -> SweepRun {
    let mut scenario = document(boundary())["base"].clone();
    scenario["equipment"] = json!({"gate_opening_m": gate, "belt_speed_m_s": speed});
    scenario["seed"] = json!(seed);
    change(&mut scenario);
    let scenario = json!(roost_solver::scenario::from_value(&scenario).unwrap());
    let responses = json!({"jammed": u8::from(gate < 0.06), "regime": "constant"});
    let responses = responses.as_object().unwrap().clone();
    SweepRun { scenario, solver_revision: roost_solver::SOLVER_REVISION, responses }
}

fn copy(study: &mut Study, runs: &[SweepRun]) -> Vec<Observation> {
    let (counts, copies) = study.copy((SweepId::new(), "gates".to_owned(), 3), runs, &mut Copied::default());
    study.seeding.push(counts);
    copies
}

#[test]
fn runs_of_sweeps_are_evidence_outside_the_budget() {
    let mut study = study(boundary());
    let same = |_: &mut Value| {};
    let mut other_revision = sweep_run(0.05, 0.5, 9, &same);
    other_revision.solver_revision -= 1;
    let runs = [
        sweep_run(0.05, 0.5, 1, &same),
        sweep_run(0.05, 0.5, 2, &same),
        sweep_run(0.05, 0.5, 2, &same), // the same run again
        sweep_run(0.06, 0.5, 2, &same), // the same seed at another point
        sweep_run(0.10, 0.5, 3, &same), // outside the range
        sweep_run(0.05, 0.5, 3, &|scenario| scenario["product"]["count"] = json!(7)),
        other_revision,
    ];
    let copies = copy(&mut study, &runs);
    let counts = study.seeding[0].clone();
    assert_eq!(
        (counts.copied, counts.repeated, counts.other_scenarios, counts.other_revisions),
        (4, 1, 1, 1)
    );
    assert_eq!(counts.first_difference.as_deref(), Some("/product/count"));
    assert!(counts.shares_seeds);
    let decided = study.decide(&[], &copies, 100).unwrap();
    assert_eq!((decided.answer.runs.done, decided.answer.runs.pending), (3, 0));
    // More copies than the budget has runs leave all of it.
    let many: Vec<SweepRun> = (0..70).map(|seed| sweep_run(0.05, 0.5, 100 + seed, &same)).collect();
    let many = copy(&mut self::study(boundary()), &many);
    assert!(!study.decide(&[], &many, 10).unwrap().trials.is_empty());
    let sentences = decided.sentences.join(" ");
    for part in [
        "It uses 3 runs of the sweep `gates`",
        "1 run outside the ranges, 1 run of other scenarios (the first differs in `/product/count`), 1 run of other solver revisions, 3 runs without a result and 1 run that repeat another",
        "have seeds in common",
    ] {
        assert!(sentences.contains(part), "{part}: {sentences}");
    }
}

#[test]
fn no_run_repeats_an_observation() {
    let mut study = study(boundary());
    // An earlier study of the same base had these runs, with the seeds that this one would choose.
    let before = trials(&study, &[], 40, JobState::Succeeded, &|_| 1);
    let level = |row: &TrialRow, name: &str| row.factors[name].as_f64().unwrap();
    let run = |row: &TrialRow| sweep_run(level(row, GATE), level(row, SPEED), row.seed, &|_| {});
    // Of each point all runs but the first.
    let runs: Vec<SweepRun> = before.iter().filter(|row| row.replicate > 0).map(run).collect();
    assert!(runs.len() >= 10);
    let copies = copy(&mut study, &runs);
    assert_eq!(copies.len(), runs.len());
    let decided = study.decide(&[], &copies, 40).unwrap();
    let known: BTreeSet<u64> = copies.iter().map(|copy| copy.seed).collect();
    assert!(decided.trials.len() >= 10);
    assert!(decided.trials.iter().all(|trial| !known.contains(&trial.scenario.seed)));
    // Replicate 0 of the points belongs to the copies.
    assert!(decided.trials.iter().any(|trial| trial.replicate > 0));
    // A run with the same point and seed counts once.
    let twice: Vec<Observation> = copies.iter().chain(&copies).cloned().collect();
    assert_eq!(study.decide(&[], &twice, 0).unwrap().answer.runs.done, copies.len());
    let as_jobs: Vec<TrialRow> = before.iter().filter(|row| row.replicate > 0).cloned().collect();
    assert_eq!(study.decide(&as_jobs, &copies, 0).unwrap().answer.runs.done, copies.len());
    assert!(copies.iter().all(|copy| matches!(copy.source, Source::Sweep(_))));
}

#[test]
fn a_wider_range_keeps_all_runs_and_begins_confirmations_again() {
    let goal = json!({"optimise": {"objectives": [{"minimise": {"probability": "jammed"}}]}});
    let narrow = study(goal);
    let mut rows = Vec::new();
    let jammed = |gate: f64| u8::from(gate < 0.06);
    let finished = loop {
        rows.extend(trials(&narrow, &rows, 10, JobState::Succeeded, &jammed));
        let decided = narrow.decide(&rows, &[], 10).unwrap();
        if let Some(end) = decided.finished {
            break end;
        }
    };
    assert_eq!(finished, StudyEnd::ByRule);
    let confirmed = rows.iter().map(|row| row.replicate).max().unwrap();
    assert!((1_000_000..2_000_000).contains(&confirmed));
    let wider = |past_attempts: u32| {
        let ranges = Some(vec![(0.02, 0.5), (0.1, 1.0)]);
        Study::stored(Present { past_attempts, max_runs: 400, ..present(&narrow, ranges) }).unwrap()
    };
    // Without the count of attempts, the old confirmation would answer the new question.
    assert_eq!(wider(0).decide(&rows, &[], 10).unwrap().finished, Some(StudyEnd::ByRule));
    let wide = wider(confirmed / 1_000_000);
    let decided = wide.decide(&rows, &[], 10).unwrap();
    assert_eq!((decided.finished, decided.answer.runs.done), (None, rows.len()));
    let seeds: BTreeSet<u64> = rows.iter().map(|row| row.seed).collect();
    let places: BTreeSet<(u32, u32)> = rows.iter().map(|row| (row.point, row.replicate)).collect();
    let mut more = rows.clone();
    let finished = loop {
        let new = trials(&wide, &more, 10, JobState::Succeeded, &jammed);
        assert!(
            new.iter().all(|row| !seeds.contains(&row.seed) && !places.contains(&(row.point, row.replicate)))
        );
        more.extend(new);
        if let Some(end) = wide.decide(&more, &[], 10).unwrap().finished {
            break end;
        }
    };
    assert_eq!(finished, StudyEnd::ByRule);
    assert!(more[rows.len()..].iter().any(|row| row.replicate >= 2_000_000), "a new confirmation");
}
