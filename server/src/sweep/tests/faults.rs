//! Tests of the faults of designs and factors.

use super::*;

/// Pointer and detail of each fault.
fn found_in(design: Value, factors: Value) -> Vec<(String, String)> {
    faults(&of_design(design, factors)).into_iter().map(|fault| (fault.pointer, fault.detail)).collect()
}

#[track_caller]
fn assert_fault(found: &[(String, String)], pointer: &str, word: &str) {
    assert!(
        found.iter().any(|(at, detail)| at == pointer && detail.contains(word)),
        "{pointer}: {word}\n{found:#?}"
    );
}

#[test]
fn faults_of_a_design_are_listed() {
    let gate = json!([{"pointer": GATE, "low": 0.05, "high": 0.07}]);
    assert_fault(
        &found_in(json!({"kind": "grid", "seed": 3}), gate.clone()),
        "/design/seed",
        "grid does not take this field",
    );
    assert_fault(
        &found_in(json!({"kind": "random", "points": 3}), json!([])),
        "/factors",
        "nothing is varied",
    );
    assert_fault(&found_in(json!({"kind": "sobol"}), gate.clone()), "/design/points", "needs this field");
    assert_fault(
        &found_in(json!({"kind": "random", "points": 0}), gate.clone()),
        "/design/points",
        "at least one",
    );
    assert_fault(
        &found_in(json!({"kind": "sobol", "points": 70000}), gate.clone()),
        "/design/points",
        "70000",
    );
    assert_fault(
        &found_in(json!({"kind": "random", "points": 2, "seed": 1_u64 << 53}), gate.clone()),
        "/design/seed",
        "range",
    );
    assert_fault(
        &found_in(json!({"kind": "list", "rows": []}), json!([{"pointer": GATE}])),
        "/design/rows",
        "no row",
    );
    let list =
        found_in(json!({"kind": "list", "rows": [[0.05, 1], [0.05], [0.05]]}), json!([{"pointer": GATE}]));
    assert_fault(&list, "/design/rows/0", "2 values for 1 factors");
    assert_fault(&list, "/design/rows", "row 2 is the same as row 1");
    assert_fault(
        &found_in(json!({"kind": "list", "rows": [[0.05]]}), gate.clone()),
        "/factors/0/low",
        "the rows of a list",
    );
    assert_fault(
        &found_in(json!({"kind": "list", "rows": [[0.05], ["x"]]}), json!([{"pointer": GATE}])),
        "/design/rows/1/0",
        "",
    );
    let csv = |table: &str| found_in(json!({"kind": "csv", "table": table}), json!([{"pointer": GATE}]));
    assert_fault(&csv("gate\n0.05\n"), "/design/table", "column 1 is no factor");
    assert_fault(&csv("gate\n0.05\n"), "/design/table", &format!("no column `{GATE}`"));
    assert_fault(&csv(&format!("{GATE}\n0.05,1\n")), "/design/table", "fields");
    let wrong = csv(&format!("{GATE}\n-1\nx\n0.05\n"));
    assert_fault(&wrong, "/design/table", "design point 0");
    assert_fault(&wrong, "/design/table", "design point 1");
}

#[test]
fn faults_of_a_factor_are_listed() {
    let random = || json!({"kind": "random", "points": 4});
    let of = |factor: Value| found_in(random(), json!([factor]));
    assert_fault(&of(json!({"pointer": GATE})), "/factors/0/levels", "needs values");
    assert_fault(&of(json!({"levels": [1]})), "/factors/0/pointer", "needs a field");
    assert_fault(
        &of(json!({"pointer": GATE, "pointers": [BELT], "levels": [1]})),
        "/factors/0/pointers",
        "already",
    );
    assert_fault(&of(json!({"pointer": GATE, "low": 0.05})), "/factors/0/high", "`low` needs");
    assert_fault(&of(json!({"pointer": GATE, "low": 0.07, "high": 0.05})), "/factors/0/high", "not above");
    assert_fault(
        &of(json!({"pointer": GATE, "low": 0.05, "high": 1e9})),
        "/factors/0/high",
        "not a value of",
    );
    assert_fault(&of(json!({"pointer": COUNT, "low": 1.5, "high": 4})), "/factors/0/low", "not a value of");
    assert_fault(
        &of(json!({"pointer": "/contact/condition", "low": 0, "high": 1})),
        "/factors/0/low",
        "not a value of",
    );
    let log = json!({"pointer": "/scene/gravity", "low": -1.0, "high": 1.0, "scale": "log"});
    assert_fault(&of(log), "/factors/0/low", "logarithmic");
    assert_fault(
        &of(json!({"pointer": GATE, "low": 0.05, "high": 0.07, "count": 3})),
        "/factors/0/count",
        "does not take",
    );
    assert_fault(
        &of(json!({"pointer": GATE, "levels": [0.05], "low": 0.05})),
        "/factors/0/low",
        "`levels` already",
    );
    let linked = json!({"pointers": [BELT, BELT], "levels": [0.1]});
    assert_fault(&of(linked), "/factors/0/pointers/1", "factor 0 varies the same field");
    let few = found_in(json!({"kind": "grid"}), json!([{"pointer": COUNT, "low": 3, "high": 5, "count": 9}]));
    assert_fault(&few, "/factors/0", "no 9 different whole numbers");
}

#[test]
fn a_misspelled_field_in_a_list_has_its_index() {
    let base = json!({"experiment": "scene", "scene": {
        "bodies": [{"position_m": [0, 0, 0.5]}, {"position_m": [0, 0, 1]}],
        "surfaces": [{"name": "floor", "plate_m": [[0, 0, 0], [1, 0, 0], [0, 1, 0]]}]}});
    let sweep = json!({"name": "s", "base": base, "design": {"kind": "grid"},
                       "factors": [{"pointer": "/scene/bodies/1/positon_m", "levels": [[0, 0, 1]]}]});
    let found = faults(&serde_json::from_value(sweep).unwrap());
    assert!(found[0].detail.ends_with("did you mean /scene/bodies/1/position_m?"), "{found:?}");
}

#[test]
fn an_unknown_kind_of_design_is_one_fault() {
    let sweep = json!({"name": "s", "base": {"experiment": "hopper"}, "design": {"kind": "lhs", "points": 30, "seed": 2},
                       "factors": [{"pointer": GATE, "low": 0.02, "high": 0.08}]});
    let found = read(sweep, &Meshes::default(), LIMITS).map(drop).expect_err("an unknown kind");
    assert_eq!(found.iter().map(|fault| fault.pointer.as_str()).collect::<Vec<_>>(), ["/design/kind"]);
}

#[test]
fn placeholders_beyond_the_maximum_of_faults_are_not_checked() {
    let sweep = json!({"name": "s", "base": {}, "design": {"kind": "grid"}, "factors": vec![3; 200]});
    let faults = read(sweep, &Meshes::default(), LIMITS).map(drop).expect_err("faulty factors");
    assert_eq!(faults.len(), 50);
}
