//! Processes that tests start, stop, freeze and kill.

use std::fs::File;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus};
use std::time::{Duration, Instant};

use super::wall_clock::WallClock;
use super::{signal, wait_until};

/// A process that is killed at the end of the test. Its log is printed if the test has failed.
pub(crate) struct Process {
    child: Child,
    log: PathBuf,
}

impl Process {
    pub(crate) fn start(command: &mut Command, log: PathBuf) -> Self {
        let file = File::create(&log).unwrap();
        let child = command.stdout(file.try_clone().unwrap()).stderr(file).spawn().unwrap();
        Self { child, log }
    }

    /// The process id.
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Sends SIGKILL and waits for the end.
    pub(crate) fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Sends SIGSTOP: connections stay open, but the process does not respond.
    pub(crate) fn freeze(&self) {
        signal(self.child.id(), "STOP");
    }

    /// Sends SIGCONT: the process continues.
    pub(crate) fn thaw(&self) {
        signal(self.child.id(), "CONT");
    }

    /// Sends SIGTERM.
    pub(crate) fn terminate(&self) {
        signal(self.child.id(), "TERM");
    }

    /// Waits for the end. Returns the exit status and the time of the wait.
    pub(crate) fn wait(mut self) -> (ExitStatus, Duration) {
        let started = Instant::now();
        let status = wait_until("the process ends", || self.child.try_wait().unwrap());
        (status, started.elapsed())
    }

    pub(crate) fn log(&self) -> String {
        std::fs::read_to_string(&self.log).unwrap_or_default()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        WallClock::tidy_after(self.child.id());
        if std::thread::panicking() {
            eprintln!("--- {}\n{}", self.log.display(), self.log());
        }
    }
}
