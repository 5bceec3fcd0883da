//! The belt that passes under the gate of a hopper, and its speed.

use crate::engine::scene::Scene;
use crate::equipment::{Motion, Presence, Surface};
use crate::experiments::surfaces::extent;
use crate::scenario::Equipment;

/// Speed of the belt under the gate, in m/s, or the reason why it is unknown. Only a hopper of its own surfaces needs the scene.
pub(super) fn belt_speed_m_s<'a>(
    equipment: &Equipment,
    scene: impl FnOnce() -> &'a Scene,
) -> Result<f64, String> {
    if equipment.parametric { Ok(equipment.belt_speed_m_s) } else { speed_of_belt_m_s(&scene().surfaces) }
}

/// Speed along x of the belts that pass the gate plane.
fn speed_of_belt_m_s(surfaces: &[Surface]) -> Result<f64, String> {
    let mut speeds: Vec<f64> = surfaces.iter().filter_map(speed_through_gate_m_s).collect();
    speeds.sort_unstable_by(f64::total_cmp);
    speeds.dedup();
    match speeds[..] {
        [speed] => Ok(speed),
        [] => Err("no surface with motion \"belt\" passes the gate plane x = 0".to_owned()),
        [lowest, .., highest] => Err(format!(
            "belts through the gate plane run at {lowest} to {highest} m/s, which is no one speed"
        )),
    }
}

fn speed_through_gate_m_s(surface: &Surface) -> Option<f64> {
    let Motion::Belt { velocity } = surface.motion else { return None };
    let (low, high) = extent(std::slice::from_ref(surface))?;
    let passes = low.x < 0.0 && high.x > 0.0 && surface.presence == Presence::Always;
    passes.then_some(velocity.x)
}
