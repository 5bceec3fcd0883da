//! Tests of factors: values and coordinates, whole numbers, levels.

use serde_json::{Value, json};

use super::*;
use crate::Point;

fn factor(document: Value) -> Factor {
    serde_json::from_value(document).unwrap()
}

#[test]
fn values_and_coordinates_are_inverse() {
    for scale in [Scale::Linear, Scale::Log] {
        let factor = Factor { scale, ..Factor::range("/gate/height_m".into(), 0.02, 0.2) };
        assert_eq!((factor.value(0.0), factor.value(1.0)), (0.02, 0.2));
        for step in 0..=10 {
            let coordinate = f64::from(step) / 10.0;
            let back = factor.coordinate(factor.value(coordinate)).unwrap();
            assert!((back - coordinate).abs() < 1e-7, "{scale:?}: {back}, not {coordinate}");
        }
        assert_eq!(factor.coordinate(0.21), None);
    }
    let log = Factor { scale: Scale::Log, ..Factor::range("x".into(), 1.0, 100.0) };
    assert!((log.value(0.5) - 10.0).abs() < 1e-12);
}

#[test]
fn each_whole_number_and_each_level_is_one_point() {
    let levels = factor(json!({"name": "walls", "levels": ["frictionless", "steel", 3, true]}));
    let count = factor(json!({"name": "count", "low": 24, "high": 96, "is_whole": true}));
    let log = factor(json!({"name": "count", "low": 1, "high": 50, "scale": "log", "is_whole": true}));
    for (factor, expected) in [(&levels, 4), (&count, 73), (&log, 50)] {
        assert_eq!(factor.count(), Some(expected));
        let all = std::slice::from_ref(factor);
        let mut points = std::collections::BTreeSet::new();
        for step in 0..=10_000 {
            let rounded = Point::new(&[f64::from(step) / 10_000.0]).rounded(all);
            let number = rounded.values(all)[0];
            assert_eq!(number.fract(), 0.0);
            // The value of a run leads back to its point, also by way of the document.
            let level = factor.level(number);
            assert!(factor.is_categorical() || level.is_i64(), "{level}");
            assert_eq!(Point::of_values(all, &[factor.number(&level).unwrap()]), Some(rounded.clone()));
            points.insert(rounded);
        }
        assert_eq!(points.len(), expected, "{}", factor.name);
    }
    assert_eq!(levels.number(&json!(3.0)), Some(2.0), "numbers compare as numbers");
    assert_eq!(
        (levels.number(&json!("rubber")), count.coordinate(24.5), count.coordinate(97.0)),
        (None, None, None)
    );
}

#[test]
fn uniform_numbers_choose_each_value_equally_often() {
    let levels = factor(json!({"name": "walls", "levels": ["a", "b", "c"]}));
    let count = factor(json!({"name": "count", "low": 7, "high": 9, "is_whole": true}));
    for factor in [levels, count] {
        let mut times = [0; 3];
        (0..3000).for_each(|step| {
            times[(factor.value((f64::from(step) + 0.5) / 3000.0) - factor.low) as usize] += 1;
        });
        assert_eq!(times, [1000; 3], "{}", factor.name);
    }
}

#[test]
fn a_factor_is_read_and_written() {
    for document in [
        json!({"name": "x", "low": 1.5, "high": 2.0, "scale": "log"}),
        json!({"name": "x", "low": 1.0, "high": 2.0, "scale": "linear", "is_whole": true}),
        json!({"name": "x", "levels": ["a", false, 2]}),
    ] {
        assert_eq!(json!(factor(document.clone())), document);
    }
    for document in [
        json!({"name": "x", "low": 1.5}),
        json!({"name": "x"}),
        json!({"name": "x", "low": 1.0, "high": 2.0, "levels": ["a", "b"]}),
        json!({"name": "x", "levels": ["a", "b"], "scale": "log"}),
    ] {
        let error = serde_json::from_value::<Factor>(document).unwrap_err().to_string();
        assert!(error.contains("both `low` and `high`, or two or more `levels`"), "{error}");
    }
}

#[test]
fn faults_name_field_value_and_allowed_values() {
    let faults = |document| {
        let mut faults = Vec::new();
        factor(document).faults("/factors/0", &mut faults);
        faults.into_iter().map(|fault| (fault.pointer, fault.allowed)).collect::<Vec<_>>()
    };
    let pair = |pointer: &str, allowed: &str| (pointer.to_owned(), allowed.to_owned());
    let whole = "a whole number from -1000000 to 1000000";
    assert_eq!(
        faults(json!({"name": "x", "low": 1.5, "high": 2e7, "is_whole": true})),
        [pair("/factors/0/low", whole), pair("/factors/0/high", whole)]
    );
    assert_eq!(faults(json!({"name": "x", "levels": ["a"]})), [pair("/factors/0/levels", "2 to 32 levels")]);
    assert_eq!(
        faults(json!({"name": "x", "levels": ["a", null, "a", 2, 2.0]})),
        [
            pair("/factors/0/levels/1", "a word, a number, true or false"),
            pair("/factors/0/levels/2", "different levels"),
            pair("/factors/0/levels/4", "different levels")
        ]
    );
}
