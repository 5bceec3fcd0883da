//! The wall clock of a running process, which a test can set by means of libfaketime.

use std::path::PathBuf;
use std::process::Command;

/// Path of the library in Debian, variant for threads.
const LIBRARIES: &str = "/usr/lib";
const LIBRARY: &str = "faketime/libfaketimeMT.so.1";

/// A clock with an offset from the true time, initially zero.
#[derive(Clone)]
pub(crate) struct WallClock {
    library: PathBuf,
    /// File with the offset in seconds.
    offset: PathBuf,
}

impl WallClock {
    /// A clock whose offset is in this file; none without libfaketime.
    pub(crate) fn new(offset: PathBuf) -> Option<Self> {
        let here = std::fs::read_dir(LIBRARIES).ok()?.flatten().map(|entry| entry.path().join(LIBRARY));
        let library = here.into_iter().find(|path| path.exists())?;
        let clock = Self { library, offset };
        if !clock.offset.exists() {
            clock.set(0);
        }
        Some(clock)
    }

    /// Makes a process use this clock. Its monotonic clock stays that of the system.
    pub(crate) fn give_to(&self, command: &mut Command) {
        command
            .env("LD_PRELOAD", &self.library)
            .env("FAKETIME_TIMESTAMP_FILE", &self.offset)
            .env("FAKETIME_NO_CACHE", "1")
            .env("FAKETIME_DONT_FAKE_MONOTONIC", "1")
            .env("NO_FAKE_STAT", "1");
    }

    /// Removes the shared memory of the library after a process was killed.
    pub(crate) fn tidy_after(process: u32) {
        for name in ["faketime_shm", "sem.faketime_sem"] {
            let _ = std::fs::remove_file(format!("/dev/shm/{name}_{process}"));
        }
    }

    /// Sets the offset from the true time.
    pub(crate) fn set(&self, offset_s: i64) {
        let new = self.offset.with_extension("new");
        std::fs::write(&new, format!("{offset_s:+}\n")).unwrap();
        std::fs::rename(new, &self.offset).unwrap();
    }
}
