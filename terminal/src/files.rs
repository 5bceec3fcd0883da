//! Files that are whole or not there.

use std::fs::Permissions;
use std::io::{self, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use tempfile::Builder;

/// Writes a temporary file beside `path` and renames it, so that a reader sees the whole content or the old one. A full disk
/// leaves the old one, and two processes leave the content of one of them.
///
/// # Errors
/// As the system reports it.
pub fn write_atomically(path: &Path, content: &[u8]) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // As the user's other new files: those of `NamedTempFile` are for the user alone.
    let readable = Permissions::from_mode(0o666);
    let mut file = Builder::new().permissions(readable).tempfile_in(folder)?;
    file.write_all(content)?;
    file.as_file().sync_all()?;
    file.persist(path)?;
    Ok(())
}
