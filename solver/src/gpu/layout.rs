//! What the host and the kernels share: each type is declared once, as a Rust struct, and written out in WGSL from it.
//!
//! A vector of three takes the pad of four in WGSL: every one is followed by a number, or by pad that is left.

use bytemuck::{Pod, Zeroable};

use super::shared::shared;
pub use super::shared::{Atomic, Shared};
use crate::physics::bond::{BondLaw, BondModel};
use crate::physics::contact::ContactLaw;

shared! {
    /// As [`ContactLaw`].
    Law {
        /// E*, in Pa.
        e_star: f32,
        /// G*, in Pa.
        g_star: f32,
        /// R*, in m.
        r_star: f32,
        /// 2√(5/6) |β|.
        damping: f32,
        /// Coefficient of friction.
        mu: f32,
        /// Whether what follows holds; else it is 0.
        adheres: u32,
        /// 4πγR*, in N.
        force: f32,
        /// s₀², in m.
        area: f32,
        /// R*/s₀⁴, in 1/m.
        inverse_overlap: f32,
        /// Overlap at which the neck snaps, in m.
        snap_overlap: f32,
    }

    /// As [`BondLaw`].
    Bonds {
        /// Number of the formulation, as [`bond_model`] gives it.
        model: u32,
        /// k_n, in N/m.
        k_n: f32,
        /// k_t, in N/m.
        k_t: f32,
        /// Length beyond which the bond breaks, in m.
        break_length: f32,
        /// In N.
        normal_strength: f32,
        /// In N.
        shear_strength: f32,
    }

    /// What a run of the batch has of its own, and where its parts of the buffers begin.
    Scene {
        /// In m/s².
        gravity: [f32; 3],
        /// Time step, in s.
        dt: f32,
        /// Cells of its grid in each direction less 1: a power of two less 1. The grid repeats itself beyond.
        mask: [u32; 3],
        /// Its first cell.
        first_cell: u32,
        /// Radius of sub-particles, in m.
        radius: f32,
        /// Unit of positions, in m.
        unit_m: f32,
        /// Its inverse.
        inverse_unit: f32,
        /// m/I of a solid sphere, in 1/m².
        spin_factor: f32,
        /// Square of the speed limit.
        limit2: f32,
        /// How far apart sub-particles still hold each other, in m.
        tissue_reach: f32,
        /// Distance that the lists of sub-particles cover, in m.
        reach: f32,
        /// Distance that the lists of facets cover, in m.
        wall_reach: f32,
        /// Displacement up to which lists hold, in m.
        half_skin: f32,
        /// Period in y, in units; 0 without.
        period_y: i32,
        /// Edge of a cell, in units.
        cell: u32,
        /// Whether bonded neighbours point as well.
        contact_between_bonded: u32,
        /// Its first sub-particle.
        first: u32,
        /// How many it has.
        count: u32,
        /// Steps that it takes of this chunk.
        steps: u32,
        /// Its first surface.
        first_surface: u32,
        /// How many it has.
        surfaces: u32,
        /// Its first pose.
        first_pose: u32,
        /// Poses from one step to the next; 0 while zero_bits moves.
        pose_stride: u32,
        /// Its first facet.
        first_facet: u32,
        /// Its first corner of a triangle.
        first_corner: u32,
        /// Its first node of trees.
        first_node: u32,
        /// Its first place in the command of trees' leaves.
        first_leaf: u32,
        /// 0: see `kernels/vector.wgsl`.
        zero_bits: u32,
        /// Law of bonds.
        bond: Bonds,
        /// Law of contacts between sub-particles.
        tissue: Law,
    }

    /// What neighbours see of a sub-particle.
    Particle {
        /// Fixed-point position, in units.
        position: [i32; 3],
        /// Whether it is held.
        held: u32,
        /// In m/s.
        velocity: [f32; 3],
        /// In kg.
        mass: f32,
        /// In rad/s.
        spin: [f32; 3],
        /// Room.
        pad: u32,
    }

    /// What only the sub-particle itself needs.
    PrivateState {
        /// What its position has moved beyond whole units.
        remainder: [f32; 3],
        /// Bonds broken so far between it and sub-particles of higher index.
        broken: u32,
    }

    /// How many neighbours and facets stand in the rows of a sub-particle.
    Count {
        /// Neighbours.
        pairs: u32,
        /// Facets.
        walls: u32,
    }

    /// A neighbour of a sub-particle, and what bond and contact remember.
    Pair {
        /// Force of the bond, in N.
        bond: [f32; 3],
        /// Number of the other within its run.
        other: u32,
        /// Tangential displacement of the contact, in m.
        xi: [f32; 3],
        /// [`IN_CONTACT`] and the class of the bond.
        state: u32,
    }

    /// A facet near a sub-particle, and what their contact remembers.
    WallPair {
        /// Tangential displacement, in m.
        xi: [f32; 3],
        /// Number of the facet within its run.
        facet: u32,
        /// Force on the sub-particle in the last step, in N.
        force: [f32; 3],
        /// [`IN_CONTACT`] or 0.
        state: u32,
    }

    /// How a sub-particle nearest_points a facet near it, within one step.
    NearestPoint {
        /// From the centre to the nearest point, in m.
        to_wall: [f32; 3],
        /// Its length, in m.
        distance: f32,
        /// Velocity of the wall's material there, in m/s.
        velocity: [f32; 3],
        /// Whether the point lies on the rim of the facet.
        on_rim: u32,
        /// The nearest point relative to the anchor, in the surface's own axes, in m.
        local: [f32; 3],
        /// Number of the facet within its run.
        facet: u32,
    }

    /// A surface.
    Surface {
        /// Of its contacts.
        law: Law,
        /// Its first facet within its run.
        first_facet: u32,
        /// Its first node within its run.
        first_node: u32,
        /// The node after its last.
        end_node: u32,
        /// Its first place in the command of leaves within its run.
        first_leaf: u32,
    }

    /// Where a surface is in one step.
    Pose {
        /// In units.
        anchor: [i32; 3],
        /// Room.
        pad_0: u32,
        /// Columns of its rotation.
        turn_x: [f32; 3],
        /// Room.
        pad_1: u32,
        /// See `turn_x`.
        turn_y: [f32; 3],
        /// Room.
        pad_2: u32,
        /// See `turn_x`.
        turn_z: [f32; 3],
        /// Room.
        pad_3: u32,
        /// Of the material at the anchor, in m/s.
        velocity: [f32; 3],
        /// Room.
        pad_4: u32,
        /// In rad/s.
        spin: [f32; 3],
        /// Room.
        pad_5: u32,
    }

    /// A flat part of a surface.
    Facet {
        /// Unit vector across its plane.
        normal: [f32; 3],
        /// Number of its surface within its run.
        surface: u32,
        /// Its box, relative to the anchor, in m.
        low: [f32; 3],
        /// Its first triangle within its run.
        first_triangle: u32,
        /// See `low`.
        high: [f32; 3],
        /// How many triangles it has.
        triangles: u32,
        /// Whether one of them is long for its width.
        sliver: u32,
        /// Room.
        pad_0: u32,
        /// Room.
        pad_1: u32,
        /// Room.
        pad_2: u32,
    }

    /// A corner of a triangle.
    Corner {
        /// Relative to the anchor, in m.
        at: [f32; 3],
        /// Room.
        pad: u32,
    }

    /// A node of the tree that finds a surface's facets.
    Node {
        /// Its box, relative to the anchor, in m.
        low: [f32; 3],
        /// The node to go on at when this one is passed over, within its surface.
        next: u32,
        /// See `low`.
        high: [f32; 3],
        /// First place of its facets in the command of leaves within its surface, times 8, and how many they are.
        leaf: u32,
    }

    /// What a run reports of a chunk of steps.
    Report {
        /// Whether lists were used that no longer held.
        stale: Atomic,
        /// Greatest displacement since lists were built, in m, as bits.
        drift: Atomic,
        /// Greatest overlap of unbonded sub-particles, in m, as bits.
        overlap: Atomic,
        /// Bonds broken.
        broken: Atomic,
        /// First step with a runaway, or [`NONE`].
        fault_step: Atomic,
        /// The first of its runaways, or [`NONE`].
        runaway: Atomic,
        /// Longest row of neighbours wanted.
        pairs: Atomic,
        /// Longest row of facets wanted.
        walls: Atomic,
    }

    /// What goes with each dispatch.
    DispatchParams {
        /// Step of the chunk.
        step: u32,
        /// Sub-particles in the batch.
        count: u32,
        /// Room of a row of neighbours.
        pair_capacity: u32,
        /// Room of a row of facets.
        wall_capacity: u32,
    }
}

/// No step, no sub-particle.
pub const NONE: u32 = u32::MAX;

/// Set in the state of a pair whose surfaces hold each other.
pub const IN_CONTACT: u32 = 1 << 31;

/// The number of a formulation.
pub fn bond_model(model: BondModel) -> u32 {
    match model {
        BondModel::Corotated => 0,
        BondModel::AsPublished => 1,
        BondModel::FiniteExtension => 2,
    }
}

impl Report {
    /// One in which zero_bits has happened yet.
    pub fn fresh() -> Self {
        Self { fault_step: Atomic(NONE), runaway: Atomic(NONE), ..Self::default() }
    }
}

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
        // WGSL has no infinity; what no force reaches will do, and its square is a number too.
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
