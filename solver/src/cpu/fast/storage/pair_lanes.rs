//! Input and output of the pair kernels: kinematics, loads and histories of [`WIDTH`] pairs.

use crate::cpu::fast::instructions::arrays::{Lanes, Lanes3};

/// What is kinematics of [`WIDTH`] pairs before their forces are worked out.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PairKinematics {
    /// x_j − x_i, in metres.
    pub(crate) offset: Lanes3,
    /// v_j − v_i, in m/s.
    pub(crate) velocity: Lanes3,
    /// ω_i + ω_j, in rad/s.
    pub(crate) spin: Lanes3,
}

/// What comes out: force on i (j feels the opposite) and torque (both feel the same).
#[derive(Clone, Copy, Debug)]
pub(crate) struct PairLoads {
    pub(crate) force: Lanes3,
    pub(crate) torque: Lanes3,
}

/// What [`WIDTH`] contacts remember: see [`ContactHistoryMut`].
#[derive(Debug)]
pub(crate) struct ContactHistories {
    pub(crate) in_contact: u16,
    pub(crate) xi: Lanes3,
}

/// What [`WIDTH`] bonds of one class remember, and their contacts.
#[derive(Debug)]
pub(crate) struct BondHistoryMut<'a> {
    /// Length at which they pull nothing, in metres.
    pub(crate) rest: f32,
    /// Lanes that have a bond, or had one that broke; and as_range whose bond holds.
    pub(crate) exists: u16,
    pub(crate) intact: &'a mut u16,
    /// Stored force, in newton.
    pub(crate) stored: &'a mut Lanes3,
    pub(crate) contacts: ContactHistoryMut<'a>,
}

/// What [`WIDTH`] contacts remember, wherever that is kept.
#[derive(Debug)]
pub(crate) struct ContactHistoryMut<'a> {
    /// Which of them have formed, so that they hold down to the overlap where they snap.
    pub(crate) in_contact: &'a mut u16,
    /// ξ, in metres.
    pub(crate) xi: &'a mut Lanes3,
}

impl PairKinematics {
    pub(crate) const ZERO: Self =
        Self { offset: [Lanes::ZERO; 3], velocity: [Lanes::ZERO; 3], spin: [Lanes::ZERO; 3] };
}

impl PairLoads {
    pub(crate) const ZERO: Self = Self { force: [Lanes::ZERO; 3], torque: [Lanes::ZERO; 3] };
}

impl ContactHistories {
    pub(crate) fn new() -> Self {
        Self { in_contact: 0, xi: [Lanes::ZERO; 3] }
    }

    pub(crate) fn as_mut(&mut self) -> ContactHistoryMut<'_> {
        ContactHistoryMut { in_contact: &mut self.in_contact, xi: &mut self.xi }
    }
}
