//! Places the balls of a scene: sites, then velocities, then the last checks that need all balls at once.
//!
//! This is the only place where random numbers are drawn: xoshiro256++ seeded from the scene's seed, first for the random
//! sites, then for the velocities, both in the order of the file. Normal deviates come from a ziggurat built on `libm`, not on
//! the system's mathematics library, so the same seed gives the same bits on every machine.

use std::collections::HashMap;

use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::checks::{DEEPEST_IN_WALL, DEEPEST_OVERLAP, check, fault, images, in_plane, wrap};
use super::contact_grid::ContactGrid;
use super::reader::number;
use super::{Cell, Rows, Scene, Sites, Species, Velocities};
use crate::domain::Boundary;
use crate::normal::normal_vector;
use crate::snapshot::Units;
use crate::state::{Body, Placement};

/// Random sequential insertion gives up on a ball after this many tries.
const MOST_TRIES: usize = 100_000;

/// Places the balls, or says in one line per fault why they cannot be placed.
pub(super) fn place(scene: &Scene) -> Result<Placement, Vec<String>> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(scene.seed);
    let bodies = all_bodies(scene);
    let positions = all_positions(scene, &bodies, &mut random)?;
    let velocities = all_velocities(scene, &bodies, &mut random);
    check(scene, &bodies, &positions, &velocities)?;
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
    for position in &mut positions {
        *position = wrap(scene, *position);
    }
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
    // In a periodic box whole cells follow one another through the faces.
    let extent = match scene.domain.boundary {
        Boundary::Periodic => edge as f64 * cell_edges,
        Boundary::Container | Boundary::Open => cell.extent(edge) * cell_edges + 2.0 * radius,
    };
    let slack = 2.0 * DEEPEST_IN_WALL * radius + 4.0 * f64::EPSILON * size.max_element();
    if (extent - size).max_element() > slack {
        let (extent, size) = (extent.max_element(), size.min_element());
        let why = format!(
            "{key}: {edge} cells along an edge are {} long{}: must be at most {}",
            number(extent),
            if scene.domain.boundary == Boundary::Periodic {
                ""
            } else {
                " with the balls"
            },
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
    let mut grid = ContactGrid::new(bodies.iter().map(|body| body.radius), scene.domain.volume());
    for (index, position) in positions
        .iter()
        .enumerate()
        .filter(|(_, position)| !position.is_nan())
    {
        grid.insert(index as u32, *position, bodies[index].radius);
    }
    let largest = bodies
        .iter()
        .fold(0.0, |largest, body| body.radius.max(largest));
    for &(species, first) in unplaced {
        for index in first..first + species.count {
            let radius = bodies[index].radius;
            let room = match scene.domain.boundary {
                Boundary::Periodic => scene.domain.half_size,
                Boundary::Container | Boundary::Open => scene.domain.half_size - radius,
            };
            let site = (0..MOST_TRIES).find_map(|_| {
                let unit = DVec3::from_array(random.random::<[f64; 3]>());
                let site = scene.center + (2.0 * unit - 1.0) * room;
                let mut free = !(scene.domain.planes.iter())
                    .any(|plane| in_plane(plane, site - scene.center, radius) >= 0.0);
                for shift in images(scene, site, radius + largest) {
                    free = free && grid.is_free(site + shift, radius);
                }
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
    let mut normal = || normal_vector(random);
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
