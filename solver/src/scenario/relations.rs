//! Faults between fields: each value is in its range, but two of them contradict each other.

use serde_json::Value;

use super::field::{MAX_BODIES, plain};
use super::fields::{FIELDS, SECTIONS, declaration, find};
use super::sections::AtMost;
use super::sections::{DECLARATIONS, surface};
use super::{Fault, cad};

/// Pairs of shared fields in ascending order.
const ORDER: &[AtMost] = &[
    AtMost {
        small: "/numerics/output_interval_s",
        large: "/numerics/duration_s",
        otherwise: "the run would end before its first sample",
    },
    AtMost {
        small: "/numerics/timestep_s",
        large: "/numerics/output_interval_s",
        otherwise: "a sample would be due within a time step",
    },
];

/// Maximum number of samples of a run.
pub const MAX_SAMPLES: f64 = 100_000.0;

/// Checks the fields of `completed` against each other. `document` has the fields that the author wrote and can change.
pub(super) fn check(document: &Value, completed: &Value, faults: &mut Vec<Fault>) {
    for order in ORDER.iter().chain(DECLARATIONS.iter().flat_map(|declaration| declaration.order)) {
        check_order(order, document, completed, faults);
    }
    check_samples(document, completed, faults);
    check_alternatives(document, completed, faults);
    check_shapes(document, completed, faults);
    cad::check(document, completed, faults);
    check_moments(document, completed, faults);
    for section in SECTIONS.iter().filter(|section| section.items == Some(surface::ITEMS)) {
        check_surfaces(section.pointer, document, completed, faults);
    }
}

fn number(document: &Value, pointer: &str) -> Option<f64> {
    document.pointer(pointer)?.as_f64()
}

/// The value that the author wrote, or else the default.
fn as_written<'a>(document: &'a Value, completed: &'a Value, pointer: &str) -> &'a Value {
    document.pointer(pointer).or_else(|| completed.pointer(pointer)).unwrap_or(&Value::Null)
}

fn check_order(order: &AtMost, document: &Value, completed: &Value, faults: &mut Vec<Fault>) {
    let (Some(small), Some(large)) = (number(completed, order.small), number(completed, order.large)) else {
        return;
    };
    if small <= large {
        return;
    }
    let only_large = document.pointer(order.small).is_none() && document.pointer(order.large).is_some();
    let (pointer, sign, other, bound) = if only_large {
        (order.large, '≥', order.small, small)
    } else {
        (order.small, '≤', order.large, large)
    };
    let unit = find(pointer).map_or("", |field| field.unit);
    let allowed = format!("{sign} {} {unit} ({other})", plain(bound));
    let value = as_written(document, completed, pointer);
    faults.push(Fault::new(pointer, value, order.otherwise.to_owned(), Some(allowed)));
}

fn check_samples(document: &Value, completed: &Value, faults: &mut Vec<Fault>) {
    let interval_at = "/numerics/output_interval_s";
    let experiment = completed.get("experiment").and_then(Value::as_str).and_then(declaration);
    let time = |name| {
        let pointer = format!("/numerics/{name}");
        let is_taken = find(&pointer).is_none_or(|field| experiment.is_none_or(|one| one.takes(field)));
        if is_taken { number(completed, &pointer) } else { Some(0.0) }
    };
    let (Some(interval), Some(fill), Some(process)) =
        (number(completed, interval_at), time("max_fill_s"), time("duration_s"))
    else {
        return;
    };
    let duration = fill + process;
    if duration / interval > MAX_SAMPLES {
        let detail = format!("makes more than {MAX_SAMPLES} samples");
        let allowed = format!("≥ {} s at this duration and longest fill", plain(duration / MAX_SAMPLES));
        let value = as_written(document, completed, interval_at);
        faults.push(Fault::new(interval_at, value, detail, Some(allowed)));
    }
}

/// Of a field and the one it yields to, exactly one is a number.
fn check_alternatives(document: &Value, completed: &Value, faults: &mut Vec<Fault>) {
    for field in FIELDS {
        let Some(other) = field.yields_to else { continue };
        let (Some(one), Some(two)) = (completed.pointer(field.pointer), completed.pointer(other)) else {
            continue;
        };
        let allowed = Some(format!("null in one of {} and {other}", field.pointer));
        if !one.is_null() && !two.is_null() {
            let two = as_written(document, completed, other);
            faults.push(Fault::new(other, two, format!("excludes {}", field.pointer), allowed));
        } else if one.is_null() && two.is_null() {
            faults.push(Fault::new(field.pointer, one, format!("is null, and so is {other}"), allowed));
        }
    }
}

/// Shapes that do not exist, sizes beside a mesh or spheres, and a rule of the fill beside spheres.
fn check_shapes(document: &Value, completed: &Value, faults: &mut Vec<Fault>) {
    let sizes = completed.pointer("/product/sizes_m").and_then(Value::as_array).map(Vec::len);
    let mesh = completed.pointer("/product/mesh").is_some_and(Value::is_object);
    let spheres = completed.pointer("/product/spheres") == Some(&Value::Bool(true));
    let instead = [("/product/mesh", mesh), ("/product/spheres", spheres)];
    for (other, _) in instead.iter().filter(|(_, there)| *there) {
        let own = find("/product/sizes_m").and_then(|field| field.default.value());
        let written = document.pointer("/product/sizes_m").filter(|written| Some(*written) != own.as_ref());
        if let Some(written) = written {
            let allowed = Some(format!("one of {other} and /product/sizes_m"));
            faults.push(Fault::new("/product/sizes_m", written, format!("is excluded by {other}"), allowed));
        }
    }
    if mesh && spheres {
        let allowed = Some("false beside /product/mesh".to_owned());
        let detail = "excludes /product/mesh".to_owned();
        faults.push(Fault::new("/product/spheres", &Value::Bool(true), detail, allowed));
    }
    let pointer = "/product/fill";
    if spheres && completed.pointer(pointer).is_some_and(|fill| fill != "volume") {
        let allowed = Some("nothing here, or \"volume\", beside /product/spheres".to_owned());
        let value = as_written(document, completed, pointer);
        faults.push(Fault::new(pointer, value, "is excluded by /product/spheres".to_owned(), allowed));
    }
    let only_one = mesh || spheres;
    let Some(shapes) = sizes.map(|sizes| if only_one { 1 } else { 2 * sizes }) else { return };
    let bodies = completed.pointer("/scene/bodies").and_then(Value::as_array).map_or(0, Vec::len);
    let named = (0..bodies).map(|index| format!("/scene/bodies/{index}/shape"));
    for pointer in std::iter::once("/product/shape".to_owned()).chain(named) {
        let Some(shape) = number(completed, &pointer) else { continue };
        if shape >= shapes as f64 {
            // A test's own default gives way to a shorter list of sizes only when its author says which.
            let value = as_written(document, completed, &pointer);
            let detail = format!("there are {shapes} shapes, numbered from 0");
            faults.push(Fault::new(&pointer, value, detail, Some(format!("≥ 0 and ≤ {}", shapes - 1))));
        }
    }
    if completed.get("experiment").is_some_and(|experiment| experiment == "scene") && bodies == 0 {
        let empty = Value::Array(Vec::new());
        let written = document.pointer("/scene/bodies").unwrap_or(&empty);
        if written.is_array() {
            let allowed = Some(format!("a list of 1 to {MAX_BODIES} bodies"));
            faults.push(Fault::new("/scene/bodies", written, "holds no body".to_owned(), allowed));
        }
    }
    if completed
        .pointer("/scene/gravity_direction")
        .is_some_and(|v| v.as_array().is_some_and(|v| v.iter().all(|c| c == 0.0)))
    {
        let pointer = "/scene/gravity_direction";
        let value = as_written(document, completed, pointer);
        let allowed = Some("a direction; no gravity is /numerics/gravity_m_s2 0".to_owned());
        faults.push(Fault::new(pointer, value, "has no length".to_owned(), allowed));
    }
}

/// Moments that turn with the bond, beside a force that does not.
fn check_moments(document: &Value, completed: &Value, faults: &mut Vec<Fault>) {
    let pointer = "/bonds/moment_stiffness_factor";
    let formulation = completed.pointer("/bonds/formulation").and_then(Value::as_str);
    if formulation == Some("as_published") && number(completed, pointer).is_some_and(|factor| factor > 0.0) {
        let value = as_written(document, completed, pointer);
        let detail = "bonds carry no moments while /bonds/formulation is \"as_published\"".to_owned();
        let allowed = "0, or formulation \"corotated\" or \"finite_extension\"";
        faults.push(Fault::new(pointer, value, detail, Some(allowed.to_owned())));
    }
}

/// A fixed surface with a velocity, or a belt with a spin: most likely `motion` was forgotten.
fn check_motion(surface: &Value, at: &dyn Fn(&str) -> String, faults: &mut Vec<Fault>) {
    let motion = surface.get("motion").and_then(Value::as_str).unwrap_or_default();
    let idle: &[_] = match motion {
        "fixed" => &["velocity_m_s", "spin_deg_s"],
        "belt" => &["spin_deg_s"],
        _ => &[],
    };
    for name in idle {
        let Some(value) = surface.get(*name) else { continue };
        let is_zero = |number: &Value| number.as_f64() == Some(0.0);
        if value.as_array().is_some_and(|axes| !axes.iter().all(is_zero)) {
            let detail = format!("does nothing while motion is \"{motion}\"");
            let allowed =
                if *name == "spin_deg_s" { "motion \"moving\"" } else { "motion \"belt\" or \"moving\"" };
            faults.push(Fault::new(&at(name), value, detail, Some(format!("0, or {allowed}"))));
        }
    }
}

/// A surface must be a mesh or a plate with an area, with a name of its own.
fn check_surfaces(list: &str, document: &Value, completed: &Value, faults: &mut Vec<Fault>) {
    let surfaces = completed.pointer(list).and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    for (index, surface) in surfaces.iter().enumerate() {
        let at = |name: &str| format!("{list}/{index}/{name}");
        if let (Some(mesh), Some(plate)) = (surface.get("mesh"), surface.get("plate_m"))
            && mesh.is_null() == plate.is_null()
        {
            let (pointer, detail) = if mesh.is_null() {
                (at("mesh"), "is missing, and so is plate_m")
            } else {
                (at("plate_m"), "excludes mesh")
            };
            let value = as_written(document, completed, &pointer);
            faults.push(Fault::new(
                &pointer,
                value,
                detail.to_owned(),
                Some("one of mesh and plate_m".to_owned()),
            ));
        }
        if let Some(Value::Array(plate)) = surface.get("plate_m") {
            let edge =
                |k: usize| glam::DVec3::from([0, 1, 2].map(|axis| plate[k][axis].as_f64().unwrap_or(0.0)));
            if edge(1).cross(edge(2)).length() < 1e-8 {
                let allowed = Some("two edges that span at least 1e-8 m²".to_owned());
                let value = &surface["plate_m"];
                faults.push(Fault::new(&at("plate_m"), value, "has no area".to_owned(), allowed));
            }
        }
        check_motion(surface, &at, faults);
        let Some(name) = surface.get("name") else { continue };
        if surfaces[..index].iter().any(|other| other.get("name") == Some(name)) {
            let allowed = Some("a name of its own".to_owned());
            faults.push(Fault::new(&at("name"), name, "stands twice".to_owned(), allowed));
        }
    }
}
