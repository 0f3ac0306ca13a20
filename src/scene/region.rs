//! Where the balls of a scene live, as its file says: the tables `[domain]` and `[[plane]]`.

use std::ops::Range;

use glam::DVec3;

use super::PlaneText;
use super::reader::{Faults, Table};
use crate::domain::{Boundary, Domain, Plane};

/// Kinds of domains by their names in a scene file.
pub(super) const KINDS: [(&str, Boundary); 3] = [
    ("container", Boundary::Container),
    ("periodic", Boundary::Periodic),
    ("open", Boundary::Open),
];

/// A periodic box is at least this many radii of its largest ball wide, so that a ball never meets itself.
pub(super) const RADII_PER_PERIOD: f64 = 4.0;

/// A domain and its centre.
#[derive(Clone, Debug)]
pub(super) struct Region {
    pub(super) domain: Domain,
    pub(super) center: DVec3,
    /// Where the domain's size stands in the text.
    pub(super) span: Range<usize>,
}

impl Region {
    /// Largest radius that fits, and in words why.
    pub(super) fn room(&self) -> (f64, &'static str) {
        let half = self.domain.half_size.min_element();
        match self.domain.boundary {
            Boundary::Container => (half, "half the container's smallest edge"),
            Boundary::Periodic => (
                2.0 * half / RADII_PER_PERIOD,
                "a quarter of the periodic box's smallest edge",
            ),
            Boundary::Open => (half, "half the smallest edge of the size"),
        }
    }
}

/// Reads `[domain]`.
pub(super) fn read_domain(mut table: Table, faults: &mut Faults) -> Option<Region> {
    const LIMIT: &str = "must be \"container\", \"periodic\" or \"open\"";
    let kind = table.text("kind", faults);
    let boundary = kind.as_ref().and_then(|kind| {
        let known = KINDS.iter().find(|(name, _)| *name == kind.value);
        if known.is_none() {
            faults.value("kind", &kind.span, LIMIT);
        }
        known.map(|(_, boundary)| *boundary)
    });
    if kind.is_none() {
        table.missing("kind", LIMIT, faults);
    }
    let center = table
        .vector("center", faults)
        .map_or(DVec3::ZERO, |center| center.value);
    let limit = "three edges, [x, y, z], each greater than 0";
    let size = table.vector("size", faults);
    let region = match size {
        Some(size) if size.value.cmpgt(DVec3::ZERO).all() => Some(Region {
            domain: Domain {
                boundary: boundary.unwrap_or(Boundary::Container), // after a fault, so that the rest is still judged
                half_size: 0.5 * size.value,
                planes: Vec::new(),
            },
            center,
            span: size.span,
        }),
        Some(size) => {
            faults.value("size", &size.span, &format!("must be {limit}"));
            None
        }
        None => {
            table.missing("size", limit, faults);
            None
        }
    };
    table.finish(faults);
    region
}

/// Reads one `[[plane]]`, relative to the domain's centre.
pub(super) fn read_plane(
    mut table: Table,
    center: DVec3,
    faults: &mut Faults,
) -> Option<(Plane, PlaneText)> {
    let point = table.vector("point", faults);
    let normal = table.vector("normal", faults);
    table.missing("point", "[x, y, z]", faults);
    table.missing("normal", "[x, y, z], not all 0", faults);
    table.finish(faults);
    let (point, normal) = (point?, normal?);
    let made = plane(point.value, normal.value, center);
    if normal.value == DVec3::ZERO {
        let words = "must have a length greater than 0";
        faults.value("normal", &normal.span, words);
    } else if made.is_none() {
        let words = "is too far from the domain's centre";
        faults.value("point", &point.span, words);
    }
    let text = PlaneText {
        point: point.value,
        normal: normal.value,
    };
    made.map(|plane| (plane, text))
}

/// The plane through a point; `None` if the normal has no direction.
pub(super) fn plane(point: DVec3, normal: DVec3, center: DVec3) -> Option<Plane> {
    // By its largest component first, so that no square overflows or underflows.
    let direction = normal / normal.abs().max_element();
    let unit = direction / direction.length();
    let offset = unit.dot(point - center);
    (unit.is_finite() && offset.is_finite()).then_some(Plane {
        normal: unit,
        offset,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_normal_of_any_length_gives_a_unit_normal() {
        for length in [1e-320, 1e-200, 0.5, 7.0, 1e300] {
            let plane = plane(DVec3::X, DVec3::new(length, length, 0.0), DVec3::ZERO)
                .expect("it has a direction");
            assert!((plane.normal.length() - 1.0).abs() < 1e-15);
            assert!((plane.offset - 0.5_f64.sqrt()).abs() < 1e-15);
        }
        assert_eq!(plane(DVec3::ZERO, DVec3::ZERO, DVec3::ZERO), None);
    }
}
