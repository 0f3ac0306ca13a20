//! How much memory a run may take, so that a scene that cannot fit is refused before anything is allocated.

use std::fs;

/// Bytes per ball that a run needs at its start: trajectory, body, cell, event and observers, rounded up.
pub const BYTES_PER_BALL: u64 = 400;

/// Bytes that may still be taken: what the machine has free and what this process's control group allows.
///
/// `None` when the system does not say.
pub fn available() -> Option<u64> {
    let machine = fs::read_to_string("/proc/meminfo")
        .ok()
        .and_then(|text| available_in(&text));
    [machine, control_group()].into_iter().flatten().min()
}

fn available_in(meminfo: &str) -> Option<u64> {
    let rest = meminfo
        .lines()
        .find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kibibytes: u64 = rest.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kibibytes.checked_mul(1024)
}

fn control_group() -> Option<u64> {
    let own = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    // Version 2 has one line, `0::/path`; inside a container the path may not be visible, so the root is asked as well.
    let below = own
        .lines()
        .find_map(|line| line.strip_prefix("0::"))
        .unwrap_or("")
        .trim_end_matches('/');
    let version_2 = [below, ""].map(|path| format!("/sys/fs/cgroup{path}"));
    let version_2 = version_2
        .iter()
        .filter_map(|path| room(path, "memory.max", "memory.current"))
        .min();
    version_2.or_else(|| {
        room(
            "/sys/fs/cgroup/memory",
            "memory.limit_in_bytes",
            "memory.usage_in_bytes",
        )
    })
}

fn room(directory: &str, limit: &str, used: &str) -> Option<u64> {
    let read = |name: &str| {
        fs::read_to_string(format!("{directory}/{name}"))
            .ok()?
            .trim()
            .parse::<u64>()
            .ok()
    };
    Some(read(limit)?.saturating_sub(read(used).unwrap_or(0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_available_memory_is_read_in_bytes() {
        assert_eq!(
            available_in("MemTotal: 9 kB\nMemAvailable:   24 kB\n"),
            Some(24 * 1024)
        );
    }

    #[test]
    fn a_file_that_says_nothing_gives_nothing() {
        assert_eq!(available_in("MemTotal: 9 kB\n"), None);
    }
}
