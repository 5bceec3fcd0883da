//! The table of results: every run of every experiment returns its rows, and no others.

mod common;

use common::checked;
use roost_solver::experiments::{ResponseType, is_indicator, outputs_of, response_names};
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
    let others = fields::EXPERIMENTS.iter().map(|name| json!({"experiment": name}));
    let others = others.filter(|other| documents.iter().all(|one| one["experiment"] != other["experiment"]));
    documents.iter().cloned().chain(others).map(small).collect()
}

fn small(mut document: Value) -> Scenario {
    let product = document.as_object_mut().unwrap().entry("product").or_insert(json!({}));
    product["subparticle_radius_m"] = json!(0.009);
    let experiment = document["experiment"].as_str().and_then(fields::declaration).expect("an experiment");
    let takes = |pointer: &str| fields::find(pointer).is_some_and(|field| experiment.takes(field));
    if takes("/product/count") {
        document["product"]["count"] = json!(2);
    }
    let numerics = document.as_object_mut().unwrap().entry("numerics").or_insert(json!({}));
    numerics["timestep_s"] = json!("auto");
    if takes("/numerics/duration_s") {
        document["numerics"]["duration_s"] = json!(0.04);
    }
    scenario::from_value(&document).unwrap_or_else(|faults| panic!("{document}: {faults:?}"))
}

#[test]
fn every_experiment_returns_all_rows_of_its_response_table() {
    let mut ends = Vec::new();
    let mut seen = std::collections::BTreeSet::new();
    for scenario in scenarios() {
        let document = json!(scenario);
        let experiment = document["experiment"].as_str().unwrap().to_owned();
        let known = response_names(&scenario.experiment);
        let of_monitor: Vec<_> = known.iter().copied().filter(|name| !name.starts_with("warning_")).collect();
        let options = CpuOptions { threads: 1 };
        let result = simulate(&checked(&scenario), options, &mut |_: &Progress| Flow::Continue);
        let names: Vec<_> = result.responses.keys().map(String::as_str).collect();
        assert_eq!(names, known, "{experiment} that ended as {:?}", result.end_reason);
        ends.push(result.end_reason);

        let outputs = outputs_of(&experiment).expect("results of every experiment");
        assert!(
            std::ptr::eq(outputs, roost_solver::experiments::outputs(&scenario.experiment)),
            "{experiment}"
        );
        for row in outputs.responses {
            let value = &result.responses[row.name];
            let fits = match row.kind {
                ResponseType::Number => value.is_number(),
                ResponseType::Indicator => *value == 0 || *value == 1,
                ResponseType::Boolean => value.is_boolean(),
                ResponseType::Word => value.is_string(),
            };
            assert!(fits || value.is_null(), "{experiment}: {} is {value}", row.name);
            assert_eq!(is_indicator(row.name), row.kind == ResponseType::Indicator, "{}", row.name);
            assert!(row.doc.ends_with('.') && !row.doc.contains('\n'), "{experiment}: {}", row.name);
        }
        let series = outputs.series.iter().map(|row| (row.name.replace("<name>", "floor"), row.unit));
        let of_floor = |(name, _): &(String, &str)| {
            document["scene"]["surfaces"].as_array().is_some_and(|all| !all.is_empty())
                || !name.contains("floor")
        };
        let series: Vec<_> = series.filter(of_floor).collect();
        let found: Vec<_> = result.series.iter().map(|one| (one.name.clone(), one.unit.as_str())).collect();
        assert_eq!(found, series, "{experiment}");
        for row in outputs.curves {
            assert_eq!(row.per_body, ["fillet", "body"].contains(&row.over), "{experiment}: {}", row.name);
        }
        let curves: Vec<_> = outputs.curves.iter().map(|row| (row.name, row.unit, row.over)).collect();
        let found: Vec<_> = result
            .curves
            .iter()
            .map(|one| (one.name.as_str(), one.unit.as_str(), one.over.as_str()))
            .collect();
        assert_eq!(found, curves, "{experiment}");

        let monitor = checked(&scenario).setup().monitor();
        use EndReason::{Done, Duration, Empty, FillNotAtRest, Jammed, Unstable};
        for reason in [Duration, Empty, Jammed, Done, FillNotAtRest, Unstable] {
            let responses = monitor.responses(reason);
            let names: Vec<_> = responses.keys().map(String::as_str).collect();
            assert_eq!(names, of_monitor, "{experiment} that ended as {reason:?} before it began");
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
