//! Faults between the fields of a hopper and its CAD surfaces: dimensions that contradict them, or that do nothing.

use serde_json::Value;

use super::Fault;
use super::field::plain;
use super::fields::find;

const OPENING: [&str; 2] = ["/equipment/opening_width_m", "/equipment/opening_height_m"];

/// Checks a hopper. `document` has the fields that the author wrote; a default that is written out is no contradiction.
pub(super) fn check(document: &Value, completed: &Value, faults: &mut Vec<Fault>) {
    let Some(parametric) = completed.pointer("/equipment/parametric").and_then(Value::as_bool) else {
        return;
    };
    let number = |pointer: &str| completed.pointer(pointer).and_then(Value::as_f64);
    let mut refuse = |pointer: &str, detail: &str, allowed: String| {
        let value = document.pointer(pointer).unwrap_or(&Value::Null);
        faults.push(Fault::new(pointer, value, detail.to_owned(), Some(allowed)));
    };
    let [width, height] = OPENING.map(number);
    if parametric {
        for pointer in OPENING.into_iter().filter(|pointer| number(pointer).is_some()) {
            let detail = "does nothing while /equipment/parametric is true";
            refuse(pointer, detail, "null, or /equipment/parametric false".to_owned());
        }
        return;
    }
    if width.is_some() != height.is_some() {
        let [missing, given] = if width.is_none() { OPENING } else { [OPENING[1], OPENING[0]] };
        refuse(missing, &format!("is null, but {given} is not"), "both, or neither".to_owned());
    }
    let written = |pointer: &str| {
        let value = number(pointer).filter(|_| document.pointer(pointer).is_some())?;
        let default = find(pointer)?.default.value()?.as_f64();
        (Some(value) != default).then_some(value)
    };
    if let Some(gate) = written("/equipment/gate_opening_m").filter(|gate| height != Some(*gate)) {
        let declared = height.map_or("null".to_owned(), plain);
        let detail =
            format!("does nothing while /equipment/parametric is false; opening_height_m is {declared}");
        refuse(
            "/equipment/gate_opening_m",
            &detail,
            format!("nothing, and opening_height_m {}", plain(gate)),
        );
    }
    let belts: Vec<f64> = belt_speeds(completed);
    if let Some(speed) = written("/equipment/belt_speed_m_s").filter(|speed| !belts.contains(speed)) {
        let speeds: Vec<String> = belts.iter().map(|speed| plain(*speed)).collect();
        let detail = if speeds.is_empty() {
            "does nothing while /equipment/parametric is false, and no surface is a belt".to_owned()
        } else {
            format!(
                "does nothing while /equipment/parametric is false; the belts among the surfaces run at {} m/s",
                speeds.join(" and ")
            )
        };
        let allowed =
            format!("nothing, and a surface with motion \"belt\" and velocity_m_s [{}, 0, 0]", plain(speed));
        refuse("/equipment/belt_speed_m_s", &detail, allowed);
    }
}

/// Velocities along x of the surfaces that are belts.
fn belt_speeds(completed: &Value) -> Vec<f64> {
    let surfaces = completed.pointer("/equipment/surfaces").and_then(Value::as_array);
    let belts = surfaces.into_iter().flatten().filter(|surface| surface["motion"] == "belt");
    belts.filter_map(|belt| belt.pointer("/velocity_m_s/0")?.as_f64()).collect()
}
