//! Evidence, trials and sentences of studies.

use std::collections::BTreeSet;

use roost_api::ids::JobId;
use roost_api::job::{FailureClass, JobState};
use roost_api::study::StudyEnd;
use roost_api::table::TrialRow;
use roost_solver::Limits;
use roost_solver::mesh::Meshes;
use serde_json::{Map, Value, json};

use super::{Study, read};
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
    let decided = study.decide(before, wanted).unwrap();
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
    let stored = Study::stored(submitted.spec.clone(), 60).unwrap();
    let rows = trials(&submitted, &[], 12, JobState::Succeeded, &|gate| u8::from(gate < 0.05));
    let (one, other) = (submitted.decide(&rows, 5).unwrap(), stored.decide(&rows, 5).unwrap());
    let runs = |decided: &super::Decided| -> Vec<(u32, u32, u64)> {
        decided.trials.iter().map(|trial| (trial.point, trial.replicate, trial.scenario.seed)).collect()
    };
    assert_eq!(runs(&one), runs(&other));
    assert_eq!((one.answer, one.sentences), (other.answer, other.sentences));
    // Another order of results changes nothing.
    let reversed: Vec<TrialRow> = rows.iter().rev().cloned().collect();
    assert_eq!(runs(&stored.decide(&reversed, 5).unwrap()), runs(&stored.decide(&rows, 5).unwrap()));
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
        let runs = study.decide(&rows, 0).unwrap().answer.runs;
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
    let sentences = study.decide(&rows, 0).unwrap().sentences;
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
    let decided = study.decide(&rows, 0).unwrap();
    assert_ne!(decided.finished, Some(StudyEnd::NothingLeft));
}
