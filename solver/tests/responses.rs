//! The table of responses: every run of every experiment returns those of its list, and no others.

use roost_solver::experiments::{prepare, response_names};
use roost_solver::mesh::Meshes;
use roost_solver::result::EndReason;
use roost_solver::scenario::{self, Scenario, fields};
use roost_solver::{CpuOptions, Flow, Progress, simulate};
use serde_json::{Value, json};

/// Small scenarios of every experiment, with what may decide on a response.
fn scenarios() -> Vec<Scenario> {
    let plate = json!({"name": "floor", "plate_m": [[-1, -1, 0], [2, 0, 0], [0, 2, 0]]});
    let hopper = json!({"hopper_width_m": 0.2, "side_walls": "frictionless"});
    let standing = json!({"hopper_width_m": 0.2, "side_walls": "frictionless", "belt_speed_m_s": 0});
    let documents = [
        json!({"experiment": "hopper", "equipment": hopper}),
        json!({"experiment": "hopper", "equipment": standing, "numerics": {"max_fill_s": 0.02}}),
        json!({"experiment": "drop"}),
        json!({"experiment": "bend", "bend": {"support": "over_bar"}}),
        json!({"experiment": "bend", "bend": {"support": "clamped"}}),
        json!({"experiment": "bend", "bend": {"support": "off_ledge"}}),
        json!({"experiment": "slide", "slide": {"max_tilt_deg": 2, "tilt_rate_deg_s": 30}}),
        json!({"experiment": "compress", "compress": {"lattice": [2, 2, 1], "strain_rate_1_s": 1}}),
        json!({"experiment": "compress", "compress": {"lattice": [2, 2, 2], "strain_rate_1_s": 1}}),
        json!({"experiment": "scene", "scene": {"bodies": [{"position_m": [0, 0, 0.2]}], "surfaces": [plate]}}),
        json!({"experiment": "scene", "scene": {"bodies": [{"position_m": [0, 0, 9]}], "margin_m": 0.1}}),
    ];
    documents.into_iter().map(small).collect()
}

fn small(mut document: Value) -> Scenario {
    let product = document.as_object_mut().unwrap().entry("product").or_insert(json!({}));
    product["subparticle_radius_m"] = json!(0.009);
    if ["hopper", "drop"].iter().any(|one| document["experiment"] == *one) {
        document["product"]["count"] = json!(2);
    }
    let numerics = document.as_object_mut().unwrap().entry("numerics").or_insert(json!({}));
    numerics["timestep_s"] = json!("auto");
    if !["slide", "compress"].iter().any(|one| document["experiment"] == *one) {
        document["numerics"]["duration_s"] = json!(0.04);
    }
    scenario::from_value(&document).unwrap_or_else(|faults| panic!("{document}: {faults:?}"))
}

#[test]
fn every_experiment_returns_the_responses_of_its_list_whatever_happens() {
    let mut ends = Vec::new();
    let mut seen = std::collections::BTreeSet::new();
    for scenario in scenarios() {
        let document = json!(scenario);
        let experiment = document["experiment"].as_str().unwrap().to_owned();
        let known = response_names(&scenario.experiment);
        assert!(known.is_sorted() && !known.is_empty(), "{experiment}");
        let options = CpuOptions { threads: 1 };
        let result = simulate(&scenario, &Meshes::default(), options, &mut |_: &Progress| Flow::Continue);
        let names: Vec<_> = result.responses.keys().map(String::as_str).collect();
        assert_eq!(names, known, "{experiment} that ended as {:?}", result.end_reason);
        ends.push(result.end_reason);

        let watch = prepare(&scenario, &Meshes::default()).watch;
        use EndReason::{Done, Duration, Empty, FillNotAtRest, Jammed, Unstable};
        for reason in [Duration, Empty, Jammed, Done, FillNotAtRest, Unstable] {
            let responses = watch.responses(reason);
            let names: Vec<_> = responses.keys().map(String::as_str).collect();
            assert_eq!(names, known, "{experiment} that ended as {reason:?} before it began");
        }
        seen.insert(experiment);
    }
    let all: Vec<_> = seen.iter().map(String::as_str).collect();
    let mut experiments = fields::EXPERIMENTS.to_vec();
    experiments.sort_unstable();
    assert_eq!(all, experiments);
    for reason in [EndReason::Duration, EndReason::FillNotAtRest] {
        assert!(ends.contains(&reason), "{ends:?}");
    }
}
