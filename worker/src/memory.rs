//! The memory of the machine.

use std::fs;

/// The memory of the machine in MiB; none where the system does not report it.
pub(crate) fn memory_mib() -> Option<u32> {
    total_mib(&fs::read_to_string("/proc/meminfo").ok()?)
}

fn total_mib(text: &str) -> Option<u32> {
    let line = text.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    u32::try_from(kib / 1024).ok()
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
}
