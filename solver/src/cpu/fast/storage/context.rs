//! The data that all bodies share during the integration phase.

use std::ops::Range;

use super::laws::{LaneContactLaw, PairLaws};
use super::pairs::BodyPairList;
use crate::cpu::integrate::Integrator;
use crate::cpu::stages::StageTimers;
use crate::engine::frame::Frame;
use crate::walls::Walls;

/// Data shared by all bodies in a step.
#[derive(Debug)]
pub(crate) struct StepContext<'a> {
    pub(crate) laws: &'a PairLaws,
    pub(crate) integrator: &'a Integrator,
    pub(crate) frame: &'a Frame,
    pub(crate) walls: &'a Walls,
    /// Lists and loads of each body.
    pub(crate) pairs: &'a [BodyPairList],
    /// For each body pair, the range of its loads among those of its first body.
    pub(crate) loads: &'a [Range<u32>],
    /// Distance that a body may move before the body pairs are updated, in metres.
    pub(crate) margin: f64,
    pub(crate) stages: &'a StageTimers,
    /// Contact laws of the surfaces, by number.
    pub(crate) wall_laws: &'a [LaneContactLaw],
    pub(crate) radius: f32,
    /// Distance of a centre from a facet up to which a contact can hold, in metres.
    pub(crate) wall_cutoff: f32,
    /// Verlet skin of the wall lists, in metres.
    pub(crate) wall_skin: f32,
}
