//! The types shared by host and kernels. Each is declared once, as a Rust struct, and written out in WGSL
//! from it.
//!
//! A three-vector occupies four words in WGSL. The fourth word holds a number or padding.

use bytemuck::{Pod, Zeroable};

use super::shared::shared;
pub use super::shared::{Atomic, Shared};
use crate::physics::bond::BondModel;

shared! {
    /// Twin of [`crate::physics::contact::ContactLaw`].
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
        /// Whether the law has adhesion. The fields below are 0 otherwise.
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

    /// Twin of [`crate::physics::bond::BondLaw`].
    Bonds {
        /// Number of the formulation; see [`bond_model`].
        model: u32,
        /// k_n, in N/m.
        k_n: f32,
        /// k_t, in N/m.
        k_t: f32,
        /// Length beyond which a bond breaks, in m.
        break_length: f32,
        /// Normal force at which the bond yields, in N.
        normal_strength: f32,
        /// Shear force at which the bond yields, in N.
        shear_strength: f32,
    }

    /// Twin of [`crate::physics::moment::MomentLaw`].
    Moments {
        /// k_b, in N m/rad.
        k_b: f32,
        /// k_w, in N m/rad.
        k_w: f32,
        /// 2/R_b, in 1/m.
        rim: f32,
        /// I*/m*, in m².
        inertia: f32,
        /// 2√(5/6) |β|.
        damping: f32,
    }

    /// Per-run parameters, and offsets of the run in the buffers of the batch.
    Scene {
        /// Acceleration of gravity, in m/s².
        gravity: [f32; 3],
        /// Time step, in s.
        dt: f32,
        /// Cells of its cell list per direction, minus 1: a power of two minus 1. The list wraps around
        /// beyond.
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
        /// Square of the speed limit, in m²/s².
        limit2: f32,
        /// Distance of centres at first contact: within a body, and between bodies, in m.
        contact_distance: f32,
        /// See `contact_distance`.
        body_contact_distance: f32,
        /// Cutoff of the neighbour lists, skin included: within a body, and between bodies, in m.
        cutoff: f32,
        /// See `cutoff`.
        body_cutoff: f32,
        /// Cutoff of the wall lists, skin included, in m.
        wall_cutoff: f32,
        /// Maximum displacement for valid lists, in m.
        half_skin: f32,
        /// Period in y, in units; 0 without.
        period_y: i32,
        /// Edge of a cell, in units.
        cell: u32,
        /// Whether bonded neighbours also interact by contact.
        contact_between_bonded: u32,
        /// Its first sub-particle.
        first: u32,
        /// Number of its sub-particles.
        count: u32,
        /// Its steps in this chunk.
        steps: u32,
        /// Its first surface.
        first_surface: u32,
        /// Number of its surfaces.
        surfaces: u32,
        /// Its first pose.
        first_pose: u32,
        /// Poses per step; 0 while all surfaces stand still.
        pose_stride: u32,
        /// Its first facet.
        first_facet: u32,
        /// Its first corner of a triangle.
        first_corner: u32,
        /// Its first node of trees.
        first_node: u32,
        /// Its first position in the leaf order of trees.
        first_leaf: u32,
        /// Always 0; see `kernels/vector.wgsl`.
        zero_bits: u32,
        /// Its first row of moments.
        first_moments: u32,
        /// Padding.
        pad_0: u32,
        /// Padding.
        pad_1: u32,
        /// Law of the moments of bonds; 0 without.
        moment: Moments,
        /// Law of bonds.
        bond: Bonds,
        /// Law of contacts between sub-particles of one body.
        tissue: Law,
        /// Law of contacts between sub-particles of different bodies.
        body_tissue: Law,
    }

    /// The part of a sub-particle that neighbours read.
    Particle {
        /// Fixed-point position, in units.
        position: [i32; 3],
        /// Whether it is clamped.
        held: u32,
        /// In m/s.
        velocity: [f32; 3],
        /// In kg.
        mass: f32,
        /// In rad/s.
        spin: [f32; 3],
        /// Number of its body.
        body: u32,
    }

    /// The part of a sub-particle that only it reads.
    PrivateState {
        /// Fraction of a unit that its position has moved beyond integer units.
        remainder: [f32; 3],
        /// Bonds broken so far between it and sub-particles of higher index.
        broken: u32,
    }

    /// Lengths of the rows of a sub-particle.
    Count {
        /// Neighbours.
        pairs: u32,
        /// Facets.
        walls: u32,
    }

    /// A neighbour of a sub-particle, with the histories of bond and contact.
    Pair {
        /// Force history of the bond, in N.
        bond: [f32; 3],
        /// Index of the neighbour within its run.
        other: u32,
        /// Tangential displacement of the contact, in m.
        xi: [f32; 3],
        /// [`IN_CONTACT`] and the class of the bond.
        state: u32,
    }

    /// Twin of [`crate::physics::moment::MomentHistory`], for the pair at the same place of the same row.
    Moment {
        /// M_b, in N m.
        bending: [f32; 3],
        /// M_w, in N m.
        twist: f32,
    }

    /// A facet near a sub-particle, with the history of their contact.
    WallPair {
        /// Tangential displacement, in m.
        xi: [f32; 3],
        /// Number of the facet within its run.
        facet: u32,
        /// Force on the sub-particle in the last step, in N.
        force: [f32; 3],
        /// [`IN_CONTACT`], and the memory of its side: [`FROM_ABOVE`] or [`FROM_BELOW`], and [`BEYOND`].
        state: u32,
    }

    /// Nearest point of a facet to a sub-particle, within one step.
    NearestPoint {
        /// From the centre to the nearest point, in m.
        to_wall: [f32; 3],
        /// Its length, in m.
        distance: f32,
        /// Velocity of the wall's material there, in m/s.
        velocity: [f32; 3],
        /// [`ON_RIM`], [`OFF_FACET`], the memory of the side as in [`WallPair`], and the number of the entry of its facet.
        flags: u32,
        /// The nearest point relative to the anchor, in the surface's own axes, in m.
        local: [f32; 3],
        /// Number of the facet within its run.
        facet: u32,
        /// The centre, in the same coordinates as `local`.
        centre: [f32; 3],
        /// Height of the centre over the plane of the facet, in m.
        height: f32,
    }

    /// A surface.
    Surface {
        /// Law of its contacts.
        law: Law,
        /// Its first facet within its run.
        first_facet: u32,
        /// Its first node within its run.
        first_node: u32,
        /// The node after its last.
        end_node: u32,
        /// Its first position in the leaf order within its run.
        first_leaf: u32,
    }

    /// Pose of a surface in one step.
    Pose {
        /// Position of the anchor, in units.
        anchor: [i32; 3],
        /// Whether only the material moves, and not the surface.
        is_belt: u32,
        /// Columns of its rotation.
        turn_x: [f32; 3],
        /// Padding.
        pad_1: u32,
        /// See `turn_x`.
        turn_y: [f32; 3],
        /// Padding.
        pad_2: u32,
        /// See `turn_x`.
        turn_z: [f32; 3],
        /// Padding.
        pad_3: u32,
        /// Velocity of the material at the anchor, in m/s.
        velocity: [f32; 3],
        /// Padding.
        pad_4: u32,
        /// In rad/s.
        spin: [f32; 3],
        /// Padding.
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
        /// Number of its triangles.
        triangles: u32,
        /// Whether one of its triangles is a sliver.
        sliver: u32,
        /// Padding.
        pad_0: u32,
        /// Padding.
        pad_1: u32,
        /// Padding.
        pad_2: u32,
    }

    /// A corner of a triangle.
    Corner {
        /// Relative to the anchor, in m.
        at: [f32; 3],
        /// Padding.
        pad: u32,
    }

    /// A node of the tree that finds a surface's facets.
    Node {
        /// Its box, relative to the anchor, in m.
        low: [f32; 3],
        /// Node at which a traversal continues when it skips this one, within its surface.
        next: u32,
        /// See `low`.
        high: [f32; 3],
        /// First position of its facets in the leaf order within its surface, times 8, plus their number.
        leaf: u32,
    }

    /// Report of a run for a chunk of steps.
    Report {
        /// Whether stale lists were used.
        stale: Atomic,
        /// Maximum displacement since the lists were built, in m, as bits.
        drift: Atomic,
        /// Maximum overlap of unbonded sub-particles, in m, as bits.
        overlap: Atomic,
        /// Bonds broken.
        broken: Atomic,
        /// First step with a runaway, or [`NONE`].
        fault_step: Atomic,
        /// The first of its runaways, or [`NONE`].
        runaway: Atomic,
        /// Longest row of neighbours that did not fit.
        pairs: Atomic,
        /// Longest row of facets that did not fit.
        walls: Atomic,
        /// How often a sub-particle has passed through a surface.
        passed: Atomic,
    }

    /// Constants of a dispatch.
    DispatchParams {
        /// Step of the chunk.
        step: u32,
        /// Sub-particles in the batch.
        count: u32,
        /// Capacity of a row of neighbours.
        pair_capacity: u32,
        /// Capacity of a row of facets.
        wall_capacity: u32,
        /// Sub-particles that stay, in a removal.
        kept: u32,
    }
}

/// No step, no sub-particle.
pub const NONE: u32 = u32::MAX;

/// Maximum number of neighbours of a sub-particle: several times as many as spheres without overlap have.
pub const MAX_NEIGHBOURS: u32 = 128;

/// Flag in the state of a pair: the contact has formed and still holds.
pub const IN_CONTACT: u32 = 1 << 31;

/// Flags in the state of a wall pair.
pub use crate::engine::wall_pair::{BEYOND, FROM_ABOVE, FROM_BELOW};

/// Flag of a nearest point: it lies on the rim of the facet.
pub const ON_RIM: u32 = 8;

/// Flag of a nearest point: the centre is not over the inside of the facet.
pub const OFF_FACET: u32 = 16;

/// Position of the number of the facet's entry in its row, in the flags of a nearest point.
pub const ENTRY_SHIFT: u32 = 8;

/// The number of a formulation.
pub fn bond_model(model: BondModel) -> u32 {
    match model {
        BondModel::Corotated => 0,
        BondModel::AsPublished => 1,
        BondModel::FiniteExtension => 2,
    }
}

impl Report {
    /// An empty report.
    pub fn fresh() -> Self {
        Self { fault_step: Atomic(NONE), runaway: Atomic(NONE), ..Self::default() }
    }
}
