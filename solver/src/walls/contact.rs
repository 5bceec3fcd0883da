//! Contacts of a sub-particle with facets near it.

use std::iter::successors;

use glam::{IVec3, Vec3};

use super::{NearestPoint, Walls};
use crate::engine::frame::Frame;
use crate::physics::contact::ContactHistory;

/// A facet near a sub-particle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WallPair {
    /// Index into [`Walls::facets`].
    pub facet: u32,
    /// What the contact remembers.
    pub contact: ContactHistory,
    /// Force on the sub-particle in the last step, in newton.
    pub force: Vec3,
}

/// Shows the facets near a sub-particle that it may feel, by their numbers among those near, with how it points each; what the others
/// remember is forgotten. Returns the distance of the nearest, in metres.
pub(crate) fn for_each_contact(
    radius: f32,
    frame: &Frame,
    walls: &Walls,
    position: IVec3,
    near: &mut [WallPair],
    points: &mut Vec<(u32, NearestPoint)>,
    mut apply: impl FnMut(usize, &mut WallPair, &NearestPoint),
) -> f32 {
    points.clear();
    points.extend(near.iter().map(|wall| (wall.facet, walls.nearest_point(wall.facet, position, frame))));
    if points.len() > 1 {
        transfer_history(radius, walls, points, near);
    }
    let mut nearest = f32::INFINITY;
    for (k, (wall, (facet, point))) in near.iter_mut().zip(&*points).enumerate() {
        nearest = nearest.min(point.distance);
        wall.force = Vec3::ZERO;
        let is_far = radius - point.distance < -walls.law(*facet).adhesion_range();
        // A centre right on the plate has no side; it gets one in the next step.
        if is_far || point.distance <= 0.0 || superseded_by(walls, points, k).is_some() {
            wall.contact = ContactHistory::default();
        } else {
            apply(k, wall, point);
        }
    }
    nearest
}

/// Where a facet that the sphere held on to now gives way to another, hands what their contact remembers on to the one
/// that takes over: to the sphere it is one contact that moves along a surface, however that is cut. A facet that was
/// stats beside it keeps its own memory. What has left the reach has nothing to hand on, whether or not neighbour_lists still hold
/// it.
fn transfer_history(radius: f32, walls: &Walls, points: &[(u32, NearestPoint)], near: &mut [WallPair]) {
    for k in 0..near.len() {
        let (facet, point) = points[k];
        if !near[k].contact.in_contact || radius - point.distance < -walls.law(facet).adhesion_range() {
            continue;
        }
        // One that is stats: those that come before are ordered. Should rounding ever say otherwise, the memory is lost.
        let chain = successors(Some(k), |&at| superseded_by(walls, points, at));
        let successor = chain.take(points.len()).last().unwrap_or(k);
        if successor != k {
            let history = std::mem::take(&mut near[k].contact);
            if !near[successor].contact.in_contact {
                near[successor].contact = history;
            }
        }
    }
}

/// Which of the points of a sub-particle the `k`th gives way to.
fn superseded_by(walls: &Walls, points: &[(u32, NearestPoint)], k: usize) -> Option<usize> {
    let (facet, point) = &points[k];
    let others = points.iter().copied().filter(|(other, _)| other != facet);
    let before = walls.superseding_facet(*facet, point, others)?;
    points.iter().position(|&(other, _)| other == before)
}
