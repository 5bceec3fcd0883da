//! Free scenes: bodies fall, weigh, slide and are carried as closed forms say; surfaces stand and move as written.

mod common;
#[path = "common/stl.rs"]
mod stl;

use common::{assert_close, document, run_on, scene_of};
use glam::DVec3;
use roost_solver::engine::state::State;
use roost_solver::equipment::{Motion, Presence, SurfaceKind};
use roost_solver::experiments::surfaces::surfaces;
use roost_solver::mesh::Meshes;
use roost_solver::result::{EndReason, RunResult};
use roost_solver::scenario::{self, Experiment, Scenario};
use roost_solver::{CpuOptions, Flow, Limits, Progress, check, simulate};
use serde_json::{Value, json};

/// A scene of coarse fillets with these fields, by pointer.
fn scene(fields: &[(&str, Value)]) -> Scenario {
    let own = [
        ("/experiment", json!("scene")),
        ("/product/subparticle_radius_m", json!(0.009)),
        ("/numerics/timestep_s", json!("auto")),
    ];
    let scenario = scenario::from_value(&document(&[&own[..], fields].concat())).expect("a sound scenario");
    check(&scenario, &Meshes::default(), &Limits::default()).expect("a scene that can run");
    scenario
}

fn run(scenario: &Scenario) -> RunResult {
    run_on(1, scenario)
}

fn values(result: &RunResult, series: &str) -> Vec<f64> {
    result.series(series).unwrap_or_else(|| panic!("{series}")).values.clone()
}

/// Where the centre of mass of each body that is left is at the end.
fn places(result: &RunResult) -> Vec<DVec3> {
    let [x, y, z] = ["position_x", "position_y", "position_z"].map(|name| {
        let curve = common::curve(result, name);
        assert_eq!((curve.over.as_str(), curve.unit.as_str()), ("body", "m"));
        &curve.values
    });
    (0..x.len()).map(|k| DVec3::new(x[k], y[k], z[k])).collect()
}

fn mass_kg(scenario: &Scenario) -> f64 {
    State::new(&scene_of(scenario)).masses.iter().map(|&mass| f64::from(mass)).sum()
}

/// A plate of a metre about the origin, and what else is said of it.
fn plate(name: &str, more: Value) -> Value {
    let mut plate = json!({"name": name, "plate_m": [[-0.5, -0.5, 0], [1, 0, 0], [0, 1, 0]]});
    plate.as_object_mut().expect("an object").extend(more.as_object().expect("an object").clone());
    plate
}

#[test]
fn scene_that_gains_energy_is_unstable() {
    let end = |formulation: &str| {
        run(&scene(&[
            ("/product/subparticle_radius_m", json!(0.004)),
            ("/bonds/formulation", json!(formulation)),
            ("/bonds/normal_stiffness_n_m3", json!(1e7)),
            ("/bonds/shear_stiffness_n_m3", json!(1e5)),
            ("/scene/bodies", json!([{"position_m": [0, 0, 0.022], "velocity_m_s": [0, 0, -2]}])),
            ("/scene/surfaces", json!([plate("floor", json!({}))])),
            ("/scene/margin_m", json!(0.1)),
            ("/numerics/duration_s", json!(0.25)),
        ]))
    };
    // The published bond makes energy; no sub-particle is fast enough for the speed limit.
    let published = end("as_published");
    assert_eq!(published.end_reason, EndReason::Unstable, "{:?}", published.responses);
    let reason = &published.instability.as_ref().expect("said where").reason;
    assert!(reason.contains(" J of kinetic energy"), "{reason}");
    assert_eq!(end("corotated").end_reason, EndReason::Duration);
}

#[test]
fn thrown_body_follows_its_ballistic_path() {
    // Tilted, and with strength of its own; adhesion off, that it does not shrink on the way.
    let direction = DVec3::new(0.5, -1.0, -1.0);
    let scenario = scene(&[
        (
            "/scene/bodies",
            json!([
                {"shape": 1, "position_m": [0.1, 0.2, 0.3], "velocity_m_s": [0.5, 0, 1], "orientation_deg": [10, 20, 30]},
                {"shape": 0, "position_m": [0.1, 0.2, 0.7]},
            ]),
        ),
        ("/scene/gravity_direction", json!(direction.to_array())),
        ("/scene/margin_m", json!(5.0)),
        ("/contact/fillet_fillet/surface_energy_j_m2", json!(0.0)),
        ("/numerics/gravity_m_s2", json!(6.0)),
        ("/numerics/duration_s", json!(0.5)),
        ("/numerics/stop/when_done", json!(true)),
    ]);
    let result = run(&scenario);
    assert_eq!(result.end_reason, EndReason::Duration, "what falls is not at rest, slow as it is at first");
    let t = result.series[0].t_s.last().expect("samples");
    let fall = direction / 1.5 * 6.0 * t * t / 2.0;
    let expected = [DVec3::new(0.1 + 0.5 * t, 0.2, 0.3 + t) + fall, DVec3::new(0.1, 0.2, 0.7) + fall];
    for (found, expected) in places(&result).into_iter().zip(expected) {
        // Half a step of the fall is the leapfrog's.
        assert!(
            (found - expected).length() < 6.0 * t * result.solver.timestep_s,
            "{found} is not {expected}"
        );
    }
    assert_eq!(result.responses["bodies"], json!(2));
    let kinds: Vec<usize> = scene_of(&scenario).bodies.iter().map(|body| body.kind).collect();
    assert_eq!(kinds, [1, 0]);
    assert_eq!(result.responses["time_to_rest_s"], Value::Null);
    // Upwards is against gravity.
    let highest = result.response("greatest_height_m").expect("a number");
    let top = places(&result).iter().map(|place| place.dot(-direction / 1.5)).fold(f64::MIN, f64::max);
    assert!((top..top + 0.12).contains(&highest), "{highest} m over {top} m");
}

#[test]
fn body_beyond_the_margin_is_removed_and_counted() {
    let scenario = scene(&[
        (
            "/scene/bodies",
            json!([{"position_m": [0, 0, 0]}, {"position_m": [0.3, 0, 0], "velocity_m_s": [0, 0, 4]}]),
        ),
        ("/scene/margin_m", json!(0.2)),
        ("/numerics/duration_s", json!(3.0)),
    ]);
    let result = run(&scenario);
    assert_eq!(result.end_reason, EndReason::Empty);
    // The one that only falls is gone when its length and the margin are behind it, after 0.3 s.
    let end_s = result.series[0].t_s.last().expect("samples");
    assert!((0.2..0.45).contains(end_s), "{end_s} s");
    assert_close(result.response("escaped_kg").expect("a number"), mass_kg(&scenario), 1e-6);
    assert_eq!(result.responses["bodies"], json!(0));
    assert_eq!(result.responses["greatest_height_m"], Value::Null);
    assert_eq!(result.responses["bonds_intact_fraction"], json!(1.0));
    assert!(places(&result).is_empty());
    let stays = run(&scene(&[
        ("/scene/bodies", json!([{"position_m": [0, 0, 0]}])),
        ("/scene/margin_m", json!(0.01)),
        ("/numerics/stop/when_empty", json!(false)),
        ("/numerics/duration_s", json!(0.3)),
    ]));
    assert_eq!((stays.end_reason, &stays.responses["time_to_rest_s"]), (EndReason::Duration, &Value::Null));
    // Nor is what has just reached the height that it was thrown to.
    let thrown = run(&scene(&[
        ("/scene/bodies", json!([{"position_m": [0, 0, 0], "velocity_m_s": [0, 0, 0.981]}])),
        ("/numerics/duration_s", json!(0.1)),
    ]));
    assert!(thrown.response("kinetic_energy_end_j").expect("a number") < 1e-5);
    assert_eq!(thrown.responses["time_to_rest_s"], Value::Null);
}

#[test]
fn plate_load_is_the_weight_of_the_bodies_on_it() {
    let scenario = scene(&[
        ("/scene/bodies", json!([{"position_m": [0, 0, 0.03]}, {"shape": 3, "position_m": [0.25, 0, 0.03]}])),
        (
            "/scene/surfaces",
            json!([
                plate("left", json!({"plate_m": [[-0.5, -0.5, 0], [0.63, 0, 0], [0, 1, 0]]})),
                plate("right", json!({"position_m": [0.64, 0, 0]}))
            ]),
        ),
        ("/numerics/stop/when_done", json!(true)),
    ]);
    let result = run(&scenario);
    assert_eq!(result.end_reason, EndReason::Done);
    let mean = |name: &str| {
        let all = values(&result, name);
        let last = &all[all.len() - 5..];
        last.iter().sum::<f64>() / 5.0
    };
    let (weight, left, right) = (9.81 * mass_kg(&scenario), mean("force_left_z"), mean("force_right_z"));
    assert_close(left + right, -weight, 0.01);
    assert!(left < -0.2 * weight && right < -0.05 * weight, "{left} N and {right} N");
    let along = mean("force_left_x") + mean("force_right_x");
    assert!(along.abs() < 0.01 * weight, "{along} N along x");
    // At rest from when it was first slow on, a tenth of a second or more before the end.
    let (rest, end) =
        (result.response("time_to_rest_s").expect("at rest"), result.series[0].t_s.last().unwrap());
    assert!(rest > 0.05 && rest <= end - 0.0999 && rest > end - 0.121, "at {rest} s of {end} s");
}

#[test]
fn body_on_a_frictionless_slope_accelerates_at_g_sin_alpha() {
    // Along the slope nothing but gravity acts, however the fillet bounces and lies.
    let (tilt, g) = (25f64.to_radians(), 9.81);
    let scenario = scene(&[
        ("/scene/bodies", json!([{"position_m": [0, 0, 0.035], "orientation_deg": [40, 25, 0]}])),
        (
            "/scene/surfaces",
            json!([plate("slope", json!({"orientation_deg": [0, 25, 0], "kind": "frictionless"}))]),
        ),
        ("/numerics/duration_s", json!(0.35)),
        // Leapfrog is half a step ahead of what starts from rest.
        ("/numerics/timestep_s", json!(1e-4)),
    ]);
    let result = run(&scenario);
    let t = result.series[0].t_s.last().expect("samples");
    let down = DVec3::new(tilt.cos(), 0.0, -tilt.sin());
    let slid = (places(&result)[0] - DVec3::Z * 0.035).dot(down);
    assert_close(slid, g * tilt.sin() * t * t / 2.0, 2e-3);
    // And the slope pushes straight off itself.
    let (x, z) = (values(&result, "force_slope_x"), values(&result, "force_slope_z"));
    assert!(z.iter().any(|z| *z < -1.0));
    for (x, z) in x.iter().zip(&z) {
        assert!((x * tilt.cos() - z * tilt.sin()).abs() < 1e-4, "{x} N, {z} N");
    }
}

#[test]
fn belt_accelerates_a_fillet_to_its_speed() {
    let step = 2e-4;
    let scenario = scene(&[
        ("/scene/bodies", json!([{"position_m": [0, 0, 0.03]}])),
        (
            "/scene/surfaces",
            json!([plate("belt", json!({"motion": "belt", "kind": "belt", "velocity_m_s": [0.3, -0.4, 0]}))]),
        ),
        ("/numerics/timestep_s", json!(step)),
        ("/numerics/output_interval_s", json!(step)),
        ("/numerics/duration_s", json!(1.0)),
    ]);
    let result = run(&scenario);
    let mass = mass_kg(&scenario);
    // At every step, so that the sum is the impulse.
    let impulse = |axis: &str| values(&result, &format!("force_belt_{axis}")).iter().sum::<f64>() * step;
    assert_close(impulse("x"), -mass * 0.3, 0.02);
    assert_close(impulse("y"), mass * 0.4, 0.02);
    // Sliding up to the belt's speed v takes the belt's work m v²: half becomes motion, half is lost.
    let work = values(&result, "power").iter().sum::<f64>() * step;
    assert_close(work, mass * 0.25, 0.02);
    let mean_w = common::response(&result, "mean_power_w");
    assert_close(mean_w * values(&result, "power").len() as f64 * step, work, 1e-9);
    assert!(common::response(&result, "max_power_w") >= mean_w);
    assert_eq!(common::response(&result, "passed_through"), 0.0);
    // It slides, rolls and is carried: behind the belt by what the sliding cost.
    let place = places(&result)[0];
    assert_close(place.y / place.x, -4.0 / 3.0, 0.1);
    assert!((0.2..0.3).contains(&place.x), "{place}");
}

#[test]
fn rising_and_rotating_plates_carry_their_load() {
    // Up at 0.1 m/s; and about the vertical through (0.2, 0, 0) by 90° in half a second.
    let on = |more: Value| {
        run(&scene(&[
            ("/scene/bodies", json!([{"position_m": [0, 0, 0.03]}])),
            ("/scene/surfaces", json!([plate("lift", more)])),
            ("/contact/fillet_equipment/static_friction", json!(2.0)),
            ("/scene/margin_m", json!(1.0)),
            ("/numerics/duration_s", json!(1.0)),
        ]))
    };
    let still = places(&on(json!({})))[0];
    let raised =
        places(&on(json!({"motion": "moving", "velocity_m_s": [0, 0, 0.1], "pivot_m": [50, 0, 0]})))[0];
    assert!((raised - still - DVec3::Z * 0.1).length() < 2e-3, "{raised} from {still}");
    let spun = json!({"motion": "moving", "spin_deg_s": [0, 0, 30], "pivot_m": [0.2, 0, 0]});
    let turned = places(&on(spun))[0] - DVec3::X * 0.2;
    let angle = turned.y.atan2(turned.x).to_degrees() - 180.0;
    assert!((angle.rem_euclid(360.0) - 30.0).abs() < 2.0, "{angle}°");
}

#[test]
fn surfaces_have_the_specified_position_orientation_and_motion() {
    let scenario = scene(&[
        ("/scene/bodies", json!([{"position_m": [0, 0, 9]}])),
        (
            "/scene/surfaces",
            json!([
                {"name": "a", "plate_m": [[1, 0, 0], [1, 0, 0], [0, 2, 0]], "position_m": [0, 0, 3],
                    "orientation_deg": [90, 0, 0], "kind": "belt", "static_friction": 0.7,
                    "motion": "moving", "velocity_m_s": [1, 2, 3], "spin_deg_s": [0, 0, 180], "pivot_m": [4, 5, 6]},
                {"name": "b", "plate_m": [[0, 0, 0], [1, 0, 0], [0, 2, 0]], "orientation_deg": [0, 90, 0],
                    "motion": "moving", "velocity_m_s": [1, 0, 0], "pivot_m": [4, 5, 6], "kind": "frictionless"},
                {"name": "c", "plate_m": [[0, 0, 0], [1, 0, 0], [0, 2, 0]], "motion": "belt", "velocity_m_s": [0, 1, 0]},
            ]),
        ),
    ]);
    let Experiment::Scene { scene } = &scenario.experiment else { panic!("a scene") };
    let [a, b, c] = &surfaces(&scene.surfaces, &Meshes::default())[..] else { panic!("three") };
    let near = |found: DVec3, x: f64, y: f64, z: f64| {
        assert!(found.distance(DVec3::new(x, y, z)) < 1e-12, "{found}")
    };
    // Turned by 90° about z: x is y, y is −x.
    let [[p, q, r], [.., s]] = &a.triangles[..] else { panic!("two triangles") };
    near(*p, 0.0, 1.0, 3.0);
    near(*q, 0.0, 2.0, 3.0);
    near(*r, -2.0, 2.0, 3.0);
    near(*s, -2.0, 1.0, 3.0);
    assert_eq!(
        (a.name.as_str(), a.kind, a.friction, a.presence),
        ("a", SurfaceKind::Belt, Some(0.7), Presence::Always)
    );
    let Motion::Moving { velocity, pivot, spin } = a.motion else { panic!("{:?}", a.motion) };
    assert_eq!((velocity, pivot), (DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0)));
    near(spin, 0.0, 0.0, std::f64::consts::PI);
    // Pitch 90 lowers x; what does not turn needs no pivot far away.
    near(b.triangles[0][1], 0.0, 0.0, -1.0);
    let Motion::Moving { pivot, .. } = b.motion else { panic!("{:?}", b.motion) };
    assert!(pivot.length() < 3.0 && b.kind == SurfaceKind::Frictionless);
    assert_eq!((c.motion, c.friction), (Motion::Belt { velocity: DVec3::Y }, None));
}

#[test]
fn mesh_surface_gives_the_same_result_as_an_equal_plate() {
    let triangles = stl::quad(DVec3::new(-0.5, -0.5, 0.0), DVec3::X, DVec3::Y);
    let mut meshes = Meshes::default();
    let millimetres = triangles.map(|triangle| triangle.map(|corner| corner * 1000.0));
    let digest = meshes.insert(&stl::binary(&millimetres)).expect("a sound file");
    let of = |surface: Value| {
        let own = [
            ("/experiment", json!("scene")),
            ("/product/subparticle_radius_m", json!(0.009)),
            ("/numerics/timestep_s", json!("auto")),
            ("/numerics/duration_s", json!(0.2)),
            ("/scene/bodies", json!([{"position_m": [0, 0, 0.05], "orientation_deg": [0, 50, 20]}])),
            ("/scene/surfaces", json!([surface])),
        ];
        let scenario = scenario::from_value(&document(&own)).expect("a sound scenario");
        let checked = check(&scenario, &meshes, &Limits::default()).expect("can run");
        simulate(&checked, CpuOptions { threads: 1 }, &mut |_: &Progress| Flow::Continue)
    };
    let flat = of(plate("table", json!({"position_m": [0, 0, -0.05]})));
    let mesh =
        of(json!({"name": "table", "mesh": {"digest": digest, "units": "mm"}, "position_m": [0, 0, -0.05]}));
    assert!(values(&flat, "force_table_z").iter().any(|z| *z < -1.0));
    assert_eq!(flat.series, mesh.series);
    assert_eq!(flat.curves, mesh.curves);
}

#[test]
fn a_scene_gives_the_same_bits_on_any_number_of_threads() {
    let bodies: Vec<Value> = (0..16)
        .map(|k| {
            json!({"shape": k % 6, "position_m": [0.05 * f64::from(k % 3), 0, 0.1 + 0.1 * f64::from(k)],
            "orientation_deg": [10 * k, 7 * k, 0]})
        })
        .collect();
    let scenario = scene(&[
        ("/scene/bodies", json!(bodies)),
        ("/scene/surfaces", json!([plate("drum", json!({"motion": "moving", "spin_deg_s": [20, 0, 0]}))])),
        ("/numerics/duration_s", json!(0.4)),
    ]);
    let text = |result: &RunResult| {
        serde_json::to_string(&(&result.responses, &result.series, &result.curves)).expect("serialises")
    };
    let one = run_on(1, &scenario);
    assert!(
        one.performance.subparticles > 512 && one.response("max_overlap_ratio").is_some_and(|o| o > 0.01)
    );
    for threads in [2, 3] {
        assert_eq!(text(&one), text(&run_on(threads, &scenario)));
    }
}

#[test]
fn bodies_that_touch_at_rest_without_gravity_have_not_diverged() {
    // Two spheres overlap by R/20; and by R/40, so soft and sticky that the neck has more energy than the overlap.
    for (apart_m, gamma, youngs) in [(0.0078, 0.0, 48_600.0), (0.0079, 0.5, 2000.0)] {
        let elastic = json!({"surface_energy_j_m2": gamma, "restitution": 1.0});
        let document = json!({
            "experiment": "scene",
            "product": {"spheres": true, "subparticle_radius_m": 0.004},
            "material": {"youngs_modulus_pa": youngs},
            "contact": {"fillet_fillet": elastic},
            "scene": {"bodies": [{"position_m": [0, 0, 0]}, {"position_m": [apart_m, 0, 0]}]},
            "numerics": {"gravity_m_s2": 0.0, "timestep_s": "auto", "duration_s": 0.1},
        });
        let result = common::run_on(1, &common::scenario(document, &[]));
        assert_eq!(result.instability, None);
        assert!(result.response("kinetic_energy_end_j").expect("a number") > 0.0);
    }
}
