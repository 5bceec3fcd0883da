//! The files for ParaView in their folder.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use roost_solver::engine::run::Snapshot;
use roost_solver::equipment::Motion;

use crate::vtk;

/// The file to open.
pub(super) const COLLECTION: &str = "frames.pvd";
/// The folder of the files that it names.
pub(super) const FOLDER: &str = "vtk";
/// Names of the surfaces, beside them.
pub(super) const LEGEND: &str = "vtk/surfaces.json";

/// Files of all frames so far.
#[derive(Debug)]
pub(super) struct Files {
    folder: PathBuf,
    /// The shape that is the first kind of the scene.
    first_shape: u32,
    scenes: Vec<vtk::Scene>,
    size: u64,
}

/// The files of one frame.
#[derive(Debug)]
pub(super) struct Frame {
    particles: Vec<u8>,
    /// None where the surfaces stand as in the frame before: most equipment stands still, and one file will do.
    surfaces: Option<Vec<u8>>,
}

impl Frame {
    pub(super) fn size(&self) -> u64 {
        (self.particles.len() + self.surfaces.as_ref().map_or(0, Vec::len)) as u64
    }
}

impl Files {
    pub(super) fn create(folder: &Path, first_shape: u32) -> io::Result<Self> {
        fs::create_dir_all(folder.join(FOLDER))?;
        let files = Self { folder: folder.to_owned(), first_shape, scenes: Vec::new(), size: 0 };
        files.write_collection()?;
        Ok(files)
    }

    /// Bytes of all files but the few of the collection and the names.
    pub(super) fn size(&self) -> u64 {
        self.size
    }

    /// Makes the files of a frame in memory.
    pub(super) fn make(&self, snapshot: &Snapshot<'_>) -> Frame {
        let surfaces = || vtk::surfaces(snapshot.scene, snapshot.belt_time_s);
        Frame {
            particles: vtk::particles(snapshot, self.first_shape),
            surfaces: (!self.stands_still(snapshot)).then(surfaces),
        }
    }

    fn stands_still(&self, snapshot: &Snapshot<'_>) -> bool {
        let moves = || {
            let motions = snapshot.scene.surfaces.iter().map(|surface| surface.motion);
            motions.into_iter().any(|motion| matches!(motion, Motion::Moving { .. }))
        };
        match self.scenes.last().map(|last| (last.belt_time_s, snapshot.belt_time_s)) {
            Some((None, None)) => true,
            Some((Some(_), Some(_))) => !moves(),
            _ => false,
        }
    }

    pub(super) fn write(&mut self, snapshot: &Snapshot<'_>, frame: &Frame) -> io::Result<()> {
        let number = self.scenes.len();
        let name = |what: &str| format!("{FOLDER}/{what}_{number:06}.vtp");
        if number == 0 {
            fs::write(self.folder.join(LEGEND), vtk::legend(snapshot.scene))?;
        }
        let particles = name("particles");
        fs::write(self.folder.join(&particles), &frame.particles)?;
        let surfaces = match (&frame.surfaces, self.scenes.last()) {
            (None, Some(last)) => last.surfaces.clone(),
            (bytes, _) => {
                let surfaces = name("surfaces");
                fs::write(self.folder.join(&surfaces), bytes.as_deref().unwrap_or_default())?;
                surfaces
            }
        };
        let (simulated_s, belt_time_s) = (snapshot.simulated_s, snapshot.belt_time_s);
        self.scenes.push(vtk::Scene { simulated_s, belt_time_s, particles, surfaces });
        self.size += frame.size();
        self.write_collection()
    }

    /// Written anew after every frame, under another name first: whenever the run is killed, there is a whole one.
    fn write_collection(&self) -> io::Result<()> {
        let (path, part) = (self.folder.join(COLLECTION), self.folder.join(format!("{COLLECTION}.part")));
        fs::write(&part, vtk::collection(&self.scenes))?;
        fs::rename(part, path)
    }
}
