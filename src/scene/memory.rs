//! How much memory a run may take, so that a scene that cannot fit is refused before anything is allocated.

use std::fs;

use glam::DVec3;

use crate::domain::Boundary;
use crate::engine::event_driven::{cell_width, record_words, shell_radius};
use crate::engine::windowed::Windowed;
use crate::state::Placement;

/// Bytes per ball that a run needs at its start: trajectory, body, cell, event and observers, rounded up.
pub const BYTES_PER_BALL: u64 = 400;

/// Bytes per ball that a run of a placed scene takes with the engine that `auto` takes, observables aside.
///
/// Source: measured, the largest resident memory of runs of a million balls, less that of runs of a thousand.
pub fn bytes_per_ball(placement: &Placement) -> u64 {
    /// Engine `windowed`: trajectory, collisions, place in a window, start of the echo; placement while it is made, or the
    /// copy for a checkpoint.
    const WINDOWED: u64 = 347;
    /// Engine `event`: trajectory, collisions, candidate, event, range of cells, start of the echo.
    const EVENT: f64 = 148.0;
    /// Boxes moved on, in a periodic box.
    const IMAGE: f64 = 12.0;
    /// Index of a radius and mass, where they are not all alike.
    const KIND: f64 = 4.0;
    /// What the copy for a checkpoint, and its bytes on their way to the disk, add to that.
    const CHECKPOINT: u64 = 125;
    if Windowed::pays(placement) {
        return WINDOWED;
    }
    let periodic = placement.domain.boundary == Boundary::Periodic;
    let kinds = placement.bodies.len() > 1;
    let shell = shell(placement);
    let neighbours = shell.map_or(0.0, |shell| {
        let volume = placement.domain.volume();
        let radius = placement.bodies[0].radius;
        let words = record_words(volume, placement.positions.len(), radius, shell);
        (4 * words) as f64
    });
    let [cells, listed] = cells(placement, shell);
    // A cell has room for 16 balls; where more are listed in some cell, the lists are copied to ones twice as long.
    let room = if listed + 5.0 * listed.sqrt() > 16.0 {
        48
    } else {
        16
    };
    let cells = cells / placement.positions.len().max(1) as f64 * f64::from(4 * (room + 1));
    let bytes = EVENT
        + cells
        + neighbours
        + if periodic { IMAGE } else { 0.0 }
        + if kinds { KIND } else { 0.0 }
        + placement.domain.planes.len() as f64;
    bytes.ceil() as u64 + CHECKPOINT
}

/// Radius of the shells within which engine `event` keeps lists of neighbours, if it does.
fn shell(placement: &Placement) -> Option<f64> {
    let Placement {
        domain,
        bodies,
        positions,
        ..
    } = placement;
    let [body] = bodies.as_slice() else {
        return None;
    };
    let plain = domain.planes.is_empty() && domain.boundary != Boundary::Open;
    plain.then(|| shell_radius(domain.volume(), positions.len(), body.radius))?
}

/// Cells that engine `event` makes, and how many balls are listed in one of them on average.
fn cells(placement: &Placement, shell: Option<f64>) -> [f64; 2] {
    let count = placement.positions.len().max(1) as f64;
    let radius = |&kind: &u32| placement.bodies[kind as usize].radius;
    let mean_radius = match placement.bodies.as_slice() {
        [] => 0.0,
        [body] => body.radius,
        _ => placement.body_of.iter().map(radius).sum::<f64>() / count,
    };
    let volume = placement.domain.volume();
    let (width, reach) = if let Some(shell) = shell {
        (2.0 * (mean_radius + shell), 0.0)
    } else {
        let width = cell_width(volume, placement.positions.len(), mean_radius);
        (width, 2.0 * mean_radius)
    };
    let along = (2.0 * placement.domain.half_size / width)
        .floor()
        .max(DVec3::ONE);
    let cells = along.element_product().min(4.0 * count + 1.0);
    let reached = (1.0 + reach / width).powi(3);
    [cells, count / cells * reached]
}

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
