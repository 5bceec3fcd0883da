//! The forces of pairs, in lanes: what [`crate::physics::bond`] and [`crate::physics::contact`] say of one pair, of
//! many at once. Branches become selections; the tests hold
//! every term to the physics within a few units in the last place.

use pulp::Simd;

use super::instructions::Wide;
use super::jkr::jkr;
use super::lanes::{F, F3, Mask};
use super::laws::{LaneContact, PairLaws};
use super::load::BatchLanes;
use super::memory::{Lanes, Lanes3, WIDTH};
use crate::physics::bond::{BondModel, STRETCH_CLAMP};
use crate::physics::damping::{BODY_CAP, BONDED_CAP, DampingCap, SURFACE_CAP};

/// Squares of what is rotated_history below which it has no direction.
const NO_LENGTH2: f32 = 1e-30;

/// Share that squares of what is rotated_history may lose in a step for the first terms of a root to be as good as all.
const MUCH_LONGER: f32 = 1e-4;

/// What is seen of [`WIDTH`] pairs before their forces are worked out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// x_j − x_i, in metres.
    pub(super) apart: Lanes3,
    /// v_j − v_i, in m/s.
    pub(super) velocity: Lanes3,
    /// ω_i + ω_j, in rad/s.
    pub(super) spin: Lanes3,
}

/// What comes out: force on i (j feels the opposite) and torque (both feel the same).
#[derive(Clone, Copy, Debug)]
pub(super) struct Felt {
    pub(super) force: Lanes3,
    pub(super) torque: Lanes3,
}

/// What [`WIDTH`] contacts remember: see [`Held`].
#[derive(Debug)]
pub(super) struct Contacts {
    pub(super) held: u16,
    pub(super) xi: Lanes3,
}

/// What [`WIDTH`] bonds of one class remember, and their contacts.
#[derive(Debug)]
pub(super) struct Bonds<'a> {
    /// Length at which they pull nothing, in metres.
    pub(super) rest: f32,
    /// Lanes that have a bond, or had one that broke; and those whose bond holds.
    pub(super) exists: u16,
    pub(super) intact: &'a mut u16,
    /// Stored force, in newton.
    pub(super) stored: &'a mut Lanes3,
    pub(super) contacts: Held<'a>,
}

/// What [`WIDTH`] contacts remember, wherever that is kept.
#[derive(Debug)]
pub(super) struct Held<'a> {
    /// Which of them have formed, so that they hold down to the overlap where they snap.
    pub(super) held: &'a mut u16,
    /// ξ, in metres.
    pub(super) xi: &'a mut Lanes3,
}

impl Seen {
    pub(super) const NOTHING: Self =
        Self { apart: [Lanes::ZERO; 3], velocity: [Lanes::ZERO; 3], spin: [Lanes::ZERO; 3] };
}

impl Felt {
    pub(super) const NOTHING: Self = Self { force: [Lanes::ZERO; 3], torque: [Lanes::ZERO; 3] };
}

impl Contacts {
    pub(super) fn new() -> Self {
        Self { held: 0, xi: [Lanes::ZERO; 3] }
    }

    fn held(&mut self) -> Held<'_> {
        Held { held: &mut self.held, xi: &mut self.xi }
    }
}

/// A registerful of pairs.
struct Pairs<S: Simd> {
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

impl<S: Simd> Pairs<S> {
    #[inline(always)]
    fn new(simd: S, dt: f32, [a, b]: &[Seen; 2], part: usize) -> Self {
        let d = F3::load(simd, [&a.apart, &b.apart], part);
        // Neighbours on the lattice begin at a distance of 2R: whether they touch is decided by the last digit, which should be
        // that of the plain path. So the square is rounded as there, and so is its root.
        let length = d.length2_unfused().sqrt();
        // Two centres on one spot have no direction: d is zero then, and so is n.
        let n = d * inverse(simd, length);
        let arm = d * F::splat(simd, 0.5);
        let spin = F3::load(simd, [&a.spin, &b.spin], part);
        let v = arm.cross_add(spin, F3::load(simd, [&a.velocity, &b.velocity], part));
        Self::meeting(n, length, arm, v, spin, F::splat(simd, 0.5 * dt))
    }

    /// Sub-particles at surfaces: `apart` leads to the nearest point, `velocity` is that of the surface there against the
    /// sub-particle's, and `spin` twice the surface's.
    #[inline(always)]
    fn at_surfaces(simd: S, dt: f32, [a, b]: &[Seen; 2], part: usize) -> Self {
        let arm = F3::load(simd, [&a.apart, &b.apart], part);
        let length = arm.length2_unfused().sqrt();
        let n = arm * inverse(simd, length);
        let spin = F3::load(simd, [&a.spin, &b.spin], part);
        let v = F3::load(simd, [&a.velocity, &b.velocity], part);
        Self::meeting(n, length, arm, v, spin, F::splat(simd, 0.5 * dt))
    }

    #[inline(always)]
    fn meeting(n: F3<S>, length: F<S>, arm: F3<S>, v: F3<S>, spin: F3<S>, half_dt: F<S>) -> Self {
        let v_n = v.dot(n);
        let twist = spin.dot(n) * half_dt;
        Self { n, length, arm, v_n, v_t: n.mul_from(v_n, v), twist }
    }
}

/// Contacts of pairs that no bond joins, in two chunks that have `counts` of them, with their √m* in kg^½. Returns their
/// greatest overlap, in metres.
#[inline(always)]
pub(super) fn contacts<S: Wide>(
    simd: S,
    laws: &PairLaws,
    BatchLanes { counts, seen, root_mass: [mass_a, mass_b], memory: [one, two] }: &mut BatchLanes,
    [a, b]: &mut [Felt; 2],
) -> f32 {
    let mut deepest = F::splat(simd, 0.0);
    let (mut one, mut two) = (one.held(), two.held());
    let counts = F::splat_each(simd, counts.map(|count| count as f32));
    for part in 0..WIDTH / S::F32_LANES {
        let exists = F::load(simd, [&Lanes::PLACE; 2], part).lt(counts);
        let pairs = Pairs::new(simd, laws.dt, seen, part);
        let root_mass = F::load(simd, [mass_a, mass_b], part);
        let meets = Meets::new(simd, &laws.contact, laws.touch, BODY_CAP, laws.dt, root_mass);
        let (push, across, delta) = contact(simd, &meets, &pairs, exists, [&mut one, &mut two], part);
        deepest = deepest.max(delta);
        pairs.n.mul_from(push, across).store([&mut a.force, &mut b.force], part);
        pairs.arm.cross(across).store([&mut a.torque, &mut b.torque], part);
    }
    deepest.greatest()
}

/// Contacts of sub-particles of mass `root_mass`², in kilograms, with surfaces of one law, as [`Pairs::at_surfaces`] sees them.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "what a body has at hand")]
pub(super) fn surfaces<S: Wide>(
    simd: S,
    law: &LaneContact,
    laws: &PairLaws,
    root_mass: f32,
    counts: [usize; 2],
    seen: &[Seen; 2],
    [one, two]: &mut [Contacts; 2],
    [a, b]: &mut [Felt; 2],
) {
    let root_mass = F::splat(simd, root_mass);
    let meets = Meets::new(simd, law, 0.5 * laws.touch, SURFACE_CAP, laws.dt, root_mass);
    let counts = F::splat_each(simd, counts.map(|count| count as f32));
    let (mut one, mut two) = (one.held(), two.held());
    for part in 0..WIDTH / S::F32_LANES {
        let exists = F::load(simd, [&Lanes::PLACE; 2], part).lt(counts);
        let pairs = Pairs::at_surfaces(simd, laws.dt, seen, part);
        let (push, across, _) = contact(simd, &meets, &pairs, exists, [&mut one, &mut two], part);
        pairs.n.mul_from(push, across).store([&mut a.force, &mut b.force], part);
        pairs.arm.cross(across).store([&mut a.torque, &mut b.torque], part);
    }
}

/// Bonds of two chunks, and the contacts of the same pairs. Returns the greatest overlap of those whose bond has broken, in
/// metres.
#[inline(always)]
pub(super) fn bonds<S: Wide>(
    simd: S,
    laws: &PairLaws,
    root_mass: f32,
    seen: &[Seen; 2],
    [one, two]: &mut [Bonds<'_>; 2],
    [a, b]: &mut [Felt; 2],
) -> f32 {
    let zero = F::splat(simd, 0.0);
    let root_mass = F::splat(simd, root_mass);
    let joined = Meets::new(simd, &laws.contact, laws.touch, BONDED_CAP, laws.dt, root_mass);
    let parted = Meets::new(simd, &laws.contact, laws.touch, BODY_CAP, laws.dt, root_mass);
    let mut deepest = zero;
    let free = [one.exists & !*one.intact, two.exists & !*two.intact];
    let touch = if laws.contact_between_bonded { [one.exists, two.exists] } else { free };
    let any_touches = touch[0] | touch[1] != 0;
    let any_free = free[0] | free[1] != 0;
    for part in 0..WIDTH / S::F32_LANES {
        let pairs = Pairs::new(simd, laws.dt, seen, part);
        let (mut pull, mut across) = bond(simd, laws, &pairs, [one, two], part);
        if any_touches {
            let touches = Mask::of_bits(simd, touch, part);
            let mut meets = joined;
            if any_free {
                let free = Mask::of_bits(simd, free, part);
                meets.along = free.select(parted.along, joined.along);
                meets.across = free.select(parted.across, joined.across);
            }
            let contacts = [&mut one.contacts, &mut two.contacts];
            let (push, tangential, delta) = contact(simd, &meets, &pairs, touches, contacts, part);
            pull = pull - push;
            across += tangential;
            deepest = deepest.max(Mask::of_bits(simd, free, part).select(delta, zero));
        }
        pairs.n.mul_add(pull, across).store([&mut a.force, &mut b.force], part);
        pairs.arm.cross(across).store([&mut a.torque, &mut b.torque], part);
    }
    deepest.greatest()
}

/// [`crate::physics::bond::force`]: the pull along n, and the force across it. What breaks is no longer intact.
#[inline(always)]
fn bond<S: Wide>(
    simd: S,
    laws: &PairLaws,
    pairs: &Pairs<S>,
    [one, two]: [&mut Bonds<'_>; 2],
    part: usize,
) -> (F<S>, F3<S>) {
    let law = &laws.bond;
    let splat = |value| F::splat(simd, value);
    let Pairs { n, length, v_n, v_t, .. } = *pairs;
    let stored = F3::load(simd, [one.stored, two.stored], part);
    let (pull, shear, stored) = if law.model == BondModel::AsPublished {
        let rate = n.mul_add(splat(law.k_n) * v_n, v_t * splat(law.k_t));
        let stored = rate.mul_add(splat(laws.dt), stored);
        let pull = stored.dot(n);
        (pull, n.mul_from(pull, stored), stored)
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
    let bonded = Mask::of_bits(simd, [*one.intact, *two.intact], part);
    let acts = bonded.and_not(yields);
    acts.store([one.intact, two.intact], part);
    let none = F3::zero(simd);
    acts.select3(stored, none).store([one.stored, two.stored], part);
    (acts.select(pull, splat(0.0)), acts.select3(shear, none))
}

/// What contacts of one kind have in common.
#[derive(Clone, Copy)]
struct Meets<'a, S: Simd> {
    law: &'a LaneContact,
    /// Length at which they touch, in metres.
    touch: f32,
    dt: f32,
    /// √m*, in kg^½.
    root_mass: F<S>,
    /// The most that dashpots along n and across it can be, in kg/s.
    along: F<S>,
    across: F<S>,
}

impl<'a, S: Simd> Meets<'a, S> {
    #[inline(always)]
    fn new(simd: S, law: &'a LaneContact, touch: f32, cap: DampingCap, dt: f32, root_mass: F<S>) -> Self {
        let m_star = root_mass * root_mass;
        let along = m_star * F::splat(simd, cap.normal / dt);
        let across = m_star * F::splat(simd, cap.tangential / dt);
        Self { law, touch, dt, root_mass, along, across }
    }
}

/// [`crate::physics::contact::force`] on i: the push against n, the force across it, and the overlap where there is contact (else 0).
#[inline(always)]
fn contact<S: Wide>(
    simd: S,
    meets: &Meets<'_, S>,
    pairs: &Pairs<S>,
    touches: Mask<S>,
    [one, two]: [&mut Held<'_>; 2],
    part: usize,
) -> (F<S>, F3<S>, F<S>) {
    let LaneContact { law, damping_n, damping_t, snap } = meets.law;
    let splat = |value| F::splat(simd, value);
    let (zero, none) = (splat(0.0), F3::zero(simd));
    // Velocities here are those of j against i: what is felt on i has the opposite sign.
    let Pairs { v_n, v_t, .. } = *pairs;
    let delta = splat(meets.touch) - pairs.length;
    // From in_contact on, or from where it snaps if it has formed, which is before.
    let limit = Mask::of_bits(simd, [*one.held, *two.held], part).select(splat(*snap), zero);
    let holds = touches & limit.le(delta);
    holds.store([one.held, two.held], part);
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
    let damp = meets.root_mass * root_a;
    let eta_n = (splat(*damping_n) * damp).min(meets.along);
    let eta_t = (splat(*damping_t) * damp).min(meets.across);
    let total = eta_n.mul_from(v_n, elastic);
    // Friction, as in `physics::friction`; without area there is nothing to hold on to.
    let holds_on = zero.lt(a);
    let k_t = splat(8.0 * law.g_star) * a;
    let dashpot = v_t * eta_t;
    let old = F3::load(simd, [one.xi, two.xi], part);
    let mut xi = v_t.mul_from(splat(meets.dt), rotated_history(simd, pairs, old));
    let mut force = xi.mul_from(k_t, dashpot);
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
fn rotated_history<S: Simd>(simd: S, pairs: &Pairs<S>, v: F3<S>) -> F3<S> {
    let n = pairs.n;
    let splat = |value| F::splat(simd, value);
    let twisted = (n * pairs.twist).cross_add(v, v);
    let flat = n.mul_from(twisted.dot(n), twisted);
    let (before, after) = (v.dot(v), flat.dot(flat));
    // √(before / after) by its first terms: in a step a pair turns by next to nothing.
    let longer = (before - after) * after.roughly_inverse();
    let mut scale = longer.mul_add(splat(0.5), splat(1.0));
    let far = splat(MUCH_LONGER).lt(longer.abs());
    if far.any() {
        let least = splat(f32::MIN_POSITIVE);
        scale = far.select((before / after.max(least)).sqrt(), scale);
    }
    flat * after.le(splat(NO_LENGTH2)).select(splat(1.0), scale)
}
