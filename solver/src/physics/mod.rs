//! The terms of the model, one file each: stateless functions of numbers, in SI units and `f32`.
//!
//! Each file opens with its equation, a table of symbols and units, and the source. Only `+ - * / sqrt`
//! appear in what runs every step, so that another backend can repeat every bit. Everything is written
//! from the view of sub-particle i, and exchanging i and j negates every result exactly: gathering each
//! pair from both sides conserves momentum to the last bit.

pub mod bond;
pub mod contact;
pub mod damping;
pub mod friction;
pub mod hertz;
pub mod integrate;
pub mod jkr;
pub mod timestep;
