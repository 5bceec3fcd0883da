//! The bond between two sub-particles (paper eq. 6), in three formulations.
//!
//! k = S A, A = π R_b²;  F_n = k_n (L − 2R) n;  F_t ← rotate(F_t) + k_t v_t δt
//!
//! Velocities are those of the middle of the step, n and L those of its end. v_t is therefore brought back by half a step, to
//! first order in δt (`corotated` and `finite_extension`):
//!
//! v_t ← v_t + (2 u_t − v_t) v_n δt / 2L + n × (u_t + v_t) ω_n δt / 2
//!
//! Without this, undamped bonds gain energy in proportion to the step.
//!
//! | symbol | unit | meaning |
//! |---|---|---|
//! | S_n, S_t | N/m³ | normal and shear stiffness per unit area |
//! | R_b | m | radius of the bond disk |
//! | L | m | distance of the centres; the bond breaks beyond twice the contact radius |
//! | v | m/s | v_j − v_i − (ω_i + ω_j) × n L/2, the relative velocity at the bond |
//! | u | m/s | v_j − v_i |
//! | ω_n | rad/s | mean spin of the pair about n |
//!
//! | formulation | force |
//! |---|---|
//! | corotated | normal force from the length, free of drift; shear force rotated with the bond and with the pair's mean spin about n |
//! | as_published | one raw vector in the global frame, never rotated; its energy can grow without bound |
//! | finite_extension | corotated; a stretched bond stiffens as F_n = k_n e / (1 − (e/e_max)²), e = L − 2R |
//!
//! The shear force has a moment about both centres, (n L/2) × F_t. Without it energy grows and the fillet explodes.
//! Bending and twisting moments are an option ([`super::moment`]); the paper has none ("torque feedback disabled").

use glam::Vec3;

use super::friction::rotated_history;

/// Formulation of the bond force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BondModel {
    /// Normal force from the length; shear force rotated with the bond.
    Corotated,
    /// One vector accumulated in the global frame.
    AsPublished,
    /// Corotated; stiffens towards the breaking length.
    FiniteExtension,
}

/// Share of e_max at which the stiffening of `FiniteExtension` saturates. It keeps the force finite.
pub const STRETCH_CLAMP: f32 = 0.97;

/// The parameters of the bonds of a run, computed once from the scenario.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BondLaw {
    /// Formulation.
    pub model: BondModel,
    /// k_n, in N/m.
    pub k_n: f32,
    /// k_t, in N/m.
    pub k_t: f32,
    /// Length beyond which the bond breaks, in metres.
    pub break_length: f32,
    /// Normal force at which the bond yields, in newton; infinite when unbreakable by stress.
    pub normal_strength: f32,
    /// Shear force at which the bond yields, in newton; infinite when unbreakable by stress. Below zero it yields at once.
    pub shear_strength: f32,
}

impl BondLaw {
    /// Whether stress can break a bond.
    pub fn can_yield(&self) -> bool {
        self.normal_strength.min(self.shear_strength) < f32::INFINITY
    }

    /// The stiffness along a bond just before it breaks, dF_n/de, in N/m.
    pub fn stretched_k_n(&self) -> f64 {
        let c2 = f64::from(STRETCH_CLAMP * STRETCH_CLAMP);
        let stiffening =
            if self.model == BondModel::FiniteExtension { (1.0 + c2) / (1.0 - c2).powi(2) } else { 1.0 };
        stiffening * f64::from(self.k_n)
    }
}

/// The force of a bond on i, in newton.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BondForce {
    /// Total force.
    pub total: Vec3,
    /// Shear part. Its moment (n L/2) × shear acts on i.
    pub shear: Vec3,
}

/// Normal force of the formulations that depend on the length, in newton; positive pulls i to j.
/// `rest_length` is 2R, or the length of the lattice diagonal spanned by the bond, in metres.
pub fn normal(law: &BondLaw, rest_length: f32, length: f32) -> f32 {
    let e = length - rest_length;
    if law.model == BondModel::FiniteExtension && e > 0.0 {
        let ratio = (e / (law.break_length - rest_length)).min(STRETCH_CLAMP);
        law.k_n * e / (1.0 - ratio * ratio)
    } else {
        law.k_n * e
    }
}

/// Length below which a bond has no direction, in metres.
pub const NO_LENGTH_M: f32 = 1e-15;

/// The tangential velocity at the bond half a step ago, in m/s, carried along with the bond since. `u_t` and `v_t` are the parts
/// across n of u and v in m/s, `stretch` = v_n δt in m, `twist` = ω_n δt in radians.
pub fn mid_step(n: Vec3, length: f32, u_t: Vec3, v_t: Vec3, stretch: f32, twist: f32) -> Vec3 {
    let stretched = (u_t * 2.0 - v_t) * (stretch / (2.0 * length.max(NO_LENGTH_M)));
    v_t + stretched + n.cross(u_t + v_t) * (twist * 0.5)
}

/// Force on i, or `None` when the bond breaks.
///
/// `rest_length` and `length` are in m. `u` and `v` are the relative velocities (j against i) of the centres and at
/// the bond in m/s, `spin` the mean spin of the pair, (ω_i + ω_j)/2, in rad/s. `stored` is the force history in N.
#[expect(clippy::too_many_arguments, reason = "the quantities of the equation, in its order")]
pub fn force(
    law: &BondLaw,
    stored: &mut Vec3,
    n: Vec3,
    rest_length: f32,
    length: f32,
    u: Vec3,
    v: Vec3,
    spin: Vec3,
    dt: f32,
) -> Option<BondForce> {
    if length > law.break_length {
        return None;
    }
    let v_n = v.dot(n);
    let v_t = v - n * v_n;
    let (pull, shear, total) = if law.model == BondModel::AsPublished {
        *stored += (n * (law.k_n * v_n) + v_t * law.k_t) * dt;
        let pull = stored.dot(n);
        (pull, *stored - n * pull, *stored)
    } else {
        let twist = spin.dot(n) * dt;
        let shear_rate = mid_step(n, length, u - n * v_n, v_t, v_n * dt, twist);
        *stored = rotated_history(*stored, n, twist) + shear_rate * (law.k_t * dt);
        let pull = normal(law, rest_length, length);
        (pull, *stored, n * pull + *stored)
    };
    let yields =
        pull > law.normal_strength || shear.dot(shear) > law.shear_strength * law.shear_strength.abs();
    (!yields).then_some(BondForce { total, shear })
}
