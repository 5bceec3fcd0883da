//! Files that are whole or not there.

use std::io::Write;
use std::path::Path;
use std::{fs, io};

/// Writes a temporary file beside `path` and renames it, so that a reader sees the whole content or the old one. A full disk
/// leaves the old one.
///
/// # Errors
/// As the system reports it.
pub fn write_atomically(path: &Path, content: &[u8]) -> io::Result<()> {
    let temporary = path.with_extension("part");
    let written = || {
        let mut file = fs::File::create(&temporary)?;
        file.write_all(content)?;
        file.sync_all()?;
        fs::rename(&temporary, path)
    };
    written().inspect_err(|_| {
        let _ = fs::remove_file(&temporary);
    })
}
