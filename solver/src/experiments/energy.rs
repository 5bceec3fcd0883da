//! The energy alarm: a scene whose bodies have more kinetic energy than they can have come to has diverged, however slow each
//! sub-particle still is.

use std::f64::consts::PI;

use crate::engine::scene::BodyKind;
use crate::experiments::clashes::OVERLAP_RATIO;
use crate::physics::hertz::tissue_on_rigid;
use crate::scenario::{Contact, Material};

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

/// Plates that a sub-particle of a start may overlap, those of a corner. With the six neighbours of a cubic packing it stores less.
const PLATES: f64 = 3.0;

/// Elastic energy of the overlaps that a body may start with, in joule: of each sub-particle with [`PLATES`], by Hertz
/// 8/15 E* √R δ^{5/2} at δ = [`OVERLAP_RATIO`] R. Without it, rounding would be an alarm for bodies at rest without gravity.
pub(super) fn start_overlap_j(kind: &BodyKind, material: &Material, radius_m: f64) -> f64 {
    let e_star = tissue_on_rigid(material.youngs_modulus_pa, material.poisson_ratio).youngs;
    let plate_j = 8.0 / 15.0 * e_star * radius_m.powi(3) * OVERLAP_RATIO.powf(2.5);
    PLATES * plate_j * kind.meta.points.len() as f64
}
