//! Damping from the coefficient of restitution (Tsuji 1992; the closed form is Antypov and Elliott 2011).
//!
//! η = 2√(5/6) |β| √(k m*),  β = ln e / √(ln² e + π²)
//!
//! A step of length δt sees the dashpot at the velocity before it, and where η b δt / m* > 1 it would turn round what it
//! is to slow. So it takes no more than half of the motion of the two against each other, however long the step:
//!
//! η ≤ m* / (2 b δt)
//!
//! What acts across n also spins the two, which so give way the more easily: b = 1 + m R²/I = 7/2, and 1 along n. At the paper's step no
//! contact of its fillets comes near that, with sub-particles of 4 mm and more.
//!
//! | symbol | unit | meaning |
//! |---|---|---|
//! | η | kg/s | dashpot constant |
//! | e | – | coefficient of restitution, 0 < e ≤ 1 |
//! | k | N/m | stiffness at this overlap: 2E*a normal, 8G*a tangential |
//! | m* | kg | equivalent mass, m₁m₂/(m₁ + m₂); the mass of the sub-particle against equipment |
//! | b | – | how easily the two give way, in units of 1/m* |

/// The most that a dashpot takes of a motion in one step, as a share.
pub const MOST: f32 = 0.5;

/// b along n.
pub const ALONG: f32 = 1.0;

/// b across n.
pub const ACROSS: f32 = 3.5;

/// The factor 2√(5/6) |β| for a coefficient of restitution.
pub fn factor(restitution: f64) -> f64 {
    let ln = restitution.ln();
    2.0 * (5.0f64 / 6.0).sqrt() * (ln / (ln * ln + std::f64::consts::PI.powi(2)).sqrt()).abs()
}

/// The dashpot constant η, in kg/s, as a step of `dt` seconds takes it; `b` is [`ALONG`] or [`ACROSS`].
pub fn constant(factor: f32, stiffness: f32, m_star: f32, b: f32, dt: f32) -> f32 {
    (factor * (stiffness * m_star).sqrt()).min(MOST * m_star / (b * dt))
}
