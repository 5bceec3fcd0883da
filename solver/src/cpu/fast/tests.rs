//! The moment of a list's renewal changes no bit.

use glam::DVec3;
use serde_json::json;

use crate::check::scene_of;
use crate::cpu::{Cpu, CpuRun};
use crate::engine::Backend;
use crate::engine::scene::{BodyKind, Scene};
use crate::engine::state::State;
use crate::scenario::from_value;

/// Twelve fillets that fall into a hopper.
fn fillets() -> Scene {
    let hopper = json!({
        "experiment": "hopper",
        "product": {"count": 12, "subparticle_radius_m": 0.009},
        "equipment": {"hopper_width_m": 0.15, "hopper_length_m": 0.2},
        "numerics": {"timestep_s": "auto"},
    });
    scene_of(&from_value(&hopper).expect("a scenario"))
}

/// Single spheres in the same place, more than fit in one group.
fn spheres() -> Scene {
    let scene = fillets();
    let mut meta = (*scene.kinds[0].meta).clone();
    meta.points.truncate(1);
    meta.bonds.clear();
    let mut body = scene.bodies[0];
    body.kind = 0;
    let bodies = (0..700).map(|k| {
        let cell = DVec3::new(f64::from(k % 8), f64::from(k / 8 % 8), f64::from(k / 64));
        // Off the lattice, so that no sum is exact.
        let off = DVec3::new(f64::from(k * 37 % 17), f64::from(k * 53 % 19), 0.0) * 5e-5;
        body.position = scene.bodies[0].position + cell * 0.0178 + off;
        body
    });
    let kind = BodyKind { meta: meta.into(), ..scene.kinds[0].clone() };
    Scene { bodies: bodies.collect(), kinds: vec![kind], ..scene }
}

/// State after `steps` with skins scaled by `skins`, and the number of list renewals.
fn after(scene: &Scene, steps: u64, skins: f32) -> (State, usize) {
    let cpu = Cpu::new(2);
    let mut run = cpu.prepare(scene);
    let CpuRun::Fast(fast) = &mut run else { unreachable!("what is new is fast") };
    let search = &mut fast.search;
    (search.skins, search.outer_skins) =
        (search.skins.map(|skin| skins * skin), search.outer_skins.map(|skin| skins * skin));
    fast.wall_skin *= skins;
    let (mut searches, mut max_overlap) = (0, 0.0f32);
    for _ in 0..steps {
        let CpuRun::Fast(fast) = &mut run else { unreachable!("what is fast stays so") };
        let due = |body_pair: &super::BodyPair| body_pair.is_due(&fast.bodies);
        searches += fast.body_pairs.iter().filter(|body_pair| due(body_pair)).count();
        let done = cpu.advance(&mut [(&mut run, 1)]).swap_remove(0);
        assert_eq!(done.fault, None);
        max_overlap = max_overlap.max(done.max_overlap_m);
    }
    assert!(max_overlap > 1e-4, "they touch: {max_overlap}");
    (cpu.state(&mut run).clone(), searches)
}

#[test]
fn more_frequent_neighbour_list_rebuilds_change_no_bit() {
    for (scene, steps) in [(fillets(), 600), (spheres(), 300)] {
        let ((seldom, few), (often, many)) = (after(&scene, steps, 1.0), after(&scene, steps, 0.1));
        assert!(few > 0 && 2 * many > 3 * few, "{few} and {many} searches");
        let bits = |state: &State| {
            let of = |p: &crate::engine::state::Particle| {
                let bits = |v: glam::Vec3| v.to_array().map(f32::to_bits);
                (p.position, bits(p.velocity), bits(p.spin))
            };
            state.particles.iter().map(of).collect::<Vec<_>>()
        };
        assert!(bits(&seldom) == bits(&often));
    }
}
