//! A file system of a few MiB in memory, which a test can fill. Only root can mount it.

use std::fs::{File, remove_file};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A mounted file system, which is unmounted at the end of the test.
pub(crate) struct SmallDisk(PathBuf);

impl SmallDisk {
    /// Mounts a file system at a path; none without permission.
    pub(crate) fn mount(at: &Path, mib: u32) -> Option<Self> {
        std::fs::create_dir_all(at).unwrap();
        let size = format!("size={mib}m");
        let mounted = Command::new("mount").args(["-t", "tmpfs", "-o", &size, "tmpfs"]).arg(at).output();
        mounted.ok()?.status.success().then(|| Self(at.to_owned()))
    }

    /// Fills the file system completely, also one that was filled before.
    pub(crate) fn fill(&self) {
        let mut file = File::options().create(true).append(true).open(self.ballast()).unwrap();
        for bytes in [1 << 16, 1 << 12, 1] {
            while file.write_all(&vec![0; bytes]).is_ok() {}
        }
    }

    /// Frees the space again.
    pub(crate) fn clear(&self) {
        remove_file(self.ballast()).unwrap();
    }

    fn ballast(&self) -> PathBuf {
        self.0.join("ballast")
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        // A lazy unmount: open files stay, and the path is free at once.
        let _ = Command::new("umount").arg("--lazy").arg(&self.0).status();
    }
}
