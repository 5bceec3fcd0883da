//! The largest stable time step, from stiffness, mass and damping.
//!
//! The stiffest thing in a run is a sub-particle inside the lattice, held on six sides by bonds and by the
//! contacts between bonded neighbours. For a simple cubic lattice of spacing 2R the highest frequencies are,
//! with K_n and K_t the stiffnesses of one side along and across,
//!
//! - neighbours moving against each other: ω² = 4 (K_n + 2 K_t) / m,
//! - all spinning alike, which shears every bond: ω² = 8 K_t R² / I = 20 K_t / m.
//!
//! With one type of sub-particle the twelve face diagonals bond as well and add at most 8 (k_n + 2 k_t) / m and 80 k_t / m.
//! Where bonds are stiff one more mode decides: two sub-particles whose bond is about to break, which stiffens to k_b by then if
//! its extension is finite, and no contact damps it: ω² = (4 (k_n + 2 k_t) + 2 (k_b − k_n)) / m. One that rolls on a surface never
//! does: ω² = 3.5 K / m, where K is 2√2 times the K_t of contact between two.
//!
//! Leapfrog is stable for δt < 2/ω, and with dashpots taken at the old velocity while ω² δt²/4 + c δt / 2m < 1. A contact's dashpot
//! takes no more than a share of a motion in a step ([`super::damping`]), so that those of the six of a lattice point by themselves make no step
//! unstable. All are estimates of the linear lattice; contact
//! stiffens with overlap and is taken at a stated overlap.
//!
//! | symbol | unit | meaning |
//! |---|---|---|
//! | K | N/m | S A of the bond + 2E*a (normal) or 8G*a (tangential) of the contact |
//! | m | kg | mass of a sub-particle |
//! | I | kg m² | its moment of inertia, 2/5 m R² |
//! | c | kg/s | the η of the contacts that act in the mode, summed as the K are |

use super::bond::BondLaw;
use super::contact::ContactLaw;
use super::damping::{self, BODY_CAP, BONDED_CAP};

/// Overlap at which contact stiffness is taken, as a share of R: that of sub-particles deep in a fillet that others press on. With
/// steps for the usual overlap of neighbours, a few hundredths, single sub-particles keep trembling and the bed never comes to rest.
pub const REFERENCE_OVERLAP: f64 = 1.0;

/// Contacts with other bodies that a lattice point in a bed is held by, over those with its neighbours: what they add in stiffness.
/// Found from the eigenvalues of whole beds (`tests/pressed.rs`) and not derived: it stands for their dashpots as well, which the
/// overlap taken, as deep on all sides as it is on few, makes up for.
pub const BED_STIFFNESS: f64 = 0.75;

/// The most that `"auto"` takes of the damped limit: it decides where bonds are so stiff that contact hardly counts.
pub const SAFETY: f64 = 0.9;

/// What bounds the time step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stability {
    /// 2/ω_max without damping, in seconds, as estimated for neighbours that overlap by [`REFERENCE_OVERLAP`]: beyond it a bed pressed so
    /// far diverges. Bodies that nothing presses may bear half as much again, and twice as much without contact in bonds.
    pub undamped_s: f64,
    /// The limit with damping, in seconds: between the two a run may diverge.
    pub damped_s: f64,
    /// The step that `"auto"` takes where nothing else bounds it, in seconds: the limit where other bodies press as well, and at most
    /// [`SAFETY`] of `damped_s`.
    pub auto_s: f64,
}

/// The bounds for sub-particles of `mass` in kg and `radius` in m; `diagonals` tells whether face diagonals bond.
pub fn stability(
    mass: f64,
    radius: f64,
    contact: &ContactLaw,
    bond: &BondLaw,
    contact_between_bonded: bool,
    diagonals: bool,
) -> Stability {
    let a = (f64::from(contact.r_star) * REFERENCE_OVERLAP * radius).sqrt();
    let (contact_n, contact_t) = (2.0 * f64::from(contact.e_star) * a, 8.0 * f64::from(contact.g_star) * a);
    // Without contact in bonds it is other bodies alone that a pressed sub-particle touches.
    let cap = if contact_between_bonded { BONDED_CAP } else { BODY_CAP };
    let (k_n, k_t) = (f64::from(bond.k_n), f64::from(bond.k_t));
    let (diagonal_n, diagonal_t) = if diagonals { (k_n, k_t) } else { (0.0, 0.0) };
    let diagonal = 8.0 * (diagonal_n + 2.0 * diagonal_t);
    // With as many contacts on each side of a lattice point.
    let antiphase =
        |contacts: f64| 4.0 * (k_n + 2.0 * k_t + contacts * (contact_n + 2.0 * contact_t)) + diagonal;
    let uniform_spin = |contacts: f64| 20.0 * (k_t + contacts * contact_t) + 80.0 * diagonal_t;
    let breaking = 4.0 * (k_n + 2.0 * k_t) + diagonal + 2.0 * (bond.stretched_k_n() - k_n);
    let eta = |stiffness: f64, cap: f32, dt: f64| {
        f64::from(damping::constant(contact.damping, stiffness as f32, (mass / 2.0) as f32, cap, dt as f32))
    };
    let eta_n = |dt| eta(contact_n, cap.normal, dt);
    let eta_t = |dt| eta(contact_t, cap.tangential, dt);
    let damped = |contacts: f64| {
        let antiphase_s = longest_stable(mass, antiphase(contacts), |dt| 4.0 * (eta_n(dt) + 2.0 * eta_t(dt)));
        antiphase_s.min(longest_stable(mass, uniform_spin(contacts), |dt| 20.0 * eta_t(dt)))
    };
    let damped_s = damped(1.0).min(longest_stable(mass, breaking, |_| 0.0));
    Stability {
        undamped_s: undamped(mass, antiphase(1.0).max(uniform_spin(1.0))),
        damped_s,
        auto_s: damped(1.0 + BED_STIFFNESS).min(SAFETY * damped_s),
    }
}

/// 2/ω in seconds, for a stiffness in N/m on a mass in kg.
fn undamped(mass: f64, stiffness: f64) -> f64 {
    2.0 * (mass / stiffness).sqrt()
}

/// The longest stable step in seconds, with dashpots of `c` kg/s in a step of so many seconds: by bisection, since what is
/// bounded grows with the step.
fn longest_stable(mass: f64, stiffness: f64, c: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, undamped(mass, stiffness));
    for _ in 0..50 {
        let dt = 0.5 * (low + high);
        let bounded = stiffness * dt * dt / (4.0 * mass) + c(dt) * dt / (2.0 * mass);
        if bounded < 1.0 { low = dt } else { high = dt }
    }
    low
}
