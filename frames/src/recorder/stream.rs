//! The stream for the web as a file.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use roost_solver::engine::run::Snapshot;
use roost_solver::scenario::Scenario;

use crate::web::{Error, Header, PackedFrame, Writer};

/// Name of the file of the stream for the web.
pub const STREAM: &str = "run.roostframes";

/// A stream in a file. The first snapshot brings the scene for its header.
#[derive(Debug)]
pub(super) struct Stream {
    path: PathBuf,
    state: State,
}

#[derive(Debug)]
enum State {
    Empty(File),
    Open(Writer<File>),
    /// Complete, or failed: an incomplete frame may be in the file, and an index after it would be wrong.
    Closed,
}

impl Stream {
    pub(super) fn create(folder: &Path) -> io::Result<Self> {
        let path = folder.join(STREAM);
        Ok(Self { state: State::Empty(File::create(&path)?), path })
    }

    /// Bytes of the file, if no frame follows.
    pub(super) fn size(&self) -> u64 {
        match &self.state {
            State::Open(writer) => writer.size(),
            _ => fs::metadata(&self.path).map_or(0, |file| file.len()),
        }
    }

    /// Encodes a frame in memory; writes the header before the first.
    pub(super) fn make(
        &mut self,
        scenario: &Scenario,
        interval_s: f64,
        snapshot: &Snapshot<'_>,
    ) -> Result<PackedFrame, Error> {
        self.state = match std::mem::replace(&mut self.state, State::Closed) {
            State::Empty(file) => {
                State::Open(Writer::new(file, &Header::new(scenario, snapshot.scene, interval_s)?)?)
            }
            state => state,
        };
        self.writer()?.pack(snapshot)
    }

    pub(super) fn write(&mut self, frame: &PackedFrame) -> Result<(), Error> {
        let written = self.writer()?.append(frame);
        if written.is_err() {
            self.state = State::Closed;
        }
        written
    }

    /// Writes the index.
    pub(super) fn finish(&mut self) -> Result<(), Error> {
        match std::mem::replace(&mut self.state, State::Closed) {
            State::Open(writer) => writer.finish().map(drop),
            _ => Ok(()),
        }
    }

    fn writer(&mut self) -> Result<&mut Writer<File>, Error> {
        match &mut self.state {
            State::Open(writer) => Ok(writer),
            _ => Err(Error::Io(io::Error::other("the stream is closed"))),
        }
    }
}
