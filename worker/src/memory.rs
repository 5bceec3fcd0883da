//! Memory of the machine.

use std::fs;

/// Memory that the device has for jobs, in MiB: that of the machine, as far as it says. None where it does not.
pub(crate) fn memory_mib() -> Option<u32> {
    in_meminfo(&fs::read_to_string("/proc/meminfo").ok()?)
}

fn in_meminfo(text: &str) -> Option<u32> {
    let line = text.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    u32::try_from(kib / 1024).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_memory_of_the_machine_is_read() {
        assert_eq!(in_meminfo("MemTotal:       24607752 kB\nMemFree: 1 kB\n"), Some(24_031));
        for text in ["", "MemTotal: many kB", "MemFree: 5 kB"] {
            assert_eq!(in_meminfo(text), None, "{text}");
        }
    }
}
