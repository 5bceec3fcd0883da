//! The edges of what a scenario may ask for: what would take hours, never end or start too early is seen beforehand.

mod common;

use std::time::{Duration, Instant};

use common::{Bench, at, block, checked, document, law, scene, scene_of};
use glam::DVec3;
use roost_solver::mesh::Meshes;
use roost_solver::scenario::{self, Scenario};
use roost_solver::{CpuOptions, Flow, Limits, Progress, check, simulate};
use serde_json::{Value, json};

fn with(fields: &[(&str, Value)]) -> Scenario {
    scenario::from_value(&document(fields)).expect("a sound scenario")
}

/// The pointers of what is wrong with a scenario.
fn refused(fields: &[(&str, Value)]) -> Vec<String> {
    let faults = check(&with(fields), &Meshes::default(), &Limits::default()).expect_err("refused");
    faults.into_iter().map(|fault| fault.pointer).collect()
}

#[test]
fn belt_start_does_not_depend_on_the_output_interval() {
    let fill_s = |interval: f64, rest_speed: f64| {
        let scenario = with(&[
            ("/product/count", json!(4)),
            ("/product/subparticle_radius_m", json!(0.01)),
            ("/equipment/hopper_width_m", json!(0.15)),
            ("/equipment/hopper_length_m", json!(0.2)),
            ("/numerics/timestep_s", json!(2e-4)),
            ("/numerics/duration_s", json!(0.1)),
            ("/numerics/output_interval_s", json!(interval)),
            ("/numerics/rest_speed_m_s", json!(rest_speed)),
        ]);
        let result =
            simulate(&checked(&scenario), CpuOptions { threads: 2 }, &mut |_: &Progress| Flow::Continue);
        result.response("fill_duration_s").expect("it came to rest")
    };
    let usual = fill_s(0.02, 0.05);
    assert!((fill_s(0.001, 0.05) - usual).abs() < 0.05, "looking more often changes nothing");
    assert!(usual > 0.3);
    // However fast counts as slow, nothing is at rest while it falls: the stack is some 0.3 m high.
    assert!(fill_s(0.02, 1.0) > 0.2);
}

#[test]
fn too_fine_lattice_is_refused_within_a_second() {
    let start = Instant::now();
    let sizes = json!([[2.0, 2.0, 2.0]]);
    let fine = ("/product/subparticle_radius_m", json!(5e-4));
    assert_eq!(refused(&[("/product/sizes_m", sizes), fine.clone()]), ["/product/subparticle_radius_m"]);
    // A fill by volume takes a tenth of these points: the default fillets have 2.4e6.
    assert_eq!(refused(std::slice::from_ref(&fine)), ["/product/subparticle_radius_m"]);
    let wide = [
        ("/equipment/hopper_width_m", json!(10.0)),
        ("/equipment/hopper_length_m", json!(10.0)),
        ("/product/fill", json!("centres")),
        fine,
    ];
    assert_eq!(refused(&wide), ["/product/subparticle_radius_m"]);
    assert!(start.elapsed() < Duration::from_secs(1), "{:?}", start.elapsed());
}

#[test]
fn period_in_which_a_fillet_meets_its_own_image_is_refused() {
    // The longest fillet of Table 1 is 0.176 m, and four radii are wanted beside it.
    let periodic = |width: f64| {
        [
            ("/product/count", json!(2)),
            ("/equipment/side_walls", json!("periodic")),
            ("/equipment/hopper_width_m", json!(width)),
        ]
    };
    check(&with(&periodic(0.193)), &Meshes::default(), &Limits::default()).expect("wide enough");
    assert!(refused(&periodic(0.191)).iter().all(|pointer| pointer == "/equipment/hopper_width_m"));
}

#[test]
fn fillets_that_fit_only_upright_are_placed_upright() {
    let tight = with(&[
        ("/product/count", json!(3)),
        ("/product/sizes_m", json!([[0.5, 0.02, 0.02]])),
        ("/product/subparticle_radius_m", json!(0.002)),
        ("/equipment/hopper_width_m", json!(0.0281)),
        ("/equipment/hopper_length_m", json!(0.0281)),
    ]);
    check(&tight, &Meshes::default(), &Limits::default()).expect("fits");
    let scene = scene_of(&tight);
    assert!(scene.bodies.iter().all(|body| (body.orientation * DVec3::X).z.abs() > 0.99));
}

#[test]
fn adhesion_that_reaches_past_the_neighbours_is_refused() {
    let soft = [
        ("/material/youngs_modulus_pa", json!(100)),
        ("/contact/fillet_fillet/surface_energy_j_m2", json!(10)),
    ];
    let pointers = refused(&soft);
    assert!(pointers.iter().any(|p| p == "/contact/fillet_fillet/surface_energy_j_m2"), "{pointers:?}");
}

#[test]
fn sample_limit_includes_the_samples_of_the_fill() {
    let fields = [
        ("/numerics/max_fill_s", json!(600)),
        ("/numerics/duration_s", json!(0.1)),
        ("/numerics/timestep_s", json!(1e-5)),
        ("/numerics/output_interval_s", json!(2e-5)),
    ];
    let faults = scenario::from_value(&document(&fields)).expect_err("too many samples");
    assert_eq!(faults[0].pointer, "/numerics/output_interval_s", "{faults:?}");
}

#[test]
fn automatic_time_step_is_stable_for_a_stiff_truss() {
    let truss = with(&[
        ("/product/count", json!(2)),
        ("/product/subparticle_radius_m", json!(0.01)),
        ("/bonds/types", json!(1)),
        ("/bonds/normal_stiffness_n_m3", json!(1e8)),
        ("/bonds/shear_stiffness_n_m3", json!(6e7)),
        ("/numerics/timestep_s", json!("auto")),
    ]);
    let mut bench = Bench::new(&scene_of(&truss));
    assert_eq!(bench.steps(3000), None);
    assert_eq!(bench.state().bonds_broken, 0);
}

#[test]
fn slow_spheres_stick_with_adhesion_and_separate_without() {
    let meet = |gamma: f64| {
        let x = 0.004 + 1e-5;
        let v = DVec3::X * 0.005;
        let mut scene = scene(block([1, 1, 1]), vec![at(DVec3::X * -x, v), at(DVec3::X * x, -v)], 2e-5);
        scene.laws.tissue = law(false, 0.3, 0.0, gamma);
        let mut bench = Bench::new(&scene);
        bench.steps(50_000);
        (bench.position(1) - bench.position(0)).length()
    };
    assert!(meet(0.055) < 0.008, "held together");
    assert!(meet(0.0) > 0.0085, "went their ways");
}
