//! Meshes that were read before, so that the submissions of one design read each file once.
//!
//! When the cache is full, it is cleared: reading a mesh again takes milliseconds. The meshes of one document
//! are always returned together, which a cache that evicts single entries does not promise.

use std::collections::BTreeMap;

use roost_api::Fault;
use roost_solver::mesh::Meshes;
use serde_json::{Value, json};
use tokio::sync::Mutex;
use tokio::task::{JoinError, spawn_blocking};

use crate::document::fault;
use crate::mesh::digests_in;
use crate::store::{Store, StoreError};

/// Why the meshes of a document were not read.
#[derive(Debug, thiserror::Error)]
pub(crate) enum MeshCacheError {
    /// The document names meshes with too many triangles.
    #[error("{0}")]
    TooManyTriangles(Fault),
    /// A stored file has another digest than when it was uploaded.
    #[error("the stored file of mesh {0} is damaged: the operator must restore a backup")]
    Damaged(String),
    /// The reader panicked.
    #[error("reading a mesh failed: {0}")]
    Reader(#[from] JoinError),
    /// The store failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// A cache of meshes with a maximum number of triangles.
pub(crate) struct MeshCache {
    max_triangles: u64,
    /// One document reads its meshes at a time, which bounds memory.
    cached: Mutex<Cached>,
}

#[derive(Default)]
struct Cached {
    meshes: Meshes,
    /// Triangles of all of them.
    triangles: u64,
}

impl Cached {
    fn lacks(&self, digest: &str) -> bool {
        self.meshes.get(digest).is_none()
    }
}

impl MeshCache {
    /// An empty cache. `max_triangles` also limits the meshes of one document.
    pub(crate) fn new(max_triangles: u64) -> Self {
        Self { max_triangles, cached: Mutex::default() }
    }

    /// At least the meshes that the document names, as far as they were uploaded.
    pub(crate) async fn meshes_of(&self, document: &Value, store: &Store) -> Result<Meshes, MeshCacheError> {
        let named = digests_in(document);
        if named.is_empty() {
            return Ok(Meshes::default());
        }
        let digests: Vec<&str> = named.iter().map(|(_, digest)| digest.as_str()).collect();
        let stored = store.mesh_triangles(&digests).await?;
        self.check_triangles(&named, &stored)?;
        let mut cached = self.cached.lock().await;
        let missing: u64 =
            stored.iter().filter(|(digest, _)| cached.lacks(digest)).map(|(_, triangles)| triangles).sum();
        if cached.triangles + missing > self.max_triangles {
            *cached = Cached::default();
        }
        for (digest, triangles) in &stored {
            if cached.lacks(digest) {
                let file = store.mesh_file(digest).await?;
                let mut meshes = cached.meshes.clone();
                let read = spawn_blocking(move || meshes.insert(&file).map(|found| (found, meshes)));
                match read.await? {
                    Ok((found, meshes)) if found == *digest => cached.meshes = meshes,
                    _ => return Err(MeshCacheError::Damaged(digest.clone())),
                }
                cached.triangles += triangles;
            }
        }
        Ok(cached.meshes.clone())
    }

    /// Refuses a document whose meshes take too much memory, at the mesh that exceeds the limit.
    fn check_triangles(
        &self,
        named: &[(String, String)],
        stored: &BTreeMap<String, u64>,
    ) -> Result<(), MeshCacheError> {
        let mut counted = BTreeMap::new();
        for (pointer, digest) in named {
            let Some(triangles) = stored.get(digest) else { continue };
            counted.insert(digest, triangles);
            let total: u64 = counted.values().copied().sum();
            if total > self.max_triangles {
                let detail =
                    format!("up to this mesh, the meshes of the document have {total} triangles in total");
                let allowed = format!(
                    "at most {} (max_mesh_triangles): use coarser meshes or several sweeps",
                    self.max_triangles
                );
                let fault = fault(pointer, json!(digest), &detail, &allowed);
                return Err(MeshCacheError::TooManyTriangles(fault));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use roost_api::time::Timestamp;

    use super::*;

    /// An STL file of one triangle with legs of this length.
    fn triangle_file(side: f32) -> Vec<u8> {
        let mut file = vec![0; 80];
        file.extend(1_u32.to_le_bytes());
        file.extend([0; 12]);
        [0.0, 0.0, 0.0, side, 0.0, 0.0, 0.0, side, 0.0]
            .iter()
            .for_each(|number| file.extend(number.to_le_bytes()));
        file.extend([0; 2]);
        file
    }

    #[tokio::test]
    async fn meshes_are_read_once_and_the_cache_is_bounded() {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::open(
            &crate::store::Location::File(dir.path().join("roost.db")),
            &dir.path().join("objects"),
            None,
        )
        .await
        .unwrap();
        let cache = MeshCache::new(2);
        let mut digests = Vec::new();
        for side in [10.0, 20.0, 30.0] {
            let mesh = crate::mesh::read(&triangle_file(side), Timestamp::now()).unwrap();
            digests.push(mesh.digest.clone());
            store.insert_mesh(mesh, &triangle_file(side)).await.unwrap();
        }
        for (named, cached) in
            [(&digests[..1], 1), (&digests[..2], 2), (&digests[1..2], 2), (&digests[2..], 1)]
        {
            let before = cache.cached.lock().await.meshes.get(&named[0]);
            let meshes = cache.meshes_of(&json!({"mesh": named}), &store).await.unwrap();
            assert!(named.iter().all(|digest| meshes.get(digest).is_some()), "{named:?}");
            assert_eq!(cache.cached.lock().await.triangles, cached, "{named:?}");
            if let Some(before) = before {
                assert!(Arc::ptr_eq(&before, &meshes.get(&named[0]).unwrap()), "read again");
            }
        }
        assert!(cache.cached.lock().await.lacks(&digests[0]), "cleared");
        store.close().await;
    }
}
