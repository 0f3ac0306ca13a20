//! The centres of the shells, cell by cell: those near a place stand in few lines of memory.

use glam::{DVec3, Vec3};
use prefetch_index::prefetch_index;

use crate::cell_list::widened;
use crate::domain::{Boundary, Domain};
use crate::engine::image::image_at;

/// Centres for which a cell has room at first.
const ROOM: usize = 12;

/// Centres in a line of memory.
const CENTERS_PER_LINE: usize = 4;

/// Share by which a cell is wider than asked for: far above rounding.
const SLACK: f64 = 1e-6;

/// A shell's centre.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(16))]
pub struct Center {
    /// Whose shell it is.
    pub ball: u32,
    /// Where.
    pub place: Vec3,
}

/// Every ball's centre, each in one cell.
#[derive(Clone, Debug)]
pub struct Centers {
    counts: [i32; 3],
    half_size: DVec3,
    per_width: DVec3,
    periodic: bool,
    /// Of cell `c`: `cells[c * room..][..lengths[c]]`.
    cells: Vec<Center>,
    lengths: Vec<u32>,
    room: usize,
    cell_of: Vec<u32>,
}

impl Centers {
    /// No centres, in cells that are wider than a distance. In a periodic box at least four such cells must fit along each axis.
    pub fn new(domain: &Domain, distance: f64) -> Self {
        let edges = 2.0 * domain.half_size;
        let counts = (edges / (distance * (1.0 + SLACK))).floor().max(DVec3::ONE);
        let cells = counts.element_product() as usize;
        Self {
            counts: counts.to_array().map(|count| count as i32),
            half_size: domain.half_size,
            per_width: counts / edges,
            periodic: domain.boundary == Boundary::Periodic,
            cells: vec![Center::default(); cells * ROOM],
            lengths: vec![0; cells],
            room: ROOM,
            cell_of: Vec::new(),
        }
    }

    /// Adds the next ball's centre.
    pub fn push(&mut self, place: Vec3) {
        let ball = self.cell_of.len() as u32;
        let cell = self.cell_at(place);
        self.cell_of.push(cell as u32);
        self.insert(cell, Center { ball, place });
    }

    /// Moves a ball's centre.
    pub fn relocate(&mut self, ball: u32, place: Vec3) {
        let cell = self.cell_of[ball as usize] as usize;
        let first = cell * self.room;
        let listed = &self.cells[first..][..self.lengths[cell] as usize];
        let index = listed.iter().position(|center| center.ball == ball);
        let index = first + index.expect("a ball's centre is in its cell");
        self.lengths[cell] -= 1;
        self.cells[index] = self.cells[first + self.lengths[cell] as usize];
        let cell = self.cell_at(place);
        self.cell_of[ball as usize] = cell as u32;
        self.insert(cell, Center { ball, place });
    }

    /// Visits the cells in which all centres lie that are within the distance from a place, each with the number of the image by which
    /// what is at that place sees it.
    #[inline]
    pub fn for_each_cell_near(&self, place: Vec3, mut visit: impl FnMut(&[Center], u32)) {
        self.for_each_number_near(place, |cell, image| {
            let listed = &self.cells[cell * self.room..][..self.lengths[cell] as usize];
            visit(listed, image);
        });
    }

    /// Asks for the memory of these cells.
    #[inline]
    pub fn prefetch_near(&self, place: Vec3) {
        self.for_each_number_near(place, |cell, _| {
            let first = cell * self.room;
            for center in (0..self.lengths[cell] as usize).step_by(CENTERS_PER_LINE) {
                prefetch_index(&self.cells, first + center);
            }
        });
    }

    #[inline]
    fn for_each_number_near(&self, place: Vec3, mut visit: impl FnMut(usize, u32)) {
        let [x, y, z] = self.cell_of_place(place);
        for x in self.around(0, x) {
            for y in self.around(1, y) {
                for z in self.around(2, z) {
                    visit(self.number([x.0, y.0, z.0]), image_at([x.1, y.1, z.1]));
                }
            }
        }
    }

    /// The three cells around one along an axis, those that there are, and by how many boxes what is in the middle one is moved to
    /// see them.
    #[inline]
    fn around(&self, axis: usize, cell: i32) -> impl Iterator<Item = (i32, i8)> + use<> {
        let (count, periodic) = (self.counts[axis], self.periodic);
        (cell - 1..=cell + 1).filter_map(move |cell| {
            let (below, above) = (cell < 0, cell >= count);
            let step = i8::from(below) - i8::from(above);
            (step == 0 || periodic).then(|| (cell + i32::from(step) * count, step))
        })
    }

    fn cell_of_place(&self, place: Vec3) -> [i32; 3] {
        let place = (place.as_dvec3() + self.half_size) * self.per_width;
        std::array::from_fn(|axis| (place[axis] as i32).clamp(0, self.counts[axis] - 1))
    }

    fn number(&self, [x, y, z]: [i32; 3]) -> usize {
        ((x * self.counts[1] + y) * self.counts[2] + z) as usize
    }

    fn cell_at(&self, place: Vec3) -> usize {
        self.number(self.cell_of_place(place))
    }

    fn insert(&mut self, cell: usize, center: Center) {
        if self.lengths[cell] as usize == self.room {
            self.widen();
        }
        self.cells[cell * self.room + self.lengths[cell] as usize] = center;
        self.lengths[cell] += 1;
    }

    /// Doubles the room of every cell.
    #[cold]
    fn widen(&mut self) {
        self.cells = widened(&self.cells, self.room, 2 * self.room);
        self.room *= 2;
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;
    use crate::engine::image::steps_of;

    #[test]
    fn all_that_are_near_are_found_each_once_wherever_they_have_moved() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(7);
        for boundary in [Boundary::Container, Boundary::Periodic] {
            let domain = Domain {
                boundary,
                ..Domain::container(DVec3::new(2.0, 2.5, 3.0))
            };
            let half_size = domain.half_size.as_vec3();
            let mut draw = || {
                let share: [f32; 3] = std::array::from_fn(|_| random.random_range(-1.0..1.0));
                Vec3::from_array(share) * half_size
            };
            let mut centers = Centers::new(&domain, 1.0);
            let mut places: Vec<Vec3> = (0..2000).map(|_| draw()).collect();
            for &place in &places {
                centers.push(place);
            }
            // Many of them into one cell.
            for (ball, place) in places.iter_mut().enumerate().step_by(3) {
                *place = if ball < 1000 { Vec3::ONE } else { draw() };
                centers.relocate(ball as u32, *place);
            }
            for &from in places.iter().step_by(50) {
                let (mut found, mut expected) = (Vec::new(), Vec::new());
                let note = |list: &mut Vec<(u32, u32)>, ball: u32, place: Vec3, image: u32| {
                    let shift = DVec3::from_array(steps_of(image as usize).map(f64::from));
                    let from = from.as_dvec3() + shift * domain.period();
                    if from.distance(place.as_dvec3()) < 1.0 {
                        list.push((ball, image));
                    }
                };
                centers.for_each_cell_near(from, |others, image| {
                    for other in others {
                        note(&mut found, other.ball, other.place, image);
                    }
                });
                let images = if boundary == Boundary::Periodic {
                    27
                } else {
                    1
                };
                for (place, ball) in places.iter().zip(0..) {
                    (0..images).for_each(|image| note(&mut expected, ball, *place, image));
                }
                found.sort_unstable();
                assert!(found == expected && found.len() > 1);
            }
        }
    }
}
