//! One contact: normal force (Hertz or JKR) with its dashpot, and friction.
//!
//! n points from i to j, δ is the overlap, v the velocity of i relative to j at the contact point. The normal
//! force on i is −(F + η_n v·n) n. The friction cap uses this total, dashpot included.

use glam::Vec3;

use super::damping::{self, DampingCap};
use super::hertz::Moduli;
use super::jkr::{GAMMA_MIN, JkrScale};
use super::{friction, hertz, jkr};

/// Parameters of the contacts between two materials, computed once from the scenario.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactLaw {
    /// E*, in pascal.
    pub e_star: f32,
    /// G*, in pascal.
    pub g_star: f32,
    /// R*, in metres.
    pub r_star: f32,
    /// Adhesion; `None` below [`GAMMA_MIN`].
    pub jkr: Option<JkrScale>,
    /// 2√(5/6) |β|.
    pub damping: f32,
    /// Coefficient of friction.
    pub mu: f32,
}

impl ContactLaw {
    /// From moduli in Pa, R* in m, restitution, friction and surface energy in J/m².
    pub fn new(moduli: Moduli, r_star: f64, restitution: f64, mu: f64, gamma: f64) -> Self {
        Self {
            e_star: moduli.youngs as f32,
            g_star: moduli.shear as f32,
            r_star: r_star as f32,
            jkr: (gamma >= GAMMA_MIN).then(|| JkrScale::new(moduli.youngs, r_star, gamma)),
            damping: damping::factor(restitution) as f32,
            mu: mu as f32,
        }
    }

    /// The law between spheres whose radius is `ratio` times as large: R* is.
    #[must_use]
    pub fn with_radius_ratio(&self, ratio: f32) -> Self {
        let jkr = self.jkr.map(|scale| scale.with_radius_ratio(ratio));
        Self { r_star: self.r_star * ratio, jkr, ..*self }
    }

    /// Gap up to which an adhesive contact holds once it has formed, in metres; 0 without adhesion.
    pub fn adhesion_range(&self) -> f32 {
        self.jkr.map_or(0.0, |scale| -scale.snap_overlap)
    }
}

/// Contact history: the state of a contact that persists from step to step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactHistory {
    /// Whether the contact has formed and still holds.
    pub in_contact: bool,
    /// Tangential displacement ξ, in metres.
    pub xi: Vec3,
}

/// The force of a contact on i, in newton.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactForce {
    /// Along n.
    pub normal: Vec3,
    /// Across n. Its moment on i is (n times the arm) × tangential.
    pub tangential: Vec3,
}

/// Force on i in newton, or `None` without contact.
///
/// | argument | unit | meaning |
/// |---|---|---|
/// | `delta` | m | overlap |
/// | `v` | m/s | velocity of i relative to j at the contact point |
/// | `spin` | rad/s | spin of the contact patch |
/// | `m_star` | kg | equivalent mass |
/// | `cap` | – | cap of the dashpots |
/// | `dt` | s | time step |
#[expect(clippy::too_many_arguments, reason = "the quantities of the equations, in their order")]
pub fn force(
    law: &ContactLaw,
    history: &mut ContactHistory,
    n: Vec3,
    delta: f32,
    v: Vec3,
    spin: Vec3,
    m_star: f32,
    cap: DampingCap,
    dt: f32,
) -> Option<ContactForce> {
    let holds = match law.jkr {
        Some(scale) if history.in_contact => delta >= scale.snap_overlap,
        _ => delta >= 0.0,
    };
    if !holds {
        *history = ContactHistory::default();
        return None;
    }
    history.in_contact = true;
    let (elastic, a) = match &law.jkr {
        Some(scale) => jkr::force(scale, delta),
        None => hertz::force(law.e_star, law.r_star, delta),
    };
    let k_n = 2.0 * law.e_star * a;
    let k_t = 8.0 * law.g_star * a;
    let v_n = v.dot(n);
    let v_t = v - n * v_n;
    let total = elastic + damping::constant(law.damping, k_n, m_star, cap.normal, dt) * v_n;
    // At δ = 0 without adhesion the contact has no area, and so no tangential spring.
    let tangential = if a > 0.0 {
        let eta_t = damping::constant(law.damping, k_t, m_star, cap.tangential, dt);
        history.xi = friction::rotated_history(history.xi, n, spin.dot(n) * dt) + v_t * dt;
        friction::force(&mut history.xi, v_t, k_t, eta_t, law.mu * total.max(0.0))
    } else {
        Vec3::ZERO
    };
    Some(ContactForce { normal: n * -total, tangential })
}
