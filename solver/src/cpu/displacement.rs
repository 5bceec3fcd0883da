//! Displacements since the neighbour lists were built. Lists with a Verlet skin hold while nothing has moved
//! more than half the skin, so that no pair can have closed it.

use glam::{IVec3, Vec3};

use crate::engine::state::State;
use crate::walls::Walls;

/// Displacements since the last rebuild.
#[derive(Debug, Default)]
pub struct DisplacementTracker {
    /// Positions at the last rebuild. Empty forces a rebuild.
    reference: Vec<IVec3>,
    /// Square of the maximum displacement of a sub-particle, in m².
    max_displacement2: f32,
}

impl DisplacementTracker {
    /// Forces a rebuild before the next step.
    pub fn invalidate(&mut self) {
        self.reference.clear();
    }

    /// Whether the neighbour lists may be stale.
    pub fn needs_rebuild(&self, skin: f32, walls: &Walls) -> bool {
        let half = skin / 2.0;
        self.reference.is_empty() || self.max_displacement2 > half * half || walls.travel_m() > half
    }

    /// Restarts the displacements: the neighbour lists were built for this state.
    pub fn reset(&mut self, state: &State, walls: &mut Walls) {
        self.reference.clear();
        self.reference.extend(state.particles.iter().map(|p| p.position));
        self.max_displacement2 = 0.0;
        walls.reset_travel();
    }

    /// Positions at the last rebuild.
    pub(super) fn reference(&self) -> &[IVec3] {
        &self.reference
    }

    /// Records the maximum displacement after a step.
    pub(super) fn record(&mut self, max_displacement2: f32) {
        self.max_displacement2 = max_displacement2;
    }
}

/// Square of the length of a displacement, in m².
pub(super) fn length2(d: Vec3) -> f32 {
    d.dot(d)
}
