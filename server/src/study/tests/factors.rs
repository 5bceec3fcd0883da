//! Factors with whole numbers and levels.

use std::collections::BTreeSet;

use roost_api::ids::JobId;
use roost_api::job::JobState;
use roost_api::study::StudyEnd;
use roost_api::table::TrialRow;
use roost_solver::Limits;
use roost_solver::mesh::Meshes;
use serde_json::{Map, Value, json};

use super::{GATE, boundary, copy, document, present, sweep_run, trials};
use crate::study::{Study, read};
use crate::sweep::SweepLimits;

const COUNT: &str = "/product/count";
const WALLS: &str = "/equipment/side_walls";

/// A study of a whole number and words.
fn mixed(goal: Value) -> Value {
    let mut document = document(goal);
    document["factors"] = json!([
        {"pointer": COUNT, "low": 6, "high": 12},
        {"pointer": WALLS, "levels": ["frictionless", "rough"]},
    ]);
    document["budget"] = json!({"max_runs": 400});
    document
}

fn read_faults(document: Value) -> Vec<(String, String)> {
    let limits = SweepLimits { max_jobs: 1000, scenario: Limits::NONE };
    let faults = read(document, &Meshes::default(), limits).unwrap_err();
    faults.into_iter().map(|fault| (fault.pointer, fault.detail)).collect()
}

fn optimise() -> Value {
    json!({"optimise": {"objectives": [{"maximise": {"mean": "mean_rate_kg_s"}}]}})
}

#[test]
fn whole_numbers_and_words_are_values_of_runs() {
    let limits = SweepLimits { max_jobs: 1000, scenario: Limits::NONE };
    let (study, expansion) = read(mixed(optimise()), &Meshes::default(), limits).unwrap();
    assert_eq!(expansion.points.len(), 4, "both ends of the range with every level");
    assert_eq!(
        study.question_sentence(),
        "What maximises the mean rate for count from 6 to 12 and side walls of frictionless or rough?"
    );
    let decided = study.decide(&[], &[], 30).unwrap();
    let levels: Vec<_> = decided.trials.iter().filter_map(|trial| trial.levels.as_ref()).collect();
    // The first design: two runs at each of 14 points in all, or fewer.
    assert!(levels.len() > 5 && decided.trials.len() == 2 * levels.len(), "{}", levels.len());
    assert!(levels.iter().all(|levels| levels[COUNT].is_i64() && levels[WALLS].is_string()), "{levels:?}");
    assert_eq!(
        levels.iter().map(|levels| json!(levels).to_string()).collect::<BTreeSet<_>>().len(),
        levels.len(),
        "each value is one point"
    );
    for trial in &decided.trials {
        let scenario = json!(trial.scenario);
        assert!((6..=12).contains(&scenario.pointer(COUNT).unwrap().as_u64().unwrap()));
    }
    let words: BTreeSet<_> = levels.iter().map(|levels| levels[WALLS].as_str().unwrap()).collect();
    assert_eq!(words, ["frictionless", "rough"].into());
    // The runs of these trials are found again, and named in words.
    let rows: Vec<TrialRow> = decided
        .trials
        .iter()
        .map(|trial| {
            let own =
                decided.trials.iter().find(|other| other.point == trial.point && other.levels.is_some());
            let factors = own.unwrap().levels.clone().unwrap();
            let rate = factors[COUNT].as_f64().unwrap() / 10.0;
            TrialRow {
                job_id: JobId::new(),
                point: trial.point,
                replicate: trial.replicate,
                seed: trial.scenario.seed,
                factors,
                parameters: Map::new(),
                state: JobState::Succeeded,
                failure_class: None,
                backend: None,
                solver_revision: None,
                responses: json!({"mean_rate_kg_s": rate}).as_object().unwrap().clone(),
            }
        })
        .collect();
    let again = study.decide(&rows, &[], 0).unwrap();
    assert_eq!(again.answer.runs.done, decided.trials.len());
    assert!(again.sentences[0].contains("count 12 and side walls "), "{:?}", again.sentences);
}

#[test]
fn every_level_is_checked_with_the_rules_of_the_scenario() {
    let mut document = mixed(optimise());
    document["factors"][1]["levels"][1] = json!("wood");
    document["factors"][0]["low"] = json!(0);
    let pointers: BTreeSet<_> = read_faults(document).into_iter().map(|(pointer, _)| pointer).collect();
    assert_eq!(pointers, ["/factors/0/low", "/factors/1/levels/1"].map(str::to_owned).into());
    let mut document = mixed(optimise());
    document["factors"][0]["low"] = json!(6.5);
    assert!(read_faults(document).contains(&("/factors/0/low".into(), "the field has whole numbers".into())));
    let mut document = mixed(optimise());
    document["factors"] = json!([{"pointer": WALLS, "low": 0, "high": 1}, {"pointer": "/seed", "low": 1, "high": 9},
                                 {"pointer": GATE, "levels": [0.05, 0.06], "low": 0.03}]);
    let found = read_faults(document);
    for at in ["/factors/0/pointer", "/factors/1/pointer", "/factors/2/low"] {
        assert!(found.iter().any(|(pointer, _)| pointer == at), "{at}: {found:?}");
    }
    let found = read_faults(mixed(boundary()));
    let [(pointer, detail)] = &found[..] else { panic!("{found:?}") };
    assert!(
        pointer == "/factors/1/levels" && detail.starts_with("/equipment/side_walls has levels"),
        "{detail}"
    );
}

#[test]
fn responses_and_sweeps_are_checked_whatever_else_is_wrong() {
    let pointers = |document: Value| -> Vec<String> {
        read_faults(document).into_iter().map(|(pointer, _)| pointer).collect()
    };
    let boundary =
        |response: &str| mixed(json!({"boundary": {"of": {"probability": response}, "level": 1.5}}));
    let expected = ["/factors/1/levels", "/goal/boundary/level", "/goal/boundary/of/probability"];
    assert_eq!(pointers(boundary("jamed")), expected);
    let expected = ["/goal/boundary/of", "/factors/1/levels", "/goal/boundary/level"];
    assert_eq!(pointers(boundary("")), expected, "a missing name is one fault");
    let mut document = document(json!({"sensitivity": {"of": [{"mean": "rate"}], "width": 0}}));
    document["budget"] = json!({"max_runs": 1000});
    document["seeded_by"] = json!(["00000000-0000-7000-8000-000000000001"]);
    assert_eq!(pointers(document), ["/goal/sensitivity/width", "/seeded_by", "/goal/sensitivity/of/0/mean"]);
}

/// The gate of a CAD hopper is a plate: a factor lifts it, together with the declared opening.
#[test]
fn a_part_of_a_list_has_a_range() {
    let mut document = document(boundary());
    let plate = |name: &str, height: f64| json!({"name": name, "plate_m": [[0, -0.1, 0], [0, 0.2, 0], [0, 0, 0.4]], "position_m": [0, 0, height]});
    let belt = json!({"name": "belt", "kind": "belt", "motion": "belt", "velocity_m_s": [0.2, 0, 0],
                      "plate_m": [[-0.4, -0.3, 0], [1.4, 0, 0], [0, 0.6, 0]]});
    document["base"]["equipment"] = json!({"parametric": false, "opening_width_m": 0.2, "opening_height_m": 0.05,
        "surfaces": [plate("gate", 0.05), belt]});
    document["factors"] = json!([{"pointers": ["/equipment/opening_height_m", "/equipment/surfaces/0/position_m/2"], "low": 0.03, "high": 0.12}]);
    let limits = SweepLimits { max_jobs: 1000, scenario: Limits::NONE };
    let (study, _) = read(document.clone(), &Meshes::default(), limits).unwrap();
    let decided = study.decide(&[], &[], 4).unwrap();
    for trial in &decided.trials {
        let scenario = json!(trial.scenario);
        let height = scenario.pointer("/equipment/surfaces/0/position_m/2").unwrap();
        assert_eq!(scenario.pointer("/equipment/opening_height_m"), Some(height));
        assert!((0.03..=0.12).contains(&height.as_f64().unwrap()), "{height}");
    }
    document["factors"][0]["pointers"][1] = json!("/equipment/surfaces/0/position_m");
    assert!(read_faults(document).iter().any(|(_, detail)| detail.contains("no number and has no range")));
}

#[test]
fn copied_runs_at_missing_levels_are_counted_separately() {
    let mut document = document(optimise());
    document["factors"][0] = json!({"pointer": GATE, "levels": [0.05, 0.06]});
    let limits = SweepLimits { max_jobs: 1000, scenario: Limits::NONE };
    let (mut study, _) = read(document, &Meshes::default(), limits).unwrap();
    let run = |gate: f64, speed: f64, seed: u64| sweep_run(gate, speed, seed, &|_| {});
    // The second is outside the range of speeds, and can come into it; the others never can.
    let runs = [run(0.05, 0.5, 1), run(0.06, 2.0, 2), run(0.07, 0.5, 3), run(0.08, 2.0, 4)];
    let copies = copy(&mut study, &runs);
    let counts = &study.seeding[0];
    assert_eq!((copies.len(), counts.copied, counts.other_levels), (2, 2, 2));
    let decided = study.decide(&[], &copies, 0).unwrap();
    let expected = "Left out of this sweep: 1 run outside the ranges, 2 runs at levels that their factors lack (the first is \
                    `/equipment/gate_opening_m = 0.07`) and 3 runs without a result.";
    assert!(decided.sentences.iter().any(|sentence| sentence == expected), "{:?}", decided.sentences);
    // The wider range has the speed.
    let ranges = Some(vec![(0.0, 0.0), (0.1, 3.0)]);
    let wider = Study::stored(present(&study, ranges)).unwrap().decide(&[], &copies, 0).unwrap();
    let expected = expected.replace("1 run outside the ranges, ", "");
    assert!(wider.sentences.contains(&expected), "{:?}", wider.sentences);
}

#[test]
fn a_crossing_of_whole_numbers_lies_between_two_of_them() {
    let mut document = document(boundary());
    document["factors"] = json!([{"pointer": COUNT, "low": 24, "high": 96}]);
    document["goal"]["boundary"]["level"] = json!(0.5);
    document["budget"] = json!({"max_runs": 400});
    let limits = SweepLimits { max_jobs: 1000, scenario: Limits::NONE };
    let (study, _) = read(document, &Meshes::default(), limits).unwrap();
    let mut rows: Vec<TrialRow> = Vec::new();
    let mut levels: Vec<(u32, Map<String, Value>)> = Vec::new();
    let decided = loop {
        let decided = study.decide(&rows, &[], 16).unwrap();
        if decided.finished.is_some() {
            break decided;
        }
        for trial in decided.trials {
            levels.extend(trial.levels.map(|levels| (trial.point, levels)));
            let factors = levels.iter().find(|(point, _)| *point == trial.point).unwrap().1.clone();
            let jammed = u8::from(factors[COUNT].as_u64().unwrap() > 50);
            rows.push(TrialRow {
                job_id: JobId::new(),
                point: trial.point,
                replicate: trial.replicate,
                seed: trial.scenario.seed,
                factors,
                parameters: Map::new(),
                state: JobState::Succeeded,
                failure_class: None,
                backend: None,
                solver_revision: None,
                responses: json!({"jammed": jammed}).as_object().unwrap().clone(),
            });
        }
    };
    let expected = "The probability of `jammed` crosses 0.5 at a count between ";
    let (first, rest) = decided
        .sentences
        .iter()
        .find_map(|sentence| Some((sentence, sentence.strip_prefix(expected)?)))
        .unwrap_or_else(|| panic!("{:?}", decided.sentences));
    let numbers: Vec<f64> = rest.split([' ', ',']).filter_map(|word| word.parse().ok()).collect();
    assert!(numbers[0] <= 50.0 && numbers[1] >= 51.0 && numbers[1] - numbers[0] < 20.0, "{first}");
}

#[test]
fn answers_report_equal_values() {
    for (goal, expected) in [
        (
            json!({"estimate": {"points": [[0.05, 0.5]], "intervals": [{"of": {"mean": "mean_rate_kg_s"}, "width": 0.1}]}}),
            "the mean rate is 0.2 kg/s in all 20 runs, without an interval.",
        ),
        (
            json!({"sensitivity": {"of": [{"mean": "mean_rate_kg_s"}], "width": 0.5}}),
            "The mean rate does not vary: all runs gave the same value.",
        ),
    ] {
        let mut document = document(goal);
        document["budget"] = json!({"max_runs": 400});
        let limits = SweepLimits { max_jobs: 1000, scenario: Limits::NONE };
        let (study, _) = read(document, &Meshes::default(), limits).unwrap();
        let mut rows: Vec<TrialRow> = Vec::new();
        let decided = loop {
            let decided = study.decide(&rows, &[], 40).unwrap();
            if decided.finished.is_some() {
                break decided;
            }
            let new = trials(&study, &rows, 40, JobState::Succeeded, &|_| 0);
            assert!(!new.is_empty(), "the study ends");
            rows.extend(new.into_iter().map(|row| TrialRow {
                responses: json!({"mean_rate_kg_s": 0.2}).as_object().unwrap().clone(),
                ..row
            }));
        };
        assert_eq!(decided.finished, Some(StudyEnd::ByRule));
        assert!(decided.sentences[0].ends_with(expected), "{:?}", decided.sentences);
    }
}
