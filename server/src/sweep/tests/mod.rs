//! Tests of sweeps without a server. This file has the expansion; others have designs, faults, extensions and evaluation.

mod designs;
mod extensions;
mod faults;
mod outcomes;
mod posterior;

use roost_api::sweep::SweepSpec;
use roost_solver::Limits;
use serde_json::{Value, json};

use super::points::Point;
use super::*;

const LIMITS: SweepLimits =
    SweepLimits { max_jobs: 1000, scenario: Limits { max_subparticles: 1_000_000, max_steps: 100_000_000 } };

fn spec(factors: Value) -> SweepSpec {
    of_design(json!({"kind": "grid"}), factors)
}

fn of_design(design: Value, factors: Value) -> SweepSpec {
    let base = json!({"experiment": "hopper", "product": {"count": 6, "subparticle_radius_m": 0.008}});
    serde_json::from_value(json!({"name": "s", "base": base, "design": design, "factors": factors})).unwrap()
}

/// The levels of each point, a row per point.
fn matrix(spec: &SweepSpec) -> Vec<Vec<Value>> {
    let expansion = expand(spec, &Meshes::default(), LIMITS).unwrap_or_else(|faults| panic!("{faults:#?}"));
    let row = |point: Point| expansion.factors.iter().map(|name| point.levels[name].clone()).collect();
    expansion.points.iter().map(row).collect()
}

/// The faults of a faulty sweep.
fn faults(spec: &SweepSpec) -> Vec<Fault> {
    expand(spec, &Meshes::default(), LIMITS).map(drop).expect_err("a sweep at fault")
}

/// Reference numbers of SciPy, from `server/testdata/make.py`.
fn scipy() -> Value {
    serde_json::from_str(include_str!("../../../testdata/scipy.json")).unwrap()
}

const GATE: &str = "/equipment/gate_opening_m";
const BELT: &str = "/equipment/belt_speed_m_s";
const COUNT: &str = "/product/count";

#[test]
fn a_level_goes_into_the_document_as_submitted() {
    let complete = json!({"a": {"b": {"c": 1, "d": 2}}, "list": [[1, 2], [3, 4]]});
    let mut document = json!({"a": {"x": 0}});
    pointer::set(&mut document, &complete, "/a/b/c", &json!(7));
    assert_eq!(document, json!({"a": {"x": 0, "b": {"c": 7}}}), "siblings keep their defaults");
    pointer::set(&mut document, &complete, "/list/1/0", &json!(9));
    assert_eq!(document["list"], json!([[1, 2], [9, 4]]), "the whole array is copied first");
}

#[test]
fn pointers_overlap_by_segments() {
    assert!(pointer::overlap("/a/b", "/a"));
    assert!(pointer::overlap("/a", "/a"));
    assert!(!pointer::overlap("/a/bc", "/a/b"));
    assert_eq!(pointer::segments("/a~1b/~0").unwrap(), ["a/b", "~"]);
    assert_eq!(pointer::segments("a"), None);
    assert_eq!(pointer::segments(""), None);
}

#[test]
fn replicates_count_seeds_from_the_base() {
    let mut spec = spec(json!([{"pointer": "/equipment/gate_opening_m", "levels": [0.05, 0.06]}]));
    spec.base["seed"] = json!(40);
    spec.replicates = 3;
    let expansion = expand(&spec, &Meshes::default(), LIMITS).unwrap();
    assert_eq!(expansion.jobs(), 6);
    assert_eq!(expansion.wall_s, 6.0 * expansion.estimate.wall_s, "the gate does not change the estimate");
    let gates: Vec<_> =
        expansion.points.iter().map(|point| point.scenario.equipment().unwrap().gate_opening_m).collect();
    assert_eq!(gates, [0.05, 0.06]);
    let trials = expansion.points.trials(7, 3);
    let trials: Vec<_> =
        trials.map(|it| (it.point, it.replicate, it.scenario.seed, it.levels.is_some())).collect();
    let first = [(7, 0, 40, true), (7, 1, 41, false), (7, 2, 42, false)];
    assert_eq!(trials[..3], first, "the levels of a point come with its first trial");
    assert_eq!(trials[3..], first.map(|(_, replicate, seed, levels)| (8, replicate, seed, levels)));
}

#[test]
fn a_fault_of_a_combination_names_the_level_and_the_point() {
    let factors = json!([{"pointer": "/equipment/hopper_height_m", "levels": [0.3, 0.5]},
                         {"pointer": "/equipment/gate_opening_m", "levels": [0.06, 0.4]}]);
    let faults = expand(&spec(factors), &Meshes::default(), LIMITS).unwrap_err();
    assert!(!faults.is_empty());
    for fault in &faults {
        assert!(fault.pointer.starts_with("/factors/"), "{fault}");
        assert!(fault.detail.contains("design point 1"), "{fault}");
    }
}

#[test]
fn a_fault_outside_every_factor_names_the_base_and_the_point() {
    let mut spec = spec(json!([{"pointer": "/equipment/hopper_height_m", "levels": [0.5, 0.2]}]));
    spec.base["equipment"] = json!({"gate_opening_m": 0.3});
    let faults = expand(&spec, &Meshes::default(), LIMITS).unwrap_err();
    assert!(faults.iter().all(|fault| fault.detail.contains("design point 1")), "{faults:?}");
    assert!(
        faults.iter().all(|fault| {
            fault.pointer == "/base/equipment/gate_opening_m" || fault.pointer == "/factors/0/levels/1"
        }),
        "{faults:?}"
    );
}
