//! Damping from the coefficient of restitution (Tsuji 1992; the closed form is Antypov and Elliott 2011).
//!
//! η = 2√(5/6) |β| √(k m*),  β = ln e / √(ln² e + π²)
//!
//! | symbol | unit | meaning |
//! |---|---|---|
//! | η | kg/s | dashpot constant |
//! | e | – | coefficient of restitution, 0 < e ≤ 1 |
//! | k | N/m | stiffness at this overlap: 2E*a normal, 8G*a tangential |
//! | m* | kg | equivalent mass, m₁m₂/(m₁ + m₂); the mass of the sub-particle against equipment |

/// The factor 2√(5/6) |β| for a coefficient of restitution.
pub fn factor(restitution: f64) -> f64 {
    let ln = restitution.ln();
    2.0 * (5.0f64 / 6.0).sqrt() * (ln / (ln * ln + std::f64::consts::PI.powi(2)).sqrt()).abs()
}

/// The dashpot constant, in kg/s.
pub fn constant(factor: f32, stiffness: f32, m_star: f32) -> f32 {
    factor * (stiffness * m_star).sqrt()
}
