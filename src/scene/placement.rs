//! Places the balls of a scene: sites, then velocities, then the last checks that need all balls at once.
//!
//! This is the only place where random numbers are drawn: xoshiro256++ seeded from the scene's seed, first for the random
//! sites, then for the velocities, both in the order of the file. Normal deviates come from a ziggurat built on `libm`, not on
//! the system's mathematics library, so the same seed gives the same bits on every machine.

use std::collections::HashMap;

use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::contact_grid::ContactGrid;
use super::reader::number;
use super::{Cell, Rows, Scene, Sites, Species, Velocities};
use crate::snapshot::Units;
use crate::state::{Body, Placement};

/// Deepest overlap that is taken for rounding and accepted, relative to the contact distance.
const DEEPEST_OVERLAP: f64 = 1e-7;

/// How far a ball may stand in a wall, relative to its radius.
const DEEPEST_IN_WALL: f64 = 1e-9;

/// Random sequential insertion gives up on a ball after this many tries.
const MOST_TRIES: usize = 100_000;

/// Enough overlapping pairs to stop looking for more.
const MOST_OVERLAPS: usize = 1000;

/// Speed of light \[m/s\]: a classical gas in SI units stays far below it. Source: the SI brochure, 9th edition (exact).
const SPEED_OF_LIGHT: f64 = 299_792_458.0;

/// Largest speed that can be squared without overflow, with room to spare.
const LARGEST_SPEED: f64 = 1e150;

/// Places the balls, or says in one line per fault why they cannot be placed.
pub(super) fn place(scene: &Scene) -> Result<Placement, Vec<String>> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(scene.seed);
    let bodies = all_bodies(scene);
    let positions = all_positions(scene, &bodies, &mut random)?;
    let velocities = all_velocities(scene, &bodies, &mut random);
    check_container(scene, &bodies, &positions)?;
    check_overlaps(scene, &bodies, &positions)?;
    check_speeds(scene, &velocities)?;
    let (bodies, body_of) = distinct(&bodies);
    Ok(Placement {
        domain: scene.domain.clone(),
        center: scene.center,
        bodies,
        body_of,
        positions,
        velocities,
    })
}

/// Radius and mass of every ball.
fn all_bodies(scene: &Scene) -> Vec<Body> {
    let mut bodies = Vec::with_capacity(scene.ball_count());
    for species in &scene.species {
        bodies.extend((0..species.count).map(|index| body_of(species, index)));
    }
    bodies.extend(scene.balls.iter().map(|ball| Body {
        radius: ball.radius,
        mass: ball.mass,
    }));
    bodies
}

fn body_of(species: &Species, index: usize) -> Body {
    let (radii, masses) = match &species.sites {
        Sites::Rows(rows) => (rows.radii.as_ref(), rows.masses.as_ref()),
        _ => (None, None),
    };
    Body {
        radius: species
            .radius
            .or_else(|| Some(radii?[index]))
            .expect("a species without a radius has a column of radii"),
        mass: species
            .mass
            .or_else(|| Some(masses?[index]))
            .expect("a species without a mass has a column of masses"),
    }
}

fn all_positions(
    scene: &Scene,
    bodies: &[Body],
    random: &mut Xoshiro256PlusPlus,
) -> Result<Vec<DVec3>, Vec<String>> {
    let mut positions = Vec::with_capacity(bodies.len());
    let mut unplaced = Vec::new(); // random species, and the index of their first ball
    for species in &scene.species {
        match &species.sites {
            Sites::Lattice { cell, spacing } => {
                let spacing = lattice_spacing(scene, species, *cell, *spacing)?;
                positions.extend(
                    cell.sites(species.count, spacing)
                        .map(|site| scene.center + site),
                );
            }
            Sites::Rows(rows) => positions.extend_from_slice(&rows.positions),
            Sites::Random => {
                unplaced.push((species, positions.len()));
                positions.resize(positions.len() + species.count, DVec3::NAN);
            }
        }
    }
    positions.extend(scene.balls.iter().map(|ball| ball.position));
    if !unplaced.is_empty() {
        // Large balls find room only while there are few others.
        let radius = |species: &Species| species.radius.expect("a random species has a radius");
        unplaced.sort_by(|a, b| radius(b.0).total_cmp(&radius(a.0)));
        insert_at_random(scene, bodies, &unplaced, &mut positions, random)?;
    }
    Ok(positions)
}

/// Edges of a lattice cell, after checking that the lattice fits the container and its balls do not overlap.
fn lattice_spacing(
    scene: &Scene,
    species: &Species,
    cell: Cell,
    spacing: Option<f64>,
) -> Result<DVec3, Vec<String>> {
    let edge = cell.edge_for(species.count);
    let size = 2.0 * scene.domain.half_size;
    let cell_edges = spacing.map_or(size / edge.max(1) as f64, DVec3::splat);
    let radius = species.radius.expect("a lattice species has a radius");
    let (least, cells) = (
        2.0 * radius / cell.neighbour_distance(),
        species.count.min(2),
    );
    let key = spacing.map_or_else(
        || "spacing".to_owned(),
        |spacing| format!("spacing = {spacing:?}"),
    );
    if cells > 1 && cell_edges.min_element() < least * (1.0 - DEEPEST_OVERLAP) {
        let found = cell_edges.min_element();
        let why = format!(
            "{key}: neighbours overlap: the cells are {} wide: must be at least {}",
            number(found),
            number(least)
        );
        return Err(vec![fault(scene, species.line, &why)]);
    }
    let extent = cell.extent(edge) * cell_edges + 2.0 * radius;
    if (extent - size).max_element() > 2.0 * DEEPEST_IN_WALL * radius {
        let (extent, size) = (extent.max_element(), size.min_element());
        let why = format!(
            "{key}: {edge} cells along an edge are {} long with the balls: must be at most {}",
            number(extent),
            number(size)
        );
        return Err(vec![fault(scene, species.line, &why)]);
    }
    Ok(cell_edges)
}

/// Random sequential insertion: each ball at the first place drawn where there is room.
fn insert_at_random(
    scene: &Scene,
    bodies: &[Body],
    unplaced: &[(&Species, usize)],
    positions: &mut [DVec3],
    random: &mut Xoshiro256PlusPlus,
) -> Result<(), Vec<String>> {
    let mut grid = ContactGrid::new(bodies.iter().map(|body| body.radius));
    for (index, position) in positions
        .iter()
        .enumerate()
        .filter(|(_, position)| !position.is_nan())
    {
        grid.insert(index as u32, *position, bodies[index].radius);
    }
    for &(species, first) in unplaced {
        for index in first..first + species.count {
            let radius = bodies[index].radius;
            let room = scene.domain.half_size - radius;
            let site = (0..MOST_TRIES).find_map(|_| {
                let unit = DVec3::from_array(random.random::<[f64; 3]>());
                let site = scene.center + (2.0 * unit - 1.0) * room;
                let mut free = true;
                grid.near(site, radius, |_, _, _| {
                    free = false;
                    false
                });
                free.then_some(site)
            });
            let Some(site) = site else {
                let (placed, count) = (index - first, species.count);
                let why = format!(
                    "count = {count}: random placement found room for {placed} and none for the next in {MOST_TRIES} tries: \
                     must be fewer, or on a lattice (random placement jams near a packing fraction of 0.38)"
                );
                return Err(vec![fault(scene, species.line, &why)]);
            };
            positions[index] = site;
            grid.insert(index as u32, site, radius);
        }
    }
    Ok(())
}

fn all_velocities(scene: &Scene, bodies: &[Body], random: &mut Xoshiro256PlusPlus) -> Vec<DVec3> {
    let mut velocities = Vec::with_capacity(bodies.len());
    for species in &scene.species {
        for index in 0..species.count {
            let mass = bodies[velocities.len()].mass;
            velocities.push(match species.velocities {
                Some(rule) => draw(rule, mass, scene.units, random),
                None => match &species.sites {
                    Sites::Rows(Rows {
                        velocities: Some(velocities),
                        ..
                    }) => velocities[index],
                    _ => unreachable!(
                        "a species without a rule for velocities has columns of velocities"
                    ),
                },
            });
        }
    }
    velocities.extend(scene.balls.iter().map(|ball| ball.velocity));
    velocities
}

fn draw(rule: Velocities, mass: f64, units: Units, random: &mut Xoshiro256PlusPlus) -> DVec3 {
    let mut normal = || DVec3::from_array([(); 3].map(|()| StandardNormal.sample(random)));
    match rule {
        Velocities::Maxwell { temperature } => {
            normal() * (units.boltzmann() * temperature / mass).sqrt()
        }
        Velocities::Normal { deviation } => normal() * deviation,
        Velocities::Speed { value } => loop {
            let direction = normal();
            let length = direction.length();
            if length > 0.0 {
                return direction * (value / length);
            }
        },
        Velocities::Rest => DVec3::ZERO,
    }
}

fn check_container(scene: &Scene, bodies: &[Body], positions: &[DVec3]) -> Result<(), Vec<String>> {
    let half_size = scene.domain.half_size;
    let mut outside = 0_usize;
    let mut worst = (0.0, 0);
    for (index, (position, body)) in positions.iter().zip(bodies).enumerate() {
        let overshoot = ((*position - scene.center).abs() + body.radius - half_size).max_element();
        if overshoot > DEEPEST_IN_WALL * body.radius {
            outside += 1;
            if overshoot > worst.0 {
                worst = (overshoot, index);
            }
        }
    }
    if outside == 0 {
        return Ok(());
    }
    let (overshoot, index) = worst;
    let why = format!(
        "{}: position = {}: reaches {} beyond the container: must be inside{}",
        ball_name(scene, index),
        show(positions[index]),
        number(overshoot),
        if outside > 1 {
            format!(" ({outside} balls are not)")
        } else {
            String::new()
        }
    );
    Err(vec![fault(scene, line_of(scene, index), &why)])
}

fn check_overlaps(scene: &Scene, bodies: &[Body], positions: &[DVec3]) -> Result<(), Vec<String>> {
    let mut grid = ContactGrid::new(bodies.iter().map(|body| body.radius));
    let mut overlapping = 0_usize;
    let mut worst = (0.0, 0, 0);
    for (index, (position, body)) in positions.iter().zip(bodies).enumerate() {
        grid.near(*position, body.radius, |other, distance, contact| {
            let depth = (contact - distance) / contact;
            if depth > DEEPEST_OVERLAP {
                overlapping += 1;
                if depth > worst.0 {
                    worst = (depth, other as usize, index);
                }
            }
            overlapping < MOST_OVERLAPS
        });
        if overlapping >= MOST_OVERLAPS {
            break;
        }
        grid.insert(index as u32, *position, body.radius);
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

fn check_speeds(scene: &Scene, velocities: &[DVec3]) -> Result<(), Vec<String>> {
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

/// The different bodies in the order of their first ball, and the body of each ball unless all are alike.
fn distinct(all: &[Body]) -> (Vec<Body>, Vec<u32>) {
    let mut bodies: Vec<Body> = Vec::new();
    let mut known: HashMap<(u64, u64), u32> = HashMap::new();
    let mut body_of = Vec::with_capacity(all.len());
    for body in all {
        let key = (body.radius.to_bits(), body.mass.to_bits());
        body_of.push(*known.entry(key).or_insert_with(|| {
            bodies.push(*body);
            bodies.len() as u32 - 1
        }));
    }
    if bodies.len() == 1 {
        body_of = Vec::new();
    }
    (bodies, body_of)
}

fn fault(scene: &Scene, line: usize, why: &str) -> String {
    format!("{}:{line}: {why}", scene.path.display())
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
fn origin(scene: &Scene, index: usize) -> (Result<&Species, &super::Ball>, usize) {
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
            Err(super::Ball {
                name: Some(name), ..
            }),
            _,
        ) => format!("ball {name}"),
        (Ok(_), _) => format!("ball {}", index + 1),
        (Err(_), rest) => format!("[[ball]] {}", rest + 1),
    }
}
