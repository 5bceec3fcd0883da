//! Motion of surfaces: a pure function of belt time. Before t = 0 all surfaces stand still.

use glam::{DMat3, DVec3};

/// Motion of a surface from t = 0 on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// No motion.
    Fixed,
    /// The surface stays in place; its material runs along it.
    Belt {
        /// Velocity of the material, in m/s.
        velocity: DVec3,
    },
    /// The surface translates and rotates steadily.
    Moving {
        /// Velocity of the pivot, in m/s.
        velocity: DVec3,
        /// Centre of rotation, at t = 0, in metres.
        pivot: DVec3,
        /// Angular velocity, in rad/s.
        spin: DVec3,
    },
}

/// Pose and velocity of a surface at one moment: x = pivot + turn · (x₀ − pivot₀).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Displacement of the pivot since t = 0, in metres.
    pub shift: DVec3,
    /// Rotation since t = 0.
    pub turn: DMat3,
    /// Velocity of the material at the pivot, in m/s.
    pub velocity: DVec3,
    /// Angular velocity, in rad/s.
    pub spin: DVec3,
}

impl Motion {
    /// Pose at belt time `t` in seconds; `None` for any time before the start.
    pub fn pose(&self, t: Option<f64>) -> Pose {
        let still =
            Pose { shift: DVec3::ZERO, turn: DMat3::IDENTITY, velocity: DVec3::ZERO, spin: DVec3::ZERO };
        match (*self, t) {
            (_, None) | (Motion::Fixed, _) => still,
            (Motion::Belt { velocity }, _) => Pose { velocity, ..still },
            (Motion::Moving { velocity, spin, .. }, Some(t)) => {
                let rate = spin.length();
                let turn =
                    if rate > 0.0 { DMat3::from_axis_angle(spin / rate, rate * t) } else { DMat3::IDENTITY };
                Pose { shift: velocity * t, turn, velocity, spin }
            }
        }
    }

    /// Maximum speed of any point within `reach` metres of the pivot, in m/s; 0 for a belt, whose surface
    /// stays in place.
    pub fn max_speed(&self, reach: f64) -> f64 {
        match *self {
            Motion::Moving { velocity, spin, .. } => velocity.length() + spin.length() * reach,
            _ => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pose_of_a_rotating_plate_follows_its_angle() {
        let motion = Motion::Moving { velocity: DVec3::X, pivot: DVec3::ZERO, spin: DVec3::Y * 0.5 };
        let pose = motion.pose(Some(std::f64::consts::PI));
        assert!((pose.turn * DVec3::X - -DVec3::Z).length() < 1e-12, "a quarter turn about y takes x to -z");
        assert!((pose.shift - DVec3::X * std::f64::consts::PI).length() < 1e-12);
        assert_eq!(motion.pose(None).turn, DMat3::IDENTITY);
        assert_eq!(Motion::Belt { velocity: DVec3::X }.pose(None).velocity, DVec3::ZERO);
    }
}
