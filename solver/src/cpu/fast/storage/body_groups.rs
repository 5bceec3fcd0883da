//! Grouping of single spheres. A body of the fast path is a body of the scene or a group of single spheres.

use std::ops::Range;

use crate::engine::scene::{BodyKind, Placement};

/// Maximum number of single spheres per group.
const MAX_SPHERES_PER_GROUP: usize = 512;

/// A body of the fast path: its range in the run, and the kind that gives bonds and mass.
pub(crate) struct BodyGroup<'a> {
    pub(crate) range: Range<usize>,
    pub(crate) kind: &'a BodyKind,
}

/// Some bodies, of which the first begins at `from`, with consecutive single spheres in groups. Alone, each
/// sphere would occupy a whole block.
pub(crate) fn body_groups<'a>(
    kinds: &'a [BodyKind],
    bodies: &[Placement],
    mut from: usize,
) -> Vec<BodyGroup<'a>> {
    let mut body_groups: Vec<BodyGroup<'_>> = Vec::new();
    for placement in bodies {
        let kind = &kinds[placement.kind];
        let range = from..from + kind.meta.points.len();
        from = range.end;
        let is_single = |kind: &BodyKind| kind.meta.points.len() == 1;
        match body_groups.last_mut() {
            Some(last)
                if is_single(kind)
                    && is_single(last.kind)
                    && last.kind.subparticle_mass_kg == kind.subparticle_mass_kg
                    && last.range.len() < MAX_SPHERES_PER_GROUP =>
            {
                last.range.end = range.end;
            }
            _ if range.is_empty() => {}
            _ => body_groups.push(BodyGroup { range, kind }),
        }
    }
    body_groups
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::check::scene_of;
    use crate::engine::scene::Scene;
    use crate::scenario::from_value;

    #[test]
    fn consecutive_single_spheres_of_one_kind_share_a_group() {
        let drop = from_value(&json!({"experiment": "drop"})).expect("a scenario");
        let scene = scene_of(&drop);
        let fillet = scene.kinds[0].clone();
        let mut single = fillet.clone();
        let mut meta = (*single.meta).clone();
        meta.points.truncate(1);
        meta.bonds.clear();
        single.meta = meta.into();
        let heavy = BodyKind { subparticle_mass_kg: 2.0 * single.subparticle_mass_kg, ..single.clone() };
        let length = fillet.meta.points.len();
        let some = |kind: usize, count: usize| vec![Placement { kind, ..scene.bodies[0] }; count];
        let bodies = [some(1, 1100), some(0, 2), some(1, 3), some(2, 4)].concat();
        let scene = Scene { kinds: vec![fillet, single, heavy], bodies, ..scene };
        let lengths: Vec<usize> =
            body_groups(&scene.kinds, &scene.bodies, 0).iter().map(|group| group.range.len()).collect();
        assert_eq!(lengths, [512, 512, 76, length, length, 3, 4]);
    }
}
