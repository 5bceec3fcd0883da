//! The stream for the web as a file that is being written.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use roost_solver::engine::run::Snapshot;
use roost_solver::scenario::Scenario;

use crate::web::{Error, Header, Packed, Writer};

/// Name of the file of the stream for the web.
pub const STREAM: &str = "run.roostframes";

/// A stream in a file; its header waits for a first picture, which brings the scene.
#[derive(Debug)]
pub(super) struct Stream {
    path: PathBuf,
    state: State,
}

#[derive(Debug)]
enum State {
    Empty(File),
    Begun(Writer<File>),
    /// Ended, or given up after a fault: perhaps half of a frame is there, and an index after it would only mislead.
    Closed,
}

impl Stream {
    pub(super) fn create(folder: &Path) -> io::Result<Self> {
        let path = folder.join(STREAM);
        Ok(Self { state: State::Empty(File::create(&path)?), path })
    }

    /// Bytes of the file, if there are no more frames.
    pub(super) fn size(&self) -> u64 {
        match &self.state {
            State::Begun(writer) => writer.size(),
            _ => fs::metadata(&self.path).map_or(0, |file| file.len()),
        }
    }

    /// Makes a frame in memory, after writing the header if it is the first.
    pub(super) fn make(
        &mut self,
        scenario: &Scenario,
        interval_s: f64,
        snapshot: &Snapshot<'_>,
    ) -> Result<Packed, Error> {
        self.state = match std::mem::replace(&mut self.state, State::Closed) {
            State::Empty(file) => {
                State::Begun(Writer::new(file, &Header::new(scenario, snapshot.scene, interval_s)?)?)
            }
            state => state,
        };
        self.writer()?.pack(snapshot)
    }

    pub(super) fn write(&mut self, frame: &Packed) -> Result<(), Error> {
        let written = self.writer()?.append(frame);
        if written.is_err() {
            self.state = State::Closed;
        }
        written
    }

    /// Writes the index.
    pub(super) fn finish(&mut self) -> Result<(), Error> {
        match std::mem::replace(&mut self.state, State::Closed) {
            State::Begun(writer) => writer.finish().map(drop),
            _ => Ok(()),
        }
    }

    fn writer(&mut self) -> Result<&mut Writer<File>, Error> {
        match &mut self.state {
            State::Begun(writer) => Ok(writer),
            _ => Err(Error::Io(io::Error::other("it is closed"))),
        }
    }
}
