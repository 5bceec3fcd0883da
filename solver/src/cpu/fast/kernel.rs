//! The forces of pairs, in lanes: what [`crate::physics::bond`] and [`crate::physics::contact`] say of one pair, of
//! many at once. Branches become selections and divisions by lengths become products; the tests beside this file hold
//! every term to the physics within a few units in the last place.

use pulp::Simd;

use super::lanes::{F, F3, Lanes, Lanes3, Mask, WIDTH};
use crate::physics::bond::{BondLaw, Form, STRETCH_CLAMP};
use crate::physics::contact::ContactLaw;
use crate::physics::jkr::{CURVATURE, D_SNAP, JkrScale, X_SNAP};

/// Squared lengths below this have no direction, as in [`crate::physics::friction::turn_into_plane`].
const NO_LENGTH2: f32 = 1e-30;

/// A law of contact, with what can be worked out beforehand.
#[derive(Clone, Copy, Debug)]
pub(super) struct LaneContact {
    law: ContactLaw,
    /// η / √(m* a), normal and tangential.
    damping_n: f32,
    damping_t: f32,
    /// Overlap down to which a contact that has formed holds, in metres.
    snap: f32,
}

/// All laws of pairs of a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct PairLaws {
    pub(super) contact: LaneContact,
    pub(super) bond: BondLaw,
    pub(super) contact_between_bonded: bool,
    /// 2R, in metres.
    pub(super) touch: f32,
    pub(super) dt: f32,
}

impl LaneContact {
    pub(super) fn new(law: ContactLaw) -> Self {
        Self {
            law,
            damping_n: law.damping * (2.0 * law.e_star).sqrt(),
            damping_t: law.damping * (8.0 * law.g_star).sqrt(),
            snap: law.jkr.map_or(0.0, |scale| scale.snap_overlap),
        }
    }
}

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

/// What [`WIDTH`] contacts remember.
#[derive(Clone, Debug)]
pub(super) struct Contacts {
    /// Overlap from which the contact acts: 0, or where it snaps if it has formed; in metres.
    pub(super) limit: Lanes,
    /// ξ, in metres.
    pub(super) slide: Lanes3,
}

/// What [`WIDTH`] bonds of one class remember.
#[derive(Clone, Debug)]
pub(super) struct Bonds {
    /// Length at which they pull nothing, in metres.
    pub(super) rest: f32,
    /// Length beyond which each breaks, in metres; 0 once it has.
    pub(super) break_length: Lanes,
    /// Stored force, in newton.
    pub(super) stored: Lanes3,
    pub(super) contacts: Contacts,
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
        Self { limit: Lanes::ZERO, slide: [Lanes::ZERO; 3] }
    }
}

/// A registerful of pairs.
struct Pairs<S: Simd> {
    n: F3<S>,
    length: F<S>,
    arm: F3<S>,
    /// Of j against i where they meet.
    v: F3<S>,
    spin: F3<S>,
}

impl<S: Simd> Pairs<S> {
    #[inline(always)]
    fn new(simd: S, seen: &Seen, part: usize) -> Self {
        let d = F3::load(simd, &seen.apart, part);
        let length = d.dot(d).sqrt();
        // Two centres on one spot have no direction: d is zero then, and so is n.
        let n = d * (F::splat(simd, 1.0) / length.max(F::splat(simd, 1e-30)));
        let arm = n * (length * F::splat(simd, 0.5));
        let spin = F3::load(simd, &seen.spin, part);
        let v = F3::load(simd, &seen.velocity, part) - spin.cross(arm);
        Self { n, length, arm, v, spin }
    }
}

/// Contacts of pairs that no bond joins; `count` of them exist, all of √m* = `root_mass` in kg^½. Returns their greatest overlap, in metres.
#[inline(always)]
pub(super) fn contacts<S: Simd>(
    simd: S,
    laws: &PairLaws,
    root_mass: f32,
    count: usize,
    seen: &Seen,
    memory: &mut Contacts,
    felt: &mut Felt,
) -> f32 {
    let mut deepest = F::splat(simd, 0.0);
    for part in 0..WIDTH / S::F32_LANES {
        let exists = F::load(simd, &Lanes::COUNT, part).lt(F::splat(simd, count as f32));
        let pairs = Pairs::new(simd, seen, part);
        let (normal, across, delta) = contact(simd, laws, root_mass, &pairs, exists, memory, part);
        deepest = deepest.max(delta);
        (normal + across).store(&mut felt.force, part);
        pairs.arm.cross(across).store(&mut felt.torque, part);
    }
    deepest.greatest()
}

/// Bonds, and the contacts of the same pairs. Returns the greatest overlap of those whose bond has broken, in metres,
/// and whether any bond broke in this step.
#[inline(always)]
pub(super) fn bonds<S: Simd>(
    simd: S,
    laws: &PairLaws,
    root_mass: f32,
    count: usize,
    seen: &Seen,
    memory: &mut Bonds,
    felt: &mut Felt,
) -> (f32, bool) {
    let zero = F::splat(simd, 0.0);
    let (mut deepest, mut broke) = (zero, false);
    for part in 0..WIDTH / S::F32_LANES {
        let exists = F::load(simd, &Lanes::COUNT, part).lt(F::splat(simd, count as f32));
        let pairs = Pairs::new(simd, seen, part);
        let limit = F::load(simd, &memory.break_length, part);
        let bonded = exists & zero.lt(limit);
        let (mut force, mut across, breaks) = bond(simd, laws, &pairs, bonded, limit, memory, part);
        if breaks.any() {
            broke = true;
            breaks.select(zero, limit).store(&mut memory.break_length, part);
        }
        let free = exists & limit.le(zero);
        let touches = if laws.contact_between_bonded { exists } else { free };
        if laws.contact_between_bonded || free.any() {
            let (normal, tangential, delta) =
                contact(simd, laws, root_mass, &pairs, touches, &mut memory.contacts, part);
            force += normal + tangential;
            across += tangential;
            deepest = deepest.max(free.select(delta, zero));
        }
        force.store(&mut felt.force, part);
        pairs.arm.cross(across).store(&mut felt.torque, part);
    }
    (deepest.greatest(), broke)
}

/// [`crate::physics::bond::force`]: the whole force, the part across, and which bonds break.
#[inline(always)]
fn bond<S: Simd>(
    simd: S,
    laws: &PairLaws,
    pairs: &Pairs<S>,
    bonded: Mask<S>,
    break_length: F<S>,
    memory: &mut Bonds,
    part: usize,
) -> (F3<S>, F3<S>, Mask<S>) {
    let law = &laws.bond;
    let splat = |value| F::splat(simd, value);
    let Pairs { n, length, v, .. } = *pairs;
    let stored = F3::load(simd, &memory.stored, part);
    let v_n = v.dot(n);
    let v_t = v - n * v_n;
    let (pull, shear, total, stored) = if law.form == Form::AsPublished {
        let stored = stored + (n * (splat(law.k_n) * v_n) + v_t * splat(law.k_t)) * splat(laws.dt);
        let pull = stored.dot(n);
        (pull, stored - n * pull, stored, stored)
    } else {
        // Twisting restores the length it had, and so does turning: once, at the end, will do.
        let twist = pairs.spin.dot(n) * splat(0.5 * laws.dt);
        let twisted = stored + n.cross(stored) * twist;
        let turned = in_plane(simd, twisted, n, stored.dot(stored));
        let shear = turned + v_t * splat(law.k_t * laws.dt);
        let e = length - splat(memory.rest);
        let pull = splat(law.k_n) * e;
        let pull = if law.form == Form::FiniteExtension {
            let share = (e * splat(1.0 / (law.break_length - memory.rest))).min(splat(STRETCH_CLAMP));
            let share = share.max(splat(0.0));
            pull / (splat(1.0) - share * share)
        } else {
            pull
        };
        (pull, shear, n * pull + shear, shear)
    };
    let yields = splat(law.normal_strength).lt(pull)
        | splat(law.shear_strength * law.shear_strength).lt(shear.dot(shear));
    let breaks = bonded & (break_length.lt(length) | yields);
    let (zero, none) = (splat(0.0), F3::zero(simd));
    let acts = zero.lt(breaks.select(zero, bonded.select(splat(1.0), zero)));
    acts.select3(stored, none).store(&mut memory.stored, part);
    (acts.select3(total, none), acts.select3(shear, none), breaks)
}

/// [`crate::physics::contact::force`] on i: along n, across it, and the overlap where there is contact (else 0).
#[inline(always)]
fn contact<S: Simd>(
    simd: S,
    laws: &PairLaws,
    root_mass: f32,
    pairs: &Pairs<S>,
    touches: Mask<S>,
    memory: &mut Contacts,
    part: usize,
) -> (F3<S>, F3<S>, F<S>) {
    let LaneContact { law, damping_n, damping_t, snap } = &laws.contact;
    let splat = |value| F::splat(simd, value);
    let (zero, none) = (splat(0.0), F3::zero(simd));
    let n = pairs.n;
    let delta = splat(laws.touch) - pairs.length;
    let holds = touches & F::load(simd, &memory.limit, part).le(delta);
    holds.select(splat(*snap), zero).store(&mut memory.limit, part);
    if !holds.any() {
        none.store(&mut memory.slide, part);
        return (none, none, zero);
    }
    let (elastic, a, root_a) = match &law.jkr {
        Some(scale) => jkr(simd, scale, delta),
        None => {
            let a = (splat(law.r_star) * delta.max(zero)).sqrt();
            (splat(4.0 / 3.0 * law.e_star) * a * delta, a, a.sqrt())
        }
    };
    let damp = splat(root_mass) * root_a;
    let v = -pairs.v;
    let v_n = v.dot(n);
    let v_t = v - n * v_n;
    let total = elastic + splat(*damping_n) * damp * v_n;
    // Friction, as in `physics::friction`; without area there is nothing to hold on to.
    let holds_on = holds & zero.lt(a);
    let k_t = splat(8.0 * law.g_star) * a;
    let dashpot = v_t * (splat(*damping_t) * damp);
    let old = F3::load(simd, &memory.slide, part);
    let slide = in_plane(simd, old, n, old.dot(old)) + v_t * splat(laws.dt);
    let trial = -(slide * k_t) - dashpot;
    let cap = splat(law.mu) * total.max(zero);
    let size2 = trial.dot(trial);
    let sticks = size2.le(cap * cap);
    let capped = trial * (cap / size2.max(splat(1e-37)).sqrt());
    let slipped = -(capped + dashpot) * (splat(1.0) / k_t);
    let slide = sticks.select3(slide, slipped);
    let tangential = sticks.select3(trial, capped);
    holds_on.select3(slide, none).store(&mut memory.slide, part);
    (holds.select3(-(n * total), none), holds_on.select3(tangential, none), holds.select(delta, zero))
}

/// Takes the part along `n` out of `v` and makes its squared length `length2`.
#[inline(always)]
fn in_plane<S: Simd>(simd: S, v: F3<S>, n: F3<S>, length2: F<S>) -> F3<S> {
    let floor = F::splat(simd, NO_LENGTH2);
    let flat = v - n * v.dot(n);
    let after = flat.dot(flat);
    let scale = (length2 / after.max(floor)).sqrt();
    flat * after.le(floor).select(F::splat(simd, 1.0), scale)
}

/// [`crate::physics::jkr::force`]: force, a and √a. Below the snap it gives what it gives there.
#[inline(always)]
fn jkr<S: Simd>(simd: S, scale: &JkrScale, delta: F<S>) -> (F<S>, F<S>, F<S>) {
    let splat = |value| F::splat(simd, value);
    let x = root(simd, delta * splat(scale.inverse_overlap));
    let x2 = x * x;
    let x3 = x2 * x;
    let force = splat(scale.force) * x3 * (splat(4.0 / 3.0) * x3 - splat(2.0));
    (force, splat(scale.area) * x2, splat(scale.area.sqrt()) * x)
}

/// [`crate::physics::jkr::root`].
#[inline(always)]
fn root<S: Simd>(simd: S, d: F<S>) -> F<S> {
    let splat = |value| F::splat(simd, value);
    let above = (d - splat(D_SNAP)).max(splat(0.0));
    let from_snap = splat(X_SNAP) + (above * splat(1.0 / CURVATURE)).sqrt();
    let mut x = from_snap.min((d + from_snap).max(splat(0.0)).sqrt().sqrt());
    for _ in 0..3 {
        let x3 = x * x * x;
        let slope = (splat(4.0) * x3 - splat(1.0)).max(splat(1e-6));
        x = (x - (x * x3 - x - d) / slope).max(splat(X_SNAP));
    }
    x
}
