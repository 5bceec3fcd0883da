//! `roost_solver::check`: what cannot run is refused with the field's name, what can is estimated as it is then built.

mod common;

use std::time::{Duration, Instant};

use common::{assert_close, document, kinds, scene_of};
use roost_solver::engine::state::State;
use roost_solver::experiments::bounds_on_timestep;
use roost_solver::mesh::Meshes;
use roost_solver::result::Estimate;
use roost_solver::scenario::{self, Scenario};
use roost_solver::{Limits, check};
use serde_json::{Value, json};

/// A hopper scenario with these fields, by pointer, instead of the defaults.
fn with(fields: &[(&str, Value)]) -> Scenario {
    scenario::from_value(&document(fields)).expect("a sound scenario")
}

/// The pointers of the faults found, sorted, each once.
fn refused(scenario: &Scenario, limits: &Limits) -> Vec<String> {
    let faults = check(scenario, &Meshes::default(), limits).expect_err("refused");
    assert!(faults.iter().all(|fault| fault.allowed.is_some() && !fault.detail.is_empty()));
    let mut pointers: Vec<String> = faults.into_iter().map(|fault| fault.pointer).collect();
    pointers.sort_unstable();
    pointers.dedup();
    pointers
}

fn accepted(scenario: &Scenario) -> Estimate {
    check(scenario, &Meshes::default(), &Limits::NONE).expect("accepted").into_estimate()
}

#[test]
fn hopper_of_the_paper_is_accepted_with_the_published_mass() {
    let estimate =
        check(&with(&[]), &Meshes::default(), &Limits::default()).expect("accepted").into_estimate();
    assert_eq!((estimate.fillets, estimate.warnings.len()), (191, 0), "{:?}", estimate.warnings);
    assert_close(estimate.mass_kg, 38.21, 0.01);
    assert_eq!(estimate.timestep_s, 5.75e-5);
    assert!(estimate.timestep_s < estimate.stable_timestep_s / 5.0);
    assert_eq!(estimate.steps, (16.0f64 / 5.75e-5).ceil() as u64);
}

#[test]
fn estimate_matches_the_built_scene() {
    for fields in [
        vec![],
        vec![("/product/count", json!(7)), ("/product/subparticle_radius_m", json!(0.007))],
        vec![("/product/fill", json!("whole_spheres")), ("/bonds/types", json!(1))],
        vec![("/product/count", json!(20)), ("/product/subparticle_density_kg_m3", json!(2200.0))],
        vec![("/product/count", json!(50)), ("/numerics/timestep_s", json!("auto"))],
    ] {
        let scenario = with(&fields);
        let (estimate, scene) = (accepted(&scenario), scene_of(&scenario));
        let state = State::new(&scene);
        assert_eq!(estimate.fillets, scene.bodies.len() as u64);
        assert_eq!(estimate.subparticles, state.particles.len() as u64);
        assert_eq!(estimate.bonds, state.bonds_at_start);
        assert_close(estimate.mass_kg, state.masses.iter().map(|&mass| f64::from(mass)).sum(), 1e-6);
        assert_eq!(estimate.timestep_s, scene.timestep_s);
        let simulated = scenario.numerics.max_fill_s + scenario.numerics.duration_s;
        assert_eq!(estimate.steps, (simulated / scene.timestep_s).ceil() as u64);
        assert!(estimate.memory_bytes > 100 * estimate.subparticles && estimate.wall_s > 0.0);
    }
}

#[test]
fn fillets_that_cannot_fit_are_refused() {
    let few = ("/product/count", json!(50));
    let one = |pointer: &str, value: Value| refused(&with(&[few.clone(), (pointer, value)]), &Limits::NONE);
    assert_eq!(one("/equipment/hopper_length_m", json!(0.08)), ["/equipment/hopper_length_m"]);
    assert_eq!(one("/equipment/hopper_width_m", json!(0.08)), ["/equipment/hopper_width_m"]);
    assert_eq!(one("/product/count", json!(800)), ["/product/count"]);
    // Fewer fit, and so do these where the hopper is just long enough.
    accepted(&with(&[("/product/count", json!(300))]));
    accepted(&with(&[("/equipment/hopper_length_m", json!(0.09)), ("/product/count", json!(50))]));
}

#[test]
fn a_radius_too_coarse_for_a_size_is_refused() {
    let coarse = [("/product/subparticle_radius_m", json!(0.02)), ("/product/fill", json!("whole_spheres"))];
    let faults = check(&with(&coarse), &Meshes::default(), &Limits::NONE).expect_err("refused");
    assert_eq!(faults.len(), 3, "one for each size: {faults:?}");
    assert!(faults.iter().all(|fault| fault.pointer == "/product/subparticle_radius_m"));
    assert!(
        faults[1].detail.contains("size 1") && faults[1].detail.contains("0.172"),
        "{}",
        faults[1].detail
    );
    accepted(&with(&coarse[..1]));
}

#[test]
fn fillets_of_few_layers_have_a_warning() {
    let warnings = |fields: &[(&str, Value)]| accepted(&with(fields)).warnings;
    let radius = |metres: f64| ("/product/subparticle_radius_m", json!(metres));
    let coarse = warnings(&[radius(0.006)]);
    assert!(coarse.len() == 1 && coarse[0].contains("sub-particles thick, fewer than 4"), "{coarse:?}");
    assert!(warnings(&[radius(0.003)]).is_empty());
    // A block has the layers that were asked for.
    let block = json!({"experiment": "compress", "compress": {"lattice": [3, 3, 2]}});
    let block = scenario::from_value(&block).expect("a sound scenario");
    assert!(accepted(&block).warnings.is_empty());
}

#[test]
fn unstable_time_step_is_refused_and_a_nearly_unstable_one_has_a_warning() {
    let bounds = bounds_on_timestep(&with(&[]), &kinds(&with(&[])));
    assert!(bounds.auto_s < bounds.damped_s && bounds.damped_s < bounds.undamped_s);
    let step =
        |dt: f64, fields: &[(&str, Value)]| with(&[&[("/numerics/timestep_s", json!(dt))], fields].concat());
    let allow = [("/numerics/allow_unstable", json!(true))];
    assert_eq!(refused(&step(1.01 * bounds.undamped_s, &[]), &Limits::NONE), ["/numerics/timestep_s"]);
    assert_eq!(accepted(&step(1.01 * bounds.undamped_s, &allow)).warnings.len(), 1);
    assert_eq!(accepted(&step(0.99 * bounds.undamped_s, &[])).warnings.len(), 1);
    assert_eq!(accepted(&step(1.01 * bounds.damped_s, &[])).warnings.len(), 1);
    assert_eq!(accepted(&step(0.99 * bounds.damped_s, &[])).warnings.len(), 0);
    assert_eq!(accepted(&step(0.99 * bounds.damped_s, &allow)).warnings.len(), 0);
    let auto = accepted(&with(&[("/numerics/timestep_s", json!("auto"))]));
    assert_eq!((auto.timestep_s, auto.warnings.len()), (bounds.auto_s, 0));
    assert_eq!(auto.stable_timestep_s, bounds.undamped_s);
}

#[test]
fn scenario_above_the_cost_limits_is_refused() {
    let scenario = with(&[]);
    let estimate = accepted(&scenario);
    let limits = |max_subparticles, max_steps| Limits { max_subparticles, max_steps };
    assert!(check(&scenario, &Meshes::default(), &limits(estimate.subparticles, estimate.steps)).is_ok());
    assert_eq!(refused(&scenario, &limits(estimate.subparticles - 1, u64::MAX)), ["/product/count"]);
    assert_eq!(refused(&scenario, &limits(u64::MAX, estimate.steps - 1)), ["/numerics/duration_s"]);
}

#[test]
fn all_faults_of_a_check_are_reported_at_once() {
    let scenario = with(&[
        ("/product/count", json!(2000)),
        ("/equipment/hopper_length_m", json!(0.05)),
        ("/equipment/hopper_width_m", json!(0.06)),
        ("/numerics/timestep_s", json!(0.01)),
    ]);
    let found = refused(&scenario, &Limits { max_subparticles: 10_000, max_steps: 100 });
    let expected = [
        "/equipment/hopper_length_m",
        "/equipment/hopper_width_m",
        "/numerics/duration_s",
        "/numerics/timestep_s",
        "/product/count",
    ];
    assert_eq!(found, expected);
}

#[test]
fn ten_thousand_variants_are_checked_in_seconds() {
    let mut scenario = with(&[]);
    accepted(&scenario);
    let clock = Instant::now();
    for k in 0..10_000 {
        scenario.numerics.gravity_m_s2 = 9.0 + f64::from(k) * 1e-5;
        accepted(&scenario);
    }
    assert!(clock.elapsed() < Duration::from_secs(5), "{:?}", clock.elapsed());
}
