//! The energy alarm: a scene whose bodies have more kinetic energy than they can have come to has diverged, however slow each
//! sub-particle still is.

use std::f64::consts::PI;

use crate::engine::scene::BodyKind;
use crate::scenario::Contact;

/// Bodies with this many times the energy that was given to them have it from the bonds or from too long a time step. The
/// published bonds do so at S_n 1e7, S_t 1e5.
pub(super) const ENERGY_MARGIN: f64 = 2.0;

/// Energy that a body can turn into motion, in joule: of its speed in m/s, of a fall through `fall_m2_s2` = g h, and of the necks
/// that form at every sub-particle and bond.
pub(super) fn given_j(
    kind: &BodyKind,
    contact: &Contact,
    radius_m: f64,
    speed_m_s: f64,
    fall_m2_s2: f64,
) -> f64 {
    let (points, bonds) = (kind.meta.points.len() as f64, kind.meta.bonds.len() as f64);
    let pairs = [&contact.fillet_fillet, &contact.fillet_equipment, &contact.fillet_belt];
    let gamma = pairs.map(|pair| pair.surface_energy_j_m2).into_iter().fold(0.0, f64::max);
    let mass_kg = kind.subparticle_mass_kg * points;
    mass_kg * (0.5 * speed_m_s * speed_m_s + fall_m2_s2)
        + (points + bonds) * 2.0 * gamma * PI * radius_m * radius_m
}
