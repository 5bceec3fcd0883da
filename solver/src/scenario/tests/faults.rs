//! Every kind of fault, alone and all at once.

use serde_json::{Value, json};

use super::{faults, full, pointers, with};
use crate::scenario::{ScenarioError, from_value, nearest, parse};

/// Replaces one value of the full document and expects one fault there; returns its text.
fn one(pointer: &str, value: Value) -> String {
    let found = faults(&with(pointer, value.clone()));
    assert_eq!(pointers(&found), [pointer], "{value}");
    assert_eq!(found[0].value, value);
    found[0].to_string()
}

/// Adds fields to the shortest document.
fn plus(more: Value) -> Value {
    let mut document = json!({"experiment": "hopper"});
    document.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    document
}

#[test]
fn all_faults_of_a_scenario_are_reported_at_once() {
    let document = json!({
        "schema": "roost.scenario/9", "experiment": "hoper", "gate": 1,
        "product": {"count": 0, "subparticle_raduis_m": 0.004, "sizes_m": [[0.1, 0.1], [0.1, "x", 9]],
                    "density_kg_m3": 940, "subparticle_density_kg_m3": 2200},
        "material": 7,
        "contact": {"fillet_fillet": {"restitution": 0}},
        "equipment": {"gate_opening_m": 0.6, "side_walls": "ruff", "hopper_width_m": null},
        "numerics": {"duration_s": "6", "output_interval_s": 1e-5, "stop": {"when_empty": 1}},
        "seed": 9_007_199_254_740_992_u64
    });
    let found = faults(&document);
    let mut places = pointers(&found);
    places.sort_unstable();
    let expected = [
        "/contact/fillet_fillet/restitution",
        "/equipment/gate_opening_m",
        "/equipment/hopper_width_m",
        "/equipment/side_walls",
        "/experiment",
        "/gate",
        "/material",
        "/numerics/duration_s",
        "/numerics/output_interval_s",
        "/numerics/stop/when_empty",
        "/product/count",
        "/product/sizes_m/0",
        "/product/sizes_m/1/1",
        "/product/sizes_m/1/2",
        "/product/subparticle_density_kg_m3",
        "/product/subparticle_raduis_m",
        "/schema",
        "/seed",
    ];
    assert_eq!(places, expected);
    match parse(&document.to_string()) {
        Err(ScenarioError::Faults(same)) => assert_eq!(same, found),
        other => panic!("{other:?}"),
    }
}

#[test]
fn document_that_is_not_an_object_is_one_fault() {
    for document in [json!([]), json!("hopper"), json!(1), json!(null), json!(true)] {
        let found = faults(&document);
        assert_eq!(pointers(&found), [""]);
        assert!(found[0].detail.starts_with("must be an object, not "), "{}", found[0]);
    }
}

#[test]
fn the_experiment_must_be_named() {
    let found = faults(&json!({}));
    assert_eq!(pointers(&found), ["/experiment"]);
    assert!(found[0].allowed.as_deref().is_some_and(|words| words.contains("\"hopper\", \"drop\"")));
    assert!(one("/experiment", json!("silo")).contains("not among the choices"));
}

#[test]
fn fault_message_has_value_range_and_unit() {
    assert_eq!(
        one("/equipment/gate_opening_m", json!(-0.06)),
        "/equipment/gate_opening_m: is out of range (found -0.06); allowed: ≥ 0.001 and ≤ 5 m"
    );
    assert_eq!(
        one("/numerics/timestep_s", json!("fast")),
        "/numerics/timestep_s: must be a number, not a string (found \"fast\"); \
         allowed: ≥ 1e-9 and ≤ 0.1 s, or \"auto\""
    );
}

#[test]
fn inclusive_and_exclusive_bounds_follow_the_field_table() {
    for (pointer, fine, wrong) in [
        ("/bonds/contact_radius_ratio", json!(1.732), json!(1.0)),
        ("/bonds/contact_radius_ratio", json!(1.001), json!(1.7320508)),
        ("/material/poisson_ratio", json!(0.499), json!(0.5)),
        ("/contact/fillet_fillet/restitution", json!(1.0), json!(0.0)),
        ("/contact/fillet_belt/static_friction", json!(0), json!(-1e-9)),
        ("/seed", json!(9_007_199_254_740_991_u64), json!(9_007_199_254_740_992_u64)),
        ("/seed", json!(0), json!(-1)),
        ("/product/count", json!(191.0), json!(191.5)),
        ("/product/subparticle_radius_m", json!(5e-4), json!(4.9e-4)),
        ("/bonds/normal_strength_pa", json!(1e300), json!(1.1e300)),
    ] {
        from_value(&with(pointer, fine.clone())).unwrap_or_else(|found| panic!("{fine}: {found:?}"));
        one(pointer, wrong);
    }
}

#[test]
fn null_is_accepted_only_for_nullable_fields() {
    for pointer in ["/bonds/normal_strength_pa", "/numerics/stop/when_jammed_s"] {
        from_value(&with(pointer, json!(null))).unwrap();
    }
    for pointer in
        ["/seed", "/numerics/timestep_s", "/bonds/formulation", "/product/sizes_m", "/numerics/stop"]
    {
        assert!(one(pointer, json!(null)).contains("not null"), "{pointer}");
    }
}

#[test]
fn unknown_field_is_refused_with_a_suggestion() {
    for (document, pointer, meant) in [
        (
            json!({"equipment": {"gate_openign_m": 1}}),
            "/equipment/gate_openign_m",
            "/equipment/gate_opening_m",
        ),
        (json!({"equipment": {"gate_opening": 1}}), "/equipment/gate_opening", "/equipment/gate_opening_m"),
        (json!({"equipment": {"gate_m": 1}}), "/equipment/gate_m", "/equipment/gate_opening_m"),
        (json!({"gate_opening_m": 1}), "/gate_opening_m", "/equipment/gate_opening_m"),
        (json!({"stop": {}}), "/stop", "/numerics/stop"),
        (
            json!({"numerics": {"stop": {"when_emty": 1}}}),
            "/numerics/stop/when_emty",
            "/numerics/stop/when_empty",
        ),
        (
            json!({"contact": {"fillet_belt": {"friction": 1}}}),
            "/contact/fillet_belt/friction",
            "/contact/fillet_belt/static_friction",
        ),
        (json!({"equipmnt": 1}), "/equipmnt", "/equipment"),
    ] {
        let found = faults(&plus(document));
        assert_eq!(pointers(&found), [pointer]);
        assert_eq!(found[0].detail, format!("is not a known field: did you mean {meant}?"));
    }
    let found = faults(&plus(json!({"numerics": {"stop": {"xyzzy": 1}}})));
    assert_eq!(found[0].allowed.as_deref(), Some("when_empty, when_jammed_s, when_done"));
}

#[test]
fn suggestion_prefers_a_field_of_the_same_section() {
    assert_eq!(nearest("/contact/fillet_belt/static_fricton"), Some("/contact/fillet_belt/static_friction"));
    assert_eq!(nearest("/static_friction"), Some("/contact/fillet_fillet/static_friction"));
    assert_eq!(nearest("/xyzzy"), None);
}

#[test]
fn pointers_escape_slash_and_tilde() {
    assert_eq!(pointers(&faults(&plus(json!({"a/b~c": 1})))), ["/a~1b~0c"]);
}

#[test]
fn size_of_the_fault_list_is_bounded() {
    let mut document = full();
    for index in 0..10_000 {
        document[format!("unknown{index}")] = json!(index);
    }
    document["seed"] = json!("long".repeat(100_000));
    let found = faults(&document);
    assert_eq!(found.len(), 52);
    assert!(found[50].detail.contains("9950 more unknown fields"), "{}", found[50]);
    assert!(serde_json::to_string(&found).unwrap().len() < 50_000);
}

#[test]
fn contradictory_fields_are_refused() {
    let text = one("/equipment/gate_opening_m", json!(0.51));
    assert!(
        text.contains("above the hopper") && text.contains("≤ 0.5 m (/equipment/hopper_height_m)"),
        "{text}"
    );
    let short = faults(&with("/numerics/duration_s", json!(0.015)));
    assert!(short[0].detail.contains("before its first sample"), "{short:?}");
    assert!(one("/numerics/output_interval_s", json!(5.8e-5)).contains("makes more than 100000 samples"));
    assert!(one("/numerics/timestep_s", json!(0.021)).contains("within a time step"));
    assert!(
        one("/product/subparticle_density_kg_m3", json!(2200)).contains("excludes /product/density_kg_m3")
    );
    assert!(one("/product/density_kg_m3", json!(null)).contains("and so is"));
    from_value(&with("/equipment/gate_opening_m", json!(0.5))).unwrap();
}

#[test]
fn fault_of_two_fields_points_at_the_one_in_the_document() {
    let low_hopper = plus(json!({"equipment": {"hopper_height_m": 0.05}}));
    let found = faults(&low_hopper);
    assert_eq!(pointers(&found), ["/equipment/hopper_height_m"]);
    assert_eq!(found[0].allowed.as_deref(), Some("≥ 0.06 m (/equipment/gate_opening_m)"));
}

#[test]
fn fault_of_one_field_causes_no_further_faults() {
    let inherited = plus(json!({"contact": {"fillet_fillet": {"restitution": 2}}}));
    assert_eq!(pointers(&faults(&inherited)), ["/contact/fillet_fillet/restitution"]);
    let related = plus(json!({"equipment": {"hopper_height_m": -1}}));
    assert_eq!(pointers(&faults(&related)), ["/equipment/hopper_height_m"]);
}

#[test]
fn fields_of_other_experiments_are_refused() {
    let found =
        faults(&json!({"experiment": "drop", "equipment": {"gate_opening_m": 0.05, "surfaces": [{}]}}));
    assert_eq!(pointers(&found), ["/equipment"]);
    assert!(found[0].detail.contains("belongs to the experiment \"hopper\""), "{}", found[0]);

    let found =
        faults(&json!({"experiment": "slide", "product": {"count": 2}, "numerics": {"duration_s": 3}}));
    assert_eq!(pointers(&found), ["/product/count", "/numerics/duration_s"]);
    assert!(found[0].detail.contains("means nothing in the experiment \"slide\""), "{}", found[0]);
}

#[test]
fn faults_in_lists_have_their_index() {
    let document = json!({"experiment": "scene", "scene": {
    "gravity_direction": [0, 0, 0],
    "bodies": [{"position_m": [0, 0, 1]}, {"positon_m": [0, 0, 1]}, 7, {"position_m": [0, 1], "shape": 6}],
    "surfaces": [
        {"name": "a", "plate_m": [[0, 0, 0], [1, 0, 0], [2, 0, 0]]},
        {"name": "a", "mesh": {"digest": "ab", "scale": 1}},
        {"name": "", "mesh": {"digest": "0".repeat(64), "units": "mm"}, "plate_m": [[0, 0, 0], [1, 0, 0], [0, 1, 0]]},
        {"plate_m": [[0, 0, 0], [1, 0, 0]], "motion": "belt"},
    ]}});
    let found = faults(&document);
    let mut places = pointers(&found);
    places.sort_unstable();
    let expected = [
        "/scene/bodies/1/position_m",
        "/scene/bodies/1/positon_m",
        "/scene/bodies/2",
        "/scene/bodies/3/position_m",
        "/scene/bodies/3/shape",
        "/scene/gravity_direction",
        "/scene/surfaces/0/plate_m",
        "/scene/surfaces/1/mesh/digest",
        "/scene/surfaces/1/mesh/scale",
        "/scene/surfaces/1/mesh/units",
        "/scene/surfaces/1/name",
        "/scene/surfaces/2/name",
        "/scene/surfaces/2/plate_m",
        "/scene/surfaces/3/name",
        "/scene/surfaces/3/plate_m",
    ];
    assert_eq!(places, expected);
    let near = found.iter().find(|fault| fault.pointer == "/scene/bodies/1/positon_m").unwrap();
    assert!(near.detail.ends_with("did you mean /scene/bodies/*/position_m?"));
}

#[test]
fn a_velocity_needs_a_motion() {
    let found = |motion: &str| {
        let surface = json!({"name": "a", "plate_m": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "motion": motion,
            "velocity_m_s": [1, 0, 0], "spin_deg_s": [0, 5, 0]});
        let bodies = json!([{"position_m": [0, 0, 1]}]);
        from_value(&json!({"experiment": "scene", "scene": {"bodies": bodies, "surfaces": [surface]}}))
            .err()
            .unwrap_or_default()
    };
    let [velocity, spin] = ["/scene/surfaces/0/velocity_m_s", "/scene/surfaces/0/spin_deg_s"];
    assert_eq!(pointers(&found("fixed")), [velocity, spin]);
    assert_eq!(pointers(&found("belt")), [spin]);
    assert_eq!(pointers(&found("moving")), [""; 0]);
}

#[test]
fn a_scene_needs_a_body_and_a_shape_must_exist() {
    assert_eq!(pointers(&faults(&json!({"experiment": "scene"}))), ["/scene/bodies"]);
    let found = faults(&json!({"experiment": "bend", "product": {"sizes_m": [[0.1, 0.1, 0.1]]}}));
    assert_eq!(pointers(&found), ["/product/shape"]);
    assert_eq!(found[0].allowed.as_deref(), Some("≥ 0 and ≤ 1"));
    let mesh = json!({"digest": "0".repeat(64), "units": "mm"});
    let found =
        faults(&json!({"experiment": "drop", "product": {"mesh": mesh, "sizes_m": [[0.1, 0.1, 0.1]]}}));
    assert_eq!(pointers(&found), ["/product/sizes_m"]);
}
