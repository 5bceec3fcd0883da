//! Moments of bonds against closed forms: cantilever, torsion, energy, momenta, strength, and sliding as Coulomb says.

mod common;

use std::f64::consts::{FRAC_PI_2, PI};

use common::{
    Bench, E, G, MASS, NU, RADIUS, assert_close, at, block, bonds, law, plate, scene, with_moments,
};
use glam::{DQuat, DVec3, Vec3};
use roost_solver::engine::scene::{BodyKind, Scene};
use roost_solver::equipment::SurfaceKind;
use roost_solver::experiments::laws::laws;
use roost_solver::physics::bond::{self, BondLaw};
use roost_solver::physics::moment::{self, MomentHistory, MomentLaw};
use roost_solver::scenario;
use roost_solver::shape::lattice::LatticeBond;
use serde_json::json;

const DT: f64 = 2e-4;

/// Equivalent mass of two sub-particles, in kg.
const M_STAR: f32 = MASS as f32 / 2.0;

/// The moments of Table 2 at R = 4 mm.
fn potyondy() -> MomentLaw {
    MomentLaw::new([bonds().k_n, bonds().k_t].map(f64::from), RADIUS, 1.0, RADIUS, 0.0)
}

#[test]
fn moment_stiffnesses_are_those_of_a_disk() {
    // S_n π R⁴/4 = 2.01062e-4 and S_t π R⁴/2 = 2.41274e-4 N m, at R_b = R and f = 1; R_b to the fourth power, and f to the first.
    let of = |scale: f64, factor: f64| {
        let document =
            json!({"experiment": "drop", "bonds": {"disk_scale": scale, "moment_stiffness_factor": factor}});
        laws(&scenario::from_value(&document).expect("a sound scenario")).moment
    };
    for (scale, factor, times) in [(1.0, 1.0, 1.0), (0.5, 1.0, 1.0 / 16.0), (1.0, 0.25, 0.25)] {
        let law = of(scale, factor).expect("moments");
        assert_close(law.k_b.into(), 2.01062e-4 * times, 1e-5);
        assert_close(law.k_w.into(), 2.41274e-4 * times, 1e-5);
        assert_close(law.rim.into(), 2.0 / (scale * RADIUS), 1e-6);
    }
    assert_eq!(of(1.0, 0.0), None);
    // Their dashpots are those of the contact: none without contact between bonded neighbours.
    let damping = |contact: bool| {
        let bonds = json!({"moment_stiffness_factor": 1.0, "contact_between_bonded": contact});
        let document = json!({"experiment": "drop", "bonds": bonds});
        laws(&scenario::from_value(&document).expect("a sound scenario")).moment.expect("moments").damping
    };
    assert!(damping(true) > 0.0 && damping(false) == 0.0);
}

#[test]
fn bond_moments_with_the_published_formulation_are_refused() {
    let document = |formulation: &str, factor: f64| json!({"experiment": "drop", "bonds": {"formulation": formulation, "moment_stiffness_factor": factor}});
    let faults = scenario::from_value(&document("as_published", 1.0)).expect_err("no such bond");
    assert_eq!(faults.len(), 1);
    assert_eq!(faults[0].pointer, "/bonds/moment_stiffness_factor");
    for (formulation, factor) in [("as_published", 0.0), ("corotated", 1.0), ("finite_extension", 1.0)] {
        assert!(scenario::from_value(&document(formulation, factor)).is_ok(), "{formulation}, {factor}");
    }
}

#[test]
fn bond_moment_is_the_negative_energy_gradient() {
    // U = ½ k_b θ_b² + ½ k_w θ_w² of the rotation of j against i, turned there in 100 steps about a fixed axis.
    let law = potyondy();
    let n = DVec3::new(2.0, -1.0, 2.0) / 3.0;
    let u = |theta: DVec3| {
        let along = theta.dot(n);
        0.5 * f64::from(law.k_b) * (theta - n * along).length_squared()
            + 0.5 * f64::from(law.k_w) * along * along
    };
    for theta in [DVec3::new(0.01, 0.0, 0.0), DVec3::new(0.002, -0.01, 0.007), n * 0.01] {
        let mut history = MomentHistory::default();
        let turn = (theta / 100.0 / 1e-5).as_vec3();
        let on_i = (0..100)
            .map(|_| moment::moment(&law, &mut history, n.as_vec3(), turn, Vec3::ZERO, M_STAR, 1e-5))
            .last()
            .expect("steps");
        let slope = DVec3::from_array([DVec3::X, DVec3::Y, DVec3::Z].map(|axis| {
            // j turned on by a little is i turned back.
            (u(theta + axis * 1e-6) - u(theta - axis * 1e-6)) / 2e-6
        }));
        assert!((on_i.as_dvec3() - slope).length() < 1e-5 * slope.length(), "{on_i} is not {slope}");
        let mut other = MomentHistory::default();
        (0..100).for_each(|_| {
            moment::moment(&law, &mut other, -n.as_vec3(), -turn, Vec3::ZERO, M_STAR, 1e-5);
        });
        let on_j = other.bending - n.as_vec3() * other.twist;
        assert_eq!(on_j, -on_i, "the exact opposite from the other side");
    }
}

#[test]
fn bond_moments_rotate_with_the_bond() {
    // A quarter turn of the pair in 1000 steps takes a twist about x to one about y, and bending about y to −x. A quarter turn about
    // the bond takes bending about y to z. Nothing grows: the two do not turn against each other.
    let law = potyondy();
    let mut history = MomentHistory { bending: Vec3::Y * 1e-5, twist: 2e-5 };
    let mut found = Vec3::ZERO;
    for k in 1..=1000 {
        let angle = (FRAC_PI_2 * f64::from(k) / 1000.0) as f32;
        let n = Vec3::new(angle.cos(), angle.sin(), 0.0);
        found = moment::moment(&law, &mut history, n, Vec3::ZERO, Vec3::ZERO, M_STAR, 1e-5);
    }
    assert!((found - Vec3::new(-1e-5, 2e-5, 0.0)).length() < 1e-8, "{found}");
    let mut history = MomentHistory { bending: Vec3::Y * 1e-5, twist: 2e-5 };
    let spin = Vec3::X * (FRAC_PI_2 / 1000.0 / 1e-5) as f32;
    for _ in 0..1000 {
        found = moment::moment(&law, &mut history, Vec3::X, Vec3::ZERO, spin, M_STAR, 1e-5);
    }
    assert!((found - Vec3::new(2e-5, 0.0, 1e-5)).length() < 1e-8, "{found}");
}

#[test]
fn bond_moments_reduce_the_remaining_strength_of_a_bond() {
    // At the rim of the disk: σ = M_b R/I = 4 M_b/(A R), τ = M_w R/J = 2 M_w/(A R).
    let (moments, rest) = (potyondy(), 2.0 * RADIUS as f32);
    let holds = |bending: f64, twist: f64, stretch: f32, shear: f32| {
        let bond = BondLaw { normal_strength: 0.05, shear_strength: 0.02, ..bonds() };
        let history = MomentHistory { bending: Vec3::Y * bending as f32, twist: twist as f32 };
        let weaker = moments.weaken(&bond, &history);
        let mut stored = Vec3::Z * shear;
        let e = rest + stretch / bond.k_n;
        bond::force(&weaker, &mut stored, Vec3::X, rest, e, Vec3::ZERO, Vec3::ZERO, Vec3::ZERO, 1e-5)
            .is_some()
    };
    let (bending, twist) = (0.05 * RADIUS / 4.0, 0.02 * RADIUS / 2.0);
    for sign in [1.0, -1.0] {
        assert!(holds(0.99 * sign * bending, 0.0, 0.0, 0.0) && !holds(1.01 * sign * bending, 0.0, 0.0, 0.0));
        assert!(holds(0.0, 0.99 * sign * twist, 0.0, 0.0) && !holds(0.0, 1.01 * sign * twist, 0.0, 0.0));
    }
    assert!(holds(0.5 * bending, 0.0, 0.024, 0.0) && !holds(0.5 * bending, 0.0, 0.026, 0.0));
    assert!(holds(0.0, 0.5 * twist, 0.0, 0.0099) && !holds(0.0, 0.5 * twist, 0.0, 0.0101));
}

/// A row of spheres along x, the first held, and from its last sphere one more along y.
fn hook(n: usize) -> BodyKind {
    let mut kind = block([n as i32, 1, 1]);
    let meta = std::sync::Arc::make_mut(&mut kind.meta);
    meta.points.push(meta.points[n - 1] + DVec3::Y * 2.0 * RADIUS);
    meta.bonds.push(LatticeBond { i: n as u32 - 1, j: n as u32, class: 1 });
    kind
}

/// A cantilever with moments that hangs by its weight, so little that it bends by small angles; turned by `orientation`.
fn hanging(kind: BodyKind, orientation: DQuat) -> Scene {
    let mut scene = with_moments(scene(kind, vec![at(DVec3::ZERO, DVec3::ZERO)], DT), 1.0);
    scene.bodies[0].orientation = orientation;
    scene.held = vec![0];
    scene.gravity = orientation * DVec3::NEG_Z * WEIGHT_N / MASS;
    scene
}

/// Weight of a sphere of a cantilever, in newton.
const WEIGHT_N: f64 = 4e-7;

/// Static displacements of all spheres, in the body's own axes. Let go without damping, each mode swings about its static
/// displacement: the mean under a bell-shaped window of some periods of the slowest.
fn displacements(scene: &Scene) -> Vec<DVec3> {
    let mut bench = Bench::new(scene);
    let count = bench.state().particles.len();
    let start: Vec<DVec3> = (0..count).map(|i| bench.position(i)).collect();
    let (steps, mut sums, mut weights) = (60_000u32, vec![DVec3::ZERO; count], 0.0);
    for k in 0..steps / 10 {
        assert_eq!(bench.steps(10), None);
        let weight = (PI * f64::from(k) / f64::from(steps / 10)).sin().powi(4);
        weights += weight;
        for (i, sum) in sums.iter_mut().enumerate() {
            *sum += (bench.position(i) - start[i]) * weight;
        }
    }
    let back = scene.bodies[0].orientation.inverse();
    sums.into_iter().map(|sum| back * sum / weights).collect()
}

/// How far the tip of a row of `free` spheres beyond the held one hangs: bond i bears the shear S_i = w (n − i + 1) and the
/// moment M_i = w R (n − i + 1)² at its middle.
fn row_tip(free: usize) -> f64 {
    let (k_b, k_t) = (f64::from(potyondy().k_b), f64::from(bonds().k_t));
    let (mut turn, mut down) = (0.0, 0.0);
    for i in 1..=free {
        let beyond = (free - i + 1) as f64;
        let next = turn + WEIGHT_N * RADIUS * beyond * beyond / k_b;
        down += RADIUS * (turn + next) + WEIGHT_N * beyond / k_t;
        turn = next;
    }
    down
}

#[test]
fn deflection_of_a_row_of_spheres_matches_a_timoshenko_beam() {
    let free = 8;
    let tip = -displacements(&hanging(block([free as i32 + 1, 1, 1]), DQuat::IDENTITY))[free].z;
    assert_close(tip, row_tip(free), 2e-3);
    // Timoshenko with EI = k_b 2R and κGA = k_t 2R, loaded by q from half a sphere beyond the held one to half a sphere beyond the tip.
    let (a, l, q) = (RADIUS, (2 * free) as f64 * RADIUS, WEIGHT_N / (2.0 * RADIUS));
    let ei = f64::from(potyondy().k_b) * 2.0 * RADIUS;
    let ga = f64::from(bonds().k_t) * 2.0 * RADIUS;
    // Deflection at l of a load q from a to l + a.
    let bend = |x: f64| x * x * (3.0 * l - x) / (6.0 * ei);
    let beyond = |x: f64| l * l * (3.0 * x - l) / (6.0 * ei);
    let integral = |of: &dyn Fn(f64) -> f64, from: f64, to: f64| {
        let step = (to - from) / 1000.0;
        (0..1000).map(|k| of(from + (f64::from(k) + 0.5) * step) * step).sum::<f64>()
    };
    let bending = q * (integral(&bend, a, l) + integral(&beyond, l, l + a));
    let shear = q * ((l * l - a * a) / 2.0 + l * a) / ga;
    assert_close(tip, bending + shear, 1e-2);
    println!("tip {tip:e}, Timoshenko {:e}, bending alone {bending:e}", bending + shear);
}

#[test]
fn beam_deflection_is_the_same_in_every_orientation_and_mirrored() {
    let hang = |orientation| displacements(&hanging(hook(5), orientation))[5];
    let straight = hang(DQuat::IDENTITY);
    for orientation in
        [DQuat::from_rotation_z(FRAC_PI_2), DQuat::from_euler(glam::EulerRot::XYZ, 0.7, -1.1, 2.3)]
    {
        let turned = hang(orientation);
        assert!((turned - straight).length() < 2e-3 * straight.length(), "{turned} is not {straight}");
    }
    let mut mirrored = hook(5);
    std::sync::Arc::make_mut(&mut mirrored.meta).points.iter_mut().for_each(|p| p.y = -p.y);
    let mirrored = displacements(&hanging(mirrored, DQuat::IDENTITY))[5];
    assert!(
        (mirrored * DVec3::new(1.0, -1.0, 1.0) - straight).length() < 2e-3 * straight.length(),
        "{mirrored}"
    );
}

#[test]
fn twist_of_a_row_of_spheres_matches_its_bond_stiffness() {
    // The hook's weight w at 2R beside the row twists each of its bonds by 2 R w, and bends its own by R w.
    let bonds_in_row = 5;
    let hangs = displacements(&hanging(hook(bonds_in_row + 1), DQuat::IDENTITY));
    let (law, k_t) = (potyondy(), f64::from(bonds().k_t));
    let twist = bonds_in_row as f64 * 2.0 * RADIUS * WEIGHT_N / f64::from(law.k_w);
    let bent = RADIUS * WEIGHT_N / f64::from(law.k_b);
    let expected = RADIUS * (2.0 * twist + bent) + WEIGHT_N / k_t;
    let found = hangs[bonds_in_row].z - hangs[bonds_in_row + 1].z;
    assert_close(found, expected, 3e-3);
    assert!(2.0 * RADIUS * twist > 0.8 * expected, "mostly twist");
}

#[test]
fn an_undamped_beam_keeps_its_energy() {
    // Kinetic energy, weight, and the energy of bonds from the displacements and rotations of the spheres, by small angles.
    let mut scene = hanging(hook(5), DQuat::IDENTITY);
    scene.timestep_s = 2e-5;
    let pairs: Vec<[usize; 2]> =
        scene.kinds[0].meta.bonds.iter().map(|bond| [bond.i as usize, bond.j as usize]).collect();
    let (law, bond) = (potyondy(), bonds());
    let mut bench = Bench::new(&scene);
    let start: Vec<DVec3> = (0..6).map(|i| bench.position(i)).collect();
    let mut turned = [DVec3::ZERO; 6];
    let (mut last_motion, mut most, mut worst) = (0.0f64, 0.0f64, 0.0f64);
    let square = |stiffness: f32, v: DVec3| 0.5 * f64::from(stiffness) * v.length_squared();
    for _ in 0..40_000 {
        assert_eq!(bench.steps(1), None);
        let spins: Vec<DVec3> = bench.state().particles.iter().map(|p| p.spin.as_dvec3()).collect();
        let u: Vec<DVec3> = (0..6).map(|i| bench.position(i) - start[i]).collect();
        turned.iter_mut().zip(&spins).for_each(|(turned, spin)| *turned += *spin * 2e-5);
        let in_bond = |&[i, j]: &[usize; 2]| {
            let n = (start[j] - start[i]).normalize();
            let across = |v: DVec3| v - n * v.dot(n);
            let (apart, turn) = (u[j] - u[i], turned[j] - turned[i]);
            square(bond.k_n, n * apart.dot(n))
                + square(bond.k_t, across(apart) - (turned[i] + turned[j]).cross(n) * RADIUS)
                + square(law.k_b, across(turn))
                + square(law.k_w, n * turn.dot(n))
        };
        let stored: f64 = pairs.iter().map(in_bond).sum();
        let weight: f64 = u.iter().map(|u| WEIGHT_N * u.z).sum();
        // Velocities are half a step behind the positions: their energy now is between this one and the next.
        let motion = bench.state().kinetic_energy();
        let moved = 0.5 * (motion - last_motion);
        worst = worst.max((motion + moved + stored + weight).abs());
        (last_motion, most) = (motion, most.max(-weight));
    }
    assert!(worst < 5e-3 * most, "{worst:e} J of {most:e} J");
}

/// Two rotating blocks collide off-centre, with bond moments, damping, friction and adhesion.
#[test]
fn collision_with_moments_conserves_linear_and_angular_momentum() {
    let bodies = vec![
        at(DVec3::new(-0.03, 0.004, 0.002), DVec3::X * 0.8),
        at(DVec3::new(0.03, -0.004, 0.0), DVec3::X * -0.8),
    ];
    let mut scene = scene(block([4, 4, 3]), bodies, 2e-5);
    scene.bodies[1].orientation = DQuat::from_rotation_z(0.4);
    scene.laws.tissue = law(false, 0.3, 0.4, 0.055);
    scene.laws.contact_between_bonded = true;
    let mut bench = Bench::new(&with_moments(scene, 1.0));
    let momenta = |bench: &mut Bench| {
        let of = |i: usize| {
            let (x, p) = (bench.position(i), bench.state().particles[i]);
            let (v, w) = (p.velocity.as_dvec3(), p.spin.as_dvec3());
            (v * MASS, (x.cross(v) + w * 0.4 * RADIUS * RADIUS) * MASS)
        };
        (0..96).map(of).fold((DVec3::ZERO, DVec3::ZERO), |a, b| (a.0 + b.0, a.1 + b.1))
    };
    let (_, before) = momenta(&mut bench);
    assert_eq!(bench.steps(5000), None);
    let (linear, after) = momenta(&mut bench);
    assert!(linear.length() < 1e-6 * 96.0 * MASS * 0.8, "{linear} kg m/s");
    assert!((after - before).length() < 1e-4 * before.length(), "{before} to {after}");
}

/// Whether a body that rests on a plate with friction 0.5, tilted by `tilt_deg`, stays where it is.
fn holds(kind: BodyKind, moments: f64, tilt_deg: f64) -> bool {
    let tilt = tilt_deg.to_radians();
    let gravity = DVec3::new(tilt.sin(), 0.0, -tilt.cos()) * G;
    let rigid = E / (1.0 - NU * NU);
    let overlap = (MASS * -gravity.z * 3.0 / (4.0 * rigid * RADIUS.sqrt())).powf(2.0 / 3.0);
    let mut scene = scene(kind, vec![at(DVec3::Z * (RADIUS - overlap), DVec3::ZERO)], 1e-5);
    scene.gravity = gravity;
    scene.surfaces = vec![plate(SurfaceKind::Equipment)];
    scene.laws.equipment = law(true, 0.2, 0.5, 0.0);
    scene.laws.tissue = law(false, 0.2, 0.0, 0.0);
    scene.laws.contact_between_bonded = true;
    (scene.laws.bond.k_n, scene.laws.bond.k_t) = (scene.laws.bond.k_n * 20.0, scene.laws.bond.k_t * 20.0);
    let mut bench = Bench::new(&if moments > 0.0 { with_moments(scene, moments) } else { scene });
    let mean = |bench: &mut Bench| {
        let n = bench.state().particles.len();
        (0..n).map(|i| bench.position(i).x).sum::<f64>() / n as f64
    };
    bench.steps(30_000);
    let settled = mean(&mut bench);
    bench.steps(20_000);
    (mean(&mut bench) - settled).abs() < 2e-5
}

#[test]
fn with_moments_a_layer_slides_at_its_angle_of_friction() {
    // atan 0.5 = 26.57°. Without moments it slides at less: `friction::bonded_pair_slides_below_its_angle_of_friction`.
    assert!(holds(block([4, 4, 1]), 1.0, 26.0), "holds below");
    assert!(!holds(block([4, 4, 1]), 1.0, 27.2), "slides above");
    assert!(!holds(block([4, 4, 1]), 0.0, 26.0), "slides without moments");
}
