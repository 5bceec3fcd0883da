//! Observables of made-up results, against interpolation by hand, and names.

use serde_json::{Value, json};

use super::*;
use crate::experiments::outputs_of;
use crate::result::{Curve, Series};
use crate::scenario;

fn outputs(experiment: &str) -> &'static Outputs {
    outputs_of(experiment).expect("an experiment")
}

/// A result with these responses, series over time and curves.
fn result(
    experiment: &str,
    end: EndReason,
    responses: Value,
    series: &[Series],
    curves: &[Curve],
) -> RunResult {
    let scenario = scenario::from_value(&json!({"experiment": experiment})).expect("defaults");
    let document = json!({
        "schema": crate::result::SCHEMA, "end_reason": end, "instability": null, "responses": responses,
        "series": series, "curves": curves,
        "solver": {"version": "0", "revision": 16, "backend": "cpu", "device": "none", "threads": 1, "timestep_s": 1e-4},
        "performance": {"subparticles": 1, "particle_steps": 1, "steps": 1, "wall_s": 1.0, "ns_per_particle_step": 1.0},
        "scenario": scenario, "scenario_digest": ""});
    RunResult::from_value(document).expect("a result")
}

fn value(result: &RunResult, experiment: &str, name: &str) -> Option<f64> {
    let observable = Observable::parse(outputs(experiment), name).unwrap_or_else(|| panic!("no {name}"));
    assert_eq!(observable.to_string(), name, "a name is written as it is read");
    observable.value(result)
}

fn curve(name: &str, over: &str, x: &[f64], values: &[f64]) -> Curve {
    let [name, over] = [name, over].map(str::to_owned);
    Curve {
        name,
        unit: "Pa".to_owned(),
        over,
        over_unit: "1".to_owned(),
        x: x.to_vec(),
        values: values.to_vec(),
    }
}

fn series(name: &str, t_s: &[f64], values: &[f64]) -> Series {
    Series { name: name.to_owned(), unit: "kg".to_owned(), t_s: t_s.to_vec(), values: values.to_vec() }
}

#[test]
fn stress_at_a_strain_is_interpolated() {
    let stress = curve("stress", "strain", &[0.0, 0.02, 0.03], &[0.0, 200.0, 450.0]);
    // The same name over another strain is another curve.
    let lattice = curve("stress_lattice", "strain_lattice", &[0.0, 0.01], &[0.0, 200.0]);
    let result = result("compress", EndReason::Done, json!({"modulus_pa": 9000.0}), &[], &[lattice, stress]);
    let at = |name: &str| value(&result, "compress", name);
    assert_eq!(at("stress_pa@strain=0"), Some(0.0));
    assert_eq!(at("stress_pa@strain=0.02"), Some(200.0));
    assert!((at("stress_pa@strain=0.025").unwrap() - 325.0).abs() < 1e-9);
    assert_eq!(at("stress_pa@strain=0.031"), None, "nothing is extrapolated");
    assert!((at("stress_lattice_pa@strain_lattice=0.004").unwrap() - 80.0).abs() < 1e-9);
    // The other direction: 325 Pa at the strain above.
    assert!((at("strain@stress_pa=325").unwrap() - 0.025).abs() < 1e-12);
    assert_eq!(at("modulus_pa"), Some(9000.0));
    assert_eq!(at("stress_at_end_pa"), None, "the run has no such response");
}

#[test]
fn non_monotonic_curve_is_evaluated_at_its_first_crossing() {
    let stress = curve("stress", "strain", &[0.0, 0.01, 0.02, 0.03], &[0.0, 300.0, 100.0, 400.0]);
    let result = result("compress", EndReason::Done, json!({}), &[], &[stress]);
    assert!((value(&result, "compress", "strain@stress_pa=150").unwrap() - 0.005).abs() < 1e-12);
    // From 100 Pa to 400 Pa within 0.01: 350 Pa at 5/6 of it.
    let third = value(&result, "compress", "strain@stress_pa=350").unwrap();
    assert!((third - (0.02 + 0.01 * 5.0 / 6.0)).abs() < 1e-12, "{third}");
    assert_eq!(value(&result, "compress", "strain@stress_pa=401"), None);
}

#[test]
fn discharged_mass_is_extended_only_after_an_empty_or_jammed_hopper() {
    let times = [0.0, 1.0, 2.0, 3.0];
    let (out, rate) = (
        series("discharged_mass", &times, &[0.0, 8.0, 16.0, 16.0]),
        series("mass_rate", &times, &[8.0, 8.0, 4.0, 0.0]),
    );
    let ended =
        |end| result("hopper", end, json!({"jammed": 1, "steady": false}), &[out.clone(), rate.clone()], &[]);
    let at = |end, name: &str| value(&ended(end), "hopper", name);
    assert_eq!(at(EndReason::Duration, "discharged_mass_kg@time_s=1.5"), Some(12.0));
    for end in [EndReason::Empty, EndReason::Jammed] {
        assert_eq!(at(end, "discharged_mass_kg@time_s=10"), Some(16.0));
        assert_eq!(at(end, "mass_rate_kg_s@time_s=10"), None, "a rate is no mass");
    }
    assert_eq!(at(EndReason::Duration, "discharged_mass_kg@time_s=10"), None);
    assert_eq!(at(EndReason::Duration, "time_s@discharged_mass_kg=16"), Some(2.0));
    assert_eq!(at(EndReason::Empty, "time_s@discharged_mass_kg=17"), None);
    assert_eq!((at(EndReason::Jammed, "jammed"), at(EndReason::Jammed, "steady")), (Some(1.0), Some(0.0)));
}

#[test]
fn text_per_body_per_surface_and_foreign_responses_are_no_observables() {
    let none = |experiment: &str, name: &str| {
        assert_eq!(Observable::parse(outputs(experiment), name), None, "{experiment} {name}");
    };
    none("hopper", "regime");
    none("hopper", "stress_pa@strain=0.1");
    none("hopper", "force_gate_x_n@time_s=1");
    none("drop", "settle_time_s@fillet=3");
    none("compress", "stress@strain=0.1");
    none("compress", "stress_pa@strain=");
    none("compress", "stress_pa@strain=NaN");
    none("compress", "stress_pa@time_s=1");
}

#[test]
fn every_observable_has_a_unique_name_that_parses_back() {
    for experiment in crate::scenario::fields::EXPERIMENTS {
        let lines = lines(outputs(experiment));
        let mut names: Vec<String> = Vec::new();
        for line in lines {
            let point = Observable::Point { line, at: 0.125 };
            assert_eq!(
                Observable::parse(outputs(experiment), &point.to_string()),
                Some(point.clone()),
                "{point}"
            );
            assert_eq!(point.unit(), line.of.unit);
            names.push(point.to_string());
        }
        let count = names.len();
        names.sort();
        names.dedup();
        assert!(count > 0 && names.len() == count, "{experiment}: {names:?}");
    }
}
