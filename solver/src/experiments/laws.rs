//! From the parameters of a scenario to the laws of force.

use std::f64::consts::PI;

use crate::engine::scene::Laws;
use crate::physics::bond::{BondLaw, BondModel};
use crate::physics::contact::ContactLaw;
use crate::physics::hertz;
use crate::physics::moment::MomentLaw;
use crate::scenario::{Formulation, PairContact, Scenario};

/// The laws of force of a scenario.
pub fn laws(scenario: &Scenario) -> Laws {
    let radius = scenario.product.radius_m();
    let (e, nu) = (scenario.material.youngs_modulus_pa, scenario.material.poisson_ratio);
    let contact = &scenario.contact;
    // The maximum pull of a contact grows with γ R, its share of the surface with R².
    let energy_ratio = contact.surface_energy_radius_m.map_or(1.0, |reference| radius / reference);
    let law = |pair: &PairContact, moduli, r_star| {
        let gamma = pair.surface_energy_j_m2 * energy_ratio;
        ContactLaw::new(moduli, r_star, pair.restitution, pair.static_friction, gamma)
    };
    let rigid = hertz::tissue_on_rigid(e, nu);
    let tissue = law(&contact.fillet_fillet, hertz::tissue_on_tissue(e, nu), radius / 2.0);
    Laws {
        tissue,
        body_radius_ratio: contact.fillet_fillet_radius_ratio as f32,
        equipment: law(&contact.fillet_equipment, rigid, radius),
        belt: law(&contact.fillet_belt, rigid, radius),
        bond: bond_law(scenario),
        moment: moment_law(scenario, tissue.damping),
        contact_between_bonded: scenario.bonds.contact_between_bonded,
    }
}

fn bond_law(scenario: &Scenario) -> BondLaw {
    let (bonds, radius) = (&scenario.bonds, scenario.product.radius_m());
    let area = PI * (bonds.disk_scale * radius).powi(2);
    // The lattice has the modulus S_n π R / 2: without the factor, coarser fillets are stiffer.
    let of_radius = bonds.reference_radius_m.map_or(1.0, |reference| reference / radius);
    let stiffness = |per_area: f64| (per_area * of_radius * area) as f32;
    let strength = |pascal: Option<f64>| pascal.map_or(f32::INFINITY, |p| (p * area) as f32);
    BondLaw {
        model: match bonds.formulation {
            Formulation::Corotated => BondModel::Corotated,
            Formulation::AsPublished => BondModel::AsPublished,
            Formulation::FiniteExtension => BondModel::FiniteExtension,
        },
        k_n: stiffness(bonds.normal_stiffness_n_m3),
        k_t: stiffness(bonds.shear_stiffness_n_m3),
        break_length: (2.0 * bonds.contact_radius_ratio * radius) as f32,
        normal_strength: strength(bonds.normal_strength_pa),
        shear_strength: strength(bonds.shear_strength_pa),
    }
}

/// The moments of bonds, unless their factor is 0; `damping` is that of the contact between sub-particles.
fn moment_law(scenario: &Scenario, damping: f32) -> Option<MomentLaw> {
    let (bonds, radius) = (&scenario.bonds, scenario.product.radius_m());
    let bond = bond_law(scenario);
    let stiffness = [bond.k_n, bond.k_t].map(f64::from);
    let damping = if bonds.contact_between_bonded { damping } else { 0.0 };
    let factor = bonds.moment_stiffness_factor;
    (factor > 0.0).then(|| MomentLaw::new(stiffness, bonds.disk_scale * radius, factor, radius, damping))
}
