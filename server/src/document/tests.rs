//! Documents with many faults, and the text of each.

use roost_api::sweep::SweepSpec;

use super::*;

fn faults(document: Value) -> Vec<Fault> {
    read_document::<JobEnvelope>(document).expect_err("a faulty document")
}

#[test]
fn every_fault_of_an_envelope_has_its_pointer() {
    let found = faults(json!({"scenario": {}, "priority": "high", "lables": {}, "needs": {"gpu": 1}}));
    let mut pointers: Vec<_> = found.iter().map(|fault| fault.pointer.as_str()).collect();
    pointers.sort_unstable();
    assert_eq!(pointers, ["/lables", "/needs/gpu", "/priority"]);
    let label = found.iter().find(|fault| fault.pointer == "/lables").unwrap();
    assert!(label.detail.contains("did you mean labels"), "{label:?}");
    let priority = found.iter().find(|fault| fault.pointer == "/priority").unwrap();
    assert_eq!(priority.value, json!("high"));
}

#[test]
fn a_missing_field_is_a_fault() {
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
fn a_list_in_place_of_an_object_is_a_fault() {
    let found = faults(json!([{}, 1, {}, {}, null, "use"]));
    assert_eq!((found.len(), found[0].pointer.as_str()), (1, ""));
    assert_eq!(found[0].allowed.as_deref(), Some("an object"));
    let found = faults(json!({"scenario": {}, "needs": ["cpu"], "priority": "high"}));
    assert_eq!(found.len(), 2, "{found:?}");
    assert_eq!(of(&found, "/needs").allowed.as_deref(), Some("an object"));
}

#[test]
fn faults_name_json_types_not_rust_types() {
    let document = json!({"scenario": {}, "priority": "high", "needs": 3, "max_wall_s": {}, "labels": [],
                          "cache": "never"});
    let found = faults(document);
    let allowed = |pointer| of(&found, pointer).allowed.clone().unwrap_or_default();
    assert_eq!(allowed("/priority"), "a whole number from -2147483648 to 2147483647");
    assert_eq!(of(&found, "/priority").detail, "must be a whole number, not a string");
    assert_eq!(allowed("/needs"), "an object");
    assert_eq!(allowed("/max_wall_s"), "a number or null");
    assert_eq!(allowed("/labels"), "an object");
    assert_eq!(allowed("/cache"), "use, bypass");
    assert_eq!(
        of(&faults(json!({"scenario": {}, "cache": 1})), "/cache").allowed.as_deref(),
        Some("use, bypass")
    );
    let far = faults(json!({"scenario": {}, "priority": 3_000_000_000_u64}));
    assert_eq!(far[0].detail, "is out of range");
    for fault in &found {
        assert!(!fault.detail.contains("expected") && !fault.detail.contains("struct"), "{fault}");
    }
}

#[test]
fn every_fault_in_the_shape_of_a_sweep_is_listed() {
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
    assert_eq!(of(&found, "/design/kind").detail, "is not among the choices");
    assert_eq!(
        of(&found, "/design/kind").allowed.as_deref(),
        Some("grid, one_at_a_time, random, latin_hypercube, sobol, box_behnken, list, csv")
    );
    assert_eq!(spec.expect("readable all the same").factors.len(), 3);
    let (_, found) =
        read_leniently::<SweepSpec>(json!({"name": "s", "base": {}, "factors": [], "design": ["grid"]}));
    assert_eq!((found.len(), found[0].pointer.as_str()), (1, "/design"));
    let seeds = json!({"name": "s", "base": {}, "factors": [], "design": {"kind": "grid"}, "seeds": 4});
    let (_, found) = read_leniently::<SweepSpec>(seeds);
    assert!(of(&found, "/seeds").detail.ends_with("did you mean replicates?"), "{found:?}");
    let extra = json!({"name": "s", "base": {}, "factors": [], "design": {"kind": "grid", "extra": 1}});
    let (_, found) = read_leniently::<SweepSpec>(extra);
    assert_eq!((found.len(), found[0].pointer.as_str()), (1, "/design/extra"));
}

/// Reads the placeholder of a whole document.
fn read_placeholder<T: DocumentType>() {
    let placeholder = T::shape().placeholder();
    let read = serde_json::from_value::<T>(placeholder.clone());
    assert!(read.is_ok(), "{:?}: {placeholder}", read.err());
}

#[test]
fn placeholders_of_all_documents_can_be_read() {
    read_placeholder::<ClaimRequest>();
    read_placeholder::<Extension>();
    read_placeholder::<FailureReport>();
    read_placeholder::<HeartbeatRequest>();
    read_placeholder::<JobEnvelope>();
    read_placeholder::<ResultDelivery>();
    read_placeholder::<SweepSpec>();
    read_placeholder::<WorkerRegistration>();
}

#[test]
fn numbers_outside_the_range_of_their_type_are_faults() {
    let id = "00000000-0000-0000-0000-000000000000";
    let request = json!({"request_id": id, "worker_id": "here", "max_jobs": 65, "wait_s": -1});
    let found = read_document::<ClaimRequest>(request).expect_err("three faults");
    assert_eq!(found.len(), 3, "{found:?}");
    assert_eq!(of(&found, "/max_jobs").allowed.as_deref(), Some("a whole number from 1 to 64"));
    assert_eq!(of(&found, "/wait_s").allowed.as_deref(), Some("a number from 0 to 86400"));
    assert_eq!(of(&found, "/worker_id").detail, "must be a UUID, not a string");
}

#[test]
fn a_fault_deep_in_a_list_has_its_pointer() {
    let id = "00000000-0000-0000-0000-000000000000";
    let part = json!({"name": "mass", "unit": "kg", "from": 0, "t_s": [0.0, "soon"], "values": [1.0, null]});
    let beat = json!({"job_id": id, "attempt": 1.5, "progress": null, "samples": [part]});
    let found = read_document::<HeartbeatRequest>(json!({"attempts": [beat]})).expect_err("three faults");
    let mut pointers: Vec<_> = found.iter().map(|fault| fault.pointer.as_str()).collect();
    pointers.sort_unstable();
    assert_eq!(
        pointers,
        ["/attempts/0/attempt", "/attempts/0/samples/0/t_s/1", "/attempts/0/samples/0/values/1"]
    );
    assert_eq!(of(&found, "/attempts/0/attempt").detail, "must be a whole number");
}

const ID: &str = "00000000-0000-0000-0000-000000000000";

fn pointers_of(faults: &[Fault]) -> Vec<&str> {
    let mut pointers: Vec<_> = faults.iter().map(|fault| fault.pointer.as_str()).collect();
    pointers.sort_unstable();
    pointers
}

#[test]
fn u32_beyond_its_range_is_a_fault() {
    let registration = json!({"worker_id": ID, "name": "a", "api_version": "v1", "backend": "cpu",
                              "device": "a test", "solver_revision": 5_000_000_000_u64,
                              "threads": 5_000_000_000_u64, "memory_mib": 5_000_000_000_u64});
    let found = read_document::<WorkerRegistration>(registration).expect_err("three faults");
    assert_eq!(pointers_of(&found), ["/memory_mib", "/solver_revision", "/threads"]);
    let allowed = |pointer| of(&found, pointer).allowed.clone().unwrap();
    assert_eq!(allowed("/threads"), "a whole number from 0 to 4294967295");
    assert_eq!(allowed("/memory_mib"), "a whole number from 0 to 4294967295 or null");
    assert_eq!(of(&found, "/threads").detail, "is out of range");
}

#[test]
fn every_fault_of_a_result_is_listed_once() {
    let read = |document| read_document::<ResultDelivery>(document).expect_err("a faulty delivery");
    assert_eq!(pointers_of(&read(json!({"worker_id": ID}))), ["/result"]);
    let found = read(json!({"worker_id": ID, "result": {"schema": 3, "series": [["a"]]}}));
    let all = [
        "/result/end_reason",
        "/result/performance",
        "/result/responses",
        "/result/scenario",
        "/result/scenario_digest",
        "/result/schema",
        "/result/series/0",
        "/result/solver",
    ];
    assert_eq!(pointers_of(&found), all);
    assert_eq!(of(&found, "/result/end_reason").detail, "is missing");
    assert_eq!(of(&found, "/result/series/0").detail, "must be an object, not a list");
    let found = read_document::<FailureReport>(
        json!({"worker_id": ID, "outcome": "unstable", "message": "", "result": []}),
    );
    assert_eq!(pointers_of(&found.expect_err("a list")), ["/result"]);
}

#[test]
fn progress_is_an_object() {
    let read = |progress: Value| {
        let beat = json!({"job_id": ID, "attempt": 1, "progress": progress});
        read_document::<HeartbeatRequest>(json!({"attempts": [beat]})).expect_err("faulty progress")
    };
    for progress in [json!(3), json!(["fill", 1.0, 2.0, 0.5, 9, 10, 0.1, 3.0])] {
        let found = read(progress);
        assert_eq!(pointers_of(&found), ["/attempts/0/progress"]);
        assert_eq!(found[0].allowed.as_deref(), Some("an object or null"));
        assert!(found[0].detail.starts_with("must be an object, not"), "{found:?}");
    }
}

/// A delivery with this scenario, otherwise valid.
fn delivery(change: impl FnOnce(&mut Value)) -> Value {
    let mut delivery = ResultDelivery::shape().placeholder();
    delivery["worker_id"] = json!(ID);
    change(&mut delivery["result"]["scenario"]);
    delivery
}

#[test]
fn faults_of_serde_have_a_pointer_and_plain_words() {
    let read = |change: fn(&mut Value)| {
        let found = read_document::<ResultDelivery>(delivery(change)).expect_err("a faulty scenario");
        assert_eq!(found.len(), 1, "{found:?}");
        (found[0].pointer.clone(), found[0].detail.clone())
    };
    let fault = |pointer: &str, detail: &str| (pointer.to_owned(), detail.to_owned());
    let missing = read(|scenario| drop(scenario["product"].as_object_mut().unwrap().remove("count")));
    assert_eq!(missing, fault("/result/scenario/product/count", "is missing"));
    let unknown = read(|scenario| scenario["product"]["colour"] = json!("red"));
    assert_eq!(unknown, fault("/result/scenario/product/colour", "is not a known field"));
    let text = read(|scenario| scenario["product"]["count"] = json!("many"));
    assert_eq!(text, fault("/result/scenario/product/count", "must be a whole number, not a string"));
}

#[test]
#[should_panic(expected = "int128")]
fn integer_format_without_a_range_panics() {
    Shape::compile(&json!({"type": "integer", "format": "int128"}), &serde_json::Map::new());
}
