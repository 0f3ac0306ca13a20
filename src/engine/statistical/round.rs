//! One step of the gas: in each cell partners collide, then every ball flies on and is put into the bin of its new cell.

use std::ops::Range;

use glam::{DVec3, IVec3};
use serde::{Deserialize, Serialize};

use super::bins::{Bins, Record};
use super::cells::Cells;
use super::law::{Mixture, section};
use super::random::{Draws, key};
use crate::domain::Boundary;
use crate::event::{Collision, Participants, Wall};
use crate::state::{Bodies, Body, State, Time};

/// Instead of a cell: beyond a wall or face.
const OUTSIDE: u32 = u32::MAX;

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
    nearest: [f32; 3],
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

/// One thread's share of a step.
pub struct Share<'a> {
    pub planes: Range<usize>,
    pub tallies: &'a mut [Tally],
    pub majorants: &'a mut [f32],
    /// Where the balls fly to.
    pub bins: &'a mut Bins,
    /// Where to work out the cells that the balls of one fly to.
    pub cells: Vec<u32>,
    /// In a periodic box: who left through which face.
    pub faces: Vec<(u32, Wall)>,
    /// What happened, one by one, if it is asked for.
    pub collisions: Vec<Collision>,
}

/// When a step's collisions are, and what their draws depend on.
#[derive(Clone, Copy, Debug)]
pub struct Instant {
    pub number: u64,
    pub time: Time,
    /// How long the flight lasts that follows \[epochs\].
    pub flight: f64,
}

/// Runs a share of the step. `EACH` keeps every collision, `ALIKE` is for balls of one radius and mass.
pub fn run<const EACH: bool, const ALIKE: bool>(
    rules: &Rules,
    bodies: &Bodies,
    old: &[Bins],
    now: Instant,
    share: &mut Share,
) {
    let key = key(rules.seed, now.number);
    let per_plane = rules.cells.per_plane();
    let first = share.planes.start * per_plane;
    let mut balls: Vec<Record> = Vec::new();
    for plane in share.planes.clone() {
        let mut tally = Tally::default();
        for cell in plane * per_plane..(plane + 1) * per_plane {
            balls.clear();
            for bins in old {
                bins.of(cell)
                    .for_each(|stretch| balls.extend_from_slice(stretch));
            }
            tally.balls += balls.len() as u64;
            let majorant = &mut share.majorants[cell - first];
            let meetings = Meetings {
                rules,
                bodies,
                now,
                each: EACH.then_some(&mut share.collisions),
            };
            meetings.run::<ALIKE>(&mut balls, majorant, Draws::new(key, cell), &mut tally);
            fly::<EACH, ALIKE>(rules, bodies, &mut balls, now, &mut tally, share);
        }
        share.tallies[plane - share.planes.start] = tally;
    }
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
        balls: &mut [Record],
        majorant: &mut f32,
        mut draws: Draws,
        tally: &mut Tally,
    ) {
        let count = balls.len();
        if count < 2 {
            return;
        }
        let rules = self.rules;
        let pairs = count as f64 * (count as f64 - 1.0);
        let tries = (pairs * rules.tries * f64::from(*majorant) + draws.share()) as u64;
        let body = self.bodies.kinds()[0];
        let limit = *majorant;
        let mut largest = limit;
        for _ in 0..tries {
            let (first, second, share) = draws.pair(count);
            let (a, b) = (&balls[first], &balls[second]);
            let velocity = [0, 1, 2].map(|axis| a.velocity[axis] - b.velocity[axis]);
            let square =
                velocity[0] * velocity[0] + velocity[1] * velocity[1] + velocity[2] * velocity[2];
            let need = if ALIKE {
                square
            } else {
                let section = rules
                    .relative_section([a, b].map(|record| self.bodies.of(record.ball as usize)));
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
                    [a, b].map(|record| self.bodies.of(record.ball as usize))
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
    #[inline]
    fn collide(
        &mut self,
        pair: [usize; 2],
        bodies: [Body; 2],
        balls: &mut [Record],
        draws: &mut Draws,
        tally: &mut Tally,
    ) {
        let wide = |vector: [f32; 3]| DVec3::from_array(vector.map(f64::from));
        let before = pair.map(|place| wide(balls[place].velocity));
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
            let record = &mut balls[pair[one]];
            let moved = if one == 0 {
                line * (way * shares[0])
            } else {
                -line * (way * shares[1])
            };
            let from = wide(record.position);
            record.position = (from + moved).as_vec3().to_array();
            if self.rules.boundary == Boundary::Container {
                // Centres stay between the walls.
                let limits = self.rules.limits(&bodies[one]);
                (0..3).for_each(|axis| {
                    record.position[axis] = record.position[axis].clamp(-limits[axis], limits[axis])
                });
            }
            record.velocity = after[one].as_vec3().to_array();
            record.collisions += 1;
            if self.each.is_some() {
                jump += bodies[one].mass
                    * (wide(record.position).dot(wide(record.velocity)) - from.dot(before[one]));
            }
        }
        if let Some(collisions) = &mut self.each {
            let [low, high] = if balls[pair[0]].ball < balls[pair[1]].ball {
                [0, 1]
            } else {
                [1, 0]
            };
            let impulse = (after[low] - before[low]) * bodies[low].mass;
            collisions.push(Collision {
                time: self.now.time,
                participants: Participants::Pair(balls[pair[low]].ball, balls[pair[high]].ball),
                impulse,
                external: DVec3::ZERO,
                virial,
                radial_jump: jump,
                gap: f64::NAN,
            });
        }
    }
}

/// Every ball flies for a step, turns back at walls or goes through faces, and is put into the bin of its new cell.
#[inline(always)]
pub fn fly<const EACH: bool, const ALIKE: bool>(
    rules: &Rules,
    bodies: &Bodies,
    balls: &mut [Record],
    now: Instant,
    tally: &mut Tally,
    share: &mut Share,
) {
    let step = now.flight as f32;
    let [limit_x, limit_y, limit_z] = rules.nearest;
    // First all places and cells, then all walls and bins: the second loop waits for memory, the first must not wait with it
    // (1.6 times as fast, measured).
    share.cells.clear();
    share.cells.extend(balls.iter_mut().map(|record| {
        let [x, y, z] = [0, 1, 2].map(|axis| record.position[axis] + record.velocity[axis] * step);
        record.position = [x, y, z];
        let cell = rules.cells.of([x, y, z]);
        let inside = (x.abs() <= limit_x) & (y.abs() <= limit_y) & (z.abs() <= limit_z);
        if inside { cell } else { OUTSIDE }
    }));
    for (place, record) in balls.iter_mut().enumerate() {
        let mut cell = share.cells[place];
        if cell == OUTSIDE {
            if rules.boundary == Boundary::Container {
                let body = if ALIKE {
                    bodies.kinds()[0]
                } else {
                    bodies.of(record.ball as usize)
                };
                turn_back::<EACH>(rules, body, record, now, tally, &mut share.collisions);
            } else {
                wrap::<EACH>(rules, bodies, record, now, share);
            }
            cell = rules.cells.of(record.position);
        }
        *share.bins.slot(cell as usize) = *record;
    }
}

/// A ball that has flown through walls is where they have sent it.
#[inline(never)]
fn turn_back<const EACH: bool>(
    rules: &Rules,
    body: Body,
    record: &mut Record,
    now: Instant,
    tally: &mut Tally,
    collisions: &mut Vec<Collision>,
) {
    let begin = collisions.len();
    for axis in 0..3 {
        let limit = rules.limits(&body)[axis];
        while record.position[axis].abs() > limit {
            let place = record.position[axis];
            let velocity = record.velocity[axis];
            let impulse = -2.0 * body.mass * f64::from(velocity);
            record.position[axis] = 2.0_f32.copysign(place) * limit - place;
            record.velocity[axis] = -velocity;
            record.collisions += 1;
            tally.wall_collisions += 1;
            tally.wall_impulse += impulse.abs();
            if EACH {
                let since = f64::from((place.abs() - limit) / velocity.abs());
                let received = DVec3::AXES[axis] * impulse;
                let virial = f64::from(limit.copysign(place)) * impulse;
                let upper = place > 0.0;
                collisions.push(Collision {
                    time: now
                        .time
                        .after((now.flight - since).max(0.0))
                        .expect("a step is no longer than a run"),
                    participants: Participants::Wall(record.ball, Wall { axis, upper }),
                    impulse: received,
                    external: received,
                    virial,
                    radial_jump: virial,
                    gap: 0.0,
                });
            }
        }
    }
    if EACH {
        collisions[begin..].sort_by(|a, b| a.time.partial_cmp(&b.time).expect("times are numbers"));
    }
}

/// A ball that has left a periodic box comes in at the opposite face.
#[inline(never)]
fn wrap<const EACH: bool>(
    rules: &Rules,
    bodies: &Bodies,
    record: &mut Record,
    now: Instant,
    share: &mut Share,
) {
    for axis in 0..3 {
        let half = rules.nearest[axis];
        while record.position[axis].abs() > half {
            let upper = record.position[axis] > 0.0;
            let edge = if upper { -2.0 * half } else { 2.0 * half };
            let before = record.position[axis];
            let since = f64::from((before.abs() - half) / record.velocity[axis].abs());
            record.position[axis] += edge;
            let face = Wall { axis, upper };
            share.faces.push((record.ball, face));
            if EACH {
                let momentum =
                    bodies.of(record.ball as usize).mass * f64::from(record.velocity[axis]);
                let moved = f64::from(record.position[axis]) - f64::from(before);
                share.collisions.push(Collision {
                    time: now
                        .time
                        .after((now.flight - since).max(0.0))
                        .expect("a step is no longer than a run"),
                    participants: Participants::Face(record.ball, face),
                    impulse: DVec3::ZERO,
                    external: DVec3::ZERO,
                    virial: 0.0,
                    radial_jump: momentum * moved,
                    gap: 0.0,
                });
            }
        }
    }
}
