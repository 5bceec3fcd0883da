//! Contacts of a sub-particle with the facets near it, on either CPU path.
//!
//! A surface cut into many facets must act like the surface itself: one contact, whose history moves on with
//! it.

use std::iter::successors;

use glam::{IVec3, Vec3};

use super::side;
use super::{NearestPoint, Walls};
use crate::engine::frame::Frame;
use crate::engine::wall_pair::WallPair;
use crate::physics::contact::ContactHistory;

/// A sub-particle among surfaces.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seer {
    /// Its radius, in metres.
    pub(crate) radius: f32,
    /// Fixed-point position.
    pub(crate) position: IVec3,
    /// In m/s.
    pub(crate) velocity: Vec3,
    /// Time step, in seconds.
    pub(crate) dt: f32,
}

impl Seer {
    /// Whether a facet is out of range on the side where the sub-particle is.
    pub(super) fn is_far(&self, walls: &Walls, facet: u32, point: &NearestPoint) -> bool {
        self.radius - point.distance < -walls.law(facet).adhesion_range()
    }
}

/// Statistics of the facets near a sub-particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct WallStats {
    /// Distance of the nearest facet in metres; 0 beyond a facet.
    pub(crate) nearest: f32,
    /// Surfaces that the sub-particle has passed through in this step.
    pub(crate) passed: u32,
}

/// Calls `apply` for each facet that acts on a sub-particle, with its index in `near` and its nearest point.
/// Histories of the other facets are cleared; memories of sides persist.
pub(crate) fn for_each_contact(
    seer: &Seer,
    frame: &Frame,
    walls: &Walls,
    near: &mut [WallPair],
    points: &mut Vec<(u32, NearestPoint)>,
    mut apply: impl FnMut(usize, &mut WallPair, &NearestPoint),
) -> WallStats {
    points.clear();
    points
        .extend(near.iter().map(|wall| (wall.facet, walls.nearest_point(wall.facet, seer.position, frame))));
    let passed = side::update(walls, seer, points, near);
    if points.len() > 1 {
        transfer_history(seer, walls, points, near);
    }
    let mut nearest = f32::INFINITY;
    for (k, (wall, (facet, point))) in near.iter_mut().zip(&*points).enumerate() {
        nearest = nearest.min(point.signed_distance().max(0.0));
        wall.force = Vec3::ZERO;
        let is_far = !point.memory.beyond && seer.is_far(walls, *facet, point);
        // A centre exactly on a plate has no direction. The next step moves it to one.
        if is_far || point.distance <= 0.0 || superseded_by(walls, points, k).is_some() {
            wall.contact = ContactHistory::default();
        } else {
            apply(k, wall, point);
        }
    }
    WallStats { nearest, passed }
}

/// Transfers the history of a facet that is now superseded to the facet that supersedes it. For the sphere
/// both are one contact that moves along a surface, however the surface is cut.
///
/// A successor with a contact of its own keeps its own history. A contact out of range has no history to
/// transfer, whether or not a list still holds it.
fn transfer_history(seer: &Seer, walls: &Walls, points: &[(u32, NearestPoint)], near: &mut [WallPair]) {
    for k in 0..near.len() {
        let (facet, point) = points[k];
        if !near[k].contact.in_contact || !point.memory.beyond && seer.is_far(walls, facet, &point) {
            continue;
        }
        // The end of the chain acts, since facets are ordered. If rounding ever broke the order, the history
        // would be lost.
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

/// Index of the point that supersedes the `k`th point of a sub-particle, if any.
fn superseded_by(walls: &Walls, points: &[(u32, NearestPoint)], k: usize) -> Option<usize> {
    let (facet, point) = &points[k];
    let others = points.iter().copied().filter(|(other, _)| other != facet);
    let before = walls.superseding_facet(*facet, point, others)?;
    points.iter().position(|&(other, _)| other == before)
}
