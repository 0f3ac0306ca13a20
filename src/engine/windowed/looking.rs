//! What follows a collision in windows in which every ball knows its neighbours: the ball looks at them, and at nobody else.

use prefetch_index::prefetch_index;

use super::Windowed;
use super::meeting::Meeting;
use super::paths::Window;
use super::pieces::{Id, Line, NONE, first_other};
use super::region::Region;
use super::sheet::LANES;
use crate::engine::image::{image_of, number_of, steps_of};

/// A neighbour that a ball may touch in what is left of the window.
#[derive(Clone, Copy, Debug)]
pub struct Glimpse {
    /// The ball and the one that it may touch.
    balls: [u32; 2],
    owners: [Id; 2],
    pieces: [Id; 2],
    /// By how many boxes the first ball is moved to touch the other.
    image: [i8; 3],
}

impl Glimpse {
    /// The same as the other ball sees it, if that has the lower index.
    fn in_order(mut self) -> Self {
        if self.balls[0] > self.balls[1] {
            self.balls.swap(0, 1);
            self.owners.swap(0, 1);
            self.pieces.swap(0, 1);
            self.image = self.image.map(|steps| -steps);
        }
        self
    }
}

impl Windowed {
    /// Balls whose flights have just begun look at their neighbours and at what bounds the domain. They are given by the flights with
    /// which they entered the window and by who it was that they have met, or [`NONE`]. Without lists of neighbours, what they meet has
    /// been foreseen.
    #[inline]
    pub(super) fn look(&mut self, balls: &[(Id, u32)], window: Window) {
        if self.drift.is_none() {
            return;
        }
        let mut glimpses = std::mem::take(&mut self.glimpses);
        for &(owner, partner) in balls {
            self.look_about(owner, partner, window, &mut glimpses);
        }
        for glimpse in glimpses.drain(..) {
            let gas = self.gas(window);
            let Glimpse {
                balls,
                owners,
                pieces,
                image,
            } = glimpse.in_order();
            let pair = balls.map(|ball| self.state.trajectories[ball as usize]);
            let [radius, other_radius] = balls.map(|ball| gas.body(ball).radius);
            let shift = gas.shift_by(image);
            if let Some(time) = gas.pair_time(&pair, radius + other_radius, (image, shift)) {
                let meeting = gas.meeting_of(pieces, time, (balls, owners), image);
                self.follow_ups.push(meeting);
            }
        }
        self.glimpses = glimpses;
    }

    /// One of them looks about, and asks for the memory of those whom it may touch.
    #[inline]
    fn look_about(&mut self, owner: Id, partner: u32, window: Window, glimpses: &mut Vec<Glimpse>) {
        self.begun += 1;
        let piece = first_other(self.begun);
        let gas = self.gas(window);
        let ball = self.lines[owner as usize].ball();
        let flight = &self.state.trajectories[ball as usize];
        let mut line = gas.piece_line(flight, ball);
        let region = region_of(&self.regions, owner);
        for neighbours in region.neighbours.of(owner) {
            let mut rows = [Line::NOBODY; LANES];
            for (row, &neighbour) in rows.iter_mut().zip(neighbours) {
                *row = self.lines[number_of(neighbour) as usize];
                if image_of(neighbour) != 0 {
                    let shift = self.grid.shift(image_of(neighbour));
                    *row = row.moved(shift.map(|shift| -shift));
                }
            }
            let mut touching = region.touching(&line, partner, &rows);
            while touching != 0 {
                let place = touching.trailing_zeros() as usize;
                touching &= touching - 1;
                let (other, link) = (rows[place].ball(), rows[place].link());
                let other_owner = number_of(neighbours[place]);
                prefetch_index(&self.state.trajectories, other as usize);
                glimpses.push(Glimpse {
                    balls: [ball, other],
                    owners: [owner, other_owner],
                    pieces: [piece, if link == NONE { other_owner } else { link }],
                    image: steps_of(image_of(neighbours[place])),
                });
            }
        }
        let bound = gas.next_bound(flight, ball, gas.body(ball));
        let meeting =
            bound.map(|(time, bound)| gas.meeting_with(bound, time, piece, (ball, owner)));
        if let Some(meeting) = meeting {
            self.follow_ups.push(meeting);
        }
        let speed = line.speed();
        self.fastest = self.fastest.max(speed);
        self.too_fast |= self.drift.is_some_and(|drift| speed > drift);
        line.set_link(piece);
        self.lines[owner as usize] = line;
    }

    /// A ball has left the periodic box through a face: it and its neighbours touch each other at other images now.
    #[cold]
    pub(super) fn follow_across_face(&mut self, owner: Id, axis: usize, upper: bool) {
        if self.drift.is_none() {
            return;
        }
        let step = if upper { 1 } else { -1 };
        let parts = region_of(&self.regions, owner).neighbours.of(owner);
        let mut neighbours: Vec<Id> = parts.flatten().map(|&seen| number_of(seen)).collect();
        // A pair at the edge of a cell may have been noted in two.
        neighbours.sort_unstable();
        neighbours.dedup();
        let mut move_image = |flight: Id, of: &dyn Fn(Id) -> bool, step: i8| {
            let mut regions = self.regions.iter_mut();
            let region = regions.find(|region| region.flights.contains(&(flight as usize)));
            let region = region.expect(IN_A_REGION);
            region.neighbours.move_image(flight, of, axis, step);
        };
        move_image(owner, &|_| true, step);
        for neighbour in neighbours {
            move_image(neighbour, &|seen| seen == owner, -step);
        }
    }
}

/// Asks for the memory of the lists of neighbours that a meeting's balls will need.
#[inline]
pub fn read_lists_ahead(regions: &[Region], meeting: &Meeting) {
    for owner in meeting.owners {
        if owner != NONE {
            region_of(regions, owner).neighbours.read_ahead(owner);
        }
    }
}

/// Asks for the memory of these neighbours.
#[inline]
pub fn read_neighbours_ahead(regions: &[Region], lines: &[Line], meeting: &Meeting) {
    for owner in meeting.owners {
        if owner != NONE {
            for &seen in region_of(regions, owner).neighbours.of(owner).flatten() {
                prefetch_index(lines, number_of(seen) as usize);
            }
        }
    }
}

const IN_A_REGION: &str = "every flight is in a region";

/// The region of a flight.
#[inline]
fn region_of(regions: &[Region], flight: Id) -> &Region {
    regions
        .iter()
        .find(|region| region.flights.contains(&(flight as usize)))
        .expect(IN_A_REGION)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;
    use crate::domain::{Boundary, Domain};
    use crate::engine::Engine;
    use crate::engine::event_driven::EventDriven;
    use crate::engine::image::{IMAGE_SHIFT, image_at};
    use crate::engine::windowed::WINDOWS_PER_SORT;
    use crate::state::{Body, Placement, State};

    const SIDE: i32 = 13;

    /// A dense lattice of balls that are all equally fast: before long some are faster than any was.
    fn lattice(boundary: Boundary) -> Placement {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(11);
        let mut direction = || {
            let drawn: [f64; 3] = std::array::from_fn(|_| random.random_range(-1.0..1.0));
            DVec3::from_array(drawn).normalize()
        };
        let sites =
            (0..SIDE.pow(3)).map(|site| [site / SIDE / SIDE, site / SIDE % SIDE, site % SIDE]);
        let half_size = 0.65 * f64::from(SIDE);
        let position = |site: [i32; 3]| {
            DVec3::from_array(site.map(|step| (f64::from(step) + 0.5) * 1.3 - half_size))
        };
        let positions: Vec<_> = sites.map(position).collect();
        Placement {
            domain: Domain {
                boundary,
                ..Domain::container(DVec3::splat(half_size))
            },
            center: DVec3::ZERO,
            bodies: vec![Body {
                radius: 0.5,
                mass: 1.0,
            }],
            body_of: Vec::new(),
            velocities: positions.iter().map(|_| direction()).collect(),
            positions,
        }
    }

    #[test]
    fn everybody_within_reach_is_a_neighbour_once_at_the_image_that_is_near() {
        for (boundary, regions) in [(Boundary::Container, 1), (Boundary::Periodic, 3)] {
            let mut engine = Windowed::with_regions(State::new(&lattice(boundary)), regions);
            let later = engine.state.now.after(3.0 * engine.length).expect("a time");
            engine.advance(later, &mut |_| ()).expect("room to move");
            while let Some(window) = engine.window {
                engine
                    .advance(window.end, &mut |_| ())
                    .expect("room to move");
            }
            let window = engine.open();
            let drift = f64::from(engine.drift.expect("a dense gas")) / engine.grid.scale;
            let gas = engine.gas(window);
            let reach = 2.0 * (gas.state.bodies.largest_radius() + drift);
            let place_of = |flight: Id| {
                let ball = engine.lines[flight as usize].ball();
                gas.state.trajectories[ball as usize].position_at(window.begin)
            };
            let mut count = 0;
            for flight in 0..engine.lines.len() as Id {
                let noted = region_of(&engine.regions, flight).neighbours.of(flight);
                let mut noted: Vec<u32> = noted.flatten().copied().collect();
                noted.sort_unstable();
                assert!(noted.is_sorted_by(|one, next| one < next));
                let mut expected = Vec::new();
                for other in (0..engine.lines.len() as Id).filter(|&other| other != flight) {
                    let way = place_of(other) - place_of(flight);
                    let steps = match boundary {
                        Boundary::Periodic => (way / gas.state.domain.period()).round(),
                        _ => DVec3::ZERO,
                    };
                    if (way - steps * gas.state.domain.period()).length() < reach {
                        let image = image_at(steps.to_array().map(|steps| steps as i8));
                        expected.push(other | image << IMAGE_SHIFT);
                    }
                }
                count += expected.len();
                let missed = expected.iter().find(|seen| !noted.contains(seen));
                assert!(missed.is_none() && noted.len() < expected.len() + 2);
            }
            assert!(count > 4 * engine.lines.len());
        }
    }

    #[test]
    fn a_pair_that_was_noted_twice_goes_across_a_face_once() {
        let mut engine = Windowed::with_regions(State::new(&lattice(Boundary::Periodic)), 1);
        engine.open();
        let flight = 100;
        let parts = region_of(&engine.regions, flight).neighbours.of(flight);
        let seen = *parts.flatten().next().expect("a dense gas has neighbours");
        let other = number_of(seen);
        let seen_back = steps_of(image_of(seen)).map(|steps| -steps);
        let seen_back = flight | image_at(seen_back) << IMAGE_SHIFT;
        let neighbours = &mut engine.regions[0].neighbours;
        assert!(neighbours.note(flight, seen) && neighbours.note(other, seen_back));
        let before = steps_of(image_of(seen))[1];
        engine.follow_across_face(other, 1, before > 0);
        let step = if before > 0 { 1 } else { -1 };
        for (one, two, step) in [(flight, other, -step), (other, flight, step)] {
            let parts = region_of(&engine.regions, one).neighbours.of(one);
            let twice = parts.flatten().filter(|&&seen| number_of(seen) == two);
            let steps: Vec<i8> = twice.map(|&seen| steps_of(image_of(seen))[1]).collect();
            let before = if one == flight { before } else { -before };
            assert_eq!(steps, [before + step; 2]);
        }
    }

    #[test]
    fn balls_that_get_faster_than_any_was_collide_as_in_engine_event() {
        for (boundary, regions) in [(Boundary::Container, 1), (Boundary::Periodic, 3)] {
            let state = State::new(&lattice(boundary));
            let mut expected = EventDriven::new(state.clone());
            let mut engine = Windowed::with_regions(state, regions);
            let (mut windows_cut, mut before) = (0, 0);
            for _ in 0..100 {
                let next = engine.state.now.after(0.4 * engine.length).expect("a time");
                let (mut those, mut these) = (Vec::new(), Vec::new());
                let end = |engine: &mut dyn Engine, list: &mut Vec<_>| {
                    let mut note = |collision: &crate::event::Collision| {
                        list.push((collision.time, collision.participants))
                    };
                    engine.advance(next, &mut note).expect("room to move");
                    engine.state().hash()
                };
                let hashes = [end(&mut expected, &mut those), end(&mut engine, &mut these)];
                assert!(engine.drift.is_some());
                assert_eq!(these, those);
                assert_eq!(hashes[0], hashes[1]);
                let since_sort = engine.windows_since_sort;
                windows_cut += u32::from(since_sort < before && before < WINDOWS_PER_SORT);
                before = since_sort;
            }
            assert!(windows_cut > 0);
        }
    }
}
