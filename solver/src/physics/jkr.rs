//! JKR: adhesive elastic contact (paper eq. 4 and 5; Johnson, Kendall and Roberts 1971).
//!
//! F = 4E*a³/(3R*) − 4√(πγE*) a^{3/2},  δ = a²/R* − √(4πγa/E*)
//!
//! | symbol | unit | meaning |
//! |---|---|---|
//! | γ | J/m² | interfacial surface energy; the work of adhesion is 2γ |
//! | a | m | radius of the contact area |
//! | δ | m | overlap; negative while a neck holds the bodies |
//! | s₀ | m^{1/2} | scale: s₀³ = R* √(4πγ/E*) |
//! | x | – | √a / s₀ |
//! | D | – | δ R* / s₀⁴ |
//!
//! With a = s₀² x² the second equation becomes x⁴ − x = D. Its largest root is the stable branch, and F =
//! 4πγR* (4/3 x⁶ − 2x³). The branch ends at D_c = −0.47247 (x_c = 4^{−1/3}), where a displacement-controlled
//! contact snaps. The maximum pull-off force, 3πγR*, is at x³ = 3/4. A contact forms at δ ≥ 0.
//!
//! For γ → 0 the scale vanishes; [`super::contact`] then uses Hertz.

/// D at which the neck snaps.
pub const D_SNAP: f32 = -0.472_470_4;

/// x at which the neck snaps.
pub const X_SNAP: f32 = 0.629_960_5;

/// Half the second derivative of x⁴ − x at the snap, 6 x_c².
pub const CURVATURE: f32 = 2.381_101_6;

/// Surface energy below which Hertz is used, in J/m². Pull-off is then under 1e-9 N at R* = 2 mm.
pub const GAMMA_MIN: f64 = 1e-7;

/// JKR constants of a material pair, computed once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JkrScale {
    /// 4πγR*, in newton.
    pub force: f32,
    /// s₀², in metres, from a = s₀² x².
    pub area: f32,
    /// R*/s₀⁴, in 1/m: D is δ times this.
    pub inverse_overlap: f32,
    /// Overlap at which the neck snaps, in metres (negative).
    pub snap_overlap: f32,
}

impl JkrScale {
    /// From E* in Pa, R* in m and γ > 0 in J/m².
    pub fn new(e_star: f64, r_star: f64, gamma: f64) -> Self {
        let s0 = ((4.0 * std::f64::consts::PI * gamma / e_star).sqrt() * r_star).cbrt();
        let s0_4 = s0.powi(4);
        Self {
            force: (4.0 * std::f64::consts::PI * gamma * r_star) as f32,
            area: (s0 * s0) as f32,
            inverse_overlap: (r_star / s0_4) as f32,
            snap_overlap: (f64::from(D_SNAP) * s0_4 / r_star) as f32,
        }
    }

    /// The constants for `ratio` times R*, where s₀ is ∛ratio times as large.
    #[must_use]
    pub fn with_radius_ratio(&self, ratio: f32) -> Self {
        let cube_root = ratio.cbrt();
        Self {
            force: self.force * ratio,
            area: self.area * (cube_root * cube_root),
            inverse_overlap: self.inverse_overlap / cube_root,
            snap_overlap: self.snap_overlap * cube_root,
        }
    }
}

/// Largest root of x⁴ − x = D for D ≥ D_SNAP: three Newton steps from a first guess that is close everywhere.
pub fn root(d: f32) -> f32 {
    let from_snap = X_SNAP + ((d - D_SNAP).max(0.0) / CURVATURE).sqrt();
    let mut x = from_snap.min((d + from_snap).max(0.0).sqrt().sqrt());
    for _ in 0..3 {
        let x3 = x * x * x;
        // The slope vanishes at the snap. The first guess is exact there, so the floor only disables the
        // step.
        let slope = (4.0 * x3 - 1.0).max(1e-6);
        x = (x - (x * x3 - x - d) / slope).max(X_SNAP);
    }
    x
}

/// Force in newton (positive pushes apart) and contact radius in metres at overlap `delta`.
pub fn force(scale: &JkrScale, delta: f32) -> (f32, f32) {
    let x = root(delta * scale.inverse_overlap);
    let x3 = x * x * x;
    (scale.force * (4.0 / 3.0 * x3 * x3 - 2.0 * x3), scale.area * (x * x))
}
