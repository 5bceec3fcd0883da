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
//! The cap uses the *total* normal force. The angle of sliding is therefore independent of γ (paper Fig. 8).
//!
//! ξ rotates with the contact plane, and about n with the contact patch. The spin of the patch is the mean of
//! two sub-particles' spins, or the spin of a rigid surface.
//!
//! There is no rolling friction: the shape of a fillet resists rolling (paper section 2.1).

use glam::Vec3;

/// The history vector `v` of a contact or a bond, one step later: rotated about the unit vector `n` by the
/// small angle `twist` in radians, then into the plane across `n`. Its length stays.
pub fn rotated_history(v: Vec3, n: Vec3, twist: f32) -> Vec3 {
    let twisted = v + n.cross(v) * twist;
    let flat = twisted - n * twisted.dot(n);
    let before = v.dot(v);
    let after = flat.dot(flat);
    // Below this length the direction is rounding noise, and the loss of length has no effect on a force.
    if after <= 1e-30 { flat } else { flat * (before / after).sqrt() }
}

/// Force on i, in newton. A contact that slips cuts ξ to the displacement that the cap supports.
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
