//! The mesh files of a document: what a command reads, checks and uploads. The files themselves are read by [`read_mesh_files`].

use std::path::Path;

use anyhow::Result;
use roost_api::Fault;
use roost_solver::mesh::Meshes;
use roost_solver::scenario::{MeshFile, MeshFiles, read_mesh_files};
use roost_terminal::{format, input, message};
use roost_worker::client::Client;
use serde_json::{Value, json};

use crate::named_files;

/// A document whose meshes are named by digest.
#[derive(Debug)]
pub(crate) struct Resolved {
    /// The document with digests in place of file names.
    pub(crate) document: Value,
    /// The meshes in the files.
    pub(crate) meshes: Meshes,
    /// The files and their faults.
    found: MeshFiles,
}

/// Reads the mesh files of a document, and the measurements that a calibration names by file. Paths are relative to the folder of the document, or to the working directory for stdin.
pub(crate) fn resolve(path: &Path, mut document: Value) -> Resolved {
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut faults = named_files::insert_into_study(folder, &mut document);
    faults.extend(named_files::insert_posterior(folder, &mut document));
    let mut found = read_mesh_files(folder, &mut document);
    faults.append(&mut found.faults);
    found.faults = faults;
    Resolved { document, meshes: found.meshes.clone(), found }
}

impl Resolved {
    /// Adds a fault for each mesh that only a server could have.
    pub(crate) fn without_server(mut self) -> Self {
        let allowed = "{\"file\": \"….stl\", \"units\": \"mm\" or \"m\"}";
        for (pointer, digest) in std::mem::take(&mut self.found.by_digest) {
            if self.meshes.get(&digest).is_none() {
                let detail = "is the digest of a mesh at a server; this command needs the file".to_owned();
                let at = format!("{pointer}/digest");
                self.found.faults.push(Fault::new(&at, &json!(digest), detail, Some(allowed.to_owned())));
            }
        }
        self
    }

    /// The faults of the mesh files, and those of the document outside these meshes.
    pub(crate) fn with_faults(&self, others: Vec<Fault>) -> Vec<Fault> {
        self.found.with_faults(others)
    }

    /// Returns an error if a file has a fault.
    pub(crate) fn checked(self, path: &Path) -> Result<Self> {
        if self.found.faults.is_empty() {
            Ok(self)
        } else {
            Err(input::faults_error(path, &self.found.faults).into())
        }
    }

    /// Whether all meshes of the document come from files, and there is one at least.
    pub(crate) fn is_self_contained(&self) -> bool {
        !self.found.files.is_empty() && self.found.by_digest.is_empty()
    }

    /// Uploads the files that the server does not have.
    pub(crate) async fn upload(&self, client: &Client) -> Result<()> {
        for MeshFile { name, digest, bytes } in &self.found.files {
            match client.mesh(digest).await {
                Ok(_) => continue,
                Err(error) if error.problem_status() == Some(404) => {}
                Err(error) => return Err(error.into()),
            }
            client.upload_mesh(bytes.clone()).await?;
            message!("uploaded {name}: {}", format::bytes(bytes.len() as u64));
        }
        Ok(())
    }

    /// The name of a mesh: its file name, or the start of its digest.
    pub(crate) fn name(&self, digest: &str) -> String {
        let file = self.found.files.iter().find(|file| file.digest == digest);
        file.map_or_else(|| digest.chars().take(12).collect(), |file| file.name.clone())
    }
}
