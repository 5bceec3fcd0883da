//! The largest stable time step, from stiffness, mass and damping.
//!
//! The stiffest element of a run is a sub-particle inside the lattice, held on six sides by bonds and by
//! contacts with bonded neighbours. A simple cubic lattice of spacing 2R has these highest frequencies, where
//! K_n and K_t are the normal and tangential stiffness of one side:
//!
//! - antiphase, neighbours moving against each other: ω² = 4 (K_n + 2 K_t) / m,
//! - uniform spin, which shears every bond: ω² = 8 K_t R² / I = 20 K_t / m.
//!
//! With moments in bonds ([`super::moment`]) spins against each other cost as well. About an axis of the lattice, two
//! bonds twist and four bend. Each resists either the sum of its two spins or their difference, so the highest frequency is
//!
//! - ω² = (8 max(K_t R², k_b) + 4 k_w) / I.
//!
//! With one type of sub-particle the twelve face diagonals bond as well. They add at most 8 (k_n + 2 k_t) / m
//! to the first, and (16 max(2 k_t R², k_b) + 8 k_w) / I to the others.
//!
//! Where bonds are stiff a third mode decides: two sub-particles whose bond is about to break. A bond of
//! finite extension has stiffened to k_s by then, and no contact damps it: ω² = (4 (k_n + 2 k_t) + 2 (k_s −
//! k_n)) / m. A sub-particle that rolls on a surface never decides: ω² = 3.5 K / m, where K is 2√2 times the
//! contact K_t between two sub-particles.
//!
//! Leapfrog is stable for δt < 2/ω. With dashpots evaluated at the old velocity the condition is ω² δt²/4 + c
//! δt / 2m < 1. The six dashpots of a lattice point alone never make a step unstable, since each takes a
//! capped share of a motion ([`super::damping`]).
//!
//! All limits are estimates for the linear lattice. Contact stiffens with overlap; its stiffness is taken at
//! [`REFERENCE_OVERLAP`].
//!
//! | symbol | unit | meaning |
//! |---|---|---|
//! | K | N/m | S A of the bond + 2E*a (normal) or 8G*a (tangential) of the contact |
//! | m | kg | mass of a sub-particle |
//! | I | kg m² | its moment of inertia, 2/5 m R² |
//! | k_b, k_w | N m | bending and twisting stiffness of a bond |
//! | c | kg/s | sum of η over the contacts that act in the mode, weighted as K |

use super::Laws;
use super::damping::{self, BODY_CAP, BONDED_CAP, MOMENT_CAP};

/// Overlap at which the contact stiffness is taken, as a share of R: the overlap deep in a fillet that others
/// press on. Steps for the usual overlap of neighbours, a few hundredths, leave single sub-particles
/// trembling; the bed never comes to rest.
pub const REFERENCE_OVERLAP: f64 = 1.0;

/// Stiffness added by contacts with other bodies in a bed, relative to contacts with lattice neighbours.
/// Fitted to the eigenvalues of whole beds (`tests/pressed.rs`), not derived. It also stands for the dashpots
/// of these contacts. The reference overlap compensates, since it assumes on all sides a depth that occurs on
/// few.
pub const BED_STIFFNESS: f64 = 0.75;

/// Largest share of the damped limit that `"auto"` takes. It decides where stiff bonds dominate contact.
pub const SAFETY: f64 = 0.9;

/// The same share where contacts are elastic (restitution 1). Nothing takes up the energy that a long step makes in a
/// nonlinear lattice: an undamped fillet of 4 mm gained 1 % in 8 s at 0.8 of the limit, and nothing at half of it.
pub const ELASTIC_SAFETY: f64 = 0.5;

/// Limits of the time step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stability {
    /// 2/ω_max without damping, in seconds, for neighbours that overlap by [`REFERENCE_OVERLAP`]. Beyond it a
    /// bed pressed so far diverges. Unpressed bodies may bear 1.5 times as much, and twice as much without
    /// contact between bonded neighbours.
    pub undamped_s: f64,
    /// Limit with damping, in seconds. Between the two limits a run may diverge.
    pub damped_s: f64,
    /// Step of `"auto"` where nothing else bounds it, in seconds: the limit with other bodies pressing, and
    /// at most [`SAFETY`] or [`ELASTIC_SAFETY`] of `damped_s`.
    pub auto_s: f64,
}

/// Limits for sub-particles of `mass` in kg and `radius` in m. `diagonals` is true when face diagonals bond.
pub fn stability(mass: f64, radius: f64, laws: &Laws, diagonals: bool) -> Stability {
    let Laws { tissue: contact, bond, moment, contact_between_bonded, .. } = *laws;
    let a = (f64::from(contact.r_star) * REFERENCE_OVERLAP * radius).sqrt();
    let (contact_n, contact_t) = (2.0 * f64::from(contact.e_star) * a, 8.0 * f64::from(contact.g_star) * a);
    // Without contact between bonded neighbours, a pressed sub-particle touches only other bodies.
    let cap = if contact_between_bonded { BONDED_CAP } else { BODY_CAP };
    let (k_n, k_t) = (f64::from(bond.k_n), f64::from(bond.k_t));
    let diagonal = if diagonals { 8.0 * (k_n + 2.0 * k_t) } else { 0.0 };
    // Stiffness of each mode for a number of contacts on each side of a lattice point.
    let antiphase =
        |contacts: f64| 4.0 * (k_n + 2.0 * k_t + contacts * (contact_n + 2.0 * contact_t)) + diagonal;
    // Moments at the rim of a sub-particle, in N/m.
    let at_rim = |stiffness: f32| f64::from(stiffness) / (radius * radius);
    let (bend, twist) = moment.map_or((0.0, 0.0), |law| (at_rim(law.k_b), at_rim(law.k_w)));
    let diagonal_spin = if diagonals { 40.0 * (2.0 * k_t).max(bend) + 20.0 * twist } else { 0.0 };
    let alike = |contacts: f64| 20.0 * (k_t + contacts * contact_t) + 10.0 * twist + diagonal_spin;
    let opposed = 20.0 * bend + 10.0 * twist + diagonal_spin;
    let breaking = 4.0 * (k_n + 2.0 * k_t) + diagonal + 2.0 * (bond.stretched_k_n() - k_n);
    let eta = |stiffness: f64, cap: f32, dt: f64| {
        f64::from(damping::constant(contact.damping, stiffness as f32, (mass / 2.0) as f32, cap, dt as f32))
    };
    let eta_n = |dt| eta(contact_n, cap.normal, dt);
    let eta_t = |dt| eta(contact_t, cap.tangential, dt);
    let spin_eta = |dt: f64| {
        moment.map_or([0.0; 2], |law| {
            let inertia = law.inertia * (mass / 2.0) as f32;
            [law.k_b, law.k_w].map(|stiffness| {
                at_rim(damping::constant(law.damping, stiffness, inertia, MOMENT_CAP, dt as f32))
            })
        })
    };
    let all_damped = |dt: f64| {
        let [bend, twist] = spin_eta(dt);
        20.0 * bend + 10.0 * twist
    };
    let diagonal_eta = |dt: f64| if diagonals { 2.0 * all_damped(dt) } else { 0.0 };
    let damped = |contacts: f64| {
        let antiphase_s = longest_stable(mass, antiphase(contacts), |dt| 4.0 * (eta_n(dt) + 2.0 * eta_t(dt)));
        let alike_eta = |dt: f64| 20.0 * eta_t(dt) + 10.0 * spin_eta(dt)[1] + diagonal_eta(dt);
        let opposed_eta = |dt: f64| all_damped(dt) + diagonal_eta(dt);
        let opposed_s = moment.map_or(f64::INFINITY, |_| longest_stable(mass, opposed, opposed_eta));
        antiphase_s.min(longest_stable(mass, alike(contacts), alike_eta)).min(opposed_s)
    };
    let damped_s = damped(1.0).min(longest_stable(mass, breaking, |_| 0.0));
    let safety = if contact.damping > 0.0 { SAFETY } else { ELASTIC_SAFETY };
    Stability {
        undamped_s: undamped(mass, antiphase(1.0).max(alike(1.0)).max(opposed)),
        damped_s,
        auto_s: damped(1.0 + bed_stiffness(laws.body_radius_ratio)).min(safety * damped_s),
    }
}

/// [`BED_STIFFNESS`] for a radius towards other bodies: the number of contacts grows with its square.
fn bed_stiffness(body_radius_ratio: f32) -> f64 {
    BED_STIFFNESS * f64::from(body_radius_ratio).powi(2)
}

/// 2/ω in seconds, for a stiffness in N/m on a mass in kg.
fn undamped(mass: f64, stiffness: f64) -> f64 {
    2.0 * (mass / stiffness).sqrt()
}

/// Longest stable step in seconds, by bisection: the bounded expression grows with the step. `c(dt)` is the
/// damping in kg/s.
fn longest_stable(mass: f64, stiffness: f64, c: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, undamped(mass, stiffness));
    for _ in 0..50 {
        let dt = 0.5 * (low + high);
        let bounded = stiffness * dt * dt / (4.0 * mass) + c(dt) * dt / (2.0 * mass);
        if bounded < 1.0 { low = dt } else { high = dt }
    }
    low
}
