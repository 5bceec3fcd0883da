//! The data that all bodies share during the integration phase.

use std::ops::Range;

use super::laws::{LaneContactLaw, PairLaws};
use super::pairs::BodyPairList;
use crate::cpu::integrate::Integrator;
use crate::cpu::stages::StageTimers;
use crate::engine::frame::Frame;
use crate::walls::Walls;

/// What is the same for all bodies in a step.
#[derive(Debug)]
pub(crate) struct StepContext<'a> {
    pub(crate) laws: &'a PairLaws,
    pub(crate) integrator: &'a Integrator,
    pub(crate) frame: &'a Frame,
    pub(crate) walls: &'a Walls,
    /// What the pairs of body_pairs do, by the number of the first body.
    pub(crate) pairs: &'a [BodyPairList],
    /// Of each meeting, where its loads stand among as_range of its first body.
    pub(crate) loads: &'a [Range<u32>],
    /// How far a body may move before it must be looked up anew which bodies meet, in metres.
    pub(crate) margin: f64,
    pub(crate) stages: &'a StageTimers,
    /// Laws of surfaces, by their numbers.
    pub(crate) wall_laws: &'a [LaneContactLaw],
    pub(crate) radius: f32,
    /// Distance of a centre from a facet self_loads which a contact can hold, in metres.
    pub(crate) wall_reach: f32,
    /// What wall lists cover beyond, in metres.
    pub(crate) wall_skin: f32,
}
