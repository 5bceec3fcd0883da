//! The mesh files of scenarios, by digest.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use glam::DVec3;

use super::{Mesh, MeshError, Units, stl};

/// BLAKE3 digest of a file, in hexadecimal: its name in scenarios.
pub fn digest(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// Hexadecimal digits of a [`digest`].
pub const DIGEST_DIGITS: usize = 64;

/// Whether a text has the form of a [`digest`].
pub fn is_digest(text: &str) -> bool {
    text.len() == DIGEST_DIGITS
        && text.bytes().all(|byte| byte.is_ascii_digit() || (b'a'..=b'f').contains(&byte))
}

/// A file that was read. The scenario states the units of its numbers.
#[derive(Debug)]
pub struct Stl {
    digest: String,
    triangles: Vec<[DVec3; 3]>,
    /// Meshes in millimetres and in metres, built on demand.
    meshes: [OnceLock<Result<Mesh, MeshError>>; 2],
}

impl Stl {
    /// The mesh of the file in these units, cached.
    ///
    /// # Errors
    /// A size outside the limits for these units, or no triangle with an area.
    pub fn in_units(&self, units: Units) -> Result<Mesh, MeshError> {
        let mesh = &self.meshes[units as usize];
        mesh.get_or_init(|| Mesh::new(&self.triangles, &self.digest, units)).clone()
    }
}

/// Files by their digests. A clone shares them and costs nothing.
#[derive(Clone, Debug, Default)]
pub struct Meshes(Arc<BTreeMap<String, Arc<Stl>>>);

impl Meshes {
    /// Reads a file and stores it under its digest, which is returned.
    ///
    /// # Errors
    /// The fault of the file.
    pub fn insert(&mut self, bytes: &[u8]) -> Result<String, MeshError> {
        let digest = digest(bytes);
        if !self.0.contains_key(&digest) {
            let triangles = stl::read(bytes)?;
            let stl = Stl { digest: digest.clone(), triangles, meshes: Default::default() };
            Arc::make_mut(&mut self.0).insert(digest.clone(), Arc::new(stl));
        }
        Ok(digest)
    }

    /// The file of a digest, if present.
    pub fn get(&self, digest: &str) -> Option<Arc<Stl>> {
        self.0.get(digest).cloned()
    }

    /// Total number of triangles.
    pub fn triangles(&self) -> u64 {
        self.0.values().map(|stl| stl.triangles.len() as u64).sum()
    }
}
