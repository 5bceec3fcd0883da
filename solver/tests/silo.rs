//! Single spheres as a product, and a silo that they empty: case 1 of Dosta et al. 2024 with larger spheres.
//!
//! `silo/` has the same case at the published size, and the input of LAMMPS that gave the rate compared with here.

mod common;
#[path = "common/stl.rs"]
mod stl;

use std::f64::consts::{PI, TAU};

use common::{assert_close, document, scene_of};
use glam::DVec3;
use roost_solver::mesh::Meshes;
use roost_solver::result::RunResult;
use roost_solver::scenario;
use roost_solver::{CpuOptions, Flow, Limits, Progress, check, simulate};
use serde_json::{Value, json};

/// Silo of the benchmark: radius, height of the funnel and radius of the orifice, in metres.
const SILO_M: f64 = 0.1;
const FUNNEL_M: f64 = 0.07;
const ORIFICE_M: f64 = 0.03;
const TOP_M: f64 = 0.25;
/// Two and a half times that of the benchmark, in metres.
const DIAMETER_M: f64 = 0.01;
const SPHERES: usize = 2500;
/// A hundredth of the benchmark's, in pascal: the step is ten times as long.
const MODULUS_PA: f64 = 1e7;

/// The silo as a file: funnel and barrel, open at both ends.
fn silo() -> Vec<u8> {
    let ring = |radius: f64, z: f64| {
        let turn = move |k: u32| TAU * f64::from(k) / 72.0;
        (0..72).map(|k| DVec3::new(radius * turn(k).cos(), radius * turn(k).sin(), z)).collect::<Vec<_>>()
    };
    let rings = [ring(ORIFICE_M, 0.0), ring(SILO_M, FUNNEL_M), ring(SILO_M, TOP_M)];
    let mut triangles = Vec::new();
    for pair in rings.windows(2) {
        for k in 0..72 {
            let before = (k + 71) % 72;
            let [a, b, c, d] = [pair[0][k], pair[0][before], pair[1][before], pair[1][k]];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    stl::binary(&triangles)
}

/// Places on a loose lattice in the silo, from below.
fn loose(seed: u64) -> Vec<DVec3> {
    let gap = 1.06 * DIAMETER_M;
    let mut places = Vec::new();
    for layer in 0.. {
        let z = 0.8 * DIAMETER_M + f64::from(layer) * gap;
        let slope = (SILO_M - ORIFICE_M) / FUNNEL_M;
        let wall = SILO_M.min(ORIFICE_M + slope * z) - DIAMETER_M;
        for (i, j) in (-10..=10).flat_map(|i| (-10..=10).map(move |j| (i, j))) {
            let shift = 0.5 * f64::from(layer % 2);
            let (x, y) = ((f64::from(i) + shift) * gap, (f64::from(j) + shift) * gap);
            if x.hypot(y) < wall {
                // A small disorder, other for each seed.
                let k = places.len() as f64 + 1000.0 * seed as f64;
                let off = DVec3::new((12.9 * k).sin(), (78.2 * k).sin(), (37.7 * k).sin());
                places.push(DVec3::new(x, y, z) + off * 0.02 * DIAMETER_M);
                if places.len() == SPHERES {
                    return places;
                }
            }
        }
    }
    unreachable!("layers go on")
}

fn run(places: &[DVec3], closed: bool, seconds: f64) -> RunResult {
    let mut meshes = Meshes::default();
    let digest = meshes.insert(&silo()).expect("a sound file");
    let mut surfaces = vec![json!({"name": "silo", "mesh": {"digest": digest, "units": "m"}})];
    if closed {
        let edge = 2.0 * ORIFICE_M;
        let lid = [[-ORIFICE_M, -ORIFICE_M, 0.0], [edge, 0.0, 0.0], [0.0, edge, 0.0]];
        surfaces.push(json!({"name": "lid", "plate_m": lid}));
    }
    let bodies: Vec<Value> = places.iter().map(|place| json!({"position_m": place.to_array()})).collect();
    let contact =
        |e: f64, mu: f64| json!({"restitution": e, "static_friction": mu, "surface_energy_j_m2": 0});
    let scenario = scenario::from_value(&json!({
        "experiment": "scene",
        "product": {"spheres": true, "subparticle_radius_m": DIAMETER_M / 2.0, "density_kg_m3": 2500},
        "material": {"youngs_modulus_pa": MODULUS_PA, "poisson_ratio": 0.2},
        "contact": {"fillet_fillet": contact(0.5, 0.3), "fillet_equipment": contact(0.4, 0.2)},
        "scene": {"margin_m": DIAMETER_M, "bodies": bodies, "surfaces": surfaces},
        "numerics": {"timestep_s": 3.75e-5, "duration_s": seconds, "output_interval_s": 0.01},
    }));
    let checked = check(&scenario.expect("a scenario"), &meshes, &Limits::default()).expect("it can run");
    simulate(&checked, CpuOptions { threads: 1 }, &mut |_: &Progress| Flow::Continue)
}

fn places(result: &RunResult) -> Vec<DVec3> {
    let along = |axis: &str| &common::curve(result, &format!("position_{axis}")).values;
    let (x, y, z) = (along("x"), along("y"), along("z"));
    (0..x.len()).map(|k| DVec3::new(x[k], y[k], z[k])).collect()
}

/// Spheres per second from 0.1 to 0.4 s.
fn rate(result: &RunResult) -> f64 {
    let mass = result.series.iter().find(|series| series.name == "mass").expect("a series");
    let one_kg = 2500.0 * PI / 6.0 * DIAMETER_M.powi(3);
    let at = |t: f64| mass.values[mass.t_s.iter().position(|&s| s > t - 1e-6).expect("a sample")];
    (at(0.1) - at(0.4)) / one_kg / 0.3
}

#[test]
fn discharge_rate_of_a_silo_of_spheres_matches_lammps() {
    // LAMMPS 22 Jul 2025 from starts of the same kind, n = 8: docs/validation.md.
    const LAMMPS: f64 = 996.0;
    let rates: Vec<f64> = (1..=3)
        .map(|seed| {
            let filled = run(&loose(seed), true, 0.3);
            assert_eq!(filled.response("escaped_kg"), Some(0.0), "the silo is tight");
            rate(&run(&places(&filled), false, 0.41))
        })
        .collect();
    println!("{rates:?}");
    let mean = rates.iter().sum::<f64>() / rates.len() as f64;
    assert_close(mean, LAMMPS, 0.05);
}

#[test]
fn spheres_have_their_radius_density_and_no_bonds() {
    let fields = [
        (
            "/product",
            json!({"spheres": true, "count": 50, "subparticle_radius_m": 0.005, "density_kg_m3": 2500}),
        ),
        ("/equipment", json!({"hopper_width_m": 0.1, "hopper_length_m": 0.1})),
    ];
    let scene = scene_of(&scenario::from_value(&document(&fields)).expect("a scenario"));
    assert_eq!((scene.kinds.len(), scene.bodies.len()), (1, 50));
    let kind = &scene.kinds[0];
    assert_eq!((kind.meta.points.as_slice(), kind.meta.bonds.len()), ([DVec3::ZERO].as_slice(), 0));
    assert_close(kind.subparticle_mass_kg, 2500.0 * 4.0 / 3.0 * PI * 0.005f64.powi(3), 1e-12);
    // Scaled, and by the density of the sub-particle: the same sphere.
    let same = json!({"spheres": true, "count": 50, "subparticle_radius_m": 0.0025, "scale": 2,
                      "subparticle_density_kg_m3": 2500});
    let fields = [("/product", same), fields[1].clone()];
    let again = scene_of(&scenario::from_value(&document(&fields)).expect("a scenario"));
    assert_close(again.kinds[0].subparticle_mass_kg, kind.subparticle_mass_kg, 1e-12);
    assert_eq!(again.radius_m, scene.radius_m);
}

#[test]
fn spheres_exclude_every_other_shape_field() {
    let faults = |product: Value, more: &[(&'static str, Value)]| {
        let fields = [&[("/product", product)], more].concat();
        let faults = scenario::from_value(&document(&fields)).expect_err("faults");
        faults.iter().map(|fault| fault.pointer.clone()).collect::<Vec<_>>()
    };
    assert_eq!(faults(json!({"spheres": true, "sizes_m": [[0.1, 0.1, 0.1]]}), &[]), ["/product/sizes_m"]);
    assert_eq!(faults(json!({"spheres": true, "shape": 1}), &[]), ["/product/shape"]);
    let mesh = json!({"digest": "a".repeat(64), "units": "m"});
    assert!(faults(json!({"spheres": true, "mesh": mesh}), &[]).contains(&"/product/spheres".to_owned()));
    // A test of one fillet takes no spheres.
    assert_eq!(faults(json!({"spheres": true}), &[("/experiment", json!("bend"))]), ["/product/spheres"]);
}
