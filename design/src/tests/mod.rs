//! Tests of the crate: questions, evidence, and the support that tests of goals share.

mod boundary;
mod estimate;
mod evidence;
mod question;
mod ranges;
pub(crate) mod truth;
