//! The sub-particles of a body.
//!
//! Between steps they are stored element after element ([`BodyParticles`]), as the narrow phase reads them. While a body
//! moves they are transposed into blocks of [`WIDTH`] ([`ParticleBlock`]).

use std::ops::Range;

#[cfg(test)]
use glam::DVec3;
use glam::{IVec3, Vec3};
use pulp::cast;

use crate::cpu::fast::instructions::arrays::{
    Ints, Lanes, Lanes3, Quads, WIDTH, in_metres, octets, transposed_lane,
};
use crate::cpu::fast::instructions::prefetch;
use crate::cpu::fast::instructions::prefetch::{PARTS, part};
use crate::cpu::fast::instructions::set::LaneOps;
use crate::cpu::fast::instructions::transpose::ints;
#[cfg(test)]
use crate::engine::frame::Frame;
use crate::engine::state::{Particle, State};

/// [`WIDTH`] sub-particles, transposed.
#[derive(Clone, Debug)]
pub(crate) struct ParticleBlock {
    /// Fixed-point position.
    pub(crate) position: [Ints; 3],
    /// In m/s.
    pub(crate) velocity: Lanes3,
    /// In rad/s.
    pub(crate) spin: Lanes3,
    /// Fraction of a unit that positions have moved beyond integer units, in units.
    pub(crate) remainder: Lanes3,
}

impl ParticleBlock {
    pub(crate) const ZERO: Self = Self {
        position: [Ints([0; WIDTH]); 3],
        velocity: [Lanes::ZERO; 3],
        spin: [Lanes::ZERO; 3],
        remainder: [Lanes::ZERO; 3],
    };
}

/// The sub-particles of a body, in the order of [`slot_of`]. Only these arrays are stored: a step should read
/// and write little. Padding of the last block stays at the initial position of the last sub-particle.
#[derive(Clone, Debug)]
pub(crate) struct BodyParticles {
    pub(crate) count: usize,
    /// Fixed-point positions. The fourth number holds the bits of the remainder along x (see
    /// [`ParticleBlock::remainder`]).
    pub(crate) positions: Vec<[i32; 4]>,
    /// Velocity, remainder along y, spin, remainder along z: adjacent, since pairs read velocity and spin
    /// together.
    pub(crate) velocities: Vec<[f32; 8]>,
    /// Lanes of each block that move: neither clamped nor padding.
    pub(crate) moving: Vec<u16>,
    /// 1 for the sub-particles of the last block, 0 for its padding.
    pub(crate) last_block_mask: Lanes,
}

/// Position of padding in searches, in metres.
const FAR_AWAY: f32 = 1e9;

/// Slot of the `k`th sub-particle in [`BodyParticles`] and in sums. The function is its own inverse.
pub(crate) fn slot_of(k: u32) -> u32 {
    k / WIDTH as u32 * WIDTH as u32 + transposed_lane(k as usize % WIDTH) as u32
}

impl BodyParticles {
    /// A range of sub-particles of a state.
    pub(crate) fn of(state: &State, range: Range<usize>) -> Self {
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

    /// The `k`th sub-particle.
    #[inline(always)]
    pub(crate) fn particle(&self, k: usize) -> Particle {
        let slot = slot_of(k as u32) as usize;
        let [x, y, z, _] = self.positions[slot];
        let [u, v, w, _, p, q, r, _] = self.velocities[slot];
        Particle { position: IVec3::new(x, y, z), velocity: Vec3::new(u, v, w), spin: Vec3::new(p, q, r) }
    }

    /// Writes the sub-particles to a state.
    pub(crate) fn write_to(&self, particles: &mut [Particle], remainders: &mut [Vec3]) {
        for (k, (particle, remainder)) in particles.iter_mut().zip(remainders).enumerate() {
            *particle = self.particle(k);
            let slot = slot_of(k as u32) as usize;
            let ([.., x], [_, _, _, y, .., z]) = (self.positions[slot], self.velocities[slot]);
            *remainder = Vec3::new(f32::from_bits(x as u32), y, z);
        }
    }

    /// Prefetches the `k`th of [`PARTS`] parts.
    #[inline(always)]
    pub(crate) fn prefetch_part(&self, k: usize) {
        prefetch::to_l2(part(&self.positions, k, PARTS));
        prefetch::to_l2(part(&self.velocities, k, PARTS));
    }

    /// Number of blocks.
    pub(crate) fn blocks(&self) -> usize {
        self.moving.len()
    }

    /// Positions of a block, transposed, and the bits of the remainders along x.
    #[inline(always)]
    pub(crate) fn positions_of<S: LaneOps>(&self, simd: S, b: usize) -> [Ints; 4] {
        ints(simd, &Quads::of(&self.positions, b))
    }

    /// Positions of a block relative to `from` in metres, transposed. Padding is at [`FAR_AWAY`].
    #[inline(always)]
    pub(crate) fn in_metres<S: LaneOps>(&self, simd: S, b: usize, from: IVec3, unit_m: f32) -> Lanes3 {
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

    /// Low and high corner of the bounding box of a block. The fourth number is unused.
    #[inline(always)]
    pub(crate) fn corners(&self, b: usize) -> [[i32; 4]; 2] {
        let mut positions: [[i32; 4]; WIDTH] =
            self.positions[b * WIDTH..][..WIDTH].try_into().expect("a whole block");
        // Padding takes the position of the first sub-particle.
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
        // Every fourth number belongs to the same axis.
        for half in [8, 4] {
            for k in 0..half {
                low[k] = low[k].min(low[k + half]);
                high[k] = high[k].max(high[k + half]);
            }
        }
        let ([x, y, z, r, ..], [u, v, w, s, ..]) = (low, high);
        [[x, y, z, r], [u, v, w, s]]
    }

    /// Transposes all blocks.
    #[inline(always)]
    pub(crate) fn load_blocks<S: LaneOps>(&self, simd: S, blocks: &mut Vec<ParticleBlock>) {
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

    /// Stores a block after its motion.
    #[inline(always)]
    pub(crate) fn store_block<S: LaneOps>(&mut self, simd: S, b: usize, block: &ParticleBlock) {
        let [x, y, z] = &block.position;
        let [x, y, z] = [&Lanes(cast(x.0)), &Lanes(cast(y.0)), &Lanes(cast(z.0))];
        let [rx, ry, rz] = &block.remainder;
        let positions: [[i32; 4]; WIDTH] = cast(simd.to_quads([x, y, z, rx]).0);
        self.positions[b * WIDTH..][..WIDTH].copy_from_slice(&positions);
        let ([x, y, z], [p, q, r]) = (&block.velocity, &block.spin);
        let (velocities, spins) = (simd.to_quads([x, y, z, ry]), simd.to_quads([p, q, r, rz]));
        self.velocities[b * WIDTH..][..WIDTH].copy_from_slice(&simd.join_octets([&velocities, &spins]));
    }
}

/// Bodies of so many sub-particles at random positions in boxes of a size in metres about these centres.
#[cfg(test)]
pub(crate) fn random_bodies(frame: Frame, bodies: &[(usize, DVec3, f64)]) -> Vec<BodyParticles> {
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
