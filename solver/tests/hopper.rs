//! A very small hopper from fill to end: what goes in comes out, every end has its reason, every wall and bond runs.

mod common;

use common::{checked, response, run_on, scene_of};
use roost_solver::equipment::{Motion, Surface, SurfaceKind};
use roost_solver::result::{EndReason, RunResult, Series};
use serde_json::{Value, json};

/// Runs a hopper of 8 fillets with these fields, by pointer, instead of its own.
fn run(fields: &[(&str, Value)]) -> RunResult {
    let document = json!({
        "experiment": "hopper",
        "product": {"count": 8, "subparticle_radius_m": 0.01},
        "bonds": {"reference_radius_m": null},
        "equipment": {"hopper_width_m": 0.15, "hopper_length_m": 0.2, "gate_opening_m": 0.1},
        "numerics": {"timestep_s": "auto", "duration_s": 0.4},
    });
    let result = run_on(2, &common::scenario(document, fields));
    assert_sound(&result);
    result
}

/// Checks that hold for every result, however it ended.
fn assert_sound(result: &RunResult) {
    assert_eq!(result.schema, "roost.result/1");
    assert_eq!(result.scenario_digest, result.scenario.digest());
    for series in &result.series {
        assert_eq!(series.t_s.len(), series.values.len(), "{}", series.name);
        assert!(series.t_s.is_sorted_by(|a, b| a < b), "{}", series.name);
        assert!(series.values.iter().all(|value| value.is_finite()), "{}", series.name);
    }
    assert!(masses(result).values.is_sorted());
    assert_eq!(masses(result).t_s, result.series("mass_rate").expect("there").t_s);
    let cost = &result.performance;
    assert!(cost.steps > 0 && cost.particle_steps <= cost.steps * cost.subparticles);
}

fn masses(result: &RunResult) -> &Series {
    result.series("discharged_mass").expect("there")
}

fn last(values: &[f64]) -> f64 {
    *values.last().expect("samples")
}

#[track_caller]
fn assert_near(found: f64, expected: f64, within: f64) {
    assert!((found - expected).abs() <= within, "{found} is not {expected} within {within}");
}

/// Mass of all fillets of a scenario, in kg.
fn loaded(result: &RunResult) -> f64 {
    checked(&result.scenario).estimate().mass_kg
}

#[test]
fn emptied_hopper_discharges_its_whole_mass() {
    let result = run(&[("/numerics/duration_s", json!(20.0)), ("/equipment/belt_speed_m_s", json!(0.5))]);
    assert_eq!(result.end_reason, EndReason::Empty);
    let mass = loaded(&result);
    for name in ["loaded_kg", "filled_kg", "discharged_kg"] {
        assert_near(response(&result, name), mass, 1e-6 * mass);
    }
    assert_eq!(response(&result, "escaped_kg"), 0.0);
    assert_eq!(response(&result, "bonds_intact_fraction"), 1.0);
    assert_eq!(result.responses["greatest_height_m"], Value::Null);
    let out = masses(&result);
    assert_eq!((out.t_s[0], out.values[0]), (0.0, 0.0));
    assert!(response(&result, "max_overlap_ratio") > 0.02, "the greatest of the whole run");
    // At the sample before the last, something was still inside.
    assert!(out.values[out.values.len() - 2] < mass * (1.0 - 1e-6));
    // Nothing outruns the belt for long: 0.2 m of fillets take most of 0.4 s.
    assert!(last(&out.t_s) > 0.3);
    // The mean residence time of mass is ∫ (1 − m/M) dt; the eight fillets weigh nearly the same.
    let inside = |k: usize| 1.0 - (out.values[k] + out.values[k + 1]) / 2.0 / mass;
    let mean_s: f64 = (0..out.t_s.len() - 1).map(|k| inside(k) * (out.t_s[k + 1] - out.t_s[k])).sum();
    let found_s = response(&result, "residence_mean_s");
    assert!((found_s / mean_s - 1.0).abs() < 0.05, "{found_s} s, the curve says {mean_s} s");
    let residence = common::curve(&result, "residence_share");
    assert_eq!((residence.x.len(), last(&residence.values)), (8, 1.0));
    assert_eq!(response(&result, "fillets_remaining"), 0.0);
    // Bodies that have left are not computed any more.
    let cost = &result.performance;
    assert!(cost.particle_steps < cost.steps * cost.subparticles);
}

#[test]
fn a_run_of_its_whole_duration_is_sampled_at_the_interval() {
    let result = run(&[("/numerics/output_interval_s", json!(0.015))]);
    assert_eq!(result.end_reason, EndReason::Duration);
    let dt = result.solver.timestep_s;
    let out = masses(&result);
    assert_near(last(&out.t_s), 0.4, dt);
    for (k, t) in out.t_s.iter().enumerate() {
        assert_near(*t, (0.015 * k as f64).min(0.4), 0.51 * dt);
    }
    // Energy and bonds from the fill on; belt start is among their times.
    let energy = result.series("kinetic_energy").expect("there");
    let fill = response(&result, "fill_duration_s");
    assert_near(energy.t_s[0], -fill, 1e-9);
    let from_start = &energy.t_s[energy.t_s.len() - out.t_s.len()..];
    assert!(from_start.iter().zip(&out.t_s).all(|(a, b)| (a - b).abs() < 1e-9));
    assert_eq!(result.series("bonds_intact_fraction").expect("there").t_s, energy.t_s);
    assert!(energy.values[0] < 1e-3 && energy.values.iter().copied().fold(0.0, f64::max) > 0.01);
    let steps = ((fill + last(&out.t_s)) / dt).round() as u64;
    assert_eq!(result.performance.steps, steps);
    assert_eq!(response(&result, "discharged_kg"), last(&out.values));
    assert_eq!(response(&result, "kinetic_energy_end_j"), last(&energy.values));
    assert!(response(&result, "greatest_height_m") > 0.02);
}

#[test]
fn fill_not_at_rest_in_time_ends_the_run() {
    let result = run(&[("/numerics/max_fill_s", json!(0.05))]);
    assert_eq!(result.end_reason, EndReason::FillNotAtRest);
    assert!(masses(&result).values.is_empty());
    assert_eq!(result.responses["fill_duration_s"], Value::Null);
    let energy = result.series("kinetic_energy").expect("there");
    assert_eq!(energy.t_s.last(), Some(&0.0));
    assert_near(energy.t_s[0], -0.05, result.solver.timestep_s);
    assert_eq!(result.performance.steps, (0.05 / result.solver.timestep_s).ceil() as u64);
}

#[test]
fn stationary_belt_is_a_jam() {
    let standing = [
        ("/equipment/belt_speed_m_s", json!(0.0)),
        ("/equipment/gate_opening_m", json!(0.02)),
        ("/numerics/duration_s", json!(1.5)),
    ];
    let stopped = [&standing[..], &[("/numerics/stop/when_jammed_s", json!(0.2))]].concat();
    let result = run(&stopped);
    assert_eq!(result.end_reason, EndReason::Jammed);
    assert_eq!(result.responses["jammed"], json!(1));
    // Without an early end the same run jams at the same time.
    let whole = run(&[&standing[..], &[("/numerics/jam_after_s", json!(0.2))]].concat());
    assert_eq!(whole.end_reason, EndReason::Duration);
    for name in ["jammed", "time_to_jam_s"] {
        assert_eq!(whole.responses[name], result.responses[name], "{name}");
    }
    let out = masses(&result);
    assert!(response(&result, "discharged_kg") < 0.1 * loaded(&result));
    // The end comes with the first sample 0.2 s after the last passage, or after belt start.
    let passed = out.values.windows(2).rposition(|pair| pair[1] > pair[0]).map_or(0.0, |k| out.t_s[k + 1]);
    assert_near(last(&out.t_s), passed + 0.2, 0.021);
    assert!(response(&result, "greatest_height_m") > 0.02);
}

#[test]
fn a_fall_faster_than_the_speed_limit_is_unstable_and_keeps_its_samples() {
    // A body in free fall reaches 1 m/s after 0.1 s.
    let result = run(&[("/numerics/speed_limit_m_s", json!(1.0))]);
    assert_eq!(result.end_reason, EndReason::Unstable);
    let instability = result.instability.as_ref().expect("said where");
    assert_eq!(instability.step, result.performance.steps);
    assert!(instability.reason.contains("speed limit of 1 m/s"), "{}", instability.reason);
    let simulated = instability.step as f64 * result.solver.timestep_s;
    assert!(simulated > 0.09, "{simulated}");
    assert_near(instability.time_s, simulated - result.scenario.numerics.max_fill_s, 1e-9);
    let energy = result.series("kinetic_energy").expect("there");
    let whole = (simulated / result.scenario.numerics.output_interval_s) as usize;
    assert!((whole..=whole + 1).contains(&energy.values.len()) && whole > 3, "{whole}");
    assert!(response(&result, "max_overlap_ratio") >= 0.0);
}

#[test]
fn hopper_runs_with_every_kind_of_side_wall() {
    let mut seen = Vec::new();
    for walls in ["rough", "frictionless", "periodic"] {
        let result =
            run(&[("/equipment/side_walls", json!(walls)), ("/equipment/hopper_width_m", json!(0.25))]);
        assert_eq!(result.end_reason, EndReason::Duration, "{walls}: {:?}", result.instability);
        assert!(response(&result, "discharged_kg") > 0.1, "{walls}");
        assert_eq!(response(&result, "escaped_kg"), 0.0, "{walls}");
        assert_near(response(&result, "filled_kg"), loaded(&result), 1e-6);
        seen.push(masses(&result).values.clone());
    }
    assert!(seen[0] != seen[1] && seen[1] != seen[2]);
}

#[test]
fn hopper_runs_with_a_sloped_wall_and_without_a_shutter() {
    let result = run(&[("/equipment/wall_slope_deg", json!(10.0))]);
    assert_eq!(result.end_reason, EndReason::Duration);
    assert_eq!(response(&result, "escaped_kg"), 0.0);
    assert!(response(&result, "discharged_kg") > 0.1);
    // Without a shutter some of the fill may pass before the belt starts, and is counted at t = 0.
    let open = run(&[("/equipment/shutter_while_filling", json!(false))]);
    assert_eq!(open.end_reason, EndReason::Duration);
    assert_near(response(&open, "filled_kg"), loaded(&open), 1e-6);
}

#[test]
fn the_fill_does_not_depend_on_the_opening() {
    let fill = |gate_m: f64| {
        let result =
            run(&[("/equipment/gate_opening_m", json!(gate_m)), ("/numerics/duration_s", json!(0.05))]);
        let Series { t_s, values, .. } = result.series("kinetic_energy").expect("there");
        let filling = t_s.iter().take_while(|t| **t <= 0.0).count();
        assert!(filling > 20, "{filling}");
        (t_s[..filling].to_vec(), values[..filling].to_vec(), last(values))
    };
    let (low, high) = (fill(0.03), fill(0.1));
    assert_eq!((&low.0, &low.1), (&high.0, &high.1));
    assert_ne!(low.2, high.2, "the discharge does");
}

#[test]
fn hopper_runs_with_every_bond_formulation() {
    for formulation in ["finite_extension", "as_published"] {
        let result = run(&[("/bonds/formulation", json!(formulation))]);
        assert_eq!(result.end_reason, EndReason::Duration, "{formulation}: {:?}", result.instability);
        assert!(response(&result, "discharged_kg") > 0.1, "{formulation}");
        assert_eq!(response(&result, "bonds_intact_fraction"), 1.0, "{formulation}");
    }
}

#[test]
fn bonds_with_a_small_contact_radius_ratio_break() {
    let result = run(&[("/bonds/contact_radius_ratio", json!(1.01)), ("/numerics/duration_s", json!(0.1))]);
    let intact = &result.series("bonds_intact_fraction").expect("there").values;
    assert_eq!(intact[0], 1.0);
    assert!(intact.is_sorted_by(|a, b| a >= b) && last(intact) < 0.9, "{}", last(intact));
    assert!(intact.iter().all(|share| (0.0..=1.0).contains(share)));
}

/// A surface of a scene, as one would write it.
fn written(surface: &Surface) -> Value {
    let [[a, b, _], [.., d]] = &surface.triangles[..] else { panic!("a parallelogram") };
    let mut value = json!({
        "name": surface.name,
        "plate_m": [a.to_array(), (*b - *a).to_array(), (*d - *a).to_array()],
        "kind": match surface.kind {
            SurfaceKind::Equipment => "equipment",
            SurfaceKind::Belt => "belt",
            SurfaceKind::Frictionless => "frictionless",
        },
    });
    if let Motion::Belt { velocity } = surface.motion {
        value["motion"] = json!("belt");
        value["velocity_m_s"] = json!(velocity.to_array());
    }
    value
}

#[test]
fn hopper_given_as_surfaces_equals_the_parametric_hopper_bit_for_bit() {
    for walls in ["frictionless", "periodic"] {
        let fields = [
            ("/equipment/side_walls", json!(walls)),
            ("/equipment/hopper_width_m", json!(0.25)),
            ("/equipment/shutter_while_filling", json!(false)),
            ("/numerics/duration_s", json!(0.1)),
        ];
        let parametric = run(&fields);
        let scene = scene_of(&parametric.scenario);
        let surfaces: Vec<Value> = scene.surfaces.iter().map(written).collect();
        let own = [
            ("/equipment/parametric", json!(false)),
            ("/equipment/surfaces", json!(surfaces)),
            ("/equipment/opening_width_m", json!(0.25)),
            ("/equipment/opening_height_m", json!(0.1)),
        ];
        let drawn_up = run(&[&fields[..], &own].concat());
        let theirs = scene_of(&drawn_up.scenario);
        assert_eq!(scene.surfaces, theirs.surfaces, "the same triangles in the same order");
        assert_eq!((scene.low, scene.high), (theirs.low, theirs.high));
        let text = |result: &RunResult| serde_json::to_string(&(&result.responses, &result.series)).unwrap();
        assert_eq!(text(&parametric), text(&drawn_up), "{walls}");
        assert!(response(&parametric, "discharged_kg") > 0.0);
    }
}

#[test]
fn additional_surfaces_act_on_fillets_and_extend_the_domain() {
    // A lid over the opening: the belt runs, and nothing comes out.
    let lid = json!({"name": "lid", "plate_m": [[0, -0.075, 0], [0, 0.15, 0], [0, 0, 0.1]]});
    let closed = run(&[("/equipment/surfaces", json!([lid]))]);
    assert!(response(&closed, "discharged_kg") < 0.1, "{}", response(&closed, "discharged_kg"));
    // A tray far below: what falls on it has not strayed.
    let tray = json!({"name": "tray", "plate_m": [[-1, -0.5, -0.5], [1.5, 0, 0], [0, 1, 0]]});
    let holed = run(&[
        ("/equipment/parametric", json!(false)),
        ("/equipment/surfaces", json!([tray])),
        ("/equipment/gate_opening_m", json!(0.06)),
        ("/numerics/duration_s", json!(0.1)),
    ]);
    assert_eq!(holed.end_reason, EndReason::Duration);
    assert_eq!(response(&holed, "escaped_kg"), 0.0);
    assert_near(response(&holed, "filled_kg"), loaded(&holed), 1e-6);
}
