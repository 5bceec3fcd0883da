//! Damping from the coefficient of restitution (Tsuji 1992; the closed form is Antypov and Elliott 2011).
//!
//! η = 2√(5/6) |β| √(k m*),  β = ln e / √(ln² e + π²)
//!
//! A step of length δt sees the dashpot at the velocity before it, and where η b δt / m* > 1 it would turn round what it
//! is to slow; a sub-particle that many hold, all of them at once, the sooner. So a dashpot takes no more than a share λ of the
//! motion of the two against each other, however long the step:
//!
//! η ≤ λ m* / (b δt)
//!
//! What acts across n also spins the two, which so give way the more easily: b = 1 + m R²/I = 7/2, and 1 along n. At the paper's step
//! none of its contacts comes near that along n; across, adhesive sub-particles of 4 mm do where neighbours overlap by a third of R, a
//! surface by a sixth, and other bodies from first touch on (of 6 mm by a tenth).
//!
//! | symbol | unit | meaning |
//! |---|---|---|
//! | η | kg/s | dashpot constant |
//! | e | – | coefficient of restitution, 0 < e ≤ 1 |
//! | k | N/m | stiffness at this overlap: 2E*a normal, 8G*a tangential |
//! | m* | kg | equivalent mass, m₁m₂/(m₁ + m₂); the mass of the sub-particle against equipment |
//! | b | – | how easily the two give way, in units of 1/m* |

/// b across n.
const TANGENTIAL_COMPLIANCE: f32 = 3.5;

/// The most that a dashpot takes of a motion in one step, as a share over b.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DampingCap {
    /// λ along n.
    pub normal: f32,
    /// λ/b across n.
    pub tangential: f32,
}

impl DampingCap {
    /// Of shares along n and across it.
    const fn new(normal: f32, tangential: f32) -> Self {
        Self { normal, tangential: tangential / TANGENTIAL_COMPLIANCE }
    }
}

/// Between neighbours that a bond joins: one on either side.
pub const BONDED_CAP: DampingCap = DampingCap::new(0.4, 0.2);

/// Between sub-particles of different bodies: a dozen of them may hold one that neighbours hold already, and each takes its spin as well.
pub const BODY_CAP: DampingCap = DampingCap::new(0.25, 0.1);

/// Against equipment, mostly on one side.
pub const SURFACE_CAP: DampingCap = DampingCap::new(0.75, 0.2);

/// The factor 2√(5/6) |β| for a coefficient of restitution.
pub fn factor(restitution: f64) -> f64 {
    let ln = restitution.ln();
    2.0 * (5.0f64 / 6.0).sqrt() * (ln / (ln * ln + std::f64::consts::PI.powi(2)).sqrt()).abs()
}

/// The dashpot constant η, in kg/s, as a step of `dt` seconds takes it; `most` is λ/b, of [`DampingCap`].
pub fn constant(factor: f32, stiffness: f32, m_star: f32, cap: f32, dt: f32) -> f32 {
    (factor * (stiffness * m_star).sqrt()).min(cap * m_star / dt)
}
