//! Twin of `cpu/integrate.rs` and `physics/integrate.rs`: the leapfrog step of a body, in lanes.

use glam::{IVec3, Vec3};

use crate::cpu::fast::instructions::arrays::{Lanes, Lanes3, WIDTH, larger, reduced};
use crate::cpu::fast::instructions::set::LaneOps;
use crate::cpu::fast::storage::loads::{LoadBlock, LoadSums};
use crate::cpu::fast::storage::motion::BodyMotion;
use crate::cpu::fast::storage::particles::{BodyParticles, ParticleBlock};
use crate::cpu::integrate::Integrator;
use crate::engine::frame::{DOMAIN_LIMIT, Frame};

/// Extremes of the motion of a body.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MotionExtremes {
    /// Maximum speed, in m/s.
    pub(crate) max_speed: f32,
    /// First sub-particle that is too fast, not finite or lost.
    pub(crate) runaway: Option<u32>,
}

/// 1 in every lane.
const ALL: Lanes = Lanes([1.0; WIDTH]);

impl BodyParticles {
    /// Advances all sub-particles, in `blocks`, of `mass` in kg each, by the summed loads. Updates `motion`.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "the data of a body and its scratch memory")]
    pub(crate) fn advance<S: LaneOps>(
        &mut self,
        simd: S,
        integrator: &Integrator,
        frame: &Frame,
        mass: f32,
        motion: &mut BodyMotion,
        blocks: &mut [ParticleBlock],
        sums: &LoadSums,
    ) -> MotionExtremes {
        let inverse_mass = 1.0 / mass;
        let dt = f64::from(integrator.dt);
        let mut extremes = MotionExtremes::default();
        let (mut total, mut max_relative2, mut max_speed2) = (Vec3::ZERO, Lanes::ZERO, Lanes::ZERO);
        let count = blocks.len();
        for (b, block) in blocks.iter_mut().enumerate() {
            let LoadBlock { force, torque } = sums.of_block(simd, b);
            let free = simd.splat_masked(1.0, self.moving[b]);
            let lost = block.advance(simd, integrator, frame, inverse_mass, &free, &force, &torque);
            if lost != [0; WIDTH] && extremes.runaway.is_none() {
                let first = lost.iter().position(|&lost| lost != 0).expect("one is lost");
                extremes.runaway = Some((b * WIDTH + first) as u32);
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
                // Padding has no velocity.
                sum[axis] = reduced(*v, |a, b| a + b);
            }
            for k in 0..WIDTH {
                max_speed2.0[k] = larger(max_speed2.0[k], square.0[k]);
                max_relative2.0[k] = larger(max_relative2.0[k], against.0[k] * real.0[k]);
            }
            total += sum;
            self.store_block(simd, b, block);
        }
        motion.advance(reduced(max_relative2.0, larger), total / self.count as f32, dt);
        extremes.max_speed = reduced(max_speed2.0, larger).sqrt();
        extremes
    }
}

impl ParticleBlock {
    /// One step, as in [`Integrator::step`]. `free` is 1 for lanes that move, else 0. Returns a non-zero
    /// number for lanes that are too fast, not finite or lost.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "the data of a body and its scratch memory")]
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
            // Lanes that do not move are multiplied by 0 instead of skipped.
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
            // The negated comparison would accept NaN.
            sound[k] &= u32::from(speed2[k] <= integrator.limit2);
        }
        sound.map(|sound| 1 - sound)
    }
}
