//! Meshes that a document names by file, `{"file": "hopper.stl", "units": "mm"}`. The file is read and checked, and its digest
//! replaces its name in the document, since solver and server identify meshes by digest.
//!
//! Such an object is allowed wherever a `mesh` is: in a scenario, in the base of a sweep, and as a level of a factor whose
//! pointer ends in `/mesh`.

use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use anyhow::Result;
use roost_api::Fault;
use roost_api::mesh::{MAX_BYTES, is_digest};
use roost_solver::mesh::Meshes;
use roost_solver::scenario::escape;
use roost_terminal::{format, input, message};
use roost_worker::client::Client;
use serde_json::{Map, Value, json};

use crate::measurements;

/// Placeholder for the digest of a faulty file, so that the rest of the document can be checked too.
const PLACEHOLDER_DIGEST: &str = "0000000000000000000000000000000000000000000000000000000000000000";

const ALLOWED: &str = "the path of an STL file, relative to the folder of this document";

/// A document whose meshes are named by digest.
#[derive(Debug)]
pub(crate) struct Resolved {
    /// The document with digests in place of file names.
    pub(crate) document: Value,
    /// The meshes in the files.
    pub(crate) meshes: Meshes,
    /// The files, each content once.
    files: Vec<MeshFile>,
    /// Faults of the files.
    faults: Vec<Fault>,
    /// Meshes that the document itself names by digest: JSON pointer and digest.
    by_digest: Vec<(String, String)>,
}

#[derive(Debug)]
struct MeshFile {
    /// The file name in the document.
    name: String,
    digest: String,
    bytes: Vec<u8>,
}

/// Reads the mesh files of a document, and the measurements that a calibration names by file. Paths are relative to the folder of the document, or to the working directory for stdin.
pub(crate) fn resolve(path: &Path, document: Value) -> Resolved {
    let folder = path.parent().map(Path::to_owned).unwrap_or_default();
    let resolved = Resolved {
        document,
        meshes: Meshes::default(),
        files: Vec::new(),
        faults: Vec::new(),
        by_digest: Vec::new(),
    };
    let mut reader = Reader { folder, resolved, read: HashMap::new() };
    let mut document = std::mem::take(&mut reader.resolved.document);
    reader.resolved.faults = measurements::insert_into_study(&reader.folder, &mut document);
    reader.resolved.faults.extend(measurements::insert_posterior(&reader.folder, &mut document));
    reader.walk(&mut document, String::new(), false);
    Resolved { document, ..reader.resolved }
}

struct Reader {
    folder: PathBuf,
    resolved: Resolved,
    /// Digest or error of each path that has been read.
    read: HashMap<PathBuf, Result<String, String>>,
}

impl Reader {
    fn walk(&mut self, value: &mut Value, pointer: String, is_mesh: bool) {
        match value {
            Value::Object(fields) if is_mesh => self.mesh(fields, &pointer),
            Value::Object(fields) => {
                let linked = fields.get("pointers").and_then(Value::as_array).into_iter().flatten();
                let mut pointers = fields.get("pointer").into_iter().chain(linked).filter_map(Value::as_str);
                let has_mesh_levels = pointers.any(ends_in_mesh);
                for (name, inner) in fields {
                    let at = format!("{pointer}/{}", escape(name));
                    match inner {
                        // An object in a row of levels can only be a mesh.
                        Value::Array(rows) if pointer == "/design" && name == "rows" => {
                            for (index, row) in rows.iter_mut().enumerate() {
                                for (factor, cell) in row.as_array_mut().into_iter().flatten().enumerate() {
                                    self.walk(cell, format!("{at}/{index}/{factor}"), true);
                                }
                            }
                        }
                        Value::Array(items) if has_mesh_levels && name == "levels" => {
                            for (index, level) in items.iter_mut().enumerate() {
                                self.walk(level, format!("{at}/{index}"), true);
                            }
                        }
                        inner => self.walk(inner, at, name == "mesh"),
                    }
                }
            }
            Value::Array(items) => {
                for (index, inner) in items.iter_mut().enumerate() {
                    self.walk(inner, format!("{pointer}/{index}"), false);
                }
            }
            _ => {}
        }
    }

    fn mesh(&mut self, fields: &mut Map<String, Value>, pointer: &str) {
        let digest = fields.get("digest").and_then(Value::as_str).filter(|digest| is_digest(digest));
        let Some(file) = fields.get("file").cloned() else {
            self.resolved.by_digest.extend(digest.map(|digest| (pointer.to_owned(), digest.to_owned())));
            return;
        };
        let result = match (&file, fields.get("digest")) {
            (_, Some(_)) => Err("excludes `digest`, which comes from the file".to_owned()),
            (Value::String(name), None) => self.file(name),
            _ => Err("must be a text".to_owned()),
        };
        let digest = result.unwrap_or_else(|detail| {
            let allowed = Some(ALLOWED.to_owned());
            self.resolved.faults.push(Fault::new(&format!("{pointer}/file"), &file, detail, allowed));
            PLACEHOLDER_DIGEST.to_owned()
        });
        fields.remove("file");
        fields.insert("digest".to_owned(), json!(digest));
    }

    /// The digest of a file, which is read once.
    fn file(&mut self, name: &str) -> Result<String, String> {
        let path = self.folder.join(name);
        if let Some(known) = self.read.get(&path) {
            return known.clone();
        }
        let read = read(&path).and_then(|bytes| {
            let digest =
                self.resolved.meshes.insert(&bytes).map_err(|error| format!("is no STL mesh: {error}"))?;
            if self.resolved.files.iter().all(|file| file.digest != digest) {
                self.resolved.files.push(MeshFile { name: name.to_owned(), digest: digest.clone(), bytes });
            }
            Ok(digest)
        });
        self.read.insert(path, read.clone());
        read
    }
}

fn ends_in_mesh(pointer: &str) -> bool {
    pointer.ends_with("/mesh")
}

/// Reads a file within the maximum size of a mesh.
fn read(path: &Path) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    let read = File::open(path).and_then(|file| file.take(MAX_BYTES as u64 + 1).read_to_end(&mut bytes));
    read.map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    if bytes.len() > MAX_BYTES {
        let maximum = format::bytes(MAX_BYTES as u64);
        return Err(format!("{} is larger than the maximum of {maximum}", path.display()));
    }
    Ok(bytes)
}

impl Resolved {
    /// Adds a fault for each mesh that only a server could have.
    pub(crate) fn without_server(mut self) -> Self {
        let allowed = "{\"file\": \"….stl\", \"units\": \"mm\" or \"m\"}";
        for (pointer, digest) in std::mem::take(&mut self.by_digest) {
            if self.meshes.get(&digest).is_none() {
                let detail = "is the digest of a mesh at a server; this command needs the file".to_owned();
                let at = format!("{pointer}/digest");
                self.faults.push(Fault::new(&at, &json!(digest), detail, Some(allowed.to_owned())));
            }
        }
        self
    }

    /// The faults of the mesh files, and those of the document outside these meshes.
    pub(crate) fn with_faults(&self, others: Vec<Fault>) -> Vec<Fault> {
        let parent = |fault: &Fault| fault.pointer.rsplit_once('/').map(|(parent, _)| parent.to_owned());
        let reported: Vec<String> = self.faults.iter().filter_map(parent).collect();
        let is_elsewhere = |fault: &Fault| {
            let inside = |place: &String| {
                fault
                    .pointer
                    .strip_prefix(place.as_str())
                    .is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
            };
            !reported.iter().any(inside)
        };
        self.faults.iter().cloned().chain(others.into_iter().filter(is_elsewhere)).collect()
    }

    /// Returns an error if a file has a fault.
    pub(crate) fn checked(self, path: &Path) -> Result<Self> {
        if self.faults.is_empty() { Ok(self) } else { Err(input::faults_error(path, &self.faults).into()) }
    }

    /// Whether all meshes of the document come from files, and there is one at least.
    pub(crate) fn is_self_contained(&self) -> bool {
        !self.files.is_empty() && self.by_digest.is_empty()
    }

    /// Uploads the files that the server does not have.
    pub(crate) async fn upload(&self, client: &Client) -> Result<()> {
        for MeshFile { name, digest, bytes } in &self.files {
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
        let file = self.files.iter().find(|file| file.digest == digest);
        file.map_or_else(|| digest.chars().take(12).collect(), |file| file.name.clone())
    }
}
