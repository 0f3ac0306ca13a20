//! The flight of a cell's balls after its collisions: where they come to, and what they meet on the way.

use glam::DVec3;
use pulp::Simd;

use super::bins::{Record, Row};
use super::columns::Columns;
use super::round::{Instant, Notes, Rules, Tally};
use crate::domain::Boundary;
use crate::engine::turn::SIDE;
use crate::event::{Collision, Participants, Wall};
use crate::state::{Bodies, Body};

/// Instead of a cell: beyond a wall or face.
const OUTSIDE: u32 = u32::MAX;

/// Flights between two rounds of collisions. `EACH` keeps every collision with a wall, `ALIKE` is for balls of one radius and
/// mass.
pub struct Flight<'a, const EACH: bool, const ALIKE: bool> {
    rules: &'a Rules,
    bodies: &'a Bodies,
    now: Instant,
    /// The cells that the balls fly to.
    cells: Vec<[u32; SIDE]>,
    faces: Vec<(u32, Wall)>,
    /// What has happened, if it is kept.
    pub collisions: Vec<Collision>,
}

impl<'a, const EACH: bool, const ALIKE: bool> Flight<'a, EACH, ALIKE> {
    /// Before any flight.
    pub fn new(rules: &'a Rules, bodies: &'a Bodies, now: Instant) -> Self {
        Self {
            rules,
            bodies,
            now,
            cells: Vec::new(),
            faces: Vec::new(),
            collisions: Vec::new(),
        }
    }

    /// What was noted.
    pub fn notes(self) -> Notes {
        (self.faces, self.collisions)
    }

    /// Moves every ball on by a step, and finds the cells that they come to.
    #[inline(always)]
    pub fn fly(&mut self, balls: &mut Columns) {
        let step = self.now.flight as f32;
        let (grid, nearest) = (self.rules.cells, self.rules.nearest);
        self.cells.resize(balls.blocks().len(), [0; SIDE]);
        for (block, cells) in balls.blocks_mut().iter_mut().zip(&mut self.cells) {
            let mut position = block.position;
            for (position, velocity) in position.iter_mut().zip(&block.velocity) {
                for (position, velocity) in position.iter_mut().zip(velocity) {
                    *position += velocity * step;
                }
            }
            block.position = position;
            let [x, y, z] = position;
            let mut found = [0; SIDE];
            for lane in 0..SIDE {
                let (x, y, z) = (x[lane], y[lane], z[lane]);
                let cell = grid.of([x, y, z]);
                let [limit_x, limit_y, limit_z] = nearest;
                let inside = (x.abs() <= limit_x) & (y.abs() <= limit_y) & (z.abs() <= limit_z);
                found[lane] = if inside { cell } else { OUTSIDE };
            }
            *cells = found;
        }
    }

    /// Sends balls back at walls or through faces, and gives all, some at a time, to `put` with the cells that they come to.
    ///
    /// A loop of its own: it waits for memory, and [`Self::fly`] must not wait with it (1.6 times as fast, measured).
    #[inline(always)]
    pub fn land<S: Simd>(
        &mut self,
        simd: S,
        balls: &Columns,
        tally: &mut Tally,
        mut put: impl FnMut(&[Row], &[u32]),
    ) {
        for (number, block) in balls.blocks().iter().enumerate() {
            let (mut rows, mut cells) = (block.rows(simd), self.cells[number]);
            let count = SIDE.min(balls.count() - number * SIDE);
            let (rows, cells) = (&mut rows[..count], &mut cells[..count]);
            if cells.contains(&OUTSIDE) {
                for (row, cell) in rows.iter_mut().zip(&mut *cells) {
                    if *cell == OUTSIDE {
                        *cell = self.bound(row, tally);
                    }
                }
            }
            put(rows, cells);
        }
    }

    /// A ball has left the space between the walls or faces; gives the cell that it comes to.
    #[inline(never)]
    fn bound(&mut self, row: &mut Row, tally: &mut Tally) -> u32 {
        let mut record = Record::from(*row);
        if self.rules.boundary == Boundary::Container {
            self.turn_back(&mut record, tally);
        } else {
            self.wrap(&mut record);
        }
        *row = record.into();
        self.rules.cells.of(record.position)
    }

    /// A ball that has flown through walls is where they have sent it.
    fn turn_back(&mut self, record: &mut Record, tally: &mut Tally) {
        let Instant { time, flight, .. } = self.now;
        let body = self.body(record);
        let limits = self.rules.limits(&body);
        let first = self.collisions.len();
        for (axis, limit) in limits.into_iter().enumerate() {
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
                    self.collisions.push(Collision {
                        time: time
                            .after((flight - since).max(0.0))
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
            self.collisions[first..]
                .sort_by(|a, b| a.time.partial_cmp(&b.time).expect("times are numbers"));
        }
    }

    /// A ball that has left a periodic box comes in at the opposite face.
    fn wrap(&mut self, record: &mut Record) {
        let Instant { time, flight, .. } = self.now;
        for axis in 0..3 {
            let half = self.rules.nearest[axis];
            while record.position[axis].abs() > half {
                let upper = record.position[axis] > 0.0;
                let edge = if upper { -2.0 * half } else { 2.0 * half };
                let before = record.position[axis];
                let since = f64::from((before.abs() - half) / record.velocity[axis].abs());
                record.position[axis] += edge;
                let face = Wall { axis, upper };
                self.faces.push((record.ball, face));
                if EACH {
                    let momentum = self.body(record).mass * f64::from(record.velocity[axis]);
                    let moved = f64::from(record.position[axis]) - f64::from(before);
                    self.collisions.push(Collision {
                        time: time
                            .after((flight - since).max(0.0))
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

    fn body(&self, record: &Record) -> Body {
        if ALIKE {
            self.bodies.kinds()[0]
        } else {
            self.bodies.of(record.ball as usize)
        }
    }
}
