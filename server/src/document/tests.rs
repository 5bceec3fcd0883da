//! Documents with many faults, and what is told of each.

use roost_api::sweep::SweepSpec;

use super::*;

fn faults(document: Value) -> Vec<Fault> {
    read_document::<JobEnvelope>(document).expect_err("a faulty document")
}

#[test]
fn every_fault_of_an_envelope_is_told_with_its_pointer() {
    let found = faults(json!({"scenario": {}, "priority": "high", "lables": {}, "needs": {"gpu": 1}}));
    let mut pointers: Vec<_> = found.iter().map(|fault| fault.pointer.as_str()).collect();
    pointers.sort_unstable();
    assert_eq!(pointers, ["/lables", "/needs/gpu", "/priority"]);
    let label = found.iter().find(|fault| fault.pointer == "/lables").unwrap();
    assert!(label.detail.contains("did you mean `labels`"), "{label:?}");
    let priority = found.iter().find(|fault| fault.pointer == "/priority").unwrap();
    assert_eq!(priority.value, json!("high"));
}

#[test]
fn a_missing_field_is_told_and_not_invented() {
    let found = faults(json!({"priority": 1}));
    assert_eq!(found.len(), 1);
    assert_eq!(found[0].pointer, "/scenario");
    let found = faults(json!({"priority": "high", "needs": 3}));
    let mut pointers: Vec<_> = found.iter().map(|fault| fault.pointer.as_str()).collect();
    pointers.sort_unstable();
    assert_eq!(pointers, ["/needs", "/priority", "/scenario"]);
    let found = faults(json!([]));
    assert_eq!(found.len(), 1, "{found:?}");
}

#[test]
fn a_sound_envelope_is_read() {
    let envelope: JobEnvelope = read_document(json!({"scenario": {"seed": 3}})).unwrap();
    assert_eq!(envelope.scenario, json!({"seed": 3}));
}

fn of<'a>(faults: &'a [Fault], pointer: &str) -> &'a Fault {
    faults.iter().find(|fault| fault.pointer == pointer).unwrap_or_else(|| panic!("{pointer}: {faults:#?}"))
}

#[test]
fn lists_are_no_documents() {
    let found = faults(json!([{}, 1, {}, {}, null, "use"]));
    assert_eq!((found.len(), found[0].pointer.as_str()), (1, ""));
    assert_eq!(found[0].allowed.as_deref(), Some("an object"));
    let found = faults(json!({"scenario": {}, "needs": ["cpu"], "priority": "high"}));
    assert_eq!(found.len(), 2, "{found:?}");
    assert_eq!(of(&found, "/needs").allowed.as_deref(), Some("an object"));
}

#[test]
fn faults_speak_of_json_not_of_types() {
    let document = json!({"scenario": {}, "priority": "high", "needs": 3, "max_wall_s": {}, "labels": [],
                          "cache": "never"});
    let found = faults(document);
    let allowed = |pointer| of(&found, pointer).allowed.clone().unwrap_or_default();
    assert_eq!(allowed("/priority"), "a whole number from -2147483648 to 2147483647");
    assert_eq!(of(&found, "/priority").detail, "a text cannot stand here");
    assert_eq!(allowed("/needs"), "an object");
    assert_eq!(allowed("/max_wall_s"), "a number");
    assert_eq!(allowed("/labels"), "an object");
    assert_eq!(allowed("/cache"), "use, bypass");
    assert_eq!(
        of(&faults(json!({"scenario": {}, "cache": 1})), "/cache").allowed.as_deref(),
        Some("use, bypass")
    );
    let far = faults(json!({"scenario": {}, "priority": 3_000_000_000_u64}));
    assert_eq!(far[0].detail, "out of range");
    for fault in &found {
        assert!(!fault.detail.contains("expected") && !fault.detail.contains("struct"), "{fault}");
    }
}

#[test]
fn every_shape_fault_of_a_sweep_is_told() {
    let sweep = json!({"name": "s", "base": {}, "design": {"kind": "spiral"}, "replicates": -1,
                       "factors": [3, {"pointer": 1, "levels": {}}, {"pointr": "/seed", "levels": [1]}]});
    let (spec, found) = read_leniently::<SweepSpec>(sweep);
    let mut pointers: Vec<_> = found.iter().map(|fault| fault.pointer.as_str()).collect();
    pointers.sort_unstable();
    let all = [
        "/design/kind",
        "/factors/0",
        "/factors/1/levels",
        "/factors/1/pointer",
        "/factors/2/pointr",
        "/replicates",
    ];
    assert_eq!(pointers, all);
    assert_eq!(of(&found, "/design/kind").detail, "no such choice");
    assert_eq!(
        of(&found, "/design/kind").allowed.as_deref(),
        Some("grid, one_at_a_time, random, latin_hypercube, sobol, box_behnken, list, csv")
    );
    assert_eq!(spec.expect("readable all the same").factors.len(), 3);
    let (_, found) =
        read_leniently::<SweepSpec>(json!({"name": "s", "base": {}, "factors": [], "design": ["grid"]}));
    assert_eq!((found.len(), found[0].pointer.as_str()), (1, "/design"));
    let extra = json!({"name": "s", "base": {}, "factors": [], "design": {"kind": "grid", "extra": 1}});
    let (_, found) = read_leniently::<SweepSpec>(extra);
    assert_eq!((found.len(), found[0].pointer.as_str()), (1, "/design/extra"));
}
