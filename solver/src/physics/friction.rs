//! Tangential contact force: Mindlin spring and dashpot under a Coulomb cap.
//!
//! F_t = −k_t ξ − η_t v_t, |F_t| ≤ μ max(F_n, 0)
//!
//! | symbol | unit | meaning |
//! |---|---|---|
//! | ξ | m | tangential displacement since the contact formed, in the contact plane |
//! | k_t | N/m | 8 G* a |
//! | v_t | m/s | velocity of i relative to j at the contact, normal part removed |
//! | F_n | N | total normal force, adhesion and dashpot included |
//! | μ | – | coefficient of friction |
//!
//! Capping on the *total* normal force is what leaves the slide angle independent of γ (paper Fig. 8).
//! ξ turns with the contact: with its plane, and about n with the patch where the two touch,
//! whose spin is the mean of two alike, and that of what is rigid.
//! No rolling friction: the shape of a fillet resists rolling (paper section 2.1).

use glam::Vec3;

/// What is remembered across a contact or a bond, a step later: `v`, rotated_history about the unit vector `n` by the small angle `twist` in
/// radians and into the plane across `n`, as long as it was.
pub fn rotated_history(v: Vec3, n: Vec3, twist: f32) -> Vec3 {
    let twisted = v + n.cross(v) * twist;
    let flat = twisted - n * twisted.dot(n);
    let before = v.dot(v);
    let after = flat.dot(flat);
    // Below this the direction is rounding noise; the length lost is nothing a force would notice.
    if after <= 1e-30 { flat } else { flat * (before / after).sqrt() }
}

/// The force on i, in newton. Where it slips, `xi`, which is ξ, is cut to what the cap holds.
pub fn force(xi: &mut Vec3, v_t: Vec3, k_t: f32, eta_t: f32, cap: f32) -> Vec3 {
    let trial = -(*xi * k_t) - v_t * eta_t;
    let size2 = trial.dot(trial);
    if size2 <= cap * cap {
        return trial;
    }
    let force = trial * (cap / size2.sqrt());
    *xi = -(force + v_t * eta_t) / k_t;
    force
}
