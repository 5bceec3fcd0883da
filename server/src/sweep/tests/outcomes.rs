//! Tests of summaries, effects and tables, against SciPy and a reader of Parquet.

use std::collections::BTreeMap;

use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::RowAccessor;
use roost_api::design::Factor;
use roost_api::ids::JobId;
use roost_api::job::{FailureClass, JobState};
use roost_api::table::{Pairing, PairingGain, ResponseEffects, TrialRow};
use roost_solver::experiments::outputs_of;

use super::super::to_parquet::{PANDAS_KEY, UNITS_KEY};
use super::*;

pub(super) fn trial(point: u32, replicate: u32, factors: Value, responses: Value) -> TrialRow {
    TrialRow {
        job_id: JobId::new(),
        point,
        replicate,
        seed: u64::from(replicate) + 1,
        factors: factors.as_object().unwrap().clone(),
        parameters: serde_json::Map::new(),
        state: JobState::Succeeded,
        failure_class: None,
        backend: Some("cpu".to_owned()),
        solver_revision: Some(7),
        responses: responses.as_object().unwrap().clone(),
    }
}

/// A table as CSV with a header.
pub(super) fn table_csv(columns: &[Column]) -> String {
    let head = columns.iter().map(|column| column.name().to_owned()).collect();
    String::from_utf8(csv(&[head], columns).unwrap()).unwrap()
}

fn near(value: Option<f64>, expected: &Value) {
    let (value, expected) = (value.unwrap(), expected.as_f64().unwrap());
    assert!((value - expected).abs() <= 1e-9 * expected.abs().max(1e-3), "{value}, not {expected}");
}

#[test]
fn means_and_intervals_match_scipy() {
    for expected in scipy()["intervals"].as_array().unwrap() {
        let values = expected["values"].as_array().unwrap().iter();
        let trials: Vec<_> =
            (0..).zip(values).map(|(r, y)| trial(0, r, json!({}), json!({"y": y}))).collect();
        let row = &by_point(&trials, None)[0];
        let summary = &row.responses["y"];
        assert_eq!(summary.n, trials.len() as u64);
        near(summary.mean, &expected["mean"]);
        near(summary.standard_deviation, &expected["standard_deviation"]);
        near(summary.low_95, &expected["low_95"]);
        near(summary.high_95, &expected["high_95"]);
    }
}

#[test]
fn points_average_succeeded_trials_and_count_failed_ones() {
    let mut trials = vec![
        trial(0, 0, json!({"/a": 1}), json!({"y": 2.0, "t": null, "regime": "constant"})),
        trial(0, 1, json!({"/a": 1}), json!({"y": 4.0, "t": 1.0, "regime": "no_flow"})),
        trial(0, 2, json!({"/a": 1}), json!({"y": 100.0})),
        trial(1, 0, json!({"/a": 2}), json!({"y": 5, "regime": "no_flow"})),
    ];
    (trials[2].state, trials[2].failure_class) = (JobState::Failed, Some(FailureClass::Unstable));
    let rows = by_point(&trials, None);
    assert_eq!((rows[0].counts.succeeded, rows[0].counts.failed, rows[0].unstable), (2, 1, 1));
    assert_eq!((rows[0].responses["y"].n, rows[0].responses["y"].mean), (2, Some(3.0)), "100 is in no mean");
    assert_eq!((rows[0].responses["t"].n, rows[0].responses["t"].standard_deviation), (1, None));
    let regime = &rows[0].responses["regime"];
    assert_eq!((regime.n, json!(regime.words)), (2, json!({"constant": 1, "no_flow": 1})));
    // SciPy: Wilson's intervals of 1 and 0 of 2.
    near(Some(regime.shares.as_ref().unwrap()["no_flow"].low_95), &json!(0.09453120573423074));
    near(Some(regime.shares.as_ref().unwrap()["no_flow"].high_95), &json!(0.9054687942657693));
    near(regime.unseen_high_95, &json!(0.6576197724933469));
    assert_eq!((&rows[0].responses["y"].shares, rows[0].responses["y"].unseen_high_95), (&None, None));
    let factors = [Factor { pointer: Some("/a".to_owned()), ..Factor::default() }];
    let (effects, _) = effects(&factors, &trials, 1);
    let names: Vec<_> = effects.iter().map(|of| of.response.as_str()).collect();
    assert_eq!(names, ["regime=constant", "regime=no_flow", "t", "y"]);
    assert_eq!((effects[1].mean, effects[1].factors[0].effect), (0.75, Some(0.5)), "shares of trials");
    let level = &effects[3].factors[0].levels[1];
    assert_eq!((&level.level, level.points, level.mean, level.effect), (&json!(2), 1, 5.0, 1.0));
    assert_eq!((level.low_95, effects[3].pairing, effects[3].seeds), (None, Pairing::Unpaired, None));
    assert_eq!(effects[2].factors[0].effect, None, "one point shows no effect");
}

#[test]
fn mean_of_an_indicator_is_a_share_with_its_interval() {
    // 4 of 10 trials jam; a null is no value. SciPy: binomtest(4, 10).proportion_ci(method="wilson").
    let jammed = |r: u32| if r == 10 { Value::Null } else { json!(u8::from(r < 4)) };
    let trials: Vec<_> =
        (0..11).map(|r| trial(0, r, json!({}), json!({"jammed": jammed(r), "y": jammed(r)}))).collect();
    let row = &by_point(&trials, None)[0];
    let (jammed, number) = (&row.responses["jammed"], &row.responses["y"]);
    assert_eq!((jammed.n, jammed.mean), (10, Some(0.4)));
    near(jammed.low_95, &json!(0.16818032970623614));
    near(jammed.high_95, &json!(0.6873262302663417));
    assert!(number.low_95.unwrap() < 0.04, "a number has Student's interval: {number:?}");
    // A single trial has an interval, and it is never a point.
    let single = &by_point(&trials[..1], None)[0].responses["jammed"];
    near(single.low_95, &json!(0.20654931437723745));
    assert_eq!(single.high_95, Some(1.0));
    let responses = [SweepResponse { name: "jammed".to_owned(), has_numbers: true, has_words: false }];
    let csv = table_csv(&of_points(&[], &responses, std::slice::from_ref(row), false));
    let head = "jammed.n,jammed.mean,jammed.standard_deviation,jammed.low_95,jammed.high_95";
    assert!(csv.lines().next().unwrap().ends_with(head), "{csv}");
    assert!(csv.lines().nth(1).unwrap().contains(",10,0.4,0.51"), "{csv}");
}

/// The effects of points that are added in batches of this size, in one pass and with one response per pass.
fn effects(factors: &[Factor], trials: &[TrialRow], batch: usize) -> (Vec<ResponseEffects>, PairingGain) {
    let points: Vec<_> = trials.chunk_by(|one, other| one.point == other.point).collect();
    let [(passes, found), (more_passes, same)] = [MAX_EFFECTS_BYTES, 1].map(|max_bytes| {
        let (mut effects, mut passes) = (Effects::of(factors.to_vec(), max_bytes, None), 0);
        let mut is_complete = false;
        while !is_complete {
            points.chunks(batch).for_each(|batch| effects.add(&batch.concat()));
            is_complete = effects.finish_pass();
            passes += 1;
        }
        (passes, effects.responses())
    });
    assert!(passes == 1 && more_passes > 1, "{passes} and {more_passes} passes");
    assert_eq!(json!(same.0), json!(found.0));
    found
}

#[test]
fn effects_and_rank_correlations_match_scipy() {
    let data = &scipy()["effects"];
    let at = |name: &str, index: usize| data[name][index].clone();
    // Two replicates about each value: a point counts once, with their mean.
    let trials: Vec<_> = (0..20)
        .flat_map(|point| {
            let factors =
                json!({"/a": at("a", point), "/b": at("b", point), "/c": at("c", point), "/word": "same"});
            let response = |name, shift: f64| at(name, point).as_f64().unwrap() + shift;
            [0.25, -0.25].map(|shift| {
                let responses = json!({"y": response("y", shift), "z": response("z", 0.0)});
                trial(point as u32, u32::from(shift < 0.0), factors.clone(), responses)
            })
        })
        .collect();
    let factor = |name: &str, scale: Option<&str>| {
        serde_json::from_value::<Factor>(json!({"pointer": name, "scale": scale})).unwrap()
    };
    let factors = [factor("/a", None), factor("/b", Some("log")), factor("/c", None), factor("/word", None)];
    let (found, _) = effects(&factors, &trials, 7);
    for (response, expected) in found.iter().zip([&data["of_y"], &data["of_z"]]) {
        assert_eq!(response.points, 20);
        for (effect, name) in response.factors.iter().zip(["a", "b", "c"]) {
            near(effect.effect, &expected[name]["effect"]);
            near(effect.rank_correlation, &expected[name]["rank_correlation"]);
            near(effect.p_value, &expected[name]["p_value"]);
        }
        assert_eq!(response.factors[0].levels.len(), 4);
        assert!(response.factors[2].levels.is_empty(), "twenty values are no levels");
        let words = &response.factors[3];
        assert_eq!((words.effect, words.rank_correlation, words.levels.len()), (None, None, 1));
    }
}

/// The trials of the points in `contrasts` of the reference numbers, with this many seeds.
fn contrast_trials(seeds: usize) -> Vec<TrialRow> {
    let data = &scipy()["contrasts"];
    let trial = |point: usize, seed: usize| {
        let responses = json!({"y": data["values"][point][seed], "jammed": u8::from(seed + point > 4)});
        trial(point as u32, seed as u32, json!({"/x": data["x"][point]}), responses)
    };
    (0..4).flat_map(|point| (0..seeds).map(move |seed| trial(point, seed))).collect()
}

#[test]
fn intervals_of_effects_use_common_seeds_and_match_scipy() {
    let data = &scipy()["contrasts"];
    let factors = [Factor { pointer: Some("/x".to_owned()), ..Factor::default() }];
    for (seeds, pairing, name) in
        [(6, Pairing::BySeed, "by_seed"), (3, Pairing::AdditiveModel, "additive_model")]
    {
        let (found, gain) = effects(&factors, &contrast_trials(seeds), 2);
        let y = &found[1];
        assert_eq!((y.response.as_str(), y.pairing, y.seeds), ("y", pairing, Some(seeds as u64)));
        near(y.factors[0].low_95, &data[name][0]);
        near(y.factors[0].high_95, &data[name][1]);
        if seeds == 6 {
            near(y.factors[0].effect, &data["effect"]);
        }
        // The seeds dominate the variance of y, so pairing makes its interval much narrower.
        assert!(y.factors[0].width_ratio.unwrap() < 0.6, "{y:?}");
        let level = &y.factors[0].levels[0];
        assert!(level.low_95 < Some(level.effect) && level.high_95 > Some(level.effect), "{level:?}");
        assert_eq!(found[0].pairing, Pairing::BySeed, "events are always paired by seed");
        assert_eq!(gain.intervals, 2);
        assert!(gain.sentence.contains("Pairing by seed: the median interval has"), "{}", gain.sentence);
    }
    // A failed trial leaves the seeds incomplete.
    let mut trials = contrast_trials(6);
    (trials[7].state, trials[7].failure_class) = (JobState::Failed, Some(FailureClass::Unstable));
    let (found, gain) = effects(&factors, &trials, 2);
    assert_eq!(
        (found[1].pairing, found[1].seeds, found[1].factors[0].width_ratio),
        (Pairing::Unpaired, None, None)
    );
    assert!(found[1].factors[0].low_95.is_some(), "it has an unpaired interval");
    assert_eq!((gain.median_width_ratio, gain.intervals), (None, 0));
    // One replicate has no interval.
    let (found, _) = effects(&factors, &contrast_trials(1), 2);
    assert_eq!((found[1].factors[0].low_95, found[1].factors[0].levels[0].low_95), (None, None));
}

#[test]
fn differences_of_two_points_match_scipy() {
    let data = &scipy()["contrasts"];
    let trials = contrast_trials(6);
    let points: Vec<_> = trials.chunk_by(|one, other| one.point == other.point).collect();
    let (found, gain) = differences(points[1], points[3], None);
    let names: Vec<_> = found.iter().map(|of| of.response.as_str()).collect();
    assert_eq!(names, ["jammed", "y"]);
    let y = &found[1];
    near(y.low_95, &data["difference"][0]);
    near(y.high_95, &data["difference"][1]);
    let width = |name: &str| data[name][1].as_f64().unwrap() - data[name][0].as_f64().unwrap();
    near(y.width_ratio, &json!(width("difference") / width("unpaired")));
    assert_eq!((y.pairing, y.from_n, y.to_n), (Pairing::BySeed, 6, 6));
    assert!((y.difference - (y.to_mean - y.from_mean)).abs() < 1e-12);
    assert_eq!((found[0].from_mean, found[0].to_mean), (2.0 / 6.0, 4.0 / 6.0));
    assert_eq!(gain.intervals, 2);
    // Other seeds are unpaired, a single trial has no interval, and a response of one point has no difference.
    let (found, _) = differences(points[1], &points[3][..5], None);
    assert_eq!((found[1].pairing, found[1].to_n), (Pairing::Unpaired, 5));
    let (found, _) = differences(&points[1][..1], &points[3][..1], None);
    assert_eq!((found[1].pairing, found[1].low_95), (Pairing::Unpaired, None));
    let none = [trial(9, 0, json!({}), json!({"other": 1.0, "regime": "constant"}))];
    assert!(differences(points[1], &none, None).0.is_empty());
}

#[test]
fn a_parquet_file_equals_the_table() {
    let mut trials = vec![
        trial(0, 0, json!({"/a": 1, "/w": "dry"}), json!({"y": 2.5, "ok": true, "n": 3, "t": null})),
        trial(1, 0, json!({"/a": 2, "/w": "wet"}), json!({"y": 4, "ok": false, "n": 4, "t": null})),
        trial(2, 0, json!({"/a": 3, "/w": "wet"}), json!({})),
    ];
    (trials[2].state, trials[2].failure_class) = (JobState::Failed, Some(FailureClass::Lost));
    for (trial, drawn) in trials.iter_mut().zip([0.25, 0.5, 0.75]) {
        trial.parameters.insert("/p".to_owned(), json!(drawn));
    }
    let (names, drawn) = (["/a".to_owned(), "/w".to_owned()], ["/p".to_owned()]);
    let response = |(name, has_numbers, has_words): (&str, bool, bool)| SweepResponse {
        name: name.to_owned(),
        has_numbers,
        has_words,
    };
    let responses =
        [("n", true, false), ("ok", false, true), ("t", false, false), ("y", true, false)].map(response);
    let units =
        BTreeMap::from([("/a", "m"), ("y", "kg/s")].map(|(name, unit)| (name.to_owned(), unit.to_owned())));
    let bytes = to_parquet(of_trials(&names, &drawn, &responses, &trials), &units).unwrap();
    for batch in [1, 2] {
        let mut columns = of_trials(&names, &drawn, &responses, &[]);
        for trials in trials.chunks(batch) {
            let more = of_trials(&names, &drawn, &responses, trials);
            columns.iter_mut().zip(more).for_each(|(column, more)| column.extend(more));
        }
        assert!(to_parquet(columns, &units).unwrap() == bytes, "in pieces of {batch}");
    }
    let mut file = tempfile::tempfile().unwrap();
    std::io::Write::write_all(&mut file, &bytes).unwrap();
    let reader = SerializedFileReader::new(file).unwrap();
    let metadata = reader.metadata().file_metadata().key_value_metadata().unwrap();
    let stored = |key: &str| {
        let text = metadata.iter().find(|entry| entry.key == key).and_then(|entry| entry.value.as_deref());
        serde_json::from_str::<Value>(text.unwrap()).unwrap()
    };
    assert_eq!(stored(UNITS_KEY), json!({"/a": "m", "y": "kg/s"}));
    assert_eq!(stored(PANDAS_KEY), json!({"units": {"/a": "m", "y": "kg/s"}}));
    let rows: Vec<_> = reader.get_row_iter(None).unwrap().map(Result::unwrap).collect();
    let heads: Vec<&String> = rows[0].get_column_iter().map(|(name, _)| name).collect();
    let expected = [
        "job_id",
        "point",
        "replicate",
        "seed",
        "/a",
        "/w",
        "/p",
        "state",
        "failure_class",
        "backend",
        "solver_revision",
        "n",
        "ok",
        "t",
        "y",
    ];
    assert_eq!(heads, expected);
    assert_eq!(rows[1].get_string(0).unwrap(), &trials[1].job_id.to_string());
    assert_eq!((rows[1].get_long(1).unwrap(), rows[1].get_long(4).unwrap()), (1, 2));
    assert_eq!(rows[1].get_string(5).unwrap(), "wet");
    assert_eq!(rows[1].get_double(6).unwrap(), 0.5, "drawn by this trial");
    assert_eq!((rows[0].get_long(11).unwrap(), rows[1].get_bool(12).unwrap()), (3, false));
    assert_eq!(
        (rows[0].get_double(14).unwrap(), rows[1].get_double(14).unwrap()),
        (2.5, 4.0),
        "mixed numbers"
    );
    assert!(rows[2].get_double(14).is_err() && rows[0].get_double(13).is_err(), "null is null");
    assert_eq!(rows[2].get_string(8).unwrap(), "lost");

    let csv = table_csv(&of_points(&names, &responses, &by_point(&trials, None), false));
    let head = csv.lines().next().unwrap();
    assert!(head.starts_with("point,/a,/w,trials,succeeded,failed,unstable,n.n,n.mean,"), "{head}");
    assert!(head.contains(",ok.n,ok.words,") && head.ends_with(",y.low_95,y.high_95"), "{head}");
    assert!(csv.lines().nth(1).unwrap().contains("\"{\"\"true\"\":1}\""), "{csv}");
}

#[test]
fn every_column_has_a_meaning_and_the_unit_of_its_name() {
    let outputs = outputs_of("hopper").unwrap();
    let responses: Vec<_> = outputs
        .responses
        .iter()
        .map(|row| SweepResponse { name: row.name.to_owned(), has_numbers: true, has_words: true })
        .collect();
    let names = ["/equipment/gate_opening_m".to_owned()];
    let trials = of_trials(&names, &[], &responses, &[]);
    let points = of_points(&names, &responses, &[], true);
    for column in trials.iter().chain(&points) {
        assert!(unit_of(column.name(), Some("hopper")).meaning.ends_with(['.', ')']), "{}", column.name());
    }
    let units = [
        "/equipment/gate_opening_m",
        "/equipment/surfaces/1/position_m/2",
        "mean_rate_kg_s",
        "mean_rate_kg_s.low_95",
        "mean_rate_kg_s.n",
        "regime.words",
        "critical_angle_deg",
        "gone_kg.mean",
    ]
    .map(|name| unit_of(name, Some("hopper")).unit);
    assert_eq!(units, ["m", "m", "kg/s", "kg/s", "", "", "°", ""]);
    let share = unit_of("jammed.mean", Some("hopper")).meaning;
    assert!(share.starts_with("Share of the succeeded jobs with 1. "), "{share}");
    assert_eq!(unit_of("gone_kg", None).meaning, "", "a response of an earlier version");
}

#[test]
fn the_schema_of_a_sweep_has_every_field_and_no_dangling_reference() {
    let schema = json_schema();
    let full = of_design(json!({"kind": "grid"}), json!([]));
    for name in json!(full).as_object().unwrap().keys() {
        assert!(schema["properties"].get(name).is_some(), "{name}");
    }
    assert_eq!(schema["required"], json!(["name", "base", "design"]));
    let text = schema.to_string();
    let references: Vec<&str> =
        text.split("\"$ref\":\"#").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    assert!(references.len() >= 5, "{references:?}");
    for reference in references {
        assert!(schema.pointer(reference).is_some(), "{reference}");
    }
    assert!(schema.pointer("/$defs/Scenario/properties/equipment/properties/gate_opening_m").is_some());
    let levels = schema.pointer("/$defs/Factor/properties/levels/items").unwrap();
    assert_eq!(levels.get("type"), None, "a level is whatever its field takes");
    assert_eq!(schema.pointer("/$defs/DesignKind/enum/1"), Some(&json!("one_at_a_time")));
}
