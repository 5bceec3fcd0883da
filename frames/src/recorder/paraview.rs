//! The files for ParaView in a folder.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use roost_solver::engine::run::Snapshot;
use roost_solver::equipment::Motion;

use crate::vtk;

/// The file to open in ParaView.
pub(super) const COLLECTION: &str = "frames.pvd";
/// The folder of the frames.
pub(super) const FOLDER: &str = "vtk";
/// Names of the surfaces.
pub(super) const LEGEND: &str = "vtk/surfaces.json";

/// The files of all frames so far.
#[derive(Debug)]
pub(super) struct ParaviewFiles {
    folder: PathBuf,
    /// Number of the first shape of the scene.
    first_shape: u32,
    entries: Vec<vtk::CollectionEntry>,
    size: u64,
}

/// The files of one frame.
#[derive(Debug)]
pub(super) struct FrameFiles {
    particles: Vec<u8>,
    /// None where the surfaces have not moved since the frame before, whose file serves again.
    surfaces: Option<Vec<u8>>,
}

impl FrameFiles {
    pub(super) fn size(&self) -> u64 {
        (self.particles.len() + self.surfaces.as_ref().map_or(0, Vec::len)) as u64
    }
}

impl ParaviewFiles {
    pub(super) fn create(folder: &Path, first_shape: u32) -> io::Result<Self> {
        fs::create_dir_all(folder.join(FOLDER))?;
        let files = Self { folder: folder.to_owned(), first_shape, entries: Vec::new(), size: 0 };
        files.write_collection()?;
        Ok(files)
    }

    /// Bytes of all frames, without the collection and the names of surfaces.
    pub(super) fn size(&self) -> u64 {
        self.size
    }

    /// Encodes the files of a frame in memory.
    pub(super) fn make(&self, snapshot: &Snapshot<'_>) -> FrameFiles {
        let surfaces = || vtk::surfaces(snapshot.scene, snapshot.belt_time_s);
        FrameFiles {
            particles: vtk::particles(snapshot, self.first_shape),
            surfaces: (!self.is_unmoved(snapshot)).then(surfaces),
        }
    }

    fn is_unmoved(&self, snapshot: &Snapshot<'_>) -> bool {
        let moves = || {
            let motions = snapshot.scene.surfaces.iter().map(|surface| surface.motion);
            motions.into_iter().any(|motion| matches!(motion, Motion::Moving { .. }))
        };
        match self.entries.last().map(|last| (last.belt_time_s, snapshot.belt_time_s)) {
            Some((None, None)) => true,
            Some((Some(_), Some(_))) => !moves(),
            _ => false,
        }
    }

    pub(super) fn write(&mut self, snapshot: &Snapshot<'_>, frame: &FrameFiles) -> io::Result<()> {
        let number = self.entries.len();
        let name = |kind: &str| format!("{FOLDER}/{kind}_{number:06}.vtp");
        if number == 0 {
            fs::write(self.folder.join(LEGEND), vtk::legend(snapshot.scene))?;
        }
        let particles = name("particles");
        fs::write(self.folder.join(&particles), &frame.particles)?;
        let surfaces = match (&frame.surfaces, self.entries.last()) {
            (None, Some(last)) => last.surfaces.clone(),
            (bytes, _) => {
                let surfaces = name("surfaces");
                fs::write(self.folder.join(&surfaces), bytes.as_deref().unwrap_or_default())?;
                surfaces
            }
        };
        let (simulated_s, belt_time_s) = (snapshot.simulated_s, snapshot.belt_time_s);
        self.entries.push(vtk::CollectionEntry { simulated_s, belt_time_s, particles, surfaces });
        self.size += frame.size();
        self.write_collection()
    }

    /// Writes the collection and renames it into place, so that it is complete whenever the run is killed.
    fn write_collection(&self) -> io::Result<()> {
        let (path, part) = (self.folder.join(COLLECTION), self.folder.join(format!("{COLLECTION}.part")));
        fs::write(&part, vtk::collection(&self.entries))?;
        fs::rename(part, path)
    }
}
