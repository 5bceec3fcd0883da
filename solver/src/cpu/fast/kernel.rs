//! The forces of pairs, in lanes: what [`crate::physics::bond`] and [`crate::physics::contact`] say of one pair, of
//! many at once. Branches become selections; the tests hold
//! every term to the physics within a few units in the last place.

use pulp::Simd;

use super::instructions::LaneOps;
use super::jkr::jkr;
use super::lanes::{F, F3, Mask};
use super::laws::{LaneContactLaw, PairLaws};
use super::load::BatchLanes;
use super::memory::{Lanes, Lanes3, WIDTH};
use crate::physics::bond::{BondModel, STRETCH_CLAMP};
use crate::physics::damping::{BODY_CAP, BONDED_CAP, DampingCap, SURFACE_CAP};

/// Squares of what is rotated_history below which it has no direction.
const NO_LENGTH2: f32 = 1e-30;

/// Share that squares of what is rotated_history may lose in a step for the first terms of a root to be as good as all.
const MUCH_LONGER: f32 = 1e-4;

/// What is kinematics of [`WIDTH`] pairs before their forces are worked out.
#[derive(Clone, Copy, Debug)]
pub(super) struct PairKinematics {
    /// x_j − x_i, in metres.
    pub(super) offset: Lanes3,
    /// v_j − v_i, in m/s.
    pub(super) velocity: Lanes3,
    /// ω_i + ω_j, in rad/s.
    pub(super) spin: Lanes3,
}

/// What comes out: force on i (j feels the opposite) and torque (both feel the same).
#[derive(Clone, Copy, Debug)]
pub(super) struct PairLoads {
    pub(super) force: Lanes3,
    pub(super) torque: Lanes3,
}

/// What [`WIDTH`] contacts remember: see [`ContactHistoryMut`].
#[derive(Debug)]
pub(super) struct ContactHistories {
    pub(super) in_contact: u16,
    pub(super) xi: Lanes3,
}

/// What [`WIDTH`] bonds of one class remember, and their contacts.
#[derive(Debug)]
pub(super) struct BondHistoryMut<'a> {
    /// Length at which they pull nothing, in metres.
    pub(super) rest: f32,
    /// Lanes that have a bond, or had one that broke; and as_range whose bond holds.
    pub(super) exists: u16,
    pub(super) intact: &'a mut u16,
    /// Stored force, in newton.
    pub(super) stored: &'a mut Lanes3,
    pub(super) contacts: ContactHistoryMut<'a>,
}

/// What [`WIDTH`] contacts remember, wherever that is kept.
#[derive(Debug)]
pub(super) struct ContactHistoryMut<'a> {
    /// Which of them have formed, so that they hold down to the overlap where they snap.
    pub(super) in_contact: &'a mut u16,
    /// ξ, in metres.
    pub(super) xi: &'a mut Lanes3,
}

impl PairKinematics {
    pub(super) const ZERO: Self =
        Self { offset: [Lanes::ZERO; 3], velocity: [Lanes::ZERO; 3], spin: [Lanes::ZERO; 3] };
}

impl PairLoads {
    pub(super) const ZERO: Self = Self { force: [Lanes::ZERO; 3], torque: [Lanes::ZERO; 3] };
}

impl ContactHistories {
    pub(super) fn new() -> Self {
        Self { in_contact: 0, xi: [Lanes::ZERO; 3] }
    }

    fn in_contact(&mut self) -> ContactHistoryMut<'_> {
        ContactHistoryMut { in_contact: &mut self.in_contact, xi: &mut self.xi }
    }
}

/// A registerful of pairs.
struct PairLanes<S: Simd> {
    n: F3<S>,
    length: F<S>,
    arm: F3<S>,
    /// Velocity of j against i where they meet: along n, and across it.
    v_n: F<S>,
    v_t: F3<S>,
    /// Angle that the pair turns by about n in this step.
    twist: F<S>,
}

/// One over a length; of none, something.
#[inline(always)]
fn inverse<S: Simd>(simd: S, length: F<S>) -> F<S> {
    F::splat(simd, 1.0) / length.max(F::splat(simd, 1e-15))
}

impl<S: Simd> PairLanes<S> {
    #[inline(always)]
    fn new(simd: S, dt: f32, [a, b]: &[PairKinematics; 2], part: usize) -> Self {
        let d = F3::load(simd, [&a.offset, &b.offset], part);
        // Neighbours on the lattice begin at a distance of 2R: whether they touch is decided by the last digit, which should be
        // that of the plain path. So the square is rounded as there, and so is its root.
        let length = d.length2_unfused().sqrt();
        // SearchSides centres on one spot have no direction: d is zero then, and so is n.
        let n = d * inverse(simd, length);
        let arm = d * F::splat(simd, 0.5);
        let spin = F3::load(simd, [&a.spin, &b.spin], part);
        let v = arm.cross_add(spin, F3::load(simd, [&a.velocity, &b.velocity], part));
        Self::from_contact(n, length, arm, v, spin, F::splat(simd, 0.5 * dt))
    }

    /// Sub-particles at surfaces: `apart` leads to the nearest point, `velocity` is that of the surface there against the
    /// sub-particle's, and `spin` twice the surface's.
    #[inline(always)]
    fn at_surfaces(simd: S, dt: f32, [a, b]: &[PairKinematics; 2], part: usize) -> Self {
        let arm = F3::load(simd, [&a.offset, &b.offset], part);
        let length = arm.length2_unfused().sqrt();
        let n = arm * inverse(simd, length);
        let spin = F3::load(simd, [&a.spin, &b.spin], part);
        let v = F3::load(simd, [&a.velocity, &b.velocity], part);
        Self::from_contact(n, length, arm, v, spin, F::splat(simd, 0.5 * dt))
    }

    #[inline(always)]
    fn from_contact(n: F3<S>, length: F<S>, arm: F3<S>, v: F3<S>, spin: F3<S>, half_dt: F<S>) -> Self {
        let v_n = v.dot(n);
        let twist = spin.dot(n) * half_dt;
        Self { n, length, arm, v_n, v_t: n.neg_mul_add(v_n, v), twist }
    }
}

/// ContactHistories of pairs that no bond joins, in two chunks that have `counts` of them, with their √m* in kg^½. Returns their
/// greatest overlap, in metres.
#[inline(always)]
pub(super) fn contacts<S: LaneOps>(
    simd: S,
    laws: &PairLaws,
    BatchLanes { counts, kinematics, sqrt_m_star: [mass_a, mass_b], memory: [one, two] }: &mut BatchLanes,
    [a, b]: &mut [PairLoads; 2],
) -> f32 {
    let mut max_overlap = F::splat(simd, 0.0);
    let (mut one, mut two) = (one.in_contact(), two.in_contact());
    let counts = F::splat_each(simd, counts.map(|count| count as f32));
    for part in 0..WIDTH / S::F32_LANES {
        let exists = F::load(simd, [&Lanes::TRANSPOSED; 2], part).lt(counts);
        let pairs = PairLanes::new(simd, laws.dt, kinematics, part);
        let sqrt_m_star = F::load(simd, [mass_a, mass_b], part);
        let params = ContactParams::new(simd, &laws.contact, laws.touch, BODY_CAP, laws.dt, sqrt_m_star);
        let (push, across, delta) = contact(simd, &params, &pairs, exists, [&mut one, &mut two], part);
        max_overlap = max_overlap.max(delta);
        pairs.n.neg_mul_add(push, across).store([&mut a.force, &mut b.force], part);
        pairs.arm.cross(across).store([&mut a.torque, &mut b.torque], part);
    }
    max_overlap.max_lane()
}

/// ContactHistories of sub-particles of mass `sqrt_m_star`², in kilograms, with surfaces of one law, as [`PairLanes::at_surfaces`] sees them.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "what a body has at hand")]
pub(super) fn surfaces<S: LaneOps>(
    simd: S,
    law: &LaneContactLaw,
    laws: &PairLaws,
    sqrt_m_star: f32,
    counts: [usize; 2],
    kinematics: &[PairKinematics; 2],
    [one, two]: &mut [ContactHistories; 2],
    [a, b]: &mut [PairLoads; 2],
) {
    let sqrt_m_star = F::splat(simd, sqrt_m_star);
    let params = ContactParams::new(simd, law, 0.5 * laws.touch, SURFACE_CAP, laws.dt, sqrt_m_star);
    let counts = F::splat_each(simd, counts.map(|count| count as f32));
    let (mut one, mut two) = (one.in_contact(), two.in_contact());
    for part in 0..WIDTH / S::F32_LANES {
        let exists = F::load(simd, [&Lanes::TRANSPOSED; 2], part).lt(counts);
        let pairs = PairLanes::at_surfaces(simd, laws.dt, kinematics, part);
        let (push, across, _) = contact(simd, &params, &pairs, exists, [&mut one, &mut two], part);
        pairs.n.neg_mul_add(push, across).store([&mut a.force, &mut b.force], part);
        pairs.arm.cross(across).store([&mut a.torque, &mut b.torque], part);
    }
}

/// BondHistoryMut of two chunks, and the contacts of the same pairs. Returns the greatest overlap of as_range whose bond has broken, in
/// metres.
#[inline(always)]
pub(super) fn bonds<S: LaneOps>(
    simd: S,
    laws: &PairLaws,
    sqrt_m_star: f32,
    kinematics: &[PairKinematics; 2],
    [one, two]: &mut [BondHistoryMut<'_>; 2],
    [a, b]: &mut [PairLoads; 2],
) -> f32 {
    let zero = F::splat(simd, 0.0);
    let sqrt_m_star = F::splat(simd, sqrt_m_star);
    let bonded_params = ContactParams::new(simd, &laws.contact, laws.touch, BONDED_CAP, laws.dt, sqrt_m_star);
    let broken_params = ContactParams::new(simd, &laws.contact, laws.touch, BODY_CAP, laws.dt, sqrt_m_star);
    let mut max_overlap = zero;
    let free = [one.exists & !*one.intact, two.exists & !*two.intact];
    let touch = if laws.contact_between_bonded { [one.exists, two.exists] } else { free };
    let any_touches = touch[0] | touch[1] != 0;
    let any_free = free[0] | free[1] != 0;
    for part in 0..WIDTH / S::F32_LANES {
        let pairs = PairLanes::new(simd, laws.dt, kinematics, part);
        let (mut pull, mut across) = bond(simd, laws, &pairs, [one, two], part);
        if any_touches {
            let touches = Mask::from_bits(simd, touch, part);
            let mut params = bonded_params;
            if any_free {
                let free = Mask::from_bits(simd, free, part);
                params.max_eta_n = free.select(broken_params.max_eta_n, bonded_params.max_eta_n);
                params.max_eta_t = free.select(broken_params.max_eta_t, bonded_params.max_eta_t);
            }
            let contacts = [&mut one.contacts, &mut two.contacts];
            let (push, tangential, delta) = contact(simd, &params, &pairs, touches, contacts, part);
            pull = pull - push;
            across += tangential;
            max_overlap = max_overlap.max(Mask::from_bits(simd, free, part).select(delta, zero));
        }
        pairs.n.mul_add(pull, across).store([&mut a.force, &mut b.force], part);
        pairs.arm.cross(across).store([&mut a.torque, &mut b.torque], part);
    }
    max_overlap.max_lane()
}

/// [`crate::physics::bond::force`]: the pull along n, and the force across it. What breaks is no longer intact.
#[inline(always)]
fn bond<S: LaneOps>(
    simd: S,
    laws: &PairLaws,
    pairs: &PairLanes<S>,
    [one, two]: [&mut BondHistoryMut<'_>; 2],
    part: usize,
) -> (F<S>, F3<S>) {
    let law = &laws.bond;
    let splat = |value| F::splat(simd, value);
    let PairLanes { n, length, v_n, v_t, .. } = *pairs;
    let stored = F3::load(simd, [one.stored, two.stored], part);
    let (pull, shear, stored) = if law.model == BondModel::AsPublished {
        let rate = n.mul_add(splat(law.k_n) * v_n, v_t * splat(law.k_t));
        let stored = rate.mul_add(splat(laws.dt), stored);
        let pull = stored.dot(n);
        (pull, n.neg_mul_add(pull, stored), stored)
    } else {
        let shear = v_t.mul_add(splat(law.k_t * laws.dt), rotated_history(simd, pairs, stored));
        let e = length - F::splat_each(simd, [one.rest, two.rest]);
        let pull = splat(law.k_n) * e;
        let pull = if law.model == BondModel::FiniteExtension {
            let span = [one.rest, two.rest].map(|rest| 1.0 / (law.break_length - rest));
            let share = (e * F::splat_each(simd, span)).min(splat(STRETCH_CLAMP));
            let share = share.max(splat(0.0));
            pull / (splat(1.0) - share * share)
        } else {
            pull
        };
        (pull, shear, shear)
    };
    let mut yields = splat(law.break_length).lt(length);
    if law.normal_strength.min(law.shear_strength) < f32::INFINITY {
        yields = yields
            | splat(law.normal_strength).lt(pull)
            | splat(law.shear_strength * law.shear_strength).lt(shear.dot(shear));
    }
    let bonded = Mask::from_bits(simd, [*one.intact, *two.intact], part);
    let acts = bonded.and_not(yields);
    acts.store([one.intact, two.intact], part);
    let none = F3::zero(simd);
    acts.select3(stored, none).store([one.stored, two.stored], part);
    (acts.select(pull, splat(0.0)), acts.select3(shear, none))
}

/// What contacts of one kind have in common.
#[derive(Clone, Copy)]
struct ContactParams<'a, S: Simd> {
    law: &'a LaneContactLaw,
    /// Length at which they touch, in metres.
    touch: f32,
    dt: f32,
    /// √m*, in kg^½.
    sqrt_m_star: F<S>,
    /// The most that dashpots along n and across it can be, in kg/s.
    max_eta_n: F<S>,
    max_eta_t: F<S>,
}

impl<'a, S: Simd> ContactParams<'a, S> {
    #[inline(always)]
    fn new(
        simd: S,
        law: &'a LaneContactLaw,
        touch: f32,
        cap: DampingCap,
        dt: f32,
        sqrt_m_star: F<S>,
    ) -> Self {
        let m_star = sqrt_m_star * sqrt_m_star;
        let max_eta_n = m_star * F::splat(simd, cap.normal / dt);
        let max_eta_t = m_star * F::splat(simd, cap.tangential / dt);
        Self { law, touch, dt, sqrt_m_star, max_eta_n, max_eta_t }
    }
}

/// [`crate::physics::contact::force`] on i: the push against n, the force across it, and the overlap where there is contact (else 0).
#[inline(always)]
fn contact<S: LaneOps>(
    simd: S,
    params: &ContactParams<'_, S>,
    pairs: &PairLanes<S>,
    touches: Mask<S>,
    [one, two]: [&mut ContactHistoryMut<'_>; 2],
    part: usize,
) -> (F<S>, F3<S>, F<S>) {
    let LaneContactLaw { law, damping_n, damping_t, snap } = params.law;
    let splat = |value| F::splat(simd, value);
    let (zero, none) = (splat(0.0), F3::zero(simd));
    // Velocities here are as_range of j against i: what is felt on i has the opposite sign.
    let PairLanes { v_n, v_t, .. } = *pairs;
    let delta = splat(params.touch) - pairs.length;
    // From in_contact on, or from where it snaps if it has formed, which is before.
    let limit = Mask::from_bits(simd, [*one.in_contact, *two.in_contact], part).select(splat(*snap), zero);
    let holds = touches & limit.le(delta);
    holds.store([one.in_contact, two.in_contact], part);
    if !holds.any() {
        none.store([one.xi, two.xi], part);
        return (zero, none, zero);
    }
    let (elastic, a, root_a) = match &law.jkr {
        Some(scale) => jkr(simd, scale, delta, holds),
        None => {
            let delta = holds.select(delta.max(zero), zero);
            let a = (splat(law.r_star) * delta).sqrt();
            (splat(4.0 / 3.0 * law.e_star) * a * delta, a, a.sqrt())
        }
    };
    let damp = params.sqrt_m_star * root_a;
    let eta_n = (splat(*damping_n) * damp).min(params.max_eta_n);
    let eta_t = (splat(*damping_t) * damp).min(params.max_eta_t);
    let total = eta_n.neg_mul_add(v_n, elastic);
    // Friction, as in `physics::friction`; without area there is nothing to hold on to.
    let holds_on = zero.lt(a);
    let k_t = splat(8.0 * law.g_star) * a;
    let dashpot = v_t * eta_t;
    let old = F3::load(simd, [one.xi, two.xi], part);
    let mut xi = v_t.neg_mul_add(splat(params.dt), rotated_history(simd, pairs, old));
    let mut force = xi.neg_mul_add(k_t, dashpot);
    let cap = splat(law.mu) * total.max(zero);
    let size2 = force.dot(force);
    let slips = (cap * cap).lt(size2);
    if slips.any() {
        force = force * slips.select(cap / size2.sqrt(), splat(1.0));
        let slipped = (dashpot - force) * (splat(1.0) / k_t.max(splat(1e-30)));
        xi = slips.select3(slipped, xi);
    }
    holds_on.select3(xi, none).store([one.xi, two.xi], part);
    (total, force, holds.select(delta, zero))
}

/// [`crate::physics::friction::rotated_history`], by the pairs' spin in this step.
#[inline(always)]
fn rotated_history<S: Simd>(simd: S, pairs: &PairLanes<S>, v: F3<S>) -> F3<S> {
    let n = pairs.n;
    let splat = |value| F::splat(simd, value);
    let twisted = (n * pairs.twist).cross_add(v, v);
    let flat = n.neg_mul_add(twisted.dot(n), twisted);
    let (before, after) = (v.dot(v), flat.dot(flat));
    // √(before / after) by its first terms: in a step a pair turns by next to nothing.
    let longer = (before - after) * after.approx_recip();
    let mut scale = longer.mul_add(splat(0.5), splat(1.0));
    let far = splat(MUCH_LONGER).lt(longer.abs());
    if far.any() {
        let least = splat(f32::MIN_POSITIVE);
        scale = far.select((before / after.max(least)).sqrt(), scale);
    }
    flat * after.le(splat(NO_LENGTH2)).select(splat(1.0), scale)
}
