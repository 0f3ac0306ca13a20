//! What must hold of placed balls, in words when it does not: inside the domain, clear of planes, free of overlaps.

use glam::DVec3;

use super::contact_grid::ContactGrid;
use super::reader::{number, one_line};
use super::region::RADII_PER_PERIOD;
use super::{Ball, Scene, Species};
use crate::domain::{Boundary, Plane};
use crate::snapshot::Units;
use crate::state::Body;

/// Deepest overlap that is taken for rounding and accepted, relative to the contact distance.
pub(super) const DEEPEST_OVERLAP: f64 = 1e-7;

/// How far a ball may stand in a wall or a plane, relative to its radius.
pub(super) const DEEPEST_IN_WALL: f64 = 1e-9;

/// Enough overlapping pairs to stop looking for more.
const MOST_OVERLAPS: usize = 1000;

/// Speed of light \[m/s\]: a classical gas in SI units stays far below it. Source: the SI brochure, 9th edition (exact).
const SPEED_OF_LIGHT: f64 = 299_792_458.0;

/// Largest speed that can be squared without overflow, with room to spare.
const LARGEST_SPEED: f64 = 1e150;

/// Checks placed balls; at most one fault, the worst of its kind.
pub(super) fn check(
    scene: &Scene,
    bodies: &[Body],
    positions: &[DVec3],
    velocities: &[DVec3],
) -> Result<(), Vec<String>> {
    check_inside(scene, bodies, positions)?;
    check_planes(scene, bodies, positions)?;
    check_overlaps(scene, bodies, positions)?;
    check_speeds(scene, bodies, velocities)
}

/// The image of a position that lies in the periodic box; elsewhere the position itself.
pub(super) fn wrap(scene: &Scene, position: DVec3) -> DVec3 {
    let (half, relative) = (scene.domain.half_size, position - scene.center);
    if scene.domain.boundary != Boundary::Periodic || relative.abs().cmple(half).all() {
        return position;
    }
    let period = scene.domain.period();
    let wrapped = relative - period * ((relative + half) / period).floor();
    wrapped.clamp(-half, half) + scene.center
}

/// Shifts at which a ball may meet others that reach up to `reach` from its centre: none, and whole periods near a face.
pub(super) fn images(scene: &Scene, position: DVec3, reach: f64) -> impl Iterator<Item = DVec3> {
    let (half, period) = (scene.domain.half_size, scene.domain.period());
    let relative = position - scene.center;
    let near = move |axis: usize, step: i8| match step {
        _ if period[axis] == 0.0 => step == 0,
        1 => relative[axis] + half[axis] < reach,
        -1 => half[axis] - relative[axis] < reach,
        _ => true,
    };
    // Most are far from every face.
    let inside = (relative.abs() + reach).cmple(half).all() || period == DVec3::ZERO;
    let steps = [0_i8, 1, -1];
    let all = steps
        .into_iter()
        .flat_map(move |x| steps.map(|y| (x, y)))
        .flat_map(move |(x, y)| steps.map(|z| [x, y, z]));
    all.take(if inside { 1 } else { 27 })
        .filter(move |image| (0..3).all(|axis| near(axis, image[axis])))
        .map(move |image| DVec3::from_array(image.map(f64::from)) * period)
}

/// How far a ball reaches into a plane: negative if it is clear of it. A point in the plane reaches 0 far.
pub(super) fn in_plane(plane: &Plane, position: DVec3, radius: f64) -> f64 {
    radius - plane.distance(position).abs()
}

fn check_inside(scene: &Scene, bodies: &[Body], positions: &[DVec3]) -> Result<(), Vec<String>> {
    let half_size = scene.domain.half_size;
    if scene.domain.boundary == Boundary::Periodic {
        let room = 2.0 * half_size.min_element() / RADII_PER_PERIOD;
        let large = bodies.iter().position(|body| body.radius > room);
        return large.map_or(Ok(()), |index| {
            let why = format!(
                "{}: radius = {}: must be at most {}, a quarter of the periodic box's smallest edge",
                ball_name(scene, index),
                number(bodies[index].radius),
                number(room)
            );
            Err(vec![fault(scene, line_of(scene, index), &why)])
        });
    }
    let place = match scene.domain.boundary {
        Boundary::Open => "the size, where the balls begin",
        _ => "the container",
    };
    let overshoot = |index: usize| {
        let reach = (positions[index] - scene.center).abs() + bodies[index].radius;
        (reach - half_size).max_element()
    };
    refuse_worst(scene, bodies, positions, overshoot, &|index, depth| {
        format!(
            "{}: position = {}: reaches {} beyond {place}: must be inside",
            ball_name(scene, index),
            show(positions[index]),
            number(depth)
        )
    })
}

/// Refuses balls that reach too far, in the words of the one that reaches farthest.
fn refuse_worst(
    scene: &Scene,
    bodies: &[Body],
    positions: &[DVec3],
    depth: impl Fn(usize) -> f64,
    words: &dyn Fn(usize, f64) -> String,
) -> Result<(), Vec<String>> {
    let mut refused = 0_usize;
    let mut worst = (f64::NEG_INFINITY, 0);
    for (index, body) in bodies.iter().enumerate().take(positions.len()) {
        let depth = depth(index);
        if !(depth <= DEEPEST_IN_WALL * body.radius) {
            refused += 1;
            if !(depth <= worst.0) {
                worst = (depth, index);
            }
        }
    }
    if refused == 0 {
        return Ok(());
    }
    let (depth, index) = worst;
    let others = match refused {
        1 => String::new(),
        _ => format!(" ({refused} balls are not)"),
    };
    let why = words(index, depth) + &others;
    Err(vec![fault(scene, line_of(scene, index), &why)])
}

fn check_planes(scene: &Scene, bodies: &[Body], positions: &[DVec3]) -> Result<(), Vec<String>> {
    for (number_of_plane, plane) in (1..).zip(&scene.domain.planes) {
        let depth = |index: usize| {
            let depth = in_plane(plane, positions[index] - scene.center, bodies[index].radius);
            // A point in the plane is on neither side of it.
            if depth == 0.0 && bodies[index].radius == 0.0 {
                f64::MIN_POSITIVE
            } else {
                depth
            }
        };
        refuse_worst(scene, bodies, positions, depth, &|index, depth| {
            let how = if bodies[index].radius == 0.0 {
                "lies in".to_owned()
            } else {
                format!("reaches {} into", number(depth))
            };
            let position = show(positions[index]);
            format!(
                "{}: position = {position}: {how} [[plane]] {number_of_plane}: must be clear of it",
                ball_name(scene, index)
            )
        })?;
    }
    check_planes_of_periodic_box(scene, positions)
}

/// A ball that leaves a periodic box through a face must not find itself beyond a plane: where a plane's normal has a
/// component along an axis, planes across that axis must keep every ball from its two faces.
fn check_planes_of_periodic_box(scene: &Scene, positions: &[DVec3]) -> Result<(), Vec<String>> {
    let planes = &scene.domain.planes;
    if scene.domain.boundary != Boundary::Periodic {
        return Ok(());
    }
    for axis in (0..3).filter(|&axis| planes.iter().any(|plane| plane.normal[axis] != 0.0)) {
        // Where planes across the axis stand on it.
        let stands: Vec<f64> = (planes.iter())
            .filter(|plane| plane.normal[axis].abs() == 1.0)
            .map(|plane| plane.offset * plane.normal[axis])
            .collect();
        let is_kept = |position: &DVec3| {
            let place = position[axis] - scene.center[axis];
            stands.iter().any(|stand| *stand < place) && stands.iter().any(|stand| *stand > place)
        };
        if let Some(index) = positions.iter().position(|position| !is_kept(position)) {
            let name = ["x", "y", "z"][axis];
            let why = format!(
                "{}: position = {}: leaves the periodic box along {name}, where a [[plane]] stands in the way of its images: \
                 must be kept between two planes across {name}, or the domain be a container",
                ball_name(scene, index),
                show(positions[index]),
            );
            return Err(vec![fault(scene, line_of(scene, index), &why)]);
        }
    }
    Ok(())
}

fn check_overlaps(scene: &Scene, bodies: &[Body], positions: &[DVec3]) -> Result<(), Vec<String>> {
    let mut grid = ContactGrid::new(bodies.iter().map(|body| body.radius), scene.domain.volume());
    let mut overlapping = 0_usize;
    let mut worst = (0.0, 0, 0);
    let largest = bodies
        .iter()
        .fold(0.0, |largest, body| body.radius.max(largest));
    // Largest first: to look for large balls from a small one is cheap, the other way round it is not.
    let mut order: Vec<usize> = (0..positions.len()).collect();
    if bodies.iter().any(|body| body.radius < largest) {
        order.sort_by(|&a, &b| bodies[b].radius.total_cmp(&bodies[a].radius));
    }
    for index in order {
        let (position, radius) = (positions[index], bodies[index].radius);
        for shift in images(scene, position, radius + largest) {
            grid.near(position + shift, radius, |other, distance, contact| {
                let depth = (contact - distance) / contact;
                if depth > DEEPEST_OVERLAP {
                    overlapping += 1;
                    if depth > worst.0 {
                        worst = (depth, index.min(other as usize), index.max(other as usize));
                    }
                }
                overlapping < MOST_OVERLAPS
            });
        }
        if overlapping >= MOST_OVERLAPS {
            break;
        }
        if radius > 0.0 {
            grid.insert(index as u32, position, radius); // points never meet one another
        }
    }
    if overlapping == 0 {
        return Ok(());
    }
    let (depth, first, second) = worst;
    let names = format!(
        "{} and {}",
        ball_name(scene, first),
        ball_name(scene, second)
    );
    let found = if positions[first] == positions[second] {
        format!("{names}: position = {} of both", show(positions[first]))
    } else {
        format!(
            "{names}: overlap = {} of the contact distance",
            number(depth)
        )
    };
    let others = match overlapping {
        1 => String::new(),
        MOST_OVERLAPS => format!(" (at least {overlapping} pairs overlap)"),
        _ => format!(" ({overlapping} pairs overlap)"),
    };
    let limit = format!("must overlap by at most {DEEPEST_OVERLAP:e}");
    let why = format!("{found}: {limit}{others}");
    Err(vec![fault(scene, line_of(scene, second), &why)])
}

fn check_speeds(scene: &Scene, bodies: &[Body], velocities: &[DVec3]) -> Result<(), Vec<String>> {
    let is_fixed = |index: usize| bodies[index].mass.is_infinite();
    if let Some(index) =
        (0..velocities.len()).find(|&index| is_fixed(index) && velocities[index] != DVec3::ZERO)
    {
        let why = format!(
            "{}: velocity = {}: a ball of infinite mass is fixed: must be [0, 0, 0]",
            ball_name(scene, index),
            show(velocities[index])
        );
        return Err(vec![fault(scene, line_of(scene, index), &why)]);
    }
    let limit = if scene.units == Units::Si {
        SPEED_OF_LIGHT
    } else {
        LARGEST_SPEED
    };
    let Some(index) = velocities
        .iter()
        .position(|v| !v.abs().cmplt(DVec3::splat(limit)).all())
    // also true of NaN
    else {
        return Ok(());
    };
    let why = format!(
        "{}: velocity = {}: each component must be below {limit:e}{}",
        ball_name(scene, index),
        show(velocities[index]),
        if scene.units == Units::Si {
            ", the speed of light"
        } else {
            ""
        }
    );
    Err(vec![fault(scene, line_of(scene, index), &why)])
}

pub(super) fn fault(scene: &Scene, line: usize, why: &str) -> String {
    format!("{}:{line}: {}", scene.path.display(), one_line(why))
}

fn show(vector: DVec3) -> String {
    format!(
        "[{}, {}, {}]",
        number(vector.x),
        number(vector.y),
        number(vector.z)
    )
}

/// The species or the explicit ball that a ball comes from, and its number there.
fn origin(scene: &Scene, index: usize) -> (Result<&Species, &Ball>, usize) {
    let mut rest = index;
    for species in &scene.species {
        if rest < species.count {
            return (Ok(species), rest);
        }
        rest -= species.count;
    }
    (Err(&scene.balls[rest]), rest)
}

fn line_of(scene: &Scene, index: usize) -> usize {
    match origin(scene, index).0 {
        Ok(species) => species.line,
        Err(ball) => ball.line,
    }
}

/// "ball 3 of O2", "ball pollen", counted from one.
fn ball_name(scene: &Scene, index: usize) -> String {
    match origin(scene, index) {
        (
            Ok(Species {
                name: Some(name), ..
            }),
            rest,
        ) => format!("ball {} of {name}", rest + 1),
        (
            Err(Ball {
                name: Some(name), ..
            }),
            _,
        ) => format!("ball {name}"),
        (Ok(_), _) => format!("ball {}", index + 1),
        (Err(_), rest) => format!("[[ball]] {}", rest + 1),
    }
}
