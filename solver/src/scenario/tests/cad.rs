//! Hoppers from CAD: fields that contradict the surfaces are refused by name, and documents of schema 1 keep their opening.

use serde_json::{Value, json};

use super::{faults, pointers};
use crate::scenario::{Equipment, Experiment, from_value};

/// A hopper from CAD with a belt at 0.4 m/s and these fields of its equipment.
fn cad(fields: Value) -> Value {
    let belt = json!({"name": "belt", "plate_m": [[-1, -1, 0], [2, 0, 0], [0, 2, 0]], "motion": "belt",
                      "velocity_m_s": [0.4, 0, 0]});
    let mut document =
        json!({"experiment": "hopper", "equipment": {"parametric": false, "surfaces": [belt]}});
    document["equipment"].as_object_mut().unwrap().extend(fields.as_object().unwrap().clone());
    document
}

fn equipment(document: &Value) -> Equipment {
    match from_value(document).unwrap_or_else(|faults| panic!("{faults:?}")).experiment {
        Experiment::Hopper { equipment } => equipment,
        _ => unreachable!("a hopper"),
    }
}

#[test]
fn fields_that_contradict_the_surfaces_are_refused() {
    for (fields, at, told) in [
        (json!({"belt_speed_m_s": 0.3}), "/equipment/belt_speed_m_s", "run at 0.4 m/s"),
        (json!({"belt_speed_m_s": 0.3, "surfaces": []}), "/equipment/belt_speed_m_s", "no surface is a belt"),
        (json!({"gate_opening_m": 0.08}), "/equipment/gate_opening_m", "opening_height_m is null"),
        (
            json!({"gate_opening_m": 0.08, "opening_width_m": 0.3, "opening_height_m": 0.1}),
            "/equipment/gate_opening_m",
            "opening_height_m is 0.1",
        ),
        (json!({"opening_width_m": 0.3}), "/equipment/opening_height_m", "is null"),
        (json!({"opening_height_m": 0.3}), "/equipment/opening_width_m", "is null"),
        (json!({"parametric": true, "opening_width_m": 0.3}), "/equipment/opening_width_m", "does nothing"),
    ] {
        let found = faults(&cad(fields.clone()));
        assert_eq!(pointers(&found), [at], "{fields}");
        assert!(found[0].to_string().contains(told), "{fields}: {}", found[0]);
    }
}

#[test]
fn fields_that_agree_or_are_defaults_are_read() {
    let declared = json!({"gate_opening_m": 0.08, "opening_width_m": 0.3, "opening_height_m": 0.08});
    for fields in [json!({}), json!({"belt_speed_m_s": 0.4}), json!({"belt_speed_m_s": 0.25}), declared] {
        let complete = json!(from_value(&cad(fields)).expect("a sound scenario"));
        assert_eq!(json!(from_value(&complete).expect("a complete document")), complete);
    }
}

#[test]
fn schema_1_declares_its_opening() {
    let old = |fields: Value| {
        let mut document = cad(fields);
        document["schema"] = json!("roost.scenario/1");
        equipment(&document)
    };
    let opening = |one: &Equipment| (one.opening_width_m, one.opening_height_m, one.belt_speed_m_s);
    let stated = json!({"gate_opening_m": 0.08, "hopper_width_m": 0.3, "belt_speed_m_s": 0.3});
    assert_eq!(opening(&old(stated)), (Some(0.3), Some(0.08), 0.25));
    assert_eq!(opening(&old(json!({"gate_opening_m": 0.08}))), (Some(0.59), Some(0.08), 0.25));
    // Values that the document did not state are not invented, and a parametric hopper keeps its fields.
    assert_eq!(opening(&old(json!({}))), (None, None, 0.25));
    let parametric = old(json!({"parametric": true, "gate_opening_m": 0.08, "belt_speed_m_s": 0.3}));
    assert_eq!(opening(&parametric), (None, None, 0.3));
}
