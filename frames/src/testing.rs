//! Sample states for the tests.

use glam::{IVec3, Vec3};
use roost_solver::engine::run::Snapshot;
use roost_solver::engine::scene::Scene;
use roost_solver::engine::state::State;
use roost_solver::scenario::{Scenario, parse};

/// A hopper with coarse fillets, and their initial state.
pub(crate) fn hopper_with_fillets(count: u32) -> (Scenario, Scene, State) {
    let text = format!(
        r#"{{"experiment": "hopper", "product": {{"count": {count}, "subparticle_radius_m": 0.009}},
            "numerics": {{"timestep_s": "auto"}}}}"#
    );
    let scenario = parse(&text).expect("a valid scenario");
    let checked = roost_solver::check(&scenario, &Default::default(), &roost_solver::Limits::NONE);
    let scene = checked.expect("a scenario that can run").setup().scene().clone();
    let state = State::new(&scene);
    (scenario, scene, state)
}

/// Gives each sub-particle its own displacement, velocity, spin and number of broken bonds.
pub(crate) fn disturb(state: &mut State) {
    for (i, p) in state.particles.iter_mut().enumerate() {
        p.position += IVec3::new(i as i32 * 917, -(i as i32) * 3001, (i as i32 % 7) * 40_000);
        p.velocity = Vec3::new(0.01 * (i % 5) as f32, -0.3, i as f32 * 1e-3);
        p.spin = Vec3::new(i as f32, -2.0, 0.5);
        state.broken[i] = (i % 3) as u32;
    }
}

/// All bonds of a scene, as pairs of serials.
pub(crate) fn bonds(scene: &Scene) -> Vec<[u32; 2]> {
    let mut first = 0;
    let mut bonds = Vec::new();
    for body in &scene.bodies {
        let meta = &scene.kinds[body.kind].meta;
        bonds.extend(meta.bonds.iter().map(|bond| [first + bond.i, first + bond.j]));
        first += meta.points.len() as u32;
    }
    bonds
}

/// A snapshot of a run.
pub(crate) fn snapshot_at<'a>(
    scene: &'a Scene,
    state: &'a State,
    bonds: &'a [[u32; 2]],
    simulated_s: f64,
    belt_time_s: Option<f64>,
) -> Snapshot<'a> {
    Snapshot { scene, simulated_s, belt_time_s, state, bonds }
}
