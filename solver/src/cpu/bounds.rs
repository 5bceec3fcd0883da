//! How far things have moved since the neighbour lists were built: lists hold while no pair can have closed the
//! skin, that is while nothing has moved more than half of it.

use glam::{IVec3, Vec3};

use super::walls::Walls;
use crate::engine::state::State;

/// Displacements since the last rebuild.
#[derive(Debug, Default)]
pub struct Drift {
    /// Where every sub-particle was; empty forces a rebuild.
    reference: Vec<IVec3>,
    /// Square of the greatest displacement of a sub-particle, in m².
    greatest2: f32,
}

impl Drift {
    /// Forces a rebuild before the next step.
    pub fn invalidate(&mut self) {
        self.reference.clear();
    }

    /// Whether the lists no longer hold.
    pub fn exceeds(&self, skin: f32, walls: &Walls) -> bool {
        let half = skin / 2.0;
        self.reference.is_empty() || self.greatest2 > half * half || walls.moved_m() > half
    }

    /// The lists were built for this state.
    pub fn restart(&mut self, state: &State, walls: &mut Walls) {
        self.reference.clear();
        self.reference.extend(state.particles.iter().map(|p| p.position));
        self.greatest2 = 0.0;
        walls.restart_moved();
    }

    /// Reference positions, for measuring displacements.
    pub(super) fn reference(&self) -> &[IVec3] {
        &self.reference
    }

    /// Records the greatest displacement after a step.
    pub(super) fn record(&mut self, greatest2: f32) {
        self.greatest2 = greatest2;
    }
}

/// Square of the length of a displacement, in m².
pub(super) fn length2(d: Vec3) -> f32 {
    d.dot(d)
}
