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
//! Leapfrog is stable for δt < 2/ω. A dashpot taken at the old velocity lowers that to
//! δt < (2/ω) (√(1 + ζ²) − ζ) for the damping ratio ζ. Both are estimates of the linear lattice; contact
//! stiffens with overlap and is taken at a stated overlap.
//!
//! | symbol | unit | meaning |
//! |---|---|---|
//! | K | N/m | S A of the bond + 2E*a (normal) or 8G*a (tangential) of the contact |
//! | m | kg | mass of a sub-particle |
//! | ζ | – | η ω / 2K, the share of critical damping of the contact in the mode |

use super::contact::ContactLaw;

/// Overlap at which contact stiffness is taken, as a share of R: the deepest seen in a filled hopper. Where fillets
/// have been driven into each other it decides; taken at the usual overlap of a few hundredths, single sub-particles
/// kept trembling at 0.04 m/s and the bed never came to rest.
pub const REFERENCE_OVERLAP: f64 = 1.0;

/// Share of the damped limit that `"auto"` takes.
pub const SAFETY: f64 = 0.9;

/// What bounds the time step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stability {
    /// 2/ω_max without damping, in seconds: beyond it a run must diverge.
    pub undamped_s: f64,
    /// The limit with damping, in seconds: between the two a run may diverge.
    pub damped_s: f64,
    /// The step that `"auto"` takes, in seconds.
    pub auto_s: f64,
}

/// The bounds for sub-particles of `mass` in kg and `radius` in m, bonds of `k_n` and `k_t` in N/m and contacts by
/// `law`; `diagonals` tells whether face diagonals bond, `contact_in_bonds` whether bonded neighbours touch as well.
pub fn stability(
    mass: f64,
    radius: f64,
    k_n: f64,
    k_t: f64,
    diagonals: bool,
    law: &ContactLaw,
    contact_in_bonds: bool,
) -> Stability {
    let a = (f64::from(law.r_star) * REFERENCE_OVERLAP * radius).sqrt();
    let contact_n = 2.0 * f64::from(law.e_star) * a;
    let contact_t = 8.0 * f64::from(law.g_star) * a;
    // Without contact in bonds a loaded sub-particle still touches others on about two sides of six.
    let share = if contact_in_bonds { 1.0 } else { 1.0 / 3.0 };
    let (side_n, side_t) = (k_n + share * contact_n, k_t + share * contact_t);
    let (diagonal_n, diagonal_t) = if diagonals { (k_n, k_t) } else { (0.0, 0.0) };
    let factor = f64::from(law.damping);
    let eta = |stiffness: f64| share * factor * (stiffness * mass / 2.0).sqrt();
    let modes = [
        // (ω², dashpot in the same combination per mass)
        (
            (4.0 * (side_n + 2.0 * side_t) + 8.0 * (diagonal_n + 2.0 * diagonal_t)) / mass,
            4.0 * (eta(contact_n) + 2.0 * eta(contact_t)) / mass,
        ),
        ((20.0 * side_t + 80.0 * diagonal_t) / mass, 20.0 * eta(contact_t) / mass),
    ];
    let mut stability =
        Stability { undamped_s: f64::INFINITY, damped_s: f64::INFINITY, auto_s: f64::INFINITY };
    for (omega2, rate) in modes {
        let omega = omega2.sqrt();
        let zeta = rate / (2.0 * omega);
        stability.undamped_s = stability.undamped_s.min(2.0 / omega);
        stability.damped_s = stability.damped_s.min(2.0 / omega * ((1.0 + zeta * zeta).sqrt() - zeta));
    }
    stability.auto_s = SAFETY * stability.damped_s;
    stability
}
