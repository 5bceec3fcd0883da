//! Contacts against closed forms: Hertz collision, restitution, JKR force curve and pull-off.

mod common;

use std::f64::consts::PI;

use common::{Bench, E, G, MASS, NU, RADIUS, assert_close, at, block, law, plate, scene};
use glam::{DVec3, Vec3};
use roost_solver::engine::Backend;
use roost_solver::engine::checkpoint::Stamp;
use roost_solver::engine::run::{Decision, ExperimentMonitor, RunPlan, Sample};
use roost_solver::engine::saved_fields::{SavedFields, SavedFieldsError};
use roost_solver::engine::simulation::run;
use roost_solver::equipment::SurfaceKind;
use roost_solver::observe::Recorder;
use roost_solver::physics::contact::{self, ContactHistory};
use roost_solver::physics::damping::{BODY_CAP, BONDED_CAP, SURFACE_CAP};
use roost_solver::physics::{hertz, jkr};
use roost_solver::result::EndReason;
use roost_solver::{Flow, Progress};
use serde_json::{Map, Value};

/// E* of tissue on tissue, written out from eq. 2.
fn e_star() -> f64 {
    1.0 / (2.0 * (1.0 - NU * NU) / E)
}

/// A head-on collision of two spheres: duration, maximum overlap, speed of separation.
fn collide(restitution: f64, gamma: f64, approach: f64, dt: f64) -> (f64, f64, f64) {
    let gap = 1e-4;
    let x = RADIUS + gap / 2.0;
    let v = DVec3::X * approach / 2.0;
    let mut scene = scene(block([1, 1, 1]), vec![at(DVec3::X * -x, v), at(DVec3::X * x, -v)], dt);
    scene.laws.tissue = law(false, restitution, 0.0, gamma);
    let mut bench = Bench::new(&scene);
    let (mut in_contact, mut deepest) = (0, 0.0f64);
    for _ in 0..(0.2 / dt) as u64 {
        bench.steps(1);
        let overlap = 2.0 * RADIUS - (bench.position(1) - bench.position(0)).length();
        deepest = deepest.max(overlap);
        in_contact += u64::from(overlap > 0.0);
        if overlap < -gap && in_contact > 0 {
            break;
        }
    }
    let separation = (bench.velocity(1) - bench.velocity(0)).x;
    (in_contact as f64 * dt, deepest, separation)
}

#[test]
fn hertz_collision_has_the_closed_form_duration_and_depth() {
    let (v, m_star, r_star) = (0.5, MASS / 2.0, RADIUS / 2.0);
    let (duration, depth, separation) = collide(1.0, 0.0, v, 1e-6);
    assert_close(duration, 2.8683 * (m_star * m_star / (r_star * e_star().powi(2) * v)).powf(0.2), 2e-3);
    assert_close(depth, (15.0 * m_star * v * v / (16.0 * e_star() * r_star.sqrt())).powf(0.4), 2e-3);
    assert_close(separation, v, 1e-3);
}

#[test]
fn measured_restitution_equals_the_requested_one() {
    for restitution in [0.2, 0.5, 0.8] {
        let (_, _, separation) = collide(restitution, 0.0, 0.5, 1e-6);
        assert_close(separation, restitution * 0.5, 1e-2);
    }
}

#[test]
fn dashpot_impulse_of_a_long_step_is_capped() {
    let (law, delta, dt) = (law(false, 1e-4, 1e3, 0.0), 0.5 * RADIUS as f32, 1e-3f32);
    let m_star = MASS as f32 / 2.0;
    for (cap, along, across) in [(BONDED_CAP, 0.6, 0.8), (BODY_CAP, 0.75, 0.9), (SURFACE_CAP, 0.25, 0.8)] {
        // The force on i with a velocity against j, in its direction, less what springs do.
        let damps = |n: Vec3, spring: f32| {
            let feel = |v: Vec3| {
                let mut history = ContactHistory::default();
                let force = contact::force(&law, &mut history, n, delta, v, Vec3::ZERO, m_star, cap, dt);
                let force = force.expect("it touches");
                force.normal + force.tangential
            };
            f64::from((feel(Vec3::Z) - feel(Vec3::ZERO)).z + spring * dt)
        };
        let by_mass = f64::from(dt) / f64::from(m_star);
        assert_close(1.0 + damps(Vec3::Z, 0.0) * by_mass, along, 1e-5);
        // Across, both are spun as well: at the contact a force moves 1 + m R²/I = 7/2 times as much.
        let k_t = 8.0 * law.g_star * (law.r_star * delta).sqrt();
        assert_close(1.0 + 3.5 * damps(Vec3::X, k_t) * by_mass, across, 1e-4);
    }
}

#[test]
fn hertz_force_and_moduli_match_hand_calculated_values() {
    // 4/3 · 28154.79 Pa · √0.002 m · (0.001 m)^1.5, worked out by hand.
    let (force, a) = hertz::force(28_154.79, 0.002, 0.001);
    assert_close(f64::from(force), 0.053_088_6, 1e-4);
    assert_close(f64::from(a), 2f64.sqrt() * 1e-3, 1e-6);
    let moduli = hertz::tissue_on_tissue(E, NU);
    assert_close(moduli.youngs, e_star(), 1e-12);
    assert_close(moduli.shear, 1.0 / (2.0 * (2.0 - NU) / (E / (2.0 * (1.0 + NU)))), 1e-12);
    let rigid = hertz::tissue_on_rigid(E, NU);
    assert_close(rigid.youngs, 2.0 * moduli.youngs, 1e-12);
    assert_close(rigid.shear, 2.0 * moduli.shear, 1e-12);
}

/// Eq. 4 and 5 as published, parametrised by the contact radius: overlap and force.
fn published(a: f64, e: f64, r: f64, gamma: f64) -> (f64, f64) {
    let overlap = a * a / r - (4.0 * PI * gamma * a / e).sqrt();
    let force = 4.0 * e / (3.0 * r) * a.powi(3) - 4.0 * (PI * gamma * e).sqrt() * a.powf(1.5);
    (overlap, force)
}

#[test]
fn jkr_force_follows_the_published_curve() {
    let (r_star, gamma) = (RADIUS / 2.0, 0.055);
    let scale = jkr::JkrScale::new(e_star(), r_star, gamma);
    let pull_off = 3.0 * PI * gamma * r_star;
    // The stable branch begins where dδ/da = 0.
    let a_snap = (PI * gamma * r_star * r_star / (4.0 * e_star())).cbrt();
    let (snap, _) = published(a_snap, e_star(), r_star, gamma);
    assert_close(f64::from(scale.snap_overlap), snap, 1e-5);
    let mut least = 0.0f64;
    for k in 1..2000 {
        let a = a_snap * (1.0 + 5.0 * f64::from(k) / 2000.0);
        let (overlap, force) = published(a, e_star(), r_star, gamma);
        let (found, radius) = jkr::force(&scale, overlap as f32);
        // At the snap the curve is vertical: there a rounding of δ is a change of F.
        let tolerance = if k < 40 { 2e-2 } else { 3e-4 };
        assert!((f64::from(found) - force).abs() < tolerance * pull_off.max(force.abs()), "a = {a:e}");
        assert_close(f64::from(radius), a, if k < 40 { 2e-2 } else { 1e-3 });
        least = least.min(f64::from(found));
    }
    assert_close(-least, pull_off, 1e-3);
}

#[test]
fn adhesive_contact_forms_at_touch_and_breaks_at_the_snap_overlap() {
    let law = law(false, 1.0, 0.0, 0.055);
    let snap = law.jkr.expect("adhesive").snap_overlap;
    let mut history = ContactHistory::default();
    let mut feel = |delta: f32| {
        contact::force(&law, &mut history, Vec3::X, delta, Vec3::ZERO, Vec3::ZERO, 2.3e-4, BODY_CAP, 1e-5)
            .map(|f| -f.normal.x)
    };
    assert_eq!(feel(snap * 0.5), None, "apart, and never touched");
    assert_close(f64::from(feel(0.0).expect("touches")), -8.0 / 3.0 * PI * 0.055 * 0.002, 1e-4);
    assert!(feel(snap * 0.9).expect("the neck holds") < 0.0);
    assert_eq!(feel(snap * 1.01), None, "the neck snaps");
    assert_eq!(feel(snap * 0.5), None, "and stays snapped");
}

#[test]
fn adhesive_neck_holds_beyond_touch_and_pulls_slow_spheres_back() {
    // The work from touch to the snap, of order 8/3 πγR* · |snap|, holds 14 mm/s between spheres and not 60.
    let part = |wall: bool, v: f64, gamma: f64| {
        let mut scene = scene(block([1, 1, 1]), vec![], 1e-6);
        if wall {
            scene.bodies = vec![at(DVec3::Z * (RADIUS - 1e-7), DVec3::Z * v)];
            scene.surfaces = vec![plate(SurfaceKind::Equipment)];
        } else {
            let x = DVec3::Z * (RADIUS - 1e-7);
            scene.bodies = vec![at(-x, DVec3::Z * -v / 2.0), at(x, DVec3::Z * v / 2.0)];
        }
        scene.laws.tissue = law(false, 1.0, 0.0, gamma);
        scene.laws.equipment = law(true, 1.0, 0.0, gamma);
        let mut bench = Bench::new(&scene);
        let (mut apart, mut back) = (0.0f64, false);
        for _ in 0..400 {
            bench.steps(50);
            let last = bench.state().particles.len() - 1;
            let from = if wall { DVec3::ZERO } else { bench.position(0) };
            let gap = (bench.position(last) - from).length() - if wall { RADIUS } else { 2.0 * RADIUS };
            apart = apart.max(gap);
            back |= apart > 1e-5 && gap < 0.0;
        }
        (apart, back)
    };
    for wall in [false, true] {
        let (apart, back) = part(wall, 0.014, 0.055);
        assert!(apart > 1e-5 && apart < 1e-4 && back, "wall {wall}: {apart:e} m apart");
        let (apart, back) = part(wall, 0.08, 0.055);
        assert!(apart > 3e-4 && !back, "wall {wall}: {apart:e} m apart");
        // Glue: a neck longer than what the neighbour lists allow for motion.
        let (apart, back) = part(wall, 10.0, 200.0);
        assert!(apart > 2e-3 && back, "wall {wall}: {apart:e} m apart");
    }
}

#[test]
fn maximum_overlap_excludes_bonded_pairs() {
    let overlap = |kind, bodies: Vec<_>| {
        let mut bench = Bench::new(&scene(kind, bodies, 1e-9));
        bench.cpu.advance(&mut [(&mut bench.run, 1)])[0].max_overlap_m
    };
    let apart = [DVec3::ZERO, DVec3::X * (2.0 * RADIUS - 3e-4), DVec3::Y * (2.0 * RADIUS - 1e-4)];
    let spheres = apart.map(|x| at(x, DVec3::ZERO)).to_vec();
    assert_close(f64::from(overlap(block([1, 1, 1]), spheres)), 3e-4, 1e-3);
    let mut pair = block([2, 1, 1]);
    std::sync::Arc::make_mut(&mut pair.meta).points[1].x -= 3e-4;
    assert_eq!(overlap(pair, vec![at(DVec3::ZERO, DVec3::ZERO)]), 0.0);
}

/// Records the maximum overlap of each sample.
#[derive(Default)]
struct Overlaps(Vec<f32>, Recorder);

impl ExperimentMonitor for Overlaps {
    fn observe(&mut self, sample: &Sample<'_>) -> Decision {
        self.0.push(sample.max_overlap_m);
        if sample.belt_time_s.is_none() { Decision::Start } else { Decision::Continue { remove: vec![] } }
    }

    fn recorder(&self) -> &Recorder {
        &self.1
    }

    fn save(&self) -> SavedFields {
        SavedFields::of(&self.0)
    }

    fn restore(&mut self, saved: &SavedFields) -> Result<(), SavedFieldsError> {
        self.0 = saved.read()?;
        Ok(())
    }

    fn responses(&self, _reason: EndReason) -> Map<String, Value> {
        Map::new()
    }
}

#[test]
fn maximum_overlap_is_kept_after_a_collision_ends() {
    let bodies = [-1.0, 1.0].map(|side| at(DVec3::X * side * 1.01 * RADIUS, DVec3::X * -side * 0.25));
    let scene = scene(block([1, 1, 1]), bodies.to_vec(), 1e-5);
    let plan = RunPlan { sample_interval_s: 1e-3, longest_fill_s: 1.0, duration_s: 0.1 };
    let mut overlaps = Overlaps::default();
    let (cpu, stamp) = (common::backend(1), Stamp::new(String::new(), String::new(), None));
    let ended =
        run(&cpu, &scene, plan, &stamp, None, &mut overlaps, &mut |_: &Progress| Flow::Continue).unwrap();
    assert_eq!(ended.reason, EndReason::Duration);
    let (v, m_star, r_star) = (0.5, MASS / 2.0, RADIUS / 2.0);
    let deepest = (15.0 * m_star * v * v / (16.0 * e_star() * f64::sqrt(r_star))).powf(0.4);
    assert_close(f64::from(overlaps.0[101]), deepest, 1e-2);
    assert!(overlaps.0.is_sorted() && overlaps.0.len() == 102);
}

#[test]
fn hertz_is_the_limit_of_jkr_without_adhesion() {
    let force_at = |gamma: f64| {
        let law = law(false, 1.0, 0.0, gamma);
        let mut history = ContactHistory::default();
        let force =
            contact::force(&law, &mut history, Vec3::X, 2e-4, Vec3::ZERO, Vec3::ZERO, 2.3e-4, BODY_CAP, 1e-5);
        f64::from(-force.expect("touches").normal.x)
    };
    assert!(law(false, 1.0, 0.0, 0.9e-7).jkr.is_none() && law(false, 1.0, 0.0, 1.1e-7).jkr.is_some());
    assert_close(force_at(1.1e-7), force_at(0.0), 2e-3);
}

#[test]
fn friction_is_tangential_and_capped_by_the_total_normal_force() {
    let law = law(true, 0.3, 0.5, 0.0);
    let feel = |v: Vec3| {
        let mut fresh = ContactHistory::default();
        contact::force(&law, &mut fresh, Vec3::X, 1e-4, v, Vec3::ZERO, 4.6e-4, SURFACE_CAP, 1e-3)
            .expect("touches")
    };
    let still = feel(Vec3::ZERO).normal.x;
    // The dashpot counts: coming closer presses harder, and holds more.
    for v_n in [0.0, 0.02, 0.2] {
        let force = feel(Vec3::new(v_n, 3.0, 4.0));
        assert!(v_n == 0.0 || force.normal.x < 1.1 * still);
        let expected = Vec3::new(0.0, -0.6, -0.8) * 0.5 * -force.normal.x;
        assert!((force.tangential - expected).length() < 1e-5 * expected.length(), "{force:?}");
    }
    assert_eq!(feel(Vec3::X * 0.1).tangential, Vec3::ZERO);
    let parting = feel(Vec3::new(-10.0, 3.0, 4.0));
    assert!(parting.normal.x > 0.0 && parting.tangential == Vec3::ZERO, "pulled apart: nothing to rub on");
}

#[test]
fn a_bouncing_sphere_keeps_its_energy_and_its_height() {
    let height = 0.02;
    let mut scene = scene(block([1, 1, 1]), vec![at(DVec3::Z * (RADIUS + height), DVec3::ZERO)], 5e-6);
    scene.surfaces = vec![plate(SurfaceKind::Equipment)];
    scene.gravity = DVec3::NEG_Z * G;
    let mut bench = Bench::new(&scene);
    let e_rigid = E / (1.0 - NU * NU);
    let total = MASS * G * (RADIUS + height);
    let (mut bounces, mut was_down, mut worst) = (0, false, 0.0f64);
    for _ in 0..100_000 {
        let before = bench.velocity(0).z;
        bench.steps(1);
        let z = bench.position(0).z;
        // The velocity at the time of the position, half a step on.
        let v = bench.velocity(0).z + (bench.velocity(0).z - before) / 2.0;
        let overlap = (RADIUS - z).max(0.0);
        let elastic = 8.0 / 15.0 * e_rigid * RADIUS.sqrt() * overlap.powf(2.5);
        let energy = MASS * G * z + 0.5 * MASS * v * v + elastic;
        worst = worst.max((energy / total - 1.0).abs());
        bounces += u32::from(was_down && overlap == 0.0);
        was_down = overlap > 0.0;
    }
    assert!(bounces >= 3, "{bounces} bounces");
    assert!(worst < 3e-3, "energy off by {worst:e}");
}
