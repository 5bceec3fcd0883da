//! Points of the ranges whose scenarios have faults.

use std::collections::BTreeSet;

use roost_api::job::JobState;
use roost_api::table::TrialRow;
use roost_solver::Limits;
use roost_solver::mesh::Meshes;
use serde_json::{Map, Value, json};

use super::{GATE, boundary, document, present};
use crate::study::impossible::impossible_points;
use crate::study::{Present, Study, read};
use crate::sweep::SweepLimits;

const HEIGHT: &str = "/equipment/hopper_height_m";

/// A study of 10 gates and 9 heights: too many combinations to check all of them, and some gates open above the hopper.
fn study(goal: Value) -> Study {
    let mut document = document(goal);
    document["factors"] = json!([
        {"pointer": GATE, "levels": [0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.06]},
        {"pointer": HEIGHT, "levels": [0.6, 0.55, 0.5, 0.45, 0.4, 0.35, 0.3, 0.25, 0.2]},
    ]);
    document["budget"] = json!({"max_runs": 400});
    let limits = SweepLimits { max_jobs: 1000, scenario: Limits::NONE };
    read(document, &Meshes::default(), limits).unwrap().0
}

/// Decides until the study ends, with the answer stored in between as the store does. Returns its trials, answer and sentences.
fn play(goal: Value) -> (Vec<TrialRow>, Value, Vec<String>) {
    let first = study(goal);
    let (mut rows, mut answer): (Vec<TrialRow>, Option<Value>) = (Vec::new(), None);
    let mut levels: Vec<(u32, Map<String, Value>)> = Vec::new();
    loop {
        let impossible = impossible_points(answer.as_ref()).unwrap();
        let stored = Present { max_runs: 400, impossible, ..present(&first, None) };
        let decided = Study::stored(stored).unwrap().decide(&rows, &[], 12).unwrap();
        let found = json!(decided.answer);
        if decided.finished.is_some() {
            return (rows, found, decided.sentences);
        }
        answer = Some(found);
        for trial in decided.trials {
            levels.extend(trial.levels.map(|levels| (trial.point, levels)));
            let factors = levels.iter().find(|(point, _)| *point == trial.point).unwrap().1.clone();
            let rate = factors[GATE].as_f64().unwrap() - 0.2 * factors[HEIGHT].as_f64().unwrap();
            rows.push(TrialRow {
                job_id: roost_api::ids::JobId::new(),
                point: trial.point,
                replicate: trial.replicate,
                seed: trial.scenario.seed,
                state: JobState::Succeeded,
                failure_class: None,
                backend: None,
                solver_revision: None,
                factors,
                parameters: Map::new(),
                responses: json!({"mean_rate_kg_s": rate}).as_object().unwrap().clone(),
            });
        }
    }
}

fn height_and_gate(values: &Value) -> (f64, f64) {
    (values[1].as_f64().unwrap(), values[0].as_f64().unwrap())
}

#[test]
fn study_excludes_impossible_points_and_reports_them() {
    let goal = json!({"optimise": {"objectives": [{"maximise": {"mean": "mean_rate_kg_s"}}]}});
    let (rows, answer, sentences) = play(goal);
    assert!(rows.len() > 20);
    let best = height_and_gate(&answer["finding"]["optimise"]["recommended"][0]["values"]);
    assert_eq!(best, (0.45, 0.45), "the largest gate that any hopper allows, under the lowest such hopper");
    let impossible = answer["excluded"].as_array().unwrap();
    assert!(!impossible.is_empty());
    for point in impossible {
        let (height, gate) = height_and_gate(&point["values"]);
        assert!(gate > height, "{point}");
        assert!(point["impossible"].as_str().unwrap().starts_with("/equipment/gate_opening_m"), "{point}");
    }
    let named: BTreeSet<String> = impossible.iter().map(|point| point["values"].to_string()).collect();
    assert_eq!(named.len(), impossible.len(), "each once");
    let left_out = sentences.iter().find(|sentence| sentence.starts_with("Left out")).unwrap();
    assert!(left_out.starts_with("Left out because no scenario has their values"), "{left_out}");
    assert!(sentences.iter().any(|sentence| sentence.contains("the gate would open above the hopper")));
}

#[test]
fn a_sensitivity_loses_runs_that_cannot_be_made() {
    let goal = json!({"sensitivity": {"of": [{"mean": "mean_rate_kg_s"}], "method": "sobol", "width": 0.1}});
    let (rows, answer, _) = play(goal);
    assert!(rows.len() > 20);
    let lost = answer["finding"]["sensitivity"]["lost"].as_array().unwrap();
    assert!(!lost.is_empty());
    assert!(lost.iter().all(|run| {
        let (height, gate) = height_and_gate(&run["values"]);
        gate > height
    }));
}

#[test]
fn a_study_without_any_possible_point_says_why() {
    let limits = SweepLimits { max_jobs: 1000, scenario: Limits::NONE };
    let mut study = read(document(boundary()), &Meshes::default(), limits).unwrap().0;
    // A base that the server would have refused: every gate of the range opens above this hopper.
    study.spec.base["equipment"] = json!({"hopper_height_m": 0.01, "gate_opening_m": 0.005});
    let faults = Study::stored(present(&study, None)).unwrap().decide(&[], &[], 4).unwrap_err();
    assert!(faults[0].to_string().starts_with("/equipment/gate_opening_m"), "{}", faults[0]);
}

#[test]
fn estimate_excludes_impossible_points_at_once() {
    let gates = [0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.06];
    let heights = [0.6, 0.55, 0.5, 0.45, 0.4, 0.35, 0.3, 0.25, 0.2];
    let points: Vec<[f64; 2]> =
        gates.iter().rev().flat_map(|gate| heights.map(|height| [*gate, height])).collect();
    let impossible = points.iter().filter(|[gate, height]| gate > height).count();
    let goal = json!({"estimate": {"points": points, "intervals": [{"of": {"mean": "mean_rate_kg_s"}, "width": 1}]}});
    let decided = study(goal).decide(&[], &[], 400).unwrap();
    assert_eq!(decided.answer.excluded.len(), impossible);
    assert!(decided.trials.len() >= points.len() - impossible);
}
