//! Resources of the server's process: memory, file descriptors, disk.

use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

/// File descriptors beside those of clients: the database and its log on several connections, the lock, the
/// runtime.
const OTHER_DESCRIPTORS: u64 = 64;

/// Raises the process's limit of open files to what this many connections need, as far as the system allows:
/// most systems start programs with 1,024 and allow far more. Not higher, since some system calls take time
/// for each possible file. Returns the new limit, if there is one.
#[cfg(unix)]
pub(crate) fn raise_descriptors(connections: usize) -> Option<u64> {
    use rustix::process::{Resource, getrlimit, setrlimit};
    let mut limit = getrlimit(Resource::Nofile);
    let soft = limit.current;
    limit.current = raised(soft, limit.maximum, descriptors_for(connections));
    if limit.current == soft {
        return soft;
    }
    if let Err(error) = setrlimit(Resource::Nofile, limit) {
        tracing::warn!(%error, ?soft, "raising the limit of open files failed");
        limit.current = soft;
    }
    limit.current
}

/// Windows has no such limit: its handles are limited by memory alone.
#[cfg(not(unix))]
pub(crate) fn raise_descriptors(connections: usize) -> Option<u64> {
    raised(None, None, descriptors_for(connections))
}

/// The limit of open files of this process; none without one.
#[cfg(unix)]
fn max_descriptors() -> Option<u64> {
    rustix::process::getrlimit(rustix::process::Resource::Nofile).current
}

/// Windows has no such limit.
#[cfg(not(unix))]
fn max_descriptors() -> Option<u64> {
    None
}

/// The limit of open files, raised to `needed` as far as the system allows. None is no limit.
fn raised(soft: Option<u64>, hard: Option<u64>, needed: u64) -> Option<u64> {
    Some(soft?.max(hard.map_or(needed, |hard| needed.min(hard))))
}

/// File descriptors that this many connections need.
fn descriptors_for(connections: usize) -> u64 {
    let connections = u64::try_from(connections).unwrap_or(u64::MAX);
    connections.div_ceil(3).saturating_mul(4).saturating_add(OTHER_DESCRIPTORS + 4)
}

/// Connections that this many file descriptors allow. An answer may open a file beside its connection, though
/// few do.
pub(crate) fn connections_for(descriptors: Option<u64>) -> usize {
    let connections = descriptors.map_or(u64::MAX, |all| all.saturating_sub(OTHER_DESCRIPTORS) / 4 * 3);
    usize::try_from(connections).unwrap_or(usize::MAX)
}

/// Resources of the process; none where the system does not report them.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Usage {
    pub(crate) resident_bytes: Option<u64>,
    pub(crate) open_descriptors: Option<u64>,
    pub(crate) max_descriptors: Option<u64>,
}

impl Usage {
    /// The resources now.
    pub(crate) fn now() -> Self {
        let descriptors = std::fs::read_dir("/proc/self/fd").ok();
        Self {
            resident_bytes: std::fs::read_to_string("/proc/self/status").ok().as_deref().and_then(resident),
            // One of them reads the list.
            open_descriptors: descriptors.map(|entries| entries.count().saturating_sub(1) as u64),
            max_descriptors: max_descriptors(),
        }
    }
}

/// The line `VmRSS:    5120 kB`.
fn resident(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kib| kib * 1024)
}

/// Free bytes of the disk of a folder, for users other than root.
#[cfg(unix)]
pub(crate) fn free_bytes(folder: &Path) -> Option<u64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(disk.f_bavail.saturating_mul(disk.f_frsize))
}

/// On other systems they are not measured, and the metric is left out.
#[cfg(not(unix))]
pub(crate) fn free_bytes(_folder: &Path) -> Option<u64> {
    None
}

/// Length of a file in bytes; 0 if it does not exist.
pub(crate) fn file_bytes(path: &Path) -> u64 {
    std::fs::metadata(path).map_or(0, |about| about.len())
}

/// Seconds since 1970.
pub(crate) fn unix_seconds() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resources_of_the_process_are_measured() {
        let limit = raise_descriptors(usize::MAX);
        let allowed = rustix::process::getrlimit(rustix::process::Resource::Nofile).maximum;
        assert_eq!(allowed, limit, "as high as allowed");
        assert_eq!(raise_descriptors(1), limit, "it is never lowered");
        let files: Vec<_> = (0..20).map(|_| tempfile::tempfile().unwrap()).collect();
        let block = vec![1_u8; 50_000_000];
        let usage = Usage::now();
        if cfg!(target_os = "linux") {
            assert!((20..10_000).contains(&usage.open_descriptors.unwrap()), "{usage:?}");
            assert!((50_000_000..5_000_000_000).contains(&usage.resident_bytes.unwrap()), "{usage:?}");
        }
        assert_eq!(usage.max_descriptors, limit);
        drop((files, block));
    }

    #[test]
    fn limit_of_open_files_is_raised_as_far_as_connections_need() {
        let needed = descriptors_for(8192);
        assert!(needed < 12_000 && connections_for(Some(needed)) >= 8192, "{needed}");
        assert_eq!(raised(Some(1024), Some(1 << 20), needed), Some(needed));
        assert_eq!(raised(Some(1024), None, needed), Some(needed));
        assert_eq!(raised(Some(1024), Some(4096), needed), Some(4096));
        assert_eq!(raised(Some(65_536), Some(1 << 20), needed), Some(65_536));
        assert_eq!(raised(None, None, needed), None);
    }

    #[test]
    fn some_descriptors_are_reserved_beside_connections() {
        assert_eq!(connections_for(None), usize::MAX);
        assert_eq!(connections_for(Some(1024)), 720);
        assert_eq!(connections_for(Some(10)), 0);
    }
}
