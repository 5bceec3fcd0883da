//! Instruction sets and lanes: the layer that knows registers, and no particles.
//!
//! [`arrays`] are the operands of kernels in memory, [`lanes`] the arithmetic on registers. [`set`] selects
//! the instruction set and defines the moves between lanes.

pub(crate) mod arrays;
pub(crate) mod lanes;
pub(crate) mod prefetch;
pub(crate) mod set;
pub(crate) mod transpose;
#[cfg(target_arch = "x86_64")]
mod x86;
