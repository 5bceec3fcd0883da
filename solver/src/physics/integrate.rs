//! One leapfrog step: velocities and spins from forces at x_n, then positions.
//!
//! v_{n+½} = v_{n−½} + (F/m + g) δt;  ω likewise with T/I, I = 2/5 m R²;  x_{n+1} = x_n + v_{n+½} δt
//!
//! Positions are integer multiples of a unit u (a power of two, about a nanometre). Differences are therefore
//! exact everywhere. The fraction of a unit that a step leaves over is kept as a remainder for the next step:
//! no motion is too slow to register.

use glam::{IVec3, Vec3};

/// New velocity after `dt` seconds of `force` in N, mass given as its inverse in 1/kg, and `gravity` in m/s².
pub fn velocity(v: Vec3, force: Vec3, inverse_mass: f32, gravity: Vec3, dt: f32) -> Vec3 {
    v + (force * inverse_mass + gravity) * dt
}

/// New spin after `dt` seconds of `torque` in N m, moment of inertia given as its inverse in 1/(kg m²).
pub fn spin(omega: Vec3, torque: Vec3, inverse_inertia: f32, dt: f32) -> Vec3 {
    omega + torque * (inverse_inertia * dt)
}

/// New position after a displacement `v dt`. `inverse_unit` is 1/u in 1/m, `remainder` the fraction left by
/// earlier steps, in units.
pub fn position(x: IVec3, remainder: &mut Vec3, v: Vec3, dt: f32, inverse_unit: f32) -> IVec3 {
    let moved = v * (dt * inverse_unit) + *remainder;
    let whole = moved.round();
    *remainder = moved - whole;
    x.wrapping_add(whole.as_ivec3())
}
