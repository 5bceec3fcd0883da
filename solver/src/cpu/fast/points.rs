//! The sub-particles of a body: one after the other, as pairs of bodies pair_offsets at them, and while they move in blocks of [`WIDTH`]
//! side by side.

use std::ops::Range;

use glam::{DVec3, IVec3, Vec3};
use pulp::cast;

use super::instructions::LaneOps;
use super::load::{LoadBlock, LoadSums, ints};
use super::memory::{Ints, Lanes, Lanes3, Quads, WIDTH, in_metres, larger, octets, reduced, transposed_lane};
use super::prefetch::{self, PARTS, part};
use crate::cpu::integrate::{DOMAIN_LIMIT, Integrator};
use crate::engine::frame::Frame;
use crate::engine::state::{Particle, State};

/// [`WIDTH`] sub-particles side by side.
#[derive(Clone, Debug)]
pub(super) struct ParticleBlock {
    /// Fixed-point position.
    pub(super) position: [Ints; 3],
    /// In m/s.
    pub(super) velocity: Lanes3,
    /// In rad/s.
    pub(super) spin: Lanes3,
    /// What positions have moved beyond whole units, in units.
    remainder: Lanes3,
}

/// The sub-particles of a body, in the order of [`slot_of`]. This is all that is kept of them, since what a step reads and writes
/// should be short. Those that fill up the last block stay where the last sub-particle began.
#[derive(Clone, Debug)]
pub(super) struct BodyParticles {
    pub(super) count: usize,
    /// Fixed-point positions; the fourth number has the bits of the remainder along x (see [`ParticleBlock::remainder`]).
    pub(super) positions: Vec<[i32; 4]>,
    /// Velocities, the remainder along y, spins, the remainder along z: side by side, since pairs pair_offsets for both.
    pub(super) velocities: Vec<[f32; 8]>,
    /// Lanes of each block that move: neither held nor only there to fill up.
    moving: Vec<u16>,
    /// 1 where a lane of the last block is a sub-particle, 0 where it only fills up.
    last_block_mask: Lanes,
}

/// How a body has moved since the run began. Since any moment, each of its sub-particles has moved by as much as `shift`,
/// to within what `path` has grown: a bound that follows the body.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BodyMotion {
    /// Mean velocity before the step, in m/s; any would do, but none bounds better.
    velocity: Vec3,
    /// Its integral, in metres.
    pub(super) shift: DVec3,
    /// Integral of the greatest speed against it, in metres.
    pub(super) path: f64,
}

impl BodyMotion {
    /// How far any of the body's sub-particles has moved since then at most, in metres.
    #[inline(always)]
    pub(super) fn since(&self, then: &Self) -> f64 {
        self.shift.distance(then.shift) + (self.path - then.path)
    }

    /// After a step of `dt` seconds in which none was faster against the mean than √`apart2` m/s; `mean` is the new one.
    #[inline(always)]
    fn advance(&mut self, apart2: f32, mean: Vec3, dt: f64) {
        self.shift += self.velocity.as_dvec3() * dt;
        self.path += f64::from(apart2.sqrt()) * dt;
        self.velocity = mean;
    }
}

/// What moving them has shown.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moved {
    /// The greatest speed, in m/s.
    pub(super) fastest: f32,
    /// The first that is too fast, not a number or lost.
    pub(super) runaway: Option<u32>,
}

/// Where there is no sub-particle, in metres.
const FAR_AWAY: f32 = 1e9;

/// 1 in every lane.
const ALL: Lanes = Lanes([1.0; WIDTH]);

/// Where a sub-particle stands in [`BodyParticles`] and in sums, and which stands at a slot.
pub(super) fn slot_of(k: u32) -> u32 {
    k / WIDTH as u32 * WIDTH as u32 + transposed_lane(k as usize % WIDTH) as u32
}

impl BodyParticles {
    /// Some of the sub-particles of a state.
    pub(super) fn of(state: &State, range: Range<usize>) -> Self {
        let (count, first) = (range.len(), range.start);
        let blocks = count.div_ceil(WIDTH);
        let in_last = count - WIDTH * (blocks - 1);
        let last_block_mask = Lanes(std::array::from_fn(|lane| if lane < in_last { 1.0 } else { 0.0 }));
        let mut points = Self {
            count,
            positions: vec![[0; 4]; blocks * WIDTH],
            velocities: vec![[0.0; 8]; blocks * WIDTH],
            moving: vec![0; blocks],
            last_block_mask,
        };
        for k in 0..blocks * WIDTH {
            let from = first + k.min(count - 1);
            let slot = slot_of(k as u32) as usize;
            let (Particle { position, velocity, spin }, remainder) =
                (state.particles[from], state.remainders[from]);
            points.positions[slot] = position.extend(remainder.x.to_bits() as i32).to_array();
            let is_real = k < count;
            let moving = |value: Vec3| if is_real { value } else { Vec3::ZERO };
            let ([u, v, w], [p, q, r]) = (moving(velocity).to_array(), moving(spin).to_array());
            points.velocities[slot] = [u, v, w, remainder.y, p, q, r, remainder.z];
            points.moving[k / WIDTH] |= u16::from(is_real && !state.held[from]) << (k % WIDTH);
        }
        points
    }

    /// One of them, as states have it.
    #[inline(always)]
    pub(super) fn particle(&self, k: usize) -> Particle {
        let slot = slot_of(k as u32) as usize;
        let [x, y, z, _] = self.positions[slot];
        let [u, v, w, _, p, q, r, _] = self.velocities[slot];
        Particle { position: IVec3::new(x, y, z), velocity: Vec3::new(u, v, w), spin: Vec3::new(p, q, r) }
    }

    /// Brings a state up to date.
    pub(super) fn write_to(&self, particles: &mut [Particle], remainders: &mut [Vec3]) {
        for (k, (particle, remainder)) in particles.iter_mut().zip(remainders).enumerate() {
            *particle = self.particle(k);
            let slot = slot_of(k as u32) as usize;
            let ([.., x], [_, _, _, y, .., z]) = (self.positions[slot], self.velocities[slot]);
            *remainder = Vec3::new(f32::from_bits(x as u32), y, z);
        }
    }

    /// Fetches the `k`th of [`PARTS`] parts from memory.
    #[inline(always)]
    pub(super) fn prefetch_part(&self, k: usize) {
        prefetch::to_l2(part(&self.positions, k, PARTS));
        prefetch::to_l2(part(&self.velocities, k, PARTS));
    }

    /// The number of blocks.
    pub(super) fn blocks(&self) -> usize {
        self.moving.len()
    }

    /// Positions of a block, side by side; and the bits of remainders along x.
    #[inline(always)]
    pub(super) fn positions_of<S: LaneOps>(&self, simd: S, b: usize) -> [Ints; 4] {
        ints(simd, &Quads::of(&self.positions, b))
    }

    /// Positions of a block in metres from one, side by side; as_range that only fill up are [`FAR_AWAY`].
    #[inline(always)]
    pub(super) fn in_metres<S: LaneOps>(&self, simd: S, b: usize, from: IVec3, unit_m: f32) -> Lanes3 {
        let [x, y, z, _] = self.positions_of(simd, b);
        let mut metres = in_metres(&[x, y, z], from, unit_m);
        let count = self.count - b * WIDTH;
        if count < WIDTH {
            for axis in &mut metres {
                axis.0[count..].fill(FAR_AWAY);
            }
        }
        metres
    }

    /// The lowest and the highest corner of the box around a block; their fourth numbers mean nothing.
    #[inline(always)]
    pub(super) fn corners(&self, b: usize) -> [[i32; 4]; 2] {
        let mut positions: [[i32; 4]; WIDTH] =
            self.positions[b * WIDTH..][..WIDTH].try_into().expect("a whole block");
        // Those that only fill up become as the first.
        for k in (self.count - b * WIDTH).min(WIDTH)..WIDTH {
            positions[transposed_lane(k)] = positions[0];
        }
        let rows: [[i32; WIDTH]; 4] = cast(positions);
        let [mut low, mut high] = [rows[0]; 2];
        for row in &rows[1..] {
            for k in 0..WIDTH {
                low[k] = low[k].min(row[k]);
                high[k] = high[k].max(row[k]);
            }
        }
        // Every fourth number is along one axis.
        for half in [8, 4] {
            for k in 0..half {
                low[k] = low[k].min(low[k + half]);
                high[k] = high[k].max(high[k + half]);
            }
        }
        let ([x, y, z, r, ..], [u, v, w, s, ..]) = (low, high);
        [[x, y, z, r], [u, v, w, s]]
    }

    /// Writes all blocks down side by side.
    #[inline(always)]
    pub(super) fn load_blocks<S: LaneOps>(&self, simd: S, blocks: &mut Vec<ParticleBlock>) {
        blocks.resize(self.blocks(), ParticleBlock::ZERO);
        for (b, block) in blocks.iter_mut().enumerate() {
            let [x, y, z, rx] = self.positions_of(simd, b);
            let [velocities, spins] = simd.split_octets(octets(&self.velocities, b));
            let [u, v, w, ry] = simd.to_lanes(&velocities);
            let [p, q, r, rz] = simd.to_lanes(&spins);
            let rx = Lanes(cast(rx.0));
            *block = ParticleBlock {
                position: [x, y, z],
                velocity: [u, v, w],
                spin: [p, q, r],
                remainder: [rx, ry, rz],
            };
        }
    }

    /// Takes a block back as it is now.
    #[inline(always)]
    fn store_block<S: LaneOps>(&mut self, simd: S, b: usize, block: &ParticleBlock) {
        let [x, y, z] = &block.position;
        let [x, y, z] = [&Lanes(cast(x.0)), &Lanes(cast(y.0)), &Lanes(cast(z.0))];
        let [rx, ry, rz] = &block.remainder;
        let positions: [[i32; 4]; WIDTH] = cast(simd.to_quads([x, y, z, rx]).0);
        self.positions[b * WIDTH..][..WIDTH].copy_from_slice(&positions);
        let ([x, y, z], [p, q, r]) = (&block.velocity, &block.spin);
        let (velocities, spins) = (simd.to_quads([x, y, z, ry]), simd.to_quads([p, q, r, rz]));
        self.velocities[b * WIDTH..][..WIDTH].copy_from_slice(&simd.join_octets([&velocities, &spins]));
    }

    /// One step of all, which stand in `blocks`, of `mass` in kg each, by the loads that have been summed up; `motion` is that of them all.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "what a body has at hand")]
    pub(super) fn advance<S: LaneOps>(
        &mut self,
        simd: S,
        integrator: &Integrator,
        frame: &Frame,
        mass: f32,
        motion: &mut BodyMotion,
        blocks: &mut [ParticleBlock],
        sums: &LoadSums,
    ) -> Moved {
        let inverse_mass = 1.0 / mass;
        let dt = f64::from(integrator.dt);
        let mut moved = Moved::default();
        let (mut total, mut most_apart2, mut fastest2) = (Vec3::ZERO, Lanes::ZERO, Lanes::ZERO);
        let count = blocks.len();
        for (b, block) in blocks.iter_mut().enumerate() {
            let LoadBlock { force, torque } = sums.of_block(simd, b);
            let free = simd.splat_masked(1.0, self.moving[b]);
            let lost = block.advance(simd, integrator, frame, inverse_mass, &free, &force, &torque);
            if lost != [0; WIDTH] && moved.runaway.is_none() {
                let first = lost.iter().position(|&lost| lost != 0).expect("one is lost");
                moved.runaway = Some((b * WIDTH + first) as u32);
            }
            let real = if b + 1 < count { &ALL } else { &self.last_block_mask };
            let (mut square, mut against) = (Lanes::ZERO, Lanes::ZERO);
            let mut sum = Vec3::ZERO;
            for axis in 0..3 {
                let v = &block.velocity[axis].0;
                let mean = motion.velocity[axis];
                for k in 0..WIDTH {
                    square.0[k] += v[k] * v[k];
                }
                for k in 0..WIDTH {
                    against.0[k] += (v[k] - mean) * (v[k] - mean);
                }
                // What only fills up stands still.
                sum[axis] = reduced(*v, |a, b| a + b);
            }
            for k in 0..WIDTH {
                fastest2.0[k] = larger(fastest2.0[k], square.0[k]);
                most_apart2.0[k] = larger(most_apart2.0[k], against.0[k] * real.0[k]);
            }
            total += sum;
            self.store_block(simd, b, block);
        }
        motion.advance(reduced(most_apart2.0, larger), total / self.count as f32, dt);
        moved.fastest = reduced(fastest2.0, larger).sqrt();
        moved
    }
}

impl ParticleBlock {
    const ZERO: Self = Self {
        position: [Ints([0; WIDTH]); 3],
        velocity: [Lanes::ZERO; 3],
        spin: [Lanes::ZERO; 3],
        remainder: [Lanes::ZERO; 3],
    };

    /// One step, as [`Integrator::step`] does it for one sub-particle; `free` is 1 where one moves, else 0. Not 0 for as_range that are too
    /// fast, not a number or lost.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "what a body has at hand")]
    fn advance<S: LaneOps>(
        &mut self,
        simd: S,
        integrator: &Integrator,
        frame: &Frame,
        inverse_mass: f32,
        free: &Lanes,
        force: &Lanes3,
        torque: &Lanes3,
    ) -> [u32; WIDTH] {
        let Self { position, velocity, spin, remainder } = self;
        let turn = inverse_mass * integrator.spin_factor * integrator.dt;
        let mut speed2 = [0.0f32; WIDTH];
        let mut sound = [u32::MAX; WIDTH];
        for axis in 0..3 {
            let gravity = integrator.gravity[axis];
            let (x, v, w) = (&mut position[axis].0, &mut velocity[axis].0, &mut spin[axis].0);
            let (r, f, t) = (&mut remainder[axis].0, &force[axis].0, &torque[axis].0);
            let (shift, push) = (integrator.dt * integrator.inverse_unit, integrator.dt);
            // What does not move is multiplied by 0, not skipped.
            let mut moved = Lanes::ZERO;
            for k in 0..WIDTH {
                v[k] += (f[k] * inverse_mass + gravity) * push * free.0[k];
                w[k] += t[k] * turn * free.0[k];
                moved.0[k] = v[k] * shift * free.0[k] + r[k];
            }
            let whole = simd.round_to_int(&moved);
            for k in 0..WIDTH {
                r[k] = moved.0[k] - whole.0[k] as f32;
                x[k] = x[k].wrapping_add(whole.0[k]);
                speed2[k] += v[k] * v[k];
                sound[k] &= u32::from(w[k].abs() <= f32::MAX);
            }
        }
        if frame.period_y != 0 {
            for y in &mut position[1].0 {
                *y = frame.wrap(IVec3::new(0, *y, 0)).y;
            }
        }
        for x in &*position {
            for k in 0..WIDTH {
                sound[k] &= u32::from(x.0[k].wrapping_abs() as u32 <= DOMAIN_LIMIT as u32);
            }
        }
        for k in 0..WIDTH {
            // Not `speed2 > limit2`: what is not a number is no speed either.
            sound[k] &= u32::from(speed2[k] <= integrator.limit2);
        }
        sound.map(|sound| 1 - sound)
    }
}

/// Bodies of so many points at random in a box of so many metres, around these middles.
#[cfg(test)]
pub(super) fn random_bodies(frame: Frame, bodies: &[(usize, DVec3, f64)]) -> Vec<BodyParticles> {
    let mut random = fastrand::Rng::with_seed(1);
    let mut particles = Vec::new();
    for &(count, middle, size) in bodies {
        particles.extend((0..count).map(|_| {
            let x = DVec3::from([(); 3].map(|()| random.f64() - 0.5)) * size + middle;
            let position = frame.wrap((x / f64::from(frame.unit_m)).as_ivec3());
            Particle { position, velocity: Vec3::ZERO, spin: Vec3::ZERO }
        }));
    }
    let count = particles.len();
    let state = State {
        frame,
        radius_m: 0.004,
        remainders: vec![Vec3::ZERO; count],
        masses: vec![1.0; count],
        bodies: vec![0; count],
        serials: (0..count as u32).collect(),
        held: vec![false; count],
        broken: vec![0; count],
        bonds_at_start: 0,
        bonds_broken: 0,
        particles,
    };
    let mut from = 0;
    let of = |&(count, ..): &(usize, DVec3, f64)| {
        from += count;
        BodyParticles::of(&state, from - count..from)
    };
    bodies.iter().map(of).collect()
}
