//! The terms of the model, one file each: stateless functions of numbers, in SI units and `f32`.
//!
//! Each file opens with its equation, a table of symbols and units, and the source. Per-step code uses only
//! `+ - * / sqrt`, so that another backend can repeat every bit.
//!
//! Results are those on sub-particle i. Exchanging i and j negates every result exactly: gathering a pair
//! from both sides conserves momentum to the last bit.

pub mod bond;
pub mod contact;
pub mod damping;
pub mod friction;
pub mod hertz;
pub mod integrate;
pub mod jkr;
pub mod timestep;

use bond::BondLaw;
use contact::ContactLaw;

/// The interaction laws of a run, a member per term. The fast path and the GPU name each member: a new one does not compile
/// there before it is handled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Laws {
    /// Between sub-particles.
    pub tissue: ContactLaw,
    /// Against walls, gate and plates.
    pub equipment: ContactLaw,
    /// Against the belt.
    pub belt: ContactLaw,
    /// Bonds.
    pub bond: BondLaw,
    /// Whether bonded neighbours also interact by contact.
    pub contact_between_bonded: bool,
}
