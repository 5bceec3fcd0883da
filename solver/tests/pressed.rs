//! The step of `auto` against the bed that it must carry: fillets pressed into each other, as they come to rest in a hopper.
//!
//! A motion that turns round from step to step grows where, with K and C the stiffnesses and dashpots of all that touches and M the
//! masses and moments of inertia, the greatest eigenvalue of M⁻¹ (K δt²/4 + C δt/2) is above 1. All sub-particles that touch are taken
//! to stick, surfaces are left out, and K and C are worked out here from the laws and from where the sub-particles are.

mod common;

use std::collections::{HashMap, HashSet};

use common::Bench;
use glam::{DVec3, IVec3};
use roost_solver::cpu::Cpu;
use roost_solver::engine::Backend;
use roost_solver::engine::scene::Scene;
use roost_solver::engine::state::State;
use roost_solver::physics::damping::{BODY_CAP, BONDED_CAP};
use roost_solver::physics::jkr;
use roost_solver::scenario;
use serde_json::json;

/// Two that touch or are bonded.
struct Pair {
    i: usize,
    j: usize,
    n: DVec3,
    /// Stiffness along n and across it: of the bond, in N/m.
    bond: [f64; 2],
    /// And of the contact.
    contact: [f64; 2],
    bonded: bool,
}

/// All pairs of a bed.
fn pairs(scene: &Scene, state: &State, bonds: &[[u32; 2]]) -> Vec<Pair> {
    let bond = scene.laws.bond;
    let ratio = f64::from(scene.laws.body_radius_ratio);
    let bonded: HashSet<[u32; 2]> = bonds.iter().copied().collect();
    let places: Vec<DVec3> = (0..state.particles.len()).map(|i| state.position(i)).collect();
    let cell = |x: DVec3| (x / (2.2 * ratio * scene.radius_m)).floor().as_ivec3();
    let mut cells: HashMap<IVec3, Vec<usize>> = HashMap::new();
    places.iter().enumerate().for_each(|(i, &x)| cells.entry(cell(x)).or_default().push(i));
    let around = |x: DVec3| (0..27).map(move |k| cell(x) + IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1));
    let mut found = Vec::new();
    for (i, &x) in places.iter().enumerate() {
        for &j in around(x).filter_map(|cell| cells.get(&cell)).flatten().filter(|&&j| j > i) {
            let d = places[j] - x;
            let of_one = state.bodies[i] == state.bodies[j];
            let law = if of_one { scene.laws.tissue } else { scene.laws.between_bodies() };
            let overlap = 2.0 * scene.radius_m * if of_one { 1.0 } else { ratio } - d.length();
            let joined = bonded.contains(&[i as u32, j as u32]);
            let adhesion = law.jkr.as_ref().expect("it adheres");
            let touches = if joined {
                scene.laws.contact_between_bonded && overlap >= f64::from(adhesion.snap_overlap)
            } else {
                overlap >= 0.0
            };
            let a = if touches { f64::from(jkr::force(adhesion, overlap as f32).1) } else { 0.0 };
            if joined || touches {
                found.push(Pair {
                    i,
                    j,
                    n: d.normalize(),
                    bond: [bond.k_n, bond.k_t].map(|k| if joined { f64::from(k) } else { 0.0 }),
                    contact: [2.0 * f64::from(law.e_star) * a, 8.0 * f64::from(law.g_star) * a],
                    bonded: joined,
                });
            }
        }
    }
    found
}

/// The greatest eigenvalue of M⁻¹ (K δt²/4 + C δt/2), by the power method: 1 is the limit.
fn greatest(scene: &Scene, state: &State, pairs: &[Pair], dt: f64) -> f64 {
    let masses: Vec<f64> = state.masses.iter().map(|&mass| f64::from(mass)).collect();
    let count = masses.len();
    // A motion is three displacements and three turns times R, of which m R² · 2/5 is the inertia.
    let dashpot = |pair: &Pair, axis: usize| {
        let m_star = masses[pair.i] * masses[pair.j] / (masses[pair.i] + masses[pair.j]);
        let cap = if pair.bonded { BONDED_CAP } else { BODY_CAP };
        let limit = f64::from([cap.normal, cap.tangential][axis]) * m_star / dt;
        (f64::from(scene.laws.tissue.damping) * (pair.contact[axis] * m_star).sqrt()).min(limit)
    };
    let resists = |pair: &Pair, axis: usize| {
        (pair.bond[axis] + pair.contact[axis]) * dt * dt / 4.0 + dashpot(pair, axis) * dt / 2.0
    };
    let weights: Vec<[f64; 2]> = pairs.iter().map(|pair| [resists(pair, 0), resists(pair, 1)]).collect();
    let mut dice = fastrand::Rng::with_seed(1);
    let mut any = || DVec3::new(dice.f64(), dice.f64(), dice.f64()) - 0.5;
    let mut motion: Vec<[DVec3; 2]> = (0..count).map(|_| [any(), any()]).collect();
    let mut found = 0.0;
    for _ in 0..600 {
        let mut against = vec![[DVec3::ZERO; 2]; count];
        for (&Pair { i, j, n, .. }, &[along, across]) in pairs.iter().zip(&weights) {
            let ([u, turn], [other, turns]) = (motion[i], motion[j]);
            let apart = other - u - (turn + turns).cross(n);
            let straight = n * apart.dot(n);
            let force = straight * along + (apart - straight) * across;
            let moment = n.cross(force);
            against[i] = [against[i][0] - force, against[i][1] - moment];
            against[j] = [against[j][0] + force, against[j][1] - moment];
        }
        let energy: f64 =
            motion.iter().zip(&masses).map(|(it, m)| m * (it[0].dot(it[0]) + 0.4 * it[1].dot(it[1]))).sum();
        let work: f64 = motion.iter().zip(&against).map(|(it, by)| it[0].dot(by[0]) + it[1].dot(by[1])).sum();
        found = work / energy;
        let next: Vec<[DVec3; 2]> =
            against.iter().zip(&masses).map(|(it, m)| [it[0] / m, it[1] / (0.4 * m)]).collect();
        let length = next.iter().flatten().map(|v| v.dot(*v)).sum::<f64>().sqrt();
        motion = next.iter().map(|it| it.map(|v| v / length)).collect();
    }
    found
}

#[test]
fn a_bed_of_fillets_is_stable_at_the_automatic_step() {
    // With twice the weight they press as in a hopper filled twice as high.
    let cases = [
        (0.006, 1e-4, true, 1.0, 1.0),
        (0.006, 1e-4, true, 2.0, 1.0),
        (0.008, 1e-4, true, 1.0, 1.0),
        (0.004, 1e-4, true, 2.0, 1.0),
        (0.006, 0.3, true, 1.0, 1.0),
        (0.006, 1e-4, false, 2.0, 1.0),
        (0.006, 0.3, false, 1.0, 1.0),
        (0.006, 1e-4, true, 1.0, 1.2),
        (0.006, 1e-4, true, 2.0, 1.2),
        (0.008, 1e-4, true, 2.0, 1.2),
        (0.006, 0.3, true, 1.0, 1.2),
        (0.006, 1e-4, true, 2.0, 1.4),
    ];
    for (radius, restitution, contact_between_bonded, weight, ratio) in cases {
        let document = json!({
            "experiment": "hopper",
            "product": {"count": 40, "subparticle_radius_m": radius},
            "bonds": {"contact_between_bonded": contact_between_bonded},
            "contact": {"fillet_fillet": {"restitution": restitution}, "fillet_fillet_radius_ratio": ratio},
            "equipment": {"hopper_width_m": 0.2, "hopper_length_m": 0.25, "side_walls": "frictionless"},
            "numerics": {"timestep_s": "auto", "gravity_m_s2": 9.81 * weight},
        });
        let scenario = scenario::from_value(&document).expect("a sound scenario");
        let scene = common::scene_of(&scenario);
        let mut bench = Bench::with(Cpu::new(2), &scene);
        assert_eq!(bench.steps((1.5 / scene.timestep_s) as u64), None);
        let bonds = bench.cpu.bonds(&mut bench.run);
        let state = bench.state();
        let pairs = pairs(&scene, state, &bonds);
        let count = state.particles.len();
        let pressed = pairs.iter().filter(|pair| !pair.bonded).count();
        assert!(10 * pressed > 9 * count, "{pressed} contacts of {count} are no bed");
        let [at_auto, beyond] = [1.0, 1.5].map(|k| greatest(&scene, state, &pairs, k * scene.timestep_s));
        let case = format!(
            "{radius} m, e = {restitution}, contact in bonds {contact_between_bonded}, {weight} g, radius ratio {ratio}"
        );
        let step_us = 1e6 * scene.timestep_s;
        println!("{case}: {at_auto:.3} at {step_us:.0} µs, {beyond:.3} at 1.5 times the step");
        // Below 1 the step is stable. Four layers that carry twice their weight come nearest to it.
        let most = if radius == 0.004 { 0.97 } else { 0.95 };
        assert!((0.5..most).contains(&at_auto), "{at_auto}: {case}");
        // `auto` is not much shorter than needed. Where bonds are soft and have no contact the bed decides by chance.
        assert!(beyond > 0.9, "{beyond}: {case}");
    }
}
