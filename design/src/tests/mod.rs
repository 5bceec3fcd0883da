//! Tests of the crate: questions, evidence, and the support that tests of goals share.

mod boundary;
mod calibrate;
mod estimate;
mod evidence;
mod optimise;
mod question;
mod ranges;
pub(crate) mod truth;
