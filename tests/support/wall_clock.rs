//! The wall clock of a process, which a test can set while it runs: libfaketime between the process and the system.

use std::path::PathBuf;
use std::process::Command;

/// Where Debian has it; the variant for threads.
const LIBRARIES: &str = "/usr/lib";
const LIBRARY: &str = "faketime/libfaketimeMT.so.1";

/// A clock that shows the true time until it is set.
#[derive(Clone)]
pub(crate) struct WallClock {
    library: PathBuf,
    /// How far it is off, in seconds.
    offset: PathBuf,
}

impl WallClock {
    /// A clock that is set through this file; none where libfaketime is not installed.
    pub(crate) fn new(offset: PathBuf) -> Option<Self> {
        let here = std::fs::read_dir(LIBRARIES).ok()?.flatten().map(|entry| entry.path().join(LIBRARY));
        let library = here.into_iter().find(|path| path.exists())?;
        let clock = Self { library, offset };
        if !clock.offset.exists() {
            clock.set(0);
        }
        Some(clock)
    }

    /// Has a process read this clock. What counts time that passes stays the system's.
    pub(crate) fn give_to(&self, command: &mut Command) {
        command
            .env("LD_PRELOAD", &self.library)
            .env("FAKETIME_TIMESTAMP_FILE", &self.offset)
            .env("FAKETIME_NO_CACHE", "1")
            .env("FAKETIME_DONT_FAKE_MONOTONIC", "1")
            .env("NO_FAKE_STAT", "1");
    }

    /// Takes away what the library of a process that was killed leaves behind.
    pub(crate) fn tidy_after(process: u32) {
        for name in ["faketime_shm", "sem.faketime_sem"] {
            let _ = std::fs::remove_file(format!("/dev/shm/{name}_{process}"));
        }
    }

    /// Sets it, so many seconds from the true time.
    pub(crate) fn set(&self, offset_s: i64) {
        let new = self.offset.with_extension("new");
        std::fs::write(&new, format!("{offset_s:+}\n")).unwrap();
        std::fs::rename(new, &self.offset).unwrap();
    }
}
