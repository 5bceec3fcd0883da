//! Sweeps whose replicates draw parameters from a posterior.

use serde_json::json;

use super::outcomes::{table_csv, trial};
use super::*;

const FRICTION: &str = "/contact/fillet_fillet/static_friction";

fn drawing(posterior: Value) -> SweepSpec {
    let mut document = json!(spec(json!([{"pointer": GATE, "levels": [0.05, 0.06]}])));
    document["replicates"] = json!(4);
    document["posterior"] = posterior;
    serde_json::from_value(document).unwrap()
}

#[test]
fn replicates_share_samples_at_all_points() {
    let posterior = json!({"parameters": [FRICTION], "samples": [[0.1], [0.2]], "runs_per_sample": 2});
    let expansion = expand(&drawing(posterior), &Meshes::default(), LIMITS).unwrap();
    let drawn = |point: u32| -> Vec<(f64, u64)> {
        let trials = expansion.points.trials(0, 4).filter(|trial| trial.point == point);
        let value = |scenario: &Scenario| json!(scenario).pointer(FRICTION).unwrap().as_f64().unwrap();
        trials.map(|trial| (value(&trial.scenario), trial.scenario.seed)).collect()
    };
    assert_eq!(drawn(0), [(0.1, 1), (0.1, 2), (0.2, 3), (0.2, 4)]);
    assert_eq!(drawn(0), drawn(1));
}

#[test]
fn unusable_posterior_samples_are_faults_with_their_pointer() {
    let cases = [
        (json!({}), "/posterior"),
        (json!({"parameters": [FRICTION], "samples": []}), "/posterior/samples"),
        (json!({"parameters": [FRICTION], "samples": [[0.1, 0.2]]}), "/posterior/samples/0"),
        (json!({"parameters": [GATE], "samples": [[0.1]]}), "/posterior/parameters/0"),
        (json!({"parameters": ["/contact/condition"], "samples": [[0.1]]}), "/posterior/parameters/0"),
        (json!({"parameters": [FRICTION, FRICTION], "samples": [[0.1, 0.1]]}), "/posterior/parameters/1"),
        (json!({"parameters": [FRICTION], "samples": [[0.1], [0.2], [-3.0]]}), "/posterior/samples/2"),
        (
            json!({"parameters": ["/product/subparticle_radius_m"], "samples": [[0.0005], [0.008]]}),
            "/posterior/samples/0",
        ),
        (json!({"parameters": [FRICTION], "samples": [[0.1]]}), "/replicates"),
        (
            json!({"parameters": [FRICTION], "samples": [[0.1]], "runs_per_sample": 0}),
            "/posterior/runs_per_sample",
        ),
    ];
    for (posterior, expected) in cases {
        let found = faults(&drawing(posterior.clone()));
        assert!(found.iter().any(|fault| fault.pointer.starts_with(expected)), "{posterior}: {found:#?}");
    }
}

#[test]
fn intervals_include_parameter_uncertainty() {
    // Two runs of each of three samples: variance 2 within, and 8 between expected values.
    let values = [1.0, 3.0, 4.0, 6.0, 7.0, 9.0];
    let trials: Vec<_> =
        (0..).zip(values).map(|(replicate, y)| trial(0, replicate, json!({}), json!({"y": y}))).collect();
    let plain = &by_point(&trials, None)[0].responses["y"];
    let drawn = &by_point(&trials, Some(2))[0].responses["y"];
    assert_eq!((plain.input_deviation, plain.mean), (None, drawn.mean));
    let near =
        |value: Option<f64>, expected: f64| assert!((value.unwrap() - expected).abs() < 1e-9, "{drawn:?}");
    near(drawn.input_deviation, 8.0_f64.sqrt());
    near(drawn.chance_deviation, 2.0_f64.sqrt());
    assert!(
        drawn.high_95.unwrap() - drawn.low_95.unwrap()
            > 3.0 * (plain.high_95.unwrap() - plain.low_95.unwrap())
    );
    let names = ["y".to_owned()];
    let response = SweepResponse { name: names[0].clone(), has_numbers: true, has_words: false };
    let table = of_points(&[], &[response], &by_point(&trials, Some(2)), true);
    let table = table_csv(&table);
    assert!(
        table.lines().next().unwrap().ends_with("y.high_95,y.input_deviation,y.chance_deviation"),
        "{table}"
    );
}

#[test]
fn extension_draws_no_sample_twice_and_no_faulty_one() {
    let posterior = json!({"parameters": [FRICTION], "samples": [[0.1], [0.2], [0.3]]});
    let spec = drawing(posterior);
    let expansion = expand(&spec, &Meshes::default(), LIMITS).unwrap();
    let levels = expansion.points.iter().map(|point| point.levels).collect();
    let mut stored = StoredSweep { spec, points: levels, replicates: 4 };
    let more = |stored: &StoredSweep, replicates: u32| {
        extend(stored, json!({"replicates": replicates}), &Meshes::default(), LIMITS)
            .map(|added| added.replicates)
    };
    assert_eq!(more(&stored, 2), Ok(6));
    assert_eq!(more(&stored, 3).unwrap_err()[0].pointer, "/replicates");
    // A sweep from before the samples were checked.
    let first = expansion.points.trials(0, 4).next().unwrap();
    let firsts = [(first.point, first.scenario)];
    assert_eq!(check_samples(&stored, 6, &firsts), Ok(()));
    stored.spec.posterior.as_mut().unwrap().samples = Some(vec![vec![0.1], vec![0.2], vec![-3.0]]);
    assert!(check_samples(&stored, 6, &firsts).is_err());
    assert_eq!(check_samples(&stored, 4, &firsts), Ok(()));
}

#[test]
fn equal_answers_of_yes_or_no_keep_the_interval_of_their_share() {
    let trials: Vec<_> =
        (0..20).map(|replicate| trial(0, replicate, json!({}), json!({"jammed": 0}))).collect();
    let plain = by_point(&trials, None)[0].responses["jammed"].clone();
    let drawn = by_point(&trials, Some(2))[0].responses["jammed"].clone();
    assert_eq!((drawn.low_95, drawn.high_95), (plain.low_95, plain.high_95));
    assert!(drawn.high_95.unwrap() > 0.1);
}
