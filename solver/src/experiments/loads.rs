//! Loads on surfaces over time: force and torque on each, and the power of moving surfaces.
//!
//! The power of a surface is the work that its material does on the sub-particles, per time: −(F·v + T·ω), with the
//! force F and the torque T on the surface, the velocity v of its material at the pivot, and its angular velocity ω. For
//! a belt this is the friction times the belt speed.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::SeriesRow;
use super::outputs::series;
use crate::engine::SurfaceLoad;
use crate::equipment::{Motion, Surface};
use crate::observe::{Clock, Recorder, SeriesId};
use crate::scenario::Numerics;

/// Maximum count of numbers in the series of forces and torques: half of the limit of a server for a result.
const MAX_NUMBERS: f64 = 4e5;

#[rustfmt::skip]
pub(super) const LOADS: [SeriesRow; 6] = [
    series("force_<name>_x", "N",
        "Force of the bodies on the surface `<name>`, along x, at the time of the sample. The name of the surface replaces `<name>`. For \
         example, the force is the weight of bodies on the surface, or the friction of bodies on a belt."),
    series("force_<name>_y", "N", "Force of the bodies on the surface `<name>`, along y, at the time of the sample."),
    series("force_<name>_z", "N", "Force of the bodies on the surface `<name>`, along z, at the time of the sample."),
    series("torque_<name>_x", "N·m",
        "Torque of the bodies on the surface `<name>` about an axis along x, at the time of the sample. If the field `motion` of the \
         surface is `moving` and the surface turns, this axis passes through the pivot (the point about which the surface turns). In all \
         other cases, the axis passes through the origin of the coordinates."),
    series("torque_<name>_y", "N·m",
        "Torque of the bodies on the surface `<name>` about an axis along y. This axis passes through the same point as the axis of \
         `torque_<name>_x`."),
    series("torque_<name>_z", "N·m",
        "Torque of the bodies on the surface `<name>` about an axis along z. This axis passes through the same point as the axis of \
         `torque_<name>_x`."),
];

/// Axes of forces, torques and positions.
pub(super) const AXES: [(&str, DVec3); 3] = [("x", DVec3::X), ("y", DVec3::Y), ("z", DVec3::Z)];

/// Why so many surfaces make too many numbers, and the output interval that would do; none if they do not.
pub(super) fn too_many_loads(numerics: &Numerics, surfaces: usize) -> Option<(String, String)> {
    let least_s = LOADS.len() as f64 * surfaces as f64 * numerics.duration_s / MAX_NUMBERS;
    (numerics.output_interval_s < least_s).then(|| {
        let detail =
            format!("the forces and torques on {surfaces} surfaces make more than {MAX_NUMBERS:.0e} numbers");
        (detail, format!("≥ {least_s:.2e} s at this duration and number of surfaces"))
    })
}

/// Point through which the axes of a surface's torque lead, at belt time `t` in seconds; in metres.
fn torque_point(motion: &Motion, t: f64) -> DVec3 {
    match *motion {
        Motion::Moving { velocity, pivot, spin } if spin != DVec3::ZERO => pivot + velocity * t,
        _ => DVec3::ZERO,
    }
}

/// Power of a surface at belt time `t` in seconds, in W.
pub(super) fn power_w(motion: &Motion, load: &SurfaceLoad, t: f64) -> f64 {
    match *motion {
        Motion::Fixed => 0.0,
        Motion::Belt { velocity } => -load.force.dot(velocity),
        Motion::Moving { velocity, spin, .. } => {
            -(load.force.dot(velocity) + load.torque_about(torque_point(motion, t)).dot(spin))
        }
    }
}

/// Mean and maximum of samples. Both are null without samples.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct SampleStats {
    sum: f64,
    count: u64,
    max: Option<f64>,
}

impl SampleStats {
    pub(super) fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1;
        self.max = Some(self.max.map_or(value, |max| max.max(value)));
    }

    pub(super) fn mean(&self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / self.count as f64)
    }

    pub(super) fn max(&self) -> Option<f64> {
        self.max
    }
}

/// Records force and torque on each surface, as [`LOADS`].
#[derive(Clone, Debug)]
pub(super) struct LoadSeries {
    surfaces: Vec<(Motion, [SeriesId; 6])>,
}

impl LoadSeries {
    /// Adds the series of all surfaces.
    pub(super) fn new(surfaces: &[Surface], recorder: &mut Recorder) -> Self {
        let mut series = |surface: &Surface| {
            LOADS.map(|row| recorder.add(row.name.replace("<name>", &surface.name), row.unit, Clock::Belt))
        };
        Self { surfaces: surfaces.iter().map(|surface| (surface.motion, series(surface))).collect() }
    }

    /// Records the loads at belt time `t` in seconds. Returns the maximum force in N and torque in N m of a surface.
    pub(super) fn record(&self, loads: &[SurfaceLoad], t: f64, recorder: &mut Recorder) -> [f64; 2] {
        let mut max = [0.0f64; 2];
        for ((motion, ids), load) in self.surfaces.iter().zip(loads) {
            let torque = load.torque_about(torque_point(motion, t));
            let values = load.force.to_array().into_iter().chain(torque.to_array());
            ids.iter().zip(values).for_each(|(id, value)| recorder.record(*id, value));
            max = [max[0].max(load.force.length()), max[1].max(torque.length())];
        }
        max
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_of_a_surface_is_force_times_speed_of_its_material_at_each_contact() {
        let (velocity, t) = (DVec3::new(0.3, -0.1, 0.2), 1.7);
        let (pivot, spin) = (DVec3::new(0.5, 0.2, -0.4), DVec3::new(1.0, -2.0, 3.0));
        let contacts = [
            (DVec3::new(0.1, 0.9, 0.3), DVec3::new(3.0, -2.0, 1.0)),
            (DVec3::new(-0.7, 0.4, 0.6), DVec3::new(-1.0, 4.0, 2.0)),
        ];
        let (mut load, mut turning_w) = (SurfaceLoad::default(), 0.0);
        for (place, force) in contacts {
            load.force += force;
            load.torque += place.cross(force);
            turning_w -= force.dot(velocity + spin.cross(place - pivot - velocity * t));
        }
        let straight_w = -load.force.dot(velocity);
        for (motion, expected) in [
            (Motion::Fixed, 0.0),
            (Motion::Belt { velocity }, straight_w),
            (Motion::Moving { velocity, pivot, spin: DVec3::ZERO }, straight_w),
            (Motion::Moving { velocity, pivot, spin }, turning_w),
        ] {
            let found = power_w(&motion, &load, t);
            assert!((found - expected).abs() < 1e-12, "{motion:?}: {found} W, not {expected} W");
        }
    }
}
