//! Tangential contact force: Mindlin spring and dashpot under a Coulomb cap.
//!
//! F_t = −k_t ξ − η_t v_t, |F_t| ≤ μ max(F_n, 0)
//!
//! | symbol | unit | meaning |
//! |---|---|---|
//! | ξ | m | tangential displacement since the contact formed, kept in the contact plane |
//! | k_t | N/m | 8 G* a |
//! | v_t | m/s | velocity of i relative to j at the contact, normal part removed |
//! | F_n | N | total normal force, adhesion and dashpot included |
//! | μ | – | coefficient of friction |
//!
//! Capping on the *total* normal force is what leaves the slide angle independent of γ (paper Fig. 8).
//! ξ is kept in the plane but not turned about n with the pair's spin. Between fillets contacts last too short for that to show;
//! between bonded neighbours, where they last, a body that turns about a bond's axis leaves its ξ behind, which μ F_n bounds.
//! No rolling friction: the shape of a fillet resists rolling (paper section 2.1).

use glam::Vec3;

/// Takes the component along the unit vector `n` out of `v` and restores the length that `v` had.
pub fn turn_into_plane(v: Vec3, n: Vec3) -> Vec3 {
    let flat = v - n * v.dot(n);
    let before = v.dot(v);
    let after = flat.dot(flat);
    // Below this the direction is rounding noise; the length lost is nothing a force would notice.
    if after <= 1e-30 { flat } else { flat * (before / after).sqrt() }
}

/// The force on i, in newton. `slide` is ξ and is brought up to date.
pub fn force(slide: &mut Vec3, n: Vec3, v_t: Vec3, k_t: f32, eta_t: f32, cap: f32, dt: f32) -> Vec3 {
    *slide = turn_into_plane(*slide, n) + v_t * dt;
    let trial = -(*slide * k_t) - v_t * eta_t;
    let size2 = trial.dot(trial);
    if size2 <= cap * cap {
        return trial;
    }
    let force = trial * (cap / size2.sqrt());
    *slide = -(force + v_t * eta_t) / k_t;
    force
}
