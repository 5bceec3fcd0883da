//! Tests of the crate: questions, evidence, and the support that tests of goals share.

mod boundary;
mod estimate;
mod evidence;
mod question;
pub(crate) mod truth;
