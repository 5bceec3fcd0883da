//! The meshes that a document names, read and at hand before it is checked.

use std::collections::BTreeMap;

use roost_solver::mesh::Meshes;
use serde_json::{Value, json};

use super::aside::aside;
use super::problem::{ApiError, Kind};
use crate::app::{App, Shelf};
use crate::document::fault;
use crate::mesh::digests_in;

/// Meshes with at least those that the document names, as far as they were uploaded.
pub(super) async fn at_hand(app: &App, document: &Value) -> Result<Meshes, ApiError> {
    let named = digests_in(document);
    if named.is_empty() {
        return Ok(Meshes::default());
    }
    let digests: Vec<&str> = named.iter().map(|(_, digest)| digest.as_str()).collect();
    let wanted = app.store.mesh_triangles(&digests).await?;
    within_limit(&named, &wanted, app.config.max_mesh_triangles)?;
    // One reads at a time, which bounds memory; the others wait, off the threads that answer.
    let mut shelf = app.shelf.lock().await;
    let is_missing = |shelf: &Shelf, digest: &str| shelf.meshes.get(digest).is_none();
    let missing: u64 =
        wanted.iter().filter(|(digest, _)| is_missing(&shelf, digest)).map(|(_, triangles)| triangles).sum();
    if shelf.triangles + missing > app.config.max_mesh_triangles {
        *shelf = Shelf::default();
    }
    for (digest, triangles) in &wanted {
        if is_missing(&shelf, digest) {
            let file = app.store.mesh_file(digest).await?;
            let mut meshes = shelf.meshes.clone();
            let read = aside(move || meshes.insert(&file).map(|found| (found, meshes))).await?;
            match read {
                Ok((found, meshes)) if found == *digest => shelf.meshes = meshes,
                _ => {
                    let detail = format!("the stored file of mesh {digest} is damaged");
                    return Err(ApiError::new(Kind::Internal, detail));
                }
            }
            shelf.triangles += triangles;
        }
    }
    Ok(shelf.meshes.clone())
}

/// Refuses a document whose meshes would take too much memory, at the mesh that is one too many.
fn within_limit(
    named: &[(String, String)],
    sizes: &BTreeMap<String, u64>,
    limit: u64,
) -> Result<(), ApiError> {
    let mut counted = BTreeMap::new();
    for (pointer, digest) in named {
        let Some(triangles) = sizes.get(digest) else { continue };
        counted.insert(digest, triangles);
        let total: u64 = counted.values().copied().sum();
        if total > limit {
            let detail = format!("with this one, the meshes of the document have {total} triangles in all");
            let allowed = format!("at most {limit} (max_mesh_triangles): coarser meshes, or several sweeps");
            return Err(ApiError::faults(vec![fault(pointer, json!(digest), &detail, &allowed)]));
        }
    }
    Ok(())
}
