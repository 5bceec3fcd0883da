//! The sub-particles of a body, in blocks of [`WIDTH`] side by side, and once more one after the other for those that
//! pairs of bodies look at.

use std::ops::Range;

use glam::{DVec3, IVec3, Vec3};

use super::instructions::Wide;
use super::load::{LoadBlock, Sums};
use super::memory::{Ints, Lanes, Lanes3, WIDTH, folded, greater, quad_of};
use crate::cpu::integrate::{EDGE, Mover};
use crate::engine::frame::Frame;
use crate::engine::state::{Particle, State};

/// [`WIDTH`] sub-particles. Those that fill up the last block of a body stay where its last sub-particle began.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// Fixed-point position.
    pub(super) position: [Ints; 3],
    /// In m/s.
    pub(super) velocity: Lanes3,
    /// In rad/s.
    pub(super) spin: Lanes3,
    /// What positions have moved beyond whole units, in units.
    remainder: Lanes3,
    /// 1 where a sub-particle moves, 0 where it is held or only fills up.
    free: Lanes,
}

/// The sub-particles of a body.
#[derive(Clone, Debug)]
pub(super) struct Points {
    pub(super) count: usize,
    pub(super) blocks: Vec<Block>,
    /// Once more as others look at them, by [`place_of`]: positions, with a 0 at the end.
    pub(super) positions: Vec<[i32; 4]>,
    /// The same of velocities and spins.
    pub(super) motions: Vec<[[f32; 4]; 2]>,
    /// 1 where a lane of the last block is a sub-particle, 0 where it only fills up.
    real_in_last: Lanes,
}

/// How a body has moved since the run began. Since any moment, each of its sub-particles has moved by as much as `shift`,
/// to within what `path` has grown: a bound that follows the body.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Motion {
    /// Mean velocity before the step, in m/s; any would do, but none bounds better.
    velocity: Vec3,
    /// Its integral, in metres.
    pub(super) shift: DVec3,
    /// Integral of the greatest speed against it, in metres.
    pub(super) path: f64,
}

impl Motion {
    /// After a step of `dt` seconds in which none was faster against the mean than √`apart2` m/s; `mean` is the new one.
    #[inline(always)]
    fn go_on(&mut self, apart2: f32, mean: Vec3, dt: f64) {
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

/// 1 in every lane.
const ALL: Lanes = Lanes([1.0; WIDTH]);

/// Where a sub-particle stands among looks and sums, and which stands at a place.
pub(super) fn place_of(k: u32) -> u32 {
    k / WIDTH as u32 * WIDTH as u32 + quad_of(k as usize % WIDTH) as u32
}

impl Points {
    /// Some of the sub-particles of a state.
    pub(super) fn of(state: &State, range: Range<usize>) -> Self {
        let count = range.len();
        let first = range.start;
        let block = |b: usize| {
            let at = |lane: usize| first + (b * WIDTH + lane).min(count - 1);
            let real = |lane: usize| b * WIDTH + lane < count;
            let lanes = |value: &dyn Fn(usize) -> f32| Lanes(std::array::from_fn(value));
            let moving = |lane: usize, value: f32| if real(lane) { value } else { 0.0 };
            Block {
                position: [0, 1, 2]
                    .map(|axis| Ints(std::array::from_fn(|lane| state.particles[at(lane)].position[axis]))),
                velocity: [0, 1, 2]
                    .map(|axis| lanes(&|lane| moving(lane, state.particles[at(lane)].velocity[axis]))),
                spin: [0, 1, 2].map(|axis| lanes(&|lane| moving(lane, state.particles[at(lane)].spin[axis]))),
                remainder: [0, 1, 2].map(|axis| lanes(&|lane| state.remainders[at(lane)][axis])),
                free: lanes(&|lane| moving(lane, if state.held[at(lane)] { 0.0 } else { 1.0 })),
            }
        };
        let blocks: Vec<Block> = (0..count.div_ceil(WIDTH)).map(block).collect();
        let in_last = count - WIDTH * (blocks.len() - 1);
        let real_in_last = Lanes(std::array::from_fn(|lane| if lane < in_last { 1.0 } else { 0.0 }));
        let (positions, motions) =
            (vec![[0; 4]; blocks.len() * WIDTH], vec![[[0.0; 4]; 2]; blocks.len() * WIDTH]);
        let mut points = Self { count, blocks, positions, motions, real_in_last };
        for b in 0..points.blocks.len() {
            points.show(pulp::Scalar::new(), b);
        }
        points
    }

    /// One of them, as states have it.
    #[inline(always)]
    pub(super) fn particle(&self, k: usize) -> Particle {
        let (block, lane) = (&self.blocks[k / WIDTH], k % WIDTH);
        let vector = |of: &Lanes3| Vec3::new(of[0].0[lane], of[1].0[lane], of[2].0[lane]);
        let [x, y, z] = &block.position;
        Particle {
            position: IVec3::new(x.0[lane], y.0[lane], z.0[lane]),
            velocity: vector(&block.velocity),
            spin: vector(&block.spin),
        }
    }

    /// Brings a state up to date.
    pub(super) fn tell(&self, particles: &mut [Particle], remainders: &mut [Vec3]) {
        for (k, (particle, remainder)) in particles.iter_mut().zip(remainders).enumerate() {
            *particle = self.particle(k);
            let of = &self.blocks[k / WIDTH].remainder;
            *remainder = Vec3::from(of.each_ref().map(|lanes| lanes.0[k % WIDTH]));
        }
    }

    /// Writes down a block as others look at it.
    #[inline(always)]
    fn show<S: Wide>(&mut self, simd: S, b: usize) {
        let block = &self.blocks[b];
        let bits = |ints: &Ints| Lanes(ints.0.map(|x| f32::from_bits(x as u32)));
        let [x, y, z] = [bits(&block.position[0]), bits(&block.position[1]), bits(&block.position[2])];
        let quads = simd.to_quads([&x, &y, &z, &Lanes::ZERO]);
        for (position, quad) in self.positions[b * WIDTH..].iter_mut().zip(&quads.0) {
            *position = quad.map(|x| x.to_bits() as i32);
        }
        let ([x, y, z], [p, q, r]) = (&block.velocity, &block.spin);
        let velocities = simd.to_quads([x, y, z, &Lanes::ZERO]);
        let spins = simd.to_quads([p, q, r, &Lanes::ZERO]);
        let motions = self.motions[b * WIDTH..].iter_mut();
        for (motion, (velocity, spin)) in motions.zip(velocities.0.iter().zip(&spins.0)) {
            *motion = [*velocity, *spin];
        }
    }

    /// One step of all, of `mass` in kg each, by the loads that have been summed up; `motion` is that of them all.
    #[inline(always)]
    pub(super) fn advance<S: Wide>(
        &mut self,
        simd: S,
        mover: &Mover,
        frame: &Frame,
        mass: f32,
        motion: &mut Motion,
        sums: &mut Sums,
    ) -> Moved {
        let inverse_mass = 1.0 / mass;
        let dt = f64::from(mover.dt);
        let mut moved = Moved::default();
        let (mut total, mut most_apart2, mut fastest2) = (Vec3::ZERO, Lanes::ZERO, Lanes::ZERO);
        let blocks = self.blocks.len();
        for b in 0..blocks {
            let LoadBlock { force, torque } = sums.take_block(simd, b);
            let block = &mut self.blocks[b];
            let lost = block.advance(simd, mover, frame, inverse_mass, &force, &torque);
            if lost != [0; WIDTH] && moved.runaway.is_none() {
                let first = lost.iter().position(|&lost| lost != 0).expect("one is lost");
                moved.runaway = Some((b * WIDTH + first) as u32);
            }
            let real = if b + 1 < blocks { &ALL } else { &self.real_in_last };
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
                sum[axis] = folded(*v, |a, b| a + b);
            }
            for k in 0..WIDTH {
                fastest2.0[k] = greater(fastest2.0[k], square.0[k]);
                most_apart2.0[k] = greater(most_apart2.0[k], against.0[k] * real.0[k]);
            }
            total += sum;
            self.show(simd, b);
        }
        motion.go_on(folded(most_apart2.0, greater), total / self.count as f32, dt);
        moved.fastest = folded(fastest2.0, greater).sqrt();
        moved
    }
}

impl Block {
    /// One step, as [`Mover::step`] does it for one sub-particle. Not 0 for those that are too fast, not a number or lost.
    #[inline(always)]
    fn advance<S: Wide>(
        &mut self,
        simd: S,
        mover: &Mover,
        frame: &Frame,
        inverse_mass: f32,
        force: &Lanes3,
        torque: &Lanes3,
    ) -> [u32; WIDTH] {
        let Self { position, velocity, spin, remainder, free } = self;
        let turn = inverse_mass * mover.spin_factor * mover.dt;
        let mut speed2 = [0.0f32; WIDTH];
        let mut sound = [u32::MAX; WIDTH];
        for axis in 0..3 {
            let gravity = mover.gravity[axis];
            let (x, v, w) = (&mut position[axis].0, &mut velocity[axis].0, &mut spin[axis].0);
            let (r, f, t) = (&mut remainder[axis].0, &force[axis].0, &torque[axis].0);
            let (shift, push) = (mover.dt * mover.inverse_unit, mover.dt);
            // What does not move is multiplied by 0, not skipped.
            let mut moved = Lanes::ZERO;
            for k in 0..WIDTH {
                v[k] += (f[k] * inverse_mass + gravity) * push * free.0[k];
                w[k] += t[k] * turn * free.0[k];
                moved.0[k] = v[k] * shift * free.0[k] + r[k];
            }
            let whole = simd.whole(&moved);
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
                sound[k] &= u32::from(x.0[k].wrapping_abs() as u32 <= EDGE as u32);
            }
        }
        for k in 0..WIDTH {
            // Not `speed2 > limit2`: what is not a number is no speed either.
            sound[k] &= u32::from(speed2[k] <= mover.limit2);
        }
        sound.map(|sound| 1 - sound)
    }
}
