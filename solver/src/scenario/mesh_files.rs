//! Meshes that a document names by file, `{"file": "hopper.stl", "units": "mm"}`. The file is read and checked, and its digest
//! replaces its name in the document, since solver and server identify meshes by digest.
//!
//! The object is allowed wherever a `mesh` is: in a scenario and in the base of a sweep. It can be a level of a factor whose
//! pointer ends in `/mesh`.

use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};

use super::{Fault, escape};
use crate::mesh::{MAX_FILE_BYTES, Meshes, is_digest};

/// Placeholder for the digest of a faulty file, so that the rest of the document can be checked too.
const PLACEHOLDER_DIGEST: &str = "0000000000000000000000000000000000000000000000000000000000000000";

const ALLOWED: &str = "the path of an STL file, relative to the folder of this document";

/// The mesh files of a document.
#[derive(Clone, Debug, Default)]
pub struct MeshFiles {
    /// The meshes in the files.
    pub meshes: Meshes,
    /// The files, each content once.
    pub files: Vec<MeshFile>,
    /// Faults of the files.
    pub faults: Vec<Fault>,
    /// Meshes that the document itself names by digest: JSON pointer and digest.
    pub by_digest: Vec<(String, String)>,
}

/// A mesh file.
#[derive(Clone, Debug)]
pub struct MeshFile {
    /// Its name in the document.
    pub name: String,
    /// Its digest, which replaces the name.
    pub digest: String,
    /// Its content.
    pub bytes: Vec<u8>,
}

/// Reads the mesh files of a document, and puts their digests in place of their names. Paths are relative to `folder`.
pub fn read_mesh_files(folder: &Path, document: &mut Value) -> MeshFiles {
    let mut reader = Reader { folder, found: MeshFiles::default(), read: HashMap::new() };
    reader.walk(document, String::new(), false);
    reader.found
}

impl MeshFiles {
    /// The faults of the mesh files, and those of the document outside these meshes.
    pub fn with_faults(&self, others: Vec<Fault>) -> Vec<Fault> {
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
}

struct Reader<'a> {
    folder: &'a Path,
    found: MeshFiles,
    /// Digest or error of each path that has been read.
    read: HashMap<PathBuf, Result<String, String>>,
}

impl Reader<'_> {
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
            self.found.by_digest.extend(digest.map(|digest| (pointer.to_owned(), digest.to_owned())));
            return;
        };
        let result = match (&file, fields.get("digest")) {
            (_, Some(_)) => Err("excludes `digest`, which comes from the file".to_owned()),
            (Value::String(name), None) => self.file(name),
            _ => Err("must be a text".to_owned()),
        };
        let digest = result.unwrap_or_else(|detail| {
            let allowed = Some(ALLOWED.to_owned());
            self.found.faults.push(Fault::new(&format!("{pointer}/file"), &file, detail, allowed));
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
            let inserted = self.found.meshes.insert(&bytes);
            let digest = inserted.map_err(|error| format!("is no STL mesh: {error}"))?;
            if self.found.files.iter().all(|file| file.digest != digest) {
                self.found.files.push(MeshFile { name: name.to_owned(), digest: digest.clone(), bytes });
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
    let read = File::open(path).and_then(|file| file.take(MAX_FILE_BYTES as u64 + 1).read_to_end(&mut bytes));
    read.map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    if bytes.len() > MAX_FILE_BYTES {
        let maximum = MAX_FILE_BYTES as f64 / f64::from(1 << 20);
        return Err(format!("{} is larger than the maximum of {maximum:.1} MiB", path.display()));
    }
    Ok(bytes)
}
