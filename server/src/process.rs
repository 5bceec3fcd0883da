//! What the server's process takes of the machine: memory, file descriptors, disk.

use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use rustix::process::{Resource, getrlimit, setrlimit};

/// File descriptors that are no connections: the database and its log on several connections, the lock, the runtime.
const OTHER_DESCRIPTORS: u64 = 64;

/// Lets the process open as many files as so many connections need, if the system allows it: most systems start programs with
/// 1,024 and allow far more. No higher, since some system calls and child processes take time for each possible file.
/// Returns the limit, if there is one.
pub(crate) fn raise_descriptors(connections: usize) -> Option<u64> {
    let mut limit = getrlimit(Resource::Nofile);
    let soft = limit.current;
    limit.current = raised(soft, limit.maximum, descriptors_for(connections));
    if limit.current == soft {
        return soft;
    }
    if let Err(error) = setrlimit(Resource::Nofile, limit) {
        tracing::warn!(%error, ?soft, "the limit of open files could not be raised");
        limit.current = soft;
    }
    limit.current
}

/// The limit of open files, raised to what is needed as far as the system allows it. None is no limit.
fn raised(soft: Option<u64>, hard: Option<u64>, needed: u64) -> Option<u64> {
    Some(soft?.max(hard.map_or(needed, |hard| needed.min(hard))))
}

/// File descriptors that are enough for so many connections.
fn descriptors_for(connections: usize) -> u64 {
    let connections = u64::try_from(connections).unwrap_or(u64::MAX);
    connections.div_ceil(3).saturating_mul(4).saturating_add(OTHER_DESCRIPTORS + 4)
}

/// Connections that so many file descriptors are enough for: an answer may keep a file open beside its connection, though few do.
pub(crate) fn connections_for(descriptors: Option<u64>) -> usize {
    let connections = descriptors.map_or(u64::MAX, |all| all.saturating_sub(OTHER_DESCRIPTORS) / 4 * 3);
    usize::try_from(connections).unwrap_or(usize::MAX)
}

/// What the process takes now. What the system does not tell is none.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Usage {
    pub(crate) resident_bytes: Option<u64>,
    pub(crate) open_descriptors: Option<u64>,
    pub(crate) max_descriptors: Option<u64>,
}

impl Usage {
    /// Asks the system.
    pub(crate) fn now() -> Self {
        let descriptors = std::fs::read_dir("/proc/self/fd").ok();
        Self {
            resident_bytes: std::fs::read_to_string("/proc/self/status").ok().as_deref().and_then(resident),
            // One of them reads the list.
            open_descriptors: descriptors.map(|entries| entries.count().saturating_sub(1) as u64),
            max_descriptors: getrlimit(Resource::Nofile).current,
        }
    }
}

/// The line `VmRSS:    5120 kB`.
fn resident(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kib| kib * 1024)
}

/// Bytes that are free where a folder is, for who is not root.
pub(crate) fn free_bytes(folder: &Path) -> Option<u64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(disk.f_bavail.saturating_mul(disk.f_frsize))
}

/// Length of a file; 0 where there is none.
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
    fn a_process_knows_what_it_takes() {
        let limit = raise_descriptors(usize::MAX);
        assert_eq!(getrlimit(Resource::Nofile).maximum, limit, "all that is allowed");
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
    fn the_limit_is_raised_as_far_as_connections_need() {
        let needed = descriptors_for(8192);
        assert!(needed < 12_000 && connections_for(Some(needed)) >= 8192, "{needed}");
        assert_eq!(raised(Some(1024), Some(1 << 20), needed), Some(needed));
        assert_eq!(raised(Some(1024), None, needed), Some(needed));
        assert_eq!(raised(Some(1024), Some(4096), needed), Some(4096));
        assert_eq!(raised(Some(65_536), Some(1 << 20), needed), Some(65_536));
        assert_eq!(raised(None, None, needed), None);
    }

    #[test]
    fn connections_leave_descriptors_for_the_rest() {
        assert_eq!(connections_for(None), usize::MAX);
        assert_eq!(connections_for(Some(1024)), 720);
        assert_eq!(connections_for(Some(10)), 0);
    }
}
