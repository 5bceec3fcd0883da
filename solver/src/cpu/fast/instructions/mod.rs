//! Instruction sets and lanes: the layer that knows registers.
//!
//! [`arrays`] are what kernels read and write in memory, [`lanes`] the arithmetic on registers, [`set`] the choice of an
//! instruction set and the moves between lanes. Nothing here knows particles.

pub(crate) mod arrays;
pub(crate) mod lanes;
pub(crate) mod prefetch;
pub(crate) mod set;
pub(crate) mod transpose;
#[cfg(target_arch = "x86_64")]
mod x86;
