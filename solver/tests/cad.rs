//! Equipment and products from STL files, through whole runs: a hopper drawn in CAD against the parametric one, a product
//! that is a mesh against the block it describes.

#[path = "common/stl.rs"]
mod stl;

use glam::DVec3;
use roost_solver::equipment::{Motion, Surface, SurfaceKind};
use roost_solver::mesh::Meshes;
use roost_solver::result::RunResult;
use roost_solver::scenario::{self, Scenario};
use roost_solver::{Checked, CpuOptions, Flow, Limits, Progress, check, simulate};
use serde_json::{Value, json};

/// A small hopper whose surfaces are those of the list, or the parametric ones.
fn hopper(surfaces: Option<Vec<Value>>) -> Scenario {
    let mut document = json!({
        "experiment": "hopper",
        "product": {"count": 8, "subparticle_radius_m": 0.01},
        "equipment": {"hopper_width_m": 0.15, "hopper_length_m": 0.2, "gate_opening_m": 0.1,
                      "shutter_while_filling": false},
        "numerics": {"timestep_s": "auto", "duration_s": 0.3},
    });
    if let Some(surfaces) = surfaces {
        document["equipment"]["parametric"] = json!(false);
        document["equipment"]["surfaces"] = json!(surfaces);
        document["equipment"]["gate_opening_m"] = json!(0.06);
        document["equipment"]["opening_width_m"] = json!(0.15);
        document["equipment"]["opening_height_m"] = json!(0.1);
    }
    scenario::from_value(&document).expect("a sound scenario")
}

fn checked(scenario: &Scenario, meshes: &Meshes) -> Checked {
    check(scenario, meshes, &Limits::default()).expect("a scenario that can run")
}

fn run(scenario: &Scenario, meshes: &Meshes) -> RunResult {
    simulate(&checked(scenario, meshes), CpuOptions { threads: 2 }, &mut |_: &Progress| Flow::Continue)
}

/// A surface as a user would name its file.
fn named(surface: &Surface, file: &[u8], meshes: &mut Meshes) -> Value {
    let digest = meshes.insert(file).expect("a sound file");
    let mut value = json!({"name": surface.name, "mesh": {"digest": digest, "units": "m"}});
    if let Motion::Belt { velocity } = surface.motion {
        value["motion"] = json!("belt");
        value["velocity_m_s"] = json!(velocity.to_array());
    }
    if surface.kind == SurfaceKind::Belt {
        value["kind"] = json!("belt");
    }
    value
}

/// Every surface of the parametric hopper as a file of its own.
fn drawn(write: impl Fn(&Surface) -> Vec<u8>) -> (Scenario, Meshes) {
    let mut meshes = Meshes::default();
    let scene = checked(&hopper(None), &Meshes::default()).setup().scene().clone();
    let surfaces =
        scene.surfaces.iter().map(|surface| named(surface, &write(surface), &mut meshes)).collect();
    (hopper(Some(surfaces)), meshes)
}

#[test]
fn hopper_from_ascii_stl_equals_the_parametric_hopper_bit_for_bit() {
    // ASCII files hold as many digits as one writes: all of them.
    let (scenario, meshes) = drawn(|surface| stl::ascii(&surface.triangles).into_bytes());
    let (parametric, from_files) = (run(&hopper(None), &Meshes::default()), run(&scenario, &meshes));
    let text = |result: &RunResult| serde_json::to_string(&(&result.responses, &result.series)).unwrap();
    assert_eq!(text(&parametric), text(&from_files));
    assert!(parametric.response("discharged_kg").is_some_and(|mass| mass > 0.0));
}

#[test]
fn hopper_from_binary_stl_differs_only_by_the_rounding_of_its_corners() {
    // Binary files hold f32: corners are off by up to 6e-8 of their distance from the origin, and so the runs are not
    // equal to the bit. Corners and curves stay close; the curve for as long as little has been multiplied by chaos.
    let (scenario, meshes) = drawn(|surface| stl::binary(&surface.triangles));
    let (own, theirs) = (
        checked(&hopper(None), &Meshes::default()).setup().scene().clone(),
        checked(&scenario, &meshes).setup().scene().clone(),
    );
    let corners = |surfaces: &[Surface]| -> Vec<DVec3> {
        surfaces.iter().flat_map(|surface| surface.triangles.iter().flatten().copied()).collect()
    };
    let (ours, read) = (corners(&own.surfaces), corners(&theirs.surfaces));
    assert_eq!(ours.len(), read.len());
    let off = ours.iter().zip(&read).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(off > 0.0 && off < 1e-7, "{off:e} m");
    let (parametric, from_files) = (run(&hopper(None), &Meshes::default()), run(&scenario, &meshes));
    let [ours, theirs] =
        [&parametric, &from_files].map(|r| r.series("kinetic_energy").unwrap().values.clone());
    for (k, (ours, theirs)) in ours.iter().zip(&theirs).take(10).enumerate() {
        assert!((ours - theirs).abs() <= 1e-3 * ours.abs(), "sample {k}: {ours} and {theirs}");
    }
    let [ours, theirs] = [&parametric, &from_files].map(|r| r.response("filled_kg").unwrap());
    assert_eq!(ours, theirs);
}

/// Belt capacity over bulk density, in m³/s, and the codes of the warnings, of a CAD hopper with these fields.
fn full_opening(fields: &[(&str, Value)]) -> (Option<f64>, Vec<String>) {
    let belt = |name: &str, x: f64, length: f64, speed: f64| {
        json!({"name": name, "plate_m": [[x, -0.3, 0], [length, 0, 0], [0, 0.6, 0]], "motion": "belt",
               "velocity_m_s": [speed, 0, 0]})
    };
    let mut document = json!(hopper(Some(vec![belt("belt", -0.4, 1.4, 0.4), belt("next", 0.1, 0.9, 2.0)])));
    document["numerics"]["duration_s"] = json!(0.02);
    for (pointer, value) in fields {
        *document.pointer_mut(pointer).expect("a field") = value.clone();
    }
    let result = run(&scenario::from_value(&document).expect("a sound scenario"), &Meshes::default());
    let capacity = result.response("belt_capacity_kg_s");
    assert_eq!(result.responses["regime"].is_null(), capacity.is_none());
    assert_eq!(result.responses["longest_stoppage_s"], Value::Null, "shorter than its window");
    let density = result.response("bulk_density_kg_m3").expect("a bed at rest");
    (capacity.map(|kg| kg / density), result.warnings.into_iter().map(|warning| warning.code).collect())
}

#[test]
fn the_capacity_of_a_cad_hopper_is_its_declared_opening_times_the_speed_of_its_belt() {
    let close = |found: Option<f64>, expected: f64| {
        assert!((found.unwrap() / expected - 1.0).abs() < 1e-9, "{found:?}")
    };
    let (found, codes) = full_opening(&[]);
    close(found, 0.4 * 0.15 * 0.1);
    assert!(!codes.contains(&"no_regime".to_owned()), "{codes:?}");
    let wide = [("/equipment/opening_width_m", json!(0.3)), ("/equipment/opening_height_m", json!(0.05))];
    close(full_opening(&wide).0, 0.4 * 0.3 * 0.05);
    let faster = [("/equipment/surfaces/0/velocity_m_s", json!([0.8, 0, 0]))];
    close(full_opening(&faster).0, 0.8 * 0.15 * 0.1);
}

#[test]
fn a_cad_hopper_without_a_capacity_has_no_regime_and_says_why() {
    let null = [("/equipment/opening_width_m", json!(null)), ("/equipment/opening_height_m", json!(null))];
    let slow = [("/equipment/surfaces/0/velocity_m_s", json!([0, 0, 0]))];
    let away = [("/equipment/surfaces/0/motion", json!("fixed")), slow[0].clone()];
    // The second belt passes the gate plane too, at another speed.
    let two = [("/equipment/surfaces/1/position_m", json!([-0.2, 0, 0]))];
    for fields in [&null[..], &slow, &away, &two] {
        let (found, codes) = full_opening(fields);
        assert_eq!(found, None, "{fields:?}");
        assert!(codes.contains(&"no_regime".to_owned()), "{fields:?}: {codes:?}");
    }
}

#[test]
fn a_hopper_from_one_file_is_checked_for_its_place() {
    let mut sloping = json!(hopper(None));
    sloping["equipment"]["wall_slope_deg"] = json!(20);
    let sloping = scenario::from_value(&sloping).expect("a sound scenario");
    let scene = checked(&sloping, &Meshes::default()).setup().scene().clone();
    let (belts, walls): (Vec<&Surface>, Vec<_>) =
        scene.surfaces.iter().partition(|surface| surface.kind == SurfaceKind::Belt);
    let walls: Vec<_> = walls.iter().flat_map(|surface| surface.triangles.clone()).collect();
    let mut meshes = Meshes::default();
    let part = meshes.insert(&stl::binary(&walls)).expect("a sound file");
    let belt = named(belts[0], &stl::binary(&belts[0].triangles), &mut meshes);
    let warnings = |position_m: [f64; 3], yaw: f64| {
        let part = json!({"name": "hopper", "mesh": {"digest": part, "units": "m"}, "position_m": position_m,
                          "orientation_deg": [yaw, 0, 0]});
        let mut document = json!(hopper(Some(vec![belt.clone(), part])));
        document["product"] = json!({"count": 1, "spheres": true, "subparticle_radius_m": 0.008});
        let scenario = scenario::from_value(&document).expect("a sound scenario");
        let messages = checked(&scenario, &meshes).into_estimate().warnings;
        messages.into_iter().filter(|message| message.contains("lines from its middle")).collect::<Vec<_>>()
    };
    // The back wall slopes out, and the walls go on past the height of the hopper.
    assert_eq!(warnings([0.0; 3], 0.0), [""; 0]);
    let beside = warnings([0.0, 0.1, 0.0], 0.0);
    assert!(beside[0].contains("Towards -y, 18 of 18 lines meet no wall nearby."), "{beside:?}");
    let turned = warnings([0.0; 3], 180.0);
    assert!(turned[0].contains("Towards +y, 18 of 18 lines meet no wall nearby."), "{turned:?}");
    // At 5/12 of 0.5 m the wall leans out by 0.076 m, farther than it is shifted.
    let shifted = warnings([0.07, 0.0, 0.0], 0.0);
    let inside = "Towards -x, 12 of 18 lines meet a wall inside the region, up to 0.055 m from its border.";
    assert!(shifted[0].contains(inside), "{shifted:?}");
}

#[test]
fn a_product_from_stl_falls_like_the_body_it_describes() {
    let size = DVec3::new(0.064, 0.048, 0.032);
    let mut meshes = Meshes::default();
    let file = stl::binary(&stl::cuboid(DVec3::ZERO, size * 1e3, 2));
    let digest = meshes.insert(&file).expect("a sound file");
    let of = |units: &str| {
        scenario::from_value(&json!({
            "experiment": "drop",
            "product": {"count": 1, "mesh": {"digest": digest, "units": units}, "subparticle_radius_m": 0.004},
            "numerics": {"timestep_s": "auto"},
        }))
        .expect("a sound scenario")
    };
    let estimate = checked(&of("mm"), &meshes).into_estimate();
    assert_eq!((estimate.subparticles, estimate.bonds), (8 * 6 * 4, 3 * 192 - 48 - 32 - 24));
    assert!((estimate.mass_kg / (940.0 * size.element_product()) - 1.0).abs() < 1e-6);
    let result = run(&of("mm"), &meshes);
    assert_eq!(result.response("bonds_intact_fraction"), Some(1.0));
    assert!(result.response("settle_time_s").is_some());
    // In metres it would be as large as a house, and the digest of a file that was not given is no mesh.
    let faults = check(&of("m"), &meshes, &Limits::default()).expect_err("refused");
    assert!(faults[0].pointer.starts_with("/product/"), "{faults:?}");
    let faults = check(&of("mm"), &Meshes::default(), &Limits::default()).expect_err("refused");
    assert_eq!(faults[0].pointer, "/product/mesh/digest");
}
