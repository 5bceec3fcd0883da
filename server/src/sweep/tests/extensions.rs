//! Tests of extensions: new points are added and existing points stay.

use super::*;

/// A sweep as the store returns it.
fn stored(spec: SweepSpec) -> StoredSweep {
    let expansion = expand(&spec, &Meshes::default(), LIMITS).unwrap();
    let points = expansion.points.iter().map(|point| point.levels).collect();
    StoredSweep { replicates: spec.replicates, spec, points }
}

/// Extends a sweep. Returns the levels of the new points, a row per point.
fn extended(stored: &mut StoredSweep, extension: Value) -> Vec<Vec<Value>> {
    let added =
        extend(stored, extension, &Meshes::default(), LIMITS).unwrap_or_else(|faults| panic!("{faults:#?}"));
    stored.replicates = added.replicates;
    stored.points.extend(added.points.iter().map(|point| point.levels));
    let names: Vec<String> = factors(&stored.spec).iter().map(|factor| factor.name().to_owned()).collect();
    let row = |point: Point| names.iter().map(|name| point.levels[name].clone()).collect();
    added.points.iter().map(row).collect()
}

#[track_caller]
fn refused(stored: &StoredSweep, extension: Value, pointer: &str, word: &str) {
    let found = extend(stored, extension, &Meshes::default(), LIMITS).expect_err("an extension at fault");
    let holds = found.iter().any(|fault| fault.pointer == pointer && fault.to_string().contains(word));
    assert!(holds, "{pointer}: {word}\n{found:#?}");
}

fn range() -> Value {
    json!([{"pointer": GATE, "low": 0.05, "high": 0.07}, {"pointer": BELT, "low": 0.1, "high": 0.4}])
}

#[test]
fn extended_sequences_equal_longer_ones() {
    for kind in ["random", "sobol"] {
        let of = |points: u32| of_design(json!({"kind": kind, "points": points, "seed": 5}), range());
        let mut sweep = stored(of(8));
        let first = extended(&mut sweep, json!({"points": 4}));
        let second = extended(&mut sweep, json!({"points": 20}));
        let all = matrix(&of(32));
        assert_eq!([first, second].concat(), all[8..], "the same points as of one longer sequence");
    }
    let sweep = stored(of_design(json!({"kind": "sobol", "points": 8}), range()));
    refused(&sweep, json!({"points": 65_530}), "", "at most 1000 jobs");
    let limits = SweepLimits { max_jobs: 1_000_000, ..LIMITS };
    let far = extend(&sweep, json!({"points": 65_530}), &Meshes::default(), limits).unwrap_err();
    assert_eq!(far[0].pointer, "/points");
}

#[test]
fn a_grid_grows_by_the_combinations_with_a_new_level() {
    let factors = json!([{"pointer": GATE, "levels": [0.05, 0.06]}, {"pointer": BELT, "levels": [0.1, 0.2]}]);
    let mut sweep = stored(spec(factors));
    let added = extended(&mut sweep, json!({"levels": {GATE: [0.07]}}));
    assert_eq!(json!(added), json!([[0.07, 0.1], [0.07, 0.2]]));
    let added = extended(&mut sweep, json!({"levels": {BELT: [0.3], GATE: [0.08]}}));
    let expected = json!([[0.05, 0.3], [0.06, 0.3], [0.07, 0.3], [0.08, 0.1], [0.08, 0.2], [0.08, 0.3]]);
    assert_eq!(json!(added), expected, "levels of earlier extensions count");
    assert_eq!(sweep.points.len(), 12);
    refused(&sweep, json!({"levels": {GATE: [0.08]}}), "/levels/~1equipment~1gate_opening_m/0", "already");
    refused(&sweep, json!({"levels": {"/x": [1]}}), "/levels/~1x", "no such factor");
    refused(
        &sweep,
        json!({"levels": {GATE: [-1.0]}}),
        "/levels/~1equipment~1gate_opening_m/0",
        "design point 12",
    );
    refused(&sweep, json!({"points": 3}), "/points", "allowed: levels, replicates");
}

#[test]
fn one_at_a_time_grows_by_levels() {
    let factors = json!([{"pointer": GATE, "levels": [0.05]}, {"pointer": COUNT, "levels": [4]}]);
    let mut sweep = stored(of_design(json!({"kind": "one_at_a_time"}), factors));
    let added = extended(&mut sweep, json!({"levels": {COUNT: [5, 7]}}));
    assert_eq!(json!(added), json!([[0.06, 5], [0.06, 7]]));
    for there in [4, 5, 6] {
        refused(&sweep, json!({"levels": {COUNT: [there]}}), "/levels/~1product~1count/0", "already");
    }
}

#[test]
fn points_are_counted_before_they_are_made() {
    // 36 million points would fill the memory.
    let pointers = [GATE, BELT, "/contact/fillet_belt/static_friction"];
    let factors: Vec<_> = pointers.iter().map(|at| json!({"pointer": at, "levels": [0.05]})).collect();
    let grid = stored(spec(json!(factors)));
    let levels: Vec<f64> = (0..330).map(|level| 0.1 + f64::from(level) * 1e-4).collect();
    let added: serde_json::Map<_, _> = pointers.iter().map(|at| ((*at).to_owned(), json!(levels))).collect();
    refused(&grid, json!({"levels": added}), "", "36264691 jobs");
    // A million levels would be compared with one another.
    let one = stored(of_design(json!({"kind": "one_at_a_time"}), json!(factors)));
    let many: Vec<u32> = (0..1_000_000).collect();
    refused(&one, json!({"levels": {COUNT: many}}), "", "1000004 jobs");
}

#[test]
fn a_list_grows_by_rows() {
    let mut sweep = stored(of_design(
        json!({"kind": "list", "rows": [[0.05, 0.1]]}),
        json!([{"pointer": GATE}, {"pointer": BELT}]),
    ));
    assert_eq!(
        json!(extended(&mut sweep, json!({"rows": [[0.06, 0.1], [0.07, 0.1]]}))),
        json!([[0.06, 0.1], [0.07, 0.1]])
    );
    let table = format!("{BELT},{GATE}\n0.2,0.05\n");
    assert_eq!(json!(extended(&mut sweep, json!({"table": table}))), json!([[0.05, 0.2]]));
    refused(&sweep, json!({"rows": [[0.05, 0.2]]}), "/rows", "a point of the sweep already");
    refused(&sweep, json!({"rows": [[0.05, -1]]}), "/rows/0/1", "design point 4");
}

#[test]
fn designs_without_new_points_give_the_reason() {
    let mut hypercube = stored(of_design(json!({"kind": "latin_hypercube", "points": 8}), range()));
    refused(&hypercube, json!({"points": 8}), "/points", "each point of a Latin hypercube has its own part");
    assert!(extended(&mut hypercube, json!({"replicates": 2})).is_empty());
    assert_eq!(hypercube.replicates, 3);
    let factors = json!([range()[0], range()[1], {"pointer": COUNT, "levels": [4, 6, 7]}]);
    let cube = stored(of_design(json!({"kind": "box_behnken"}), factors));
    refused(&cube, json!({"points": 1}), "/points", "a Box-Behnken design is complete");
    refused(&cube, json!({}), "", "nothing to add");
    refused(&cube, json!({"replicates": 0}), "/replicates", "nothing to add");
    refused(&cube, json!({"replicates": 500}), "", "at most 1000 jobs");
    refused(&cube, json!({"replicats": 1}), "/replicats", "did you mean replicates");
}
