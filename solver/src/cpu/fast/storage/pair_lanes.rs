//! Input and output of the pair kernels, for one chunk of pairs: kinematics, loads and histories.

use super::bond_set::BondMoments;
use crate::cpu::fast::instructions::arrays::{Lanes, Lanes3};

/// Kinematics of [`WIDTH`](crate::cpu::fast::instructions::arrays::WIDTH) pairs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PairKinematics {
    /// x_j − x_i, in metres.
    pub(crate) offset: Lanes3,
    /// v_j − v_i, in m/s.
    pub(crate) velocity: Lanes3,
    /// ω_i + ω_j, in rad/s.
    pub(crate) spin: Lanes3,
}

/// Loads of one chunk of pairs: force on i (the opposite acts on j) and torque (the same on both).
#[derive(Clone, Copy, Debug)]
pub(crate) struct PairLoads {
    pub(crate) force: Lanes3,
    pub(crate) torque: Lanes3,
}

/// Histories of one chunk of contacts; see [`ContactHistoryMut`].
#[derive(Debug)]
pub(crate) struct ContactHistories {
    pub(crate) in_contact: u16,
    pub(crate) xi: Lanes3,
}

/// Histories of one chunk of bonds of one class, and of their contacts.
#[derive(Debug)]
pub(crate) struct BondHistoryMut<'a> {
    /// Rest length, in metres.
    pub(crate) rest: f32,
    /// Lanes that have or had a bond, and lanes with an intact bond.
    pub(crate) exists: u16,
    pub(crate) intact: &'a mut u16,
    /// Force history, in newton.
    pub(crate) stored: &'a mut Lanes3,
    pub(crate) contacts: ContactHistoryMut<'a>,
}

/// Moments of one chunk of bonds, and what they come of.
#[derive(Debug)]
pub(crate) struct MomentLanes<'a> {
    /// ω_j − ω_i, in rad/s.
    pub(crate) turn: Lanes3,
    pub(crate) history: &'a mut BondMoments,
    /// Moment on i, in N m; the opposite acts on j.
    pub(crate) moment: Lanes3,
}

/// Histories of one chunk of contacts, wherever they are stored.
#[derive(Debug)]
pub(crate) struct ContactHistoryMut<'a> {
    /// Contacts that have formed, and so hold down to the snap overlap.
    pub(crate) in_contact: &'a mut u16,
    /// Tangential displacement ξ, in metres.
    pub(crate) xi: &'a mut Lanes3,
}

impl PairKinematics {
    pub(crate) const ZERO: Self =
        Self { offset: [Lanes::ZERO; 3], velocity: [Lanes::ZERO; 3], spin: [Lanes::ZERO; 3] };
}

impl PairLoads {
    pub(crate) const ZERO: Self = Self { force: [Lanes::ZERO; 3], torque: [Lanes::ZERO; 3] };
}

impl<'a> MomentLanes<'a> {
    #[inline(always)]
    pub(crate) fn new(turn: Lanes3, history: &'a mut BondMoments) -> Self {
        Self { turn, history, moment: [Lanes::ZERO; 3] }
    }
}

impl ContactHistories {
    pub(crate) fn new() -> Self {
        Self { in_contact: 0, xi: [Lanes::ZERO; 3] }
    }

    pub(crate) fn as_mut(&mut self) -> ContactHistoryMut<'_> {
        ContactHistoryMut { in_contact: &mut self.in_contact, xi: &mut self.xi }
    }
}
