//! One step of the gas: in each cell partners collide, then every ball flies on and is put into the bin of its new cell.

use std::ops::Range;

use glam::{DVec3, IVec3};
use pulp::{Arch, Scalar, Simd, WithSimd};
use serde::{Deserialize, Serialize};

use super::bins::{Bins, Record, Row};
use super::cells::Cells;
use super::columns::Columns;
use super::flight::Flight;
use super::law::{Mixture, section};
use super::random::{Draws, key};
use super::stock::Stock;
use crate::domain::Boundary;
use crate::event::{Collision, Participants, Wall};
use crate::state::{Bodies, Body, State, Time};

/// How many cells before its turn the memory of the balls of one is asked for.
const CELLS_AHEAD: usize = 2;

/// What does not change from step to step.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Rules {
    pub cells: Cells,
    pub boundary: Boundary,
    /// Half size of the box.
    half_size: DVec3,
    /// Length of a step \[epochs\].
    pub step: f64,
    pub seed: u64,
    pub mixture: Mixture,
    /// Expected tries in a cell, over its number of pairs and its majorant.
    tries: f64,
    /// What the way that partners are moved apart is multiplied by, because a step undoes a part of it.
    stretch: f64,
    /// Least majorant of the relative speed, times the section over the largest.
    pub floor: f32,
    /// How far the centre of the largest ball gets from the middle.
    pub nearest: [f32; 3],
    /// Largest product of cross section and contact value.
    largest_section: f64,
}

/// Deviations of the relative velocity that the least majorant has room for: 6.2 of one ball's.
const ROOM: f64 = 4.384;

impl Rules {
    /// Rules for steps of `share` mean free times of a gas, which is `step` epochs.
    pub fn new(
        state: &State,
        mixture: Mixture,
        cells: Cells,
        (share, step): (f64, f64),
        seed: u64,
    ) -> Self {
        let largest_section = mixture.largest_section();
        let mut rules = Self {
            boundary: state.domain.boundary,
            half_size: state.domain.half_size,
            step,
            seed,
            // Pairs meet at the rate `section contact_value speed / volume`; a try draws one of a cell's pairs.
            tries: 0.5 * step * mixture.shielding * largest_section / cells.volume(),
            stretch: 1.0 / (1.0 - 0.25 * share),
            floor: (ROOM * mixture.fastest_meeting() / largest_section) as f32,
            nearest: [0.0; 3],
            largest_section,
            mixture,
            cells,
        };
        let largest = Body {
            radius: state.bodies.largest_radius(),
            mass: 0.0,
        };
        rules.nearest = rules.limits(&largest);
        rules
    }

    /// How far the centre of a ball gets from the middle, along each axis.
    #[inline]
    pub fn limits(&self, body: &Body) -> [f32; 3] {
        let keeps = if self.boundary == Boundary::Container {
            body.radius
        } else {
            0.0
        };
        (self.half_size - keeps).as_vec3().to_array()
    }

    /// Where a ball is after a free flight, its velocity then, and how many periodic boxes it has moved on.
    pub fn flown(
        &self,
        position: DVec3,
        velocity: DVec3,
        time: f64,
        body: &Body,
    ) -> (DVec3, DVec3, IVec3) {
        let (mut position, mut velocity) = (position + velocity * time, velocity);
        if self.boundary == Boundary::Periodic {
            let boxes = (0.5 * position / self.half_size).round();
            return (
                position - 2.0 * boxes * self.half_size,
                velocity,
                boxes.as_ivec3(),
            );
        }
        let limits = self.half_size - body.radius;
        for axis in 0..3 {
            while position[axis].abs() > limits[axis] {
                position[axis] = 2.0_f64.copysign(position[axis]) * limits[axis] - position[axis];
                velocity[axis] = -velocity[axis];
            }
        }
        (position, velocity, IVec3::ZERO)
    }

    /// Cross section and contact value of two balls, over the largest.
    #[inline]
    fn relative_section(&self, bodies: [Body; 2]) -> f32 {
        let [a, b] = &bodies;
        (section(a, b) * self.mixture.contact_value([a.radius, b.radius]) / self.largest_section)
            as f32
    }
}

/// What happened in a plane of cells, and how many balls were in it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    pub balls: u64,
    pub pair_collisions: u64,
    pub wall_collisions: u64,
    /// `sum of r . dp` over the pair collisions.
    pub pair_virial: f64,
    /// Momentum given to the walls.
    pub wall_impulse: f64,
}

/// What was noted one by one: who left a periodic box through which face, and collisions.
pub type Notes = (Vec<(u32, Wall)>, Vec<Collision>);

/// One thread's share of a step.
pub struct Share<'a> {
    /// Which thread it is.
    pub number: usize,
    pub planes: Range<usize>,
    pub tallies: &'a mut [Tally],
    pub majorants: &'a mut [f32],
    /// The balls in its planes, and where those that fly to them are put.
    pub own: &'a mut Bins,
    /// Where those are put that fly to others'.
    pub sent: &'a mut Bins,
    /// What happened, as far as it is noted.
    pub notes: Notes,
}

/// When a step's collisions are, and what their draws depend on.
#[derive(Clone, Copy, Debug)]
pub struct Instant {
    pub number: u64,
    pub time: Time,
    /// How long the flight lasts that follows \[epochs\].
    pub flight: f64,
}

/// Runs a share of the step, given what all have sent in the step before. `EACH` keeps every collision, `ALIKE` is for balls of
/// one radius and mass.
pub fn run<const EACH: bool, const ALIKE: bool>(
    rules: &Rules,
    bodies: &Bodies,
    sent: &[Bins],
    now: Instant,
    share: &mut Share,
) {
    Arch::new().dispatch(Round::<EACH, ALIKE> {
        rules,
        bodies,
        sent,
        now,
        share,
    });
}

/// A share of a step.
struct Round<'a, 's, const EACH: bool, const ALIKE: bool> {
    rules: &'a Rules,
    bodies: &'a Bodies,
    sent: &'a [Bins],
    now: Instant,
    share: &'a mut Share<'s>,
}

impl<const EACH: bool, const ALIKE: bool> WithSimd for Round<'_, '_, EACH, ALIKE> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self {
            rules,
            bodies,
            sent,
            now,
            share,
        } = self;
        let key = key(rules.seed, now.number);
        let per_plane = rules.cells.per_plane();
        let own = share.planes.start * per_plane..share.planes.end * per_plane;
        let (lower, upper) = (&sent[..share.number], &sent[share.number + 1..]);
        let mut flight = Flight::<EACH, ALIKE>::new(rules, bodies, now);
        let mut balls = Columns::default();
        for plane in share.planes.clone() {
            let mut tally = Tally::default();
            for cell in plane * per_plane..(plane + 1) * per_plane {
                if cell + CELLS_AHEAD < own.end {
                    share.own.read_ahead(cell + CELLS_AHEAD);
                }
                balls.fill(simd, |balls| {
                    for stretch in lower.iter().flat_map(|bins| bins.of(cell)) {
                        balls.extend_from_slice(stretch);
                    }
                    share.own.take(cell, balls);
                    for stretch in upper.iter().flat_map(|bins| bins.of(cell)) {
                        balls.extend_from_slice(stretch);
                    }
                });
                tally.balls += balls.count() as u64;
                let majorant = &mut share.majorants[cell - own.start];
                let meetings = Meetings {
                    rules,
                    bodies,
                    now,
                    each: EACH.then_some(&mut flight.collisions),
                };
                meetings.run::<ALIKE>(&mut balls, majorant, Draws::new(key, cell), &mut tally);
                flight.fly(&mut balls);
                flight.land(simd, &balls, &mut tally, |rows, cells| {
                    let mut inside = share.own.writer(rows.len());
                    let mut outside = share.sent.writer(rows.len());
                    for (&row, &cell) in rows.iter().zip(cells) {
                        if own.contains(&(cell as usize)) {
                            inside.put(cell as usize, row);
                        } else {
                            outside.put(cell as usize, row);
                        }
                    }
                });
            }
            share.tallies[plane - share.planes.start] = tally;
        }
        share.notes = flight.notes();
    }
}

/// Puts balls into bins after a flight; gives what was noted on it.
pub fn put(
    rules: &Rules,
    bodies: &Bodies,
    balls: &[Record],
    now: Instant,
    stock: &mut Stock,
) -> (Notes, Tally) {
    let simd = Scalar::new();
    let mut tally = Tally::default();
    let mut flight = Flight::<true, false>::new(rules, bodies, now);
    let mut columns = Columns::default();
    let rows = balls.iter().map(|&record| Row::from(record));
    columns.fill(simd, |all| all.extend(rows));
    flight.fly(&mut columns);
    flight.land(simd, &columns, &mut tally, |rows, cells| {
        for (&row, &cell) in rows.iter().zip(cells) {
            stock.put(cell as usize, row);
        }
    });
    (flight.notes(), tally)
}

/// The collisions of a cell: as many tries as its fastest pair could need, each accepted by what the pair does need.
///
/// Source: Bird, Molecular Gas Dynamics and the Direct Simulation of Gas Flows (1994), 11.1: no time counter.
struct Meetings<'a> {
    rules: &'a Rules,
    bodies: &'a Bodies,
    now: Instant,
    each: Option<&'a mut Vec<Collision>>,
}

impl Meetings<'_> {
    #[inline(always)]
    fn run<const ALIKE: bool>(
        mut self,
        balls: &mut Columns,
        majorant: &mut f32,
        mut draws: Draws,
        tally: &mut Tally,
    ) {
        let count = balls.count();
        if count < 2 {
            return;
        }
        let rules = self.rules;
        let pairs = count as f64 * (count as f64 - 1.0);
        let tries = (pairs * rules.tries * f64::from(*majorant) + draws.share()) as u64;
        let body = self.bodies.kinds()[0];
        let all = self.bodies;
        let bodies_of = |balls: &Columns, pair: [usize; 2]| {
            pair.map(|place| all.of(balls.ball(place) as usize))
        };
        let limit = *majorant;
        let mut largest = limit;
        for _ in 0..tries {
            let (first, second, share) = draws.pair(count);
            let (a, b) = (balls.velocity(first), balls.velocity(second));
            let velocity = [0, 1, 2].map(|axis| a[axis] - b[axis]);
            let square =
                velocity[0] * velocity[0] + velocity[1] * velocity[1] + velocity[2] * velocity[2];
            let need = if ALIKE {
                square
            } else {
                let section = rules.relative_section(bodies_of(balls, [first, second]));
                section * section * square
            };
            // The majorant grows for the next step only: within this one it would favour the tries before.
            if need > largest * largest {
                largest = need.sqrt();
            }
            let threshold = share * limit;
            if need > threshold * threshold {
                let bodies = if ALIKE {
                    [body; 2]
                } else {
                    bodies_of(balls, [first, second])
                };
                self.collide([first, second], bodies, balls, &mut draws, tally);
            }
        }
        *majorant = largest;
    }

    /// Two balls part in a random direction, and are moved apart along the line of their centres.
    ///
    /// Source: Alexander, Garcia & Alder, Phys. Rev. Lett. 74, 5212 (1995): the way that momentum leaps between the centres
    /// of balls that touch, without which the pressure would be that of points. For unequal masses the centre of mass stays.
    #[inline(always)]
    fn collide(
        &mut self,
        pair: [usize; 2],
        bodies: [Body; 2],
        balls: &mut Columns,
        draws: &mut Draws,
        tally: &mut Tally,
    ) {
        let wide = |vector: [f32; 3]| DVec3::from_array(vector.map(f64::from));
        let before = pair.map(|place| wide(balls.velocity(place)));
        let mass = bodies[0].mass + bodies[1].mass;
        let shares = [bodies[1].mass / mass, bodies[0].mass / mass];
        let relative = before[0] - before[1];
        let centre = before[1] + relative * shares[1];
        let parting = DVec3::from_array(draws.direction()) * relative.length();
        let change = parting - relative;
        let size = change.length();
        if size == 0.0 {
            return;
        }
        let contact = bodies[0].radius + bodies[1].radius;
        let line = change / size;
        let way = 2.0 * contact * self.rules.stretch;
        let after = [centre + parting * shares[0], centre - parting * shares[1]];
        let virial = shares[0] * bodies[0].mass * contact * size;
        tally.pair_collisions += 1;
        tally.pair_virial += virial;
        let mut jump = 0.0;
        for one in [0, 1] {
            let moved = if one == 0 {
                line * (way * shares[0])
            } else {
                -line * (way * shares[1])
            };
            let from = wide(balls.position(pair[one]));
            let mut to = (from + moved).as_vec3().to_array();
            if self.rules.boundary == Boundary::Container {
                // Centres stay between the walls.
                let limits = self.rules.limits(&bodies[one]);
                (0..3).for_each(|axis| to[axis] = to[axis].clamp(-limits[axis], limits[axis]));
            }
            let velocity = after[one].as_vec3().to_array();
            balls.collide(pair[one], to, velocity);
            if self.each.is_some() {
                jump += bodies[one].mass * (wide(to).dot(wide(velocity)) - from.dot(before[one]));
            }
        }
        if let Some(collisions) = &mut self.each {
            let numbers = pair.map(|place| balls.ball(place));
            let [low, high] = if numbers[0] < numbers[1] {
                [0, 1]
            } else {
                [1, 0]
            };
            let impulse = (after[low] - before[low]) * bodies[low].mass;
            collisions.push(Collision {
                time: self.now.time,
                participants: Participants::Pair(numbers[low], numbers[high]),
                impulse,
                external: DVec3::ZERO,
                virial,
                radial_jump: jump,
                gap: f64::NAN,
            });
        }
    }
}
