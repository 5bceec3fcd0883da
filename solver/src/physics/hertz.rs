//! Hertz: the elastic contact of two smooth bodies (paper eq. 1 to 3).
//!
//! F = 4/3 E* √R* δ^{3/2} = 4/3 E* a δ, with a² = R* δ
//!
//! | symbol | unit | meaning |
//! |---|---|---|
//! | E* | Pa | equivalent Young's modulus, 1/E* = (1 − ν₁²)/E₁ + (1 − ν₂²)/E₂ |
//! | G* | Pa | equivalent shear modulus, 1/G* = (2 − ν₁)/G₁ + (2 − ν₂)/G₂, G = E / 2(1 + ν) |
//! | R* | m | equivalent radius, 1/R* = 1/R₁ + 1/R₂ |
//! | δ | m | overlap |
//! | a | m | radius of the contact area |
//!
//! Equipment is steel, four orders of magnitude stiffer than tissue. It is modelled as rigid.

/// Equivalent elastic constants of two materials, in pascal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moduli {
    /// E*.
    pub youngs: f64,
    /// G*.
    pub shear: f64,
}

/// Tissue (Young's modulus `e` in Pa, Poisson's ratio `nu`) against the same tissue.
pub fn tissue_on_tissue(e: f64, nu: f64) -> Moduli {
    Moduli { youngs: e / (2.0 * (1.0 - nu * nu)), shear: e / (4.0 * (1.0 + nu) * (2.0 - nu)) }
}

/// Tissue (Young's modulus `e` in Pa, Poisson's ratio `nu`) against a rigid surface.
pub fn tissue_on_rigid(e: f64, nu: f64) -> Moduli {
    Moduli { youngs: e / (1.0 - nu * nu), shear: e / (2.0 * (1.0 + nu) * (2.0 - nu)) }
}

/// Force in newton (positive pushes apart) and contact radius in metres at overlap `delta` ≥ 0.
pub fn force(e_star: f32, r_star: f32, delta: f32) -> (f32, f32) {
    let a = (r_star * delta).sqrt();
    (4.0 / 3.0 * e_star * a * delta, a)
}
