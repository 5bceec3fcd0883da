//! The memory that a worker may use.

use std::fs;
use std::path::Path;

/// The memory of the machine in MiB, or the limit of a control group, as in a container, if that is lower; none where the system
/// does not report it.
pub(crate) fn memory_mib() -> Option<u32> {
    let total = total_mib(&fs::read_to_string("/proc/meminfo").ok()?)?;
    let groups = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    let limit = limit_mib(Path::new("/sys/fs/cgroup"), &groups);
    Some(limit.map_or(total, |limit| limit.min(total)))
}

fn total_mib(text: &str) -> Option<u32> {
    let line = text.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    u32::try_from(kib / 1024).ok()
}

/// The lowest limit of a control group (version 2) and of the groups that contain it; none without a limit.
fn limit_mib(root: &Path, groups: &str) -> Option<u32> {
    let own = groups.lines().find_map(|line| line.strip_prefix("0::/"))?;
    let limit_of = |group: &Path| -> Option<u32> {
        let bytes: u64 = fs::read_to_string(root.join(group).join("memory.max")).ok()?.trim().parse().ok()?;
        u32::try_from(bytes >> 20).ok()
    };
    Path::new(own).ancestors().filter_map(limit_of).min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn total_memory_is_read_from_meminfo() {
        assert_eq!(total_mib("MemTotal:       24607752 kB\nMemFree: 1 kB\n"), Some(24_031));
        for text in ["", "MemTotal: many kB", "MemFree: 5 kB"] {
            assert_eq!(total_mib(text), None, "{text}");
        }
    }

    #[test]
    fn lowest_limit_of_the_control_groups_holds() {
        let root = tempfile::tempdir().unwrap();
        fs::create_dir_all(root.path().join("pods/one")).unwrap();
        let limit = |groups| limit_mib(root.path(), groups);
        let set = |name: &str, text: &str| fs::write(root.path().join(name), text).unwrap();
        assert_eq!(limit("0::/pods/one\n"), None);
        set("pods/one/memory.max", "max\n");
        assert_eq!(limit("0::/pods/one\n"), None);
        set("pods/one/memory.max", "4294967296\n");
        set("pods/memory.max", "8589934592\n");
        assert_eq!(limit("0::/pods/one\n"), Some(4096));
        assert_eq!(limit("0::/pods\n"), Some(8192));
        // A container sees its own group as the root.
        set("memory.max", "1073741824\n");
        assert_eq!(limit("0::/\n"), Some(1024));
        assert_eq!(limit("1:memory:/old\n"), None);
    }
}
