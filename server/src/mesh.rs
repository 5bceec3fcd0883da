//! Meshes without IO: properties of a file, and the meshes that a document names.

use std::collections::BTreeSet;

use roost_api::mesh::{MeshFormat, MeshView, is_digest};
use roost_api::time::Timestamp;
use roost_api::validate::MeshReport;
use roost_api::{Estimate, Fault};
use roost_solver::experiments::surfaces::placed_box;
use roost_solver::mesh::stl::binary_length;
use roost_solver::mesh::{Mesh, MeshError, Meshes, NO_AREA_M2, Units, doubled_area};
use roost_solver::scenario::{MeshRef, Scenario, escape};
use roost_solver::{Checked, Limits};
use serde_json::{Value, json};

/// Reads an STL file and measures the mesh.
pub(crate) fn read(file: &[u8], now: Timestamp) -> Result<MeshView, MeshError> {
    let mut meshes = Meshes::default();
    let digest = meshes.insert(file)?;
    let stl = meshes.get(&digest).expect("inserted above");
    let mesh = stl.in_units(Units::Mm).or_else(|_| stl.in_units(Units::M))?;
    let in_file = |metres: [f64; 3]| metres.map(|metres| (metres / mesh.units.in_metres()) as f32);
    Ok(MeshView {
        digest,
        bytes: file.len() as u64,
        format: if is_binary(file) { MeshFormat::Binary } else { MeshFormat::Ascii },
        triangles: triangles(&mesh),
        degenerate: mesh.degenerate as u64,
        closed: mesh.is_closed(),
        open_edges: mesh.open_edges as u64,
        turned_edges: mesh.turned_edges as u64,
        low: in_file(mesh.low.to_array()),
        high: in_file(mesh.high.to_array()),
        size: in_file(mesh.size_m().to_array()),
        uploaded_at: now,
    })
}

/// Whether a valid file is binary: then its length follows from its triangle count.
fn is_binary(file: &[u8]) -> bool {
    let count = file.get(80..84).and_then(|count| count.try_into().ok()).map(u32::from_le_bytes);
    count.is_some_and(|triangles| binary_length(triangles) == file.len() as u64)
}

/// Triangles in the file, including those with coinciding corners, which are not in the mesh.
fn triangles(mesh: &Mesh) -> u64 {
    let areas = mesh.triangles.iter().filter(|triangle| doubled_area(triangle) > NO_AREA_M2).count();
    (areas + mesh.degenerate) as u64
}

/// Every string of a document that may be the digest of a mesh, with its pointer: the meshes to read before
/// the document is checked.
pub(crate) fn digests_in(document: &Value) -> Vec<(String, String)> {
    let mut found = Vec::new();
    walk(document, &mut String::new(), &mut found);
    found
}

fn walk(value: &Value, pointer: &mut String, found: &mut Vec<(String, String)>) {
    let length = pointer.len();
    let mut step = |name: &str, inner: &Value| {
        pointer.push('/');
        pointer.push_str(name);
        walk(inner, pointer, found);
        pointer.truncate(length);
    };
    match value {
        Value::Object(fields) => fields.iter().for_each(|(name, inner)| step(&escape(name), inner)),
        Value::Array(items) => {
            items.iter().enumerate().for_each(|(index, inner)| step(&index.to_string(), inner));
        }
        Value::String(text) if is_digest(text) => found.push((pointer.clone(), text.clone())),
        _ => {}
    }
}

/// Checks a scenario with its meshes against the limits. Missing meshes are reported first.
pub(crate) fn check(scenario: &Scenario, meshes: &Meshes, limits: &Limits) -> Result<Estimate, Vec<Fault>> {
    let missing = |(pointer, named): (String, &MeshRef)| {
        let is_missing = meshes.get(&named.digest).is_none();
        let (detail, allowed) = (
            "there is no mesh with this digest",
            "the digest of an STL file that was uploaded with POST /v1/meshes",
        );
        is_missing.then(|| {
            Fault::new(
                &format!("{pointer}/digest"),
                &json!(named.digest),
                detail.to_owned(),
                Some(allowed.to_owned()),
            )
        })
    };
    let faults: Vec<_> = scenario.named_meshes().into_iter().filter_map(missing).collect();
    if !faults.is_empty() {
        return Err(faults);
    }
    roost_solver::check(scenario, meshes, limits).map(Checked::into_estimate)
}

/// Properties of the meshes of checked scenarios, each mesh and unit once.
pub(crate) fn reports(scenarios: impl Iterator<Item = Scenario>, meshes: &Meshes) -> Vec<MeshReport> {
    let mut reported = BTreeSet::new();
    let mut reports = Vec::new();
    for scenario in scenarios {
        for (pointer, named) in scenario.named_meshes() {
            let MeshRef { digest, units } = named;
            let is_new = reported.insert((digest.clone(), *units as u8));
            let Some(Ok(mesh)) = meshes.get(digest).filter(|_| is_new).map(|stl| stl.in_units(*units)) else {
                continue;
            };
            // Files have numbers of 32 bits, and a turn by a right angle leaves numbers such as -1e-17.
            let rounded = |metres: f64| (metres * 1e6).round() / 1e6 + 0.0;
            let placed = placed_box(&scenario, named, meshes);
            reports.push(MeshReport {
                pointer,
                digest: digest.clone(),
                units: *units,
                triangles: triangles(&mesh),
                degenerate: mesh.degenerate as u64,
                size_m: mesh.size_m().to_array(),
                placed_m: placed.map(|(low, high)| [low, high].map(|corner| corner.to_array().map(rounded))),
                closed: mesh.is_closed(),
                open_edges: mesh.open_edges as u64,
                turned_edges: mesh.turned_edges as u64,
            });
        }
    }
    reports
}
