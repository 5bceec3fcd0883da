//! The opening under the gate, and the belt that runs through it: they set the belt's capacity.

use crate::engine::scene::Scene;
use crate::experiments::belt::belt_speed_m_s;
use crate::scenario::Equipment;

/// Volume per second that the belt carries through the full opening, in m³/s, or the reason why it is unknown or 0.
pub(super) fn full_opening_m3_s(equipment: &Equipment, scene: &Scene) -> Result<f64, String> {
    let (width, height) = if equipment.parametric {
        (equipment.hopper_width_m, equipment.gate_opening_m)
    } else {
        let (Some(width), Some(height)) = (equipment.opening_width_m, equipment.opening_height_m) else {
            return Err("the opening of the CAD hopper is not declared".to_owned());
        };
        (width, height)
    };
    let speed = belt_speed_m_s(equipment, || scene)?;
    if speed > 0.0 {
        Ok(speed * width * height)
    } else {
        Err("the belt does not run out of the hopper".to_owned())
    }
}
