//! Damping from the coefficient of restitution (Tsuji 1992; the closed form is Antypov and Elliott 2011).
//!
//! η = 2√(5/6) |β| √(k m*),  β = ln e / √(ln² e + π²)
//!
//! An explicit step of length δt evaluates the dashpot at the old velocity. Where η b δt / m* > 1 the dashpot
//! would reverse the motion that it damps. A sub-particle with many contacts gets there sooner, since all of
//! its dashpots act at once. A dashpot therefore takes no more than a share λ of the relative motion per
//! step:
//!
//! η ≤ λ m* / (b δt)
//!
//! A tangential force also spins both sub-particles, which makes them more compliant: b = 1 + m R²/I = 7/2.
//! Along n, b = 1.
//!
//! At the paper's step no contact of the paper comes near the normal cap. Adhesive contacts reach the
//! tangential cap at these overlaps:
//!
//! | contact | 4 mm | 6 mm |
//! |---|---|---|
//! | lattice neighbours | R/3 | – |
//! | surface | R/6 | – |
//! | other bodies | first touch | R/10 |
//!
//! | symbol | unit | meaning |
//! |---|---|---|
//! | η | kg/s | dashpot constant |
//! | e | – | coefficient of restitution, 0 < e ≤ 1 |
//! | k | N/m | stiffness at this overlap: 2E*a normal, 8G*a tangential |
//! | m* | kg | equivalent mass, m₁m₂/(m₁ + m₂); the mass of the sub-particle against equipment |
//! | b | – | compliance of the pair, in units of 1/m* |

/// b across n: m R²/I of a solid sphere, plus 1.
const TANGENTIAL_COMPLIANCE: f32 = 3.5;

/// Cap on a dashpot: the largest share λ/b of a relative motion that it takes in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DampingCap {
    /// λ along n.
    pub normal: f32,
    /// λ/b across n.
    pub tangential: f32,
}

impl DampingCap {
    /// From the shares λ along n and across it.
    const fn new(normal: f32, tangential: f32) -> Self {
        Self { normal, tangential: tangential / TANGENTIAL_COMPLIANCE }
    }
}

/// Between bonded neighbours: a lattice point has one on either side.
pub const BONDED_CAP: DampingCap = DampingCap::new(0.4, 0.2);

/// Between sub-particles of different bodies. A dozen of them may touch one that already has bonded
/// neighbours, and each damps its spin as well.
pub const BODY_CAP: DampingCap = DampingCap::new(0.25, 0.1);

/// Against equipment, which is mostly on one side.
pub const SURFACE_CAP: DampingCap = DampingCap::new(0.75, 0.2);

/// λ of the dashpots on the relative spin of bonded neighbours: six bonds damp a spin.
pub const MOMENT_CAP: f32 = 0.1;

/// The factor 2√(5/6) |β| for a coefficient of restitution.
pub fn factor(restitution: f64) -> f64 {
    let ln = restitution.ln();
    2.0 * (5.0f64 / 6.0).sqrt() * (ln / (ln * ln + std::f64::consts::PI.powi(2)).sqrt()).abs()
}

/// Dashpot constant η in kg/s for a step of `dt` seconds; `cap` is the λ/b of a [`DampingCap`].
pub fn constant(factor: f32, stiffness: f32, m_star: f32, cap: f32, dt: f32) -> f32 {
    (factor * (stiffness * m_star).sqrt()).min(cap * m_star / dt)
}
