//! Bending and twisting moments of a bond (Potyondy and Cundall 2004, parallel bond), as an option.
//!
//! k_b = f S_n I,  k_w = f S_t J,  I = π R_b⁴/4,  J = π R_b⁴/2
//!
//! M_b ← rotate(M_b) + k_b Δω_b δt,  M_w ← M_w + k_w (Δω·n) δt
//!
//! M = M_b + M_w n + η_b Δω_b + η_w (Δω·n) n,  η = 2√(5/6) |β| √(k I*) ≤ λ I*/δt
//!
//! | symbol | unit | meaning |
//! |---|---|---|
//! | S_n, S_t | N/m³ | normal and shear stiffness per unit area of the bond |
//! | R_b | m | radius of the bond disk |
//! | f | – | factor on both stiffnesses: 1 is Potyondy and Cundall, 0 a bond without moments |
//! | Δω, Δω_b | rad/s | ω_j − ω_i, and its part across n |
//! | M | N m | moment on i; j bears the opposite |
//! | I* | kg m² | equivalent moment of inertia, ⅖ m* R² |
//!
//! M_b turns with the bond as the shear force does. M_w is a number, so it neither turns nor drifts.
//!
//! The dashpots are those of the contact of the two spheres, on their relative spin ([`super::damping`]): none without contact
//! between bonded neighbours, and none at a restitution of 1. Nothing else damps this motion: undamped, dropped fillets settle
//! 8 to 15 % later. Stability does not need the dashpots.
//!
//! The force of a bond resists the sum of two spins, ω_i + ω_j. Only these moments resist their difference, with which
//! neighbours roll on each other like gears.
//!
//! A row of bonded spheres bends like a beam with the second moment of area I. The moments take S_n and S_t as the bond
//! has them: whatever scales these scales the moments alike.
//!
//! Moments add to the stress at the rim of the disk, and so use up a part of the strength of the bond:
//!
//! σ A = F_n + |M_b| A R_b/I,  τ A = |F_t| + |M_w| A R_b/J,  A R_b/J = 2/R_b = ½ A R_b/I

use glam::Vec3;

use super::bond::BondLaw;
use super::damping::{self, MOMENT_CAP};
use super::friction::rotated_history;

/// The moments of the bonds of a run, computed once from the scenario.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MomentLaw {
    /// k_b, in N m/rad.
    pub k_b: f32,
    /// k_w, in N m/rad.
    pub k_w: f32,
    /// 2/R_b, in 1/m: from a twisting moment to the shear force of the same stress.
    pub rim: f32,
    /// I*/m*, in m².
    pub inertia: f32,
    /// 2√(5/6) |β|.
    pub damping: f32,
}

/// History of the moments of a bond, in N m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MomentHistory {
    /// M_b, on i.
    pub bending: Vec3,
    /// M_w: the same from either side.
    pub twist: f32,
}

impl MomentLaw {
    /// From the stiffnesses S_n A and S_t A in N/m, R_b and R in m, f, and 2√(5/6) |β| of the contact between neighbours.
    pub fn new(stiffness: [f64; 2], disk_radius: f64, factor: f64, radius: f64, damping: f32) -> Self {
        let [k_n, k_t] = stiffness;
        Self {
            k_b: (factor * k_n * disk_radius * disk_radius / 4.0) as f32,
            k_w: (factor * k_t * disk_radius * disk_radius / 2.0) as f32,
            rim: (2.0 / disk_radius) as f32,
            inertia: (0.4 * radius * radius) as f32,
            damping,
        }
    }

    /// The strengths of a bond that these moments leave; they may be negative.
    pub fn weaken(&self, bond: &BondLaw, history: &MomentHistory) -> BondLaw {
        let bending = history.bending.dot(history.bending).sqrt();
        BondLaw {
            normal_strength: bond.normal_strength - 2.0 * self.rim * bending,
            shear_strength: bond.shear_strength - self.rim * history.twist.abs(),
            ..*bond
        }
    }
}

/// Moment on i, in N m.
///
/// `turn` is ω_j − ω_i and `spin` the mean spin of the pair, (ω_i + ω_j)/2, in rad/s; `m_star` is m* in kg.
pub fn moment(
    law: &MomentLaw,
    history: &mut MomentHistory,
    n: Vec3,
    turn: Vec3,
    spin: Vec3,
    m_star: f32,
    dt: f32,
) -> Vec3 {
    let rate = turn.dot(n);
    let across = turn - n * rate;
    history.bending = rotated_history(history.bending, n, spin.dot(n) * dt) + across * (law.k_b * dt);
    history.twist += law.k_w * rate * dt;
    let inertia = law.inertia * m_star;
    let eta_b = damping::constant(law.damping, law.k_b, inertia, MOMENT_CAP, dt);
    let eta_w = damping::constant(law.damping, law.k_w, inertia, MOMENT_CAP, dt);
    history.bending + across * eta_b + n * (history.twist + eta_w * rate)
}
