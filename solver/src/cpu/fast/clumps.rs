//! What goes as one body on the fast path: a body of the scene, or many single spheres.

use std::ops::Range;

use crate::engine::scene::{Kind, Scene};

/// The most single spheres that go as one body.
const CLUMP: usize = 512;

/// Sub-particles that go as one body, by their numbers in the run, and the kind that has their bonds and their mass.
pub(super) struct Clump<'a> {
    pub(super) range: Range<usize>,
    pub(super) kind: &'a Kind,
}

/// The bodies of a scene. Single spheres that follow each other go together, as if they were a body without bonds: each by itself would
/// have a block of its own.
pub(super) fn clumps(scene: &Scene) -> Vec<Clump<'_>> {
    let mut clumps: Vec<Clump<'_>> = Vec::new();
    let mut from = 0;
    for placement in &scene.bodies {
        let kind = &scene.kinds[placement.kind];
        let range = from..from + kind.meta.points.len();
        from = range.end;
        let is_single = |kind: &Kind| kind.meta.points.len() == 1;
        match clumps.last_mut() {
            Some(last)
                if is_single(kind)
                    && is_single(last.kind)
                    && last.kind.subparticle_mass_kg == kind.subparticle_mass_kg
                    && last.range.len() < CLUMP =>
            {
                last.range.end = range.end;
            }
            _ if range.is_empty() => {}
            _ => clumps.push(Clump { range, kind }),
        }
    }
    clumps
}
