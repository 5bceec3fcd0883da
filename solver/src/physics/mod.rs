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
pub mod moment;
pub mod timestep;

use bond::BondLaw;
use contact::ContactLaw;
use moment::MomentLaw;

/// The interaction laws of a run, a member per term.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Laws {
    /// Between sub-particles of radius R.
    pub tissue: ContactLaw,
    /// Radius of a sub-particle towards other bodies, over R.
    pub body_radius_ratio: f32,
    /// Against walls, gate and plates.
    pub equipment: ContactLaw,
    /// Against the belt.
    pub belt: ContactLaw,
    /// Bonds.
    pub bond: BondLaw,
    /// Moments of bonds, if they carry any.
    pub moment: Option<MomentLaw>,
    /// Whether bonded neighbours also interact by contact.
    pub contact_between_bonded: bool,
}

/// The laws between sub-particles, which every path computes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InternalLaws {
    /// Contact, with the distance of centres at first contact in metres: within a body, and between bodies.
    pub contacts: [(ContactLaw, f32); 2],
    /// Bonds.
    pub bond: BondLaw,
    /// Moments of bonds, if they carry any.
    pub moment: Option<MomentLaw>,
    /// Whether bonded neighbours also interact by contact.
    pub contact_between_bonded: bool,
}

impl Laws {
    /// The laws that the fast path and the GPU take in, for sub-particles of `radius` in metres; surfaces carry their own
    /// contact law.
    ///
    /// It names every member, so that a new law does not compile before it is added here. A law that only the
    /// plain path has so far stands here as `name: _`.
    pub fn internal(&self, radius: f32) -> InternalLaws {
        let Self {
            tissue: _,
            body_radius_ratio: _,
            equipment: _,
            belt: _,
            bond,
            moment,
            contact_between_bonded,
        } = *self;
        InternalLaws { contacts: self.pair_contacts(radius), bond, moment, contact_between_bonded }
    }

    /// Between sub-particles of different bodies: spheres of radius R · `body_radius_ratio`.
    pub fn between_bodies(&self) -> ContactLaw {
        self.tissue.with_radius_ratio(self.body_radius_ratio)
    }

    /// Contact law and distance of centres at first contact in metres, for sub-particles of `radius` in metres: within a
    /// body, and between bodies.
    pub fn pair_contacts(&self, radius: f32) -> [(ContactLaw, f32); 2] {
        let distance = 2.0 * radius;
        [(self.tissue, distance), (self.between_bodies(), distance * self.body_radius_ratio)]
    }
}
