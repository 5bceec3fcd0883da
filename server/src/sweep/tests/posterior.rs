//! Sweeps whose replicates draw parameters from a posterior.

use serde_json::json;

use super::outcomes::trial;
use super::*;

const FRICTION: &str = "/contact/fillet_fillet/static_friction";

fn drawing(posterior: Value) -> SweepSpec {
    let mut document = json!(spec(json!([{"pointer": GATE, "levels": [0.05, 0.06]}])));
    document["replicates"] = json!(5);
    document["posterior"] = posterior;
    serde_json::from_value(document).unwrap()
}

#[test]
fn replicates_share_samples_at_all_points() {
    let posterior = json!({"parameters": [FRICTION], "samples": [[0.1], [0.2]], "runs_per_sample": 2});
    let expansion = expand(&drawing(posterior), &Meshes::default(), LIMITS).unwrap();
    let drawn = |point: u32| -> Vec<(f64, u64)> {
        let trials = expansion.points.trials(0, 5).filter(|trial| trial.point == point);
        let value = |scenario: &Scenario| json!(scenario).pointer(FRICTION).unwrap().as_f64().unwrap();
        trials.map(|trial| (value(&trial.scenario), trial.scenario.seed)).collect()
    };
    // Of two samples, the fifth replicate has the first again.
    assert_eq!(drawn(0), [(0.1, 1), (0.1, 2), (0.2, 3), (0.2, 4), (0.1, 5)]);
    assert_eq!(drawn(0), drawn(1));
}

#[test]
fn samples_that_cannot_be_used_are_named() {
    let cases = [
        (json!({}), "/posterior"),
        (json!({"parameters": [FRICTION], "samples": []}), "/posterior/samples"),
        (json!({"parameters": [FRICTION], "samples": [[0.1, 0.2]]}), "/posterior/samples/0"),
        (json!({"parameters": [GATE], "samples": [[0.1]]}), "/posterior/parameters/0"),
        (json!({"parameters": ["/contact/condition"], "samples": [[0.1]]}), "/posterior/parameters/0"),
        (json!({"parameters": [FRICTION, FRICTION], "samples": [[0.1, 0.1]]}), "/posterior/parameters/1"),
        (json!({"parameters": [FRICTION], "samples": [[0.1], [-3.0]]}), "/posterior/samples/1/contact"),
        (json!({"parameters": [FRICTION], "samples": [[0.1]], "runs_per_sample": 0}), "/posterior/runs_per_sample"),
    ];
    for (posterior, expected) in cases {
        let found = faults(&drawing(posterior.clone()));
        assert!(found.iter().any(|fault| fault.pointer.starts_with(expected)), "{posterior}: {found:#?}");
    }
}

#[test]
fn intervals_include_what_is_not_known_of_parameters() {
    // Two runs of each of three samples: variance 2 within, and 8 between expected values.
    let values = [1.0, 3.0, 4.0, 6.0, 7.0, 9.0];
    let trials: Vec<_> =
        (0..).zip(values).map(|(replicate, y)| trial(0, replicate, json!({}), json!({"y": y}))).collect();
    let plain = &by_point(&trials, None)[0].responses["y"];
    let drawn = &by_point(&trials, Some(2))[0].responses["y"];
    assert_eq!((plain.input_deviation, plain.mean), (None, drawn.mean));
    let near = |value: Option<f64>, expected: f64| assert!((value.unwrap() - expected).abs() < 1e-9, "{drawn:?}");
    near(drawn.input_deviation, 8.0_f64.sqrt());
    near(drawn.chance_deviation, 2.0_f64.sqrt());
    assert!(drawn.high_95.unwrap() - drawn.low_95.unwrap() > 3.0 * (plain.high_95.unwrap() - plain.low_95.unwrap()));
    let names = ["y".to_owned()];
    let response = Response { name: names[0].clone(), has_numbers: true, has_words: false };
    let table = of_points(&[], &[response], &by_point(&trials, Some(2)), true);
    let table = String::from_utf8(csv(&table, true).unwrap()).unwrap();
    assert!(table.lines().next().unwrap().ends_with("y.high_95,y.input_deviation,y.chance_deviation"), "{table}");
}
