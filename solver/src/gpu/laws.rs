//! The laws of a run in the layout of the kernels.

use super::layout::{Bonds, Law, Moments, bond_model};
use crate::physics::bond::BondLaw;
use crate::physics::contact::ContactLaw;
use crate::physics::moment::MomentLaw;

impl From<&ContactLaw> for Law {
    fn from(law: &ContactLaw) -> Self {
        let own = Self {
            e_star: law.e_star,
            g_star: law.g_star,
            r_star: law.r_star,
            damping: law.damping,
            mu: law.mu,
            ..Self::default()
        };
        law.jkr.map_or(own, |scale| Self {
            adheres: 1,
            force: scale.force,
            area: scale.area,
            inverse_overlap: scale.inverse_overlap,
            snap_overlap: scale.snap_overlap,
            ..own
        })
    }
}

impl From<&BondLaw> for Bonds {
    fn from(law: &BondLaw) -> Self {
        // WGSL has no infinity. No force reaches this value, and its square is finite.
        let strength = |strength: f32| strength.min(1e19);
        Self {
            model: bond_model(law.model),
            k_n: law.k_n,
            k_t: law.k_t,
            break_length: law.break_length,
            normal_strength: strength(law.normal_strength),
            shear_strength: strength(law.shear_strength),
        }
    }
}

impl From<&MomentLaw> for Moments {
    fn from(&MomentLaw { k_b, k_w, rim, inertia, damping }: &MomentLaw) -> Self {
        Self { k_b, k_w, rim, inertia, damping }
    }
}
