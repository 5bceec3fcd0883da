//! Contacts against another code: LAMMPS' `pair_style granular` and `fix wall/gran`, at Table 2.
//!
//! The tables, what made them and how parameters map are in `lammps/` (see its README.md). Axes are those of LAMMPS' runs:
//! the normal is x, the tangent y, spin is about z. Each limit stands beside the difference seen, both in per cent.

mod common;
#[path = "lammps/curve.rs"]
mod curve;
#[path = "lammps/motion.rs"]
mod motion;

use std::f64::consts::PI;

use common::RADIUS;
use curve::{Curve, Table, assert_agrees, assert_number_agrees, joined};
use glam::DVec3;
use motion::{Moment, Rub, Sphere, Wall, collide, rub_pair, rub_wall};
use roost_solver::physics::damping;

/// Time step of collisions, in seconds: that of LAMMPS' runs.
const DT: f64 = 1e-6;

/// The row of a table with the greatest y.
fn greatest(curve: &[(f64, f64)]) -> (usize, f64) {
    let (k, row) = curve.iter().enumerate().max_by(|a, b| a.1.1.total_cmp(&b.1.1)).expect("rows");
    (k, row.1)
}

#[test]
fn jkr_force_matches_lammps_in_compression_and_tension() {
    for (against, speed) in [(Sphere, 0.06), (Wall, 0.085)] {
        let what = format!("JKR {}", against.name());
        let table = Table::read(&format!("jkr_{}.csv", against.name()));
        let rows = joined(&table.column("overlap_m"), &table.column("normal_n"));
        let turn = greatest(&rows).0;
        let held = |rows: &[(f64, f64)]| rows.iter().copied().filter(|row| row.1 != 0.0).collect::<Curve>();
        let (pressed, mut pulled) = (held(&rows[..turn]), held(&rows[turn..]));
        pulled.reverse();

        // A collision runs through the same overlaps, and without damping the force depends on nothing else.
        let law = against.law(1.0, 0.0, 0.055);
        let moments = collide(against, law, 1e-5, DVec3::X * -speed, 4e-6, 4000);
        let mut approach: Curve = moments.iter().map(|m| (m.overlap, m.force)).collect();
        let deepest = greatest(&over_time(&moments, |m| m.overlap)).0;
        let mut retreat = approach.split_off(deepest);
        retreat.reverse();

        // In shares of the pull-off, the lesser scale: 0.2 mm press four to six times as hard.
        let pull_off = 3.0 * PI * 0.055 * against.r_star();
        assert_agrees(&format!("{what}, pressed"), &pressed, &approach, pull_off, 0.1); // 0.01; wall 0.02
        assert_agrees(&format!("{what}, pulled"), &pulled, &retreat, pull_off, 0.1); // 0.01; wall 0.02
        assert!(
            approach.iter().all(|&(overlap, force)| overlap > 0.0 || force == 0.0),
            "no neck before touch"
        );

        // LAMMPS lets go at the greatest pull, the solver goes on to where the neck snaps.
        let least = |rows: &[(f64, f64)]| *rows.iter().min_by(|a, b| a.1.total_cmp(&b.1)).expect("rows");
        let (expected, found) = (least(&pulled), least(&retreat));
        assert_number_agrees(&format!("{what}, pull-off"), expected.1, found.1, 0.1); // 0.01; wall 0.02
        const ROW: f64 = 1e-6;
        assert!((found.0 - pulled[0].0).abs() < 1.5 * ROW, "lets go at {:e}, not {:e}", pulled[0].0, found.0);
        let last = retreat.iter().find(|row| row.1 != 0.0).expect("held").0;
        let snap = f64::from(law.adhesion_range());
        assert!((last + snap).abs() < ROW && snap > 2.0 * -pulled[0].0, "the neck snaps at {last:e}");
    }
}

#[track_caller]
fn assert_rubs_agree(what: &str, expected: &Rub, found: &Rub, percent: f64) {
    let scale = |curve: &[(f64, f64)]| curve.iter().map(|row| row.1.abs()).fold(0.0, f64::max);
    let (normal, tangential) = (scale(&expected.normal), scale(&expected.tangential));
    assert_agrees(&format!("{what}, normal"), &expected.normal, &found.normal, normal, percent);
    assert_agrees(
        &format!("{what}, tangential"),
        &expected.tangential,
        &found.tangential,
        tangential,
        percent,
    );
}

#[test]
fn friction_matches_lammps_in_loading_sliding_and_torque() {
    let pair = rub_pair(Sphere.law(1.0, 0.1, 0.0), 2e-4, 6e-5);
    assert_rubs_agree("Mindlin on Hertz, pair", &Rub::read("rub_hertz_pair.csv"), &pair, 0.05);
    let wall = rub_wall(Wall.law(1.0, 0.5, 0.0), 2e-4, 2.5e-4);
    assert_rubs_agree("Mindlin on Hertz, wall", &Rub::read("rub_hertz_wall.csv"), &wall, 0.2);
}

#[test]
fn mindlin_spring_matches_lammps_with_adhesion() {
    // Friction is high enough that nothing slides, and overlaps deep enough that all push: the caps of the two codes differ.
    let pair = rub_pair(Sphere.law(1.0, 100.0, 0.055), 1e-4, 2e-5);
    assert_rubs_agree("Mindlin on JKR, pair", &Rub::read("rub_jkr_pair.csv"), &pair, 0.05);
    let wall = rub_wall(Wall.law(1.0, 100.0, 0.055), 1e-4, 2e-5);
    assert_rubs_agree("Mindlin on JKR, wall", &Rub::read("rub_jkr_wall.csv"), &wall, 0.2);
}

/// A collision over time.
fn over_time(moments: &[Moment], of: fn(&Moment) -> f64) -> Curve {
    moments.iter().enumerate().map(|(k, moment)| (k as f64 * DT, of(moment))).collect()
}

/// When the overlap has gone, between two points.
fn parting(overlaps: &[(f64, f64)]) -> f64 {
    let k = overlaps.windows(2).rposition(|w| w[0].1 > 0.0 && w[1].1 <= 0.0).expect("parts");
    let ((t0, y0), (t1, y1)) = (overlaps[k], overlaps[k + 1]);
    t0 + (t1 - t0) * y0 / (y0 - y1)
}

#[test]
fn collision_damping_matches_lammps() {
    for against in [Sphere, Wall] {
        for (restitution, file) in [(0.5, "50"), (0.2, "20")] {
            let law = against.law(restitution, 0.0, 0.0);
            let moments = collide(against, law, 0.0, DVec3::X * -0.5, DT, 9501);
            let found_overlap = over_time(&moments, |m| m.overlap);
            let found_speed = over_time(&moments, |m| m.velocity.x);
            for damping in ["coeff_restitution", "tsuji"] {
                let table = Table::read(&format!("collide_{}_{damping}_{file}.csv", against.name()));
                let of = |name: &str| joined(&table.column("t_s"), &table.column(name));
                let (overlap, speed) = (of("overlap_m"), of("normal_m_s"));
                let what = format!("{} {restitution} {damping}", against.name());
                // None of the four was over 0.002.
                let deepest = greatest(&overlap).1;
                assert_agrees(&format!("{what}, overlap"), &overlap, &found_overlap, deepest, 0.02);
                assert_agrees(&format!("{what}, speed"), &speed, &found_speed, 0.5, 0.02);
                let rebound = |curve: &[(f64, f64)]| curve[curve.len() - 1].1;
                assert_number_agrees(
                    &format!("{what}, rebound"),
                    rebound(&speed),
                    rebound(&found_speed),
                    0.02,
                );
                let (expected, found) = (parting(&overlap), parting(&found_overlap));
                assert_number_agrees(&format!("{what}, duration"), expected, found, 0.02);
            }
        }
    }
}

#[test]
fn tsuji_damping_with_converted_restitution_gives_the_same_dashpot() {
    // LAMMPS: η = α(e) √(m* 4/3 E* a), α a polynomial. The solver: η = f √(m* 2E* a). So α must be √1.5 f.
    let coefficients = [1.2728, -4.2783, 11.087, -22.348, 27.467, -18.022, 4.8218];
    let alpha = |e: f64| coefficients.iter().rev().fold(0.0, |sum, c| sum * e + c);
    for (restitution, told) in [(0.5, 0.366_651_4), (0.2, 0.070_356_35)] {
        let wanted = 1.5f64.sqrt() * damping::factor(restitution);
        assert_number_agrees("α as told", wanted, alpha(told), 1e-4);
        // Told the restitution itself, it damps less, by √2.
        assert_number_agrees("α as named, times √2", wanted, alpha(restitution) * 2f64.sqrt(), 0.1); // 0.08
    }
}

#[test]
fn oblique_collision_matches_lammps() {
    // At the wall LAMMPS' arm is R and the solver's what is left of it, 0.8 % less at the deepest.
    for (against, mu, across, percent) in [(Sphere, 0.1, 0.003, 0.15), (Wall, 0.5, 0.015, 0.8)] {
        let what = format!("oblique {}", against.name());
        let table = Table::read(&format!("oblique_{}.csv", against.name()));
        let t = table.column("t_s");
        let law = against.law(0.5, mu, 0.0);
        let moments = collide(against, law, 0.0, DVec3::new(-0.01, across, 0.0), DT, 18_001);
        let normal = joined(&t, &table.column("normal_m_s"));
        let found = over_time(&moments, |m| m.velocity.x);
        assert_agrees(&format!("{what}, normal"), &normal, &found, 0.01, 0.02); // 0.002
        // From the fastest rebound on, the dashpot pulls: there LAMMPS rubs with μ|F|, the solver not at all.
        let end = greatest(&normal).0;
        let pressed = |name: &str| joined(&t[..end], &table.column(name)[..end]);
        let (tangential, found) = (pressed("tangential_m_s"), over_time(&moments, |m| m.velocity.y));
        assert_agrees(&format!("{what}, tangential"), &tangential, &found, across, percent); // 0.07; wall 0.3
        let (spin, found) = (pressed("spin_rad_s"), over_time(&moments, |m| m.spin));
        assert_agrees(&format!("{what}, spin"), &spin, &found, across / RADIUS, percent); // 0.09; wall 0.6
    }
}
