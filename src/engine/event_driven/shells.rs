//! Lists of neighbours, good as long as every ball stays in a shell around the place where it last looked about.
//!
//! A ball that leaves its shell gets a new one around where it is, and a new list: everyone whose shell's centre is so near that
//! the two can touch while both stay in their shells. Lists are mutual, so the others need not move. In a dense gas a ball
//! collides many times in its shell, and then asks a dozen neighbours where cells would give it eighty.
//!
//! Source: Donev, Torquato, Stillinger, J. Comput. Phys. 202, 737 (2005), for lists that each ball renews on its own;
//! Smallenburg, Eur. Phys. J. E 45, 22 (2022), for what they are worth.

use glam::{DVec3, Vec3};
use prefetch_index::prefetch_index;

use super::centers::Centers;
use super::needs::Needs;
use super::search::{Candidate, look_at};
use super::sieve::Sight;
use super::surroundings::Surroundings;
use crate::cell_list::widened;
use crate::engine::image::{IMAGE_SHIFT, IMAGES, Seen, image_at, image_of, number_of, steps_of};
use crate::event::Wall;
use crate::state::{State, Trajectory};

/// Share of a shell's radius that a ball leaves unused: far above rounding, far below anything that costs.
const SLACK: f64 = 1.0 / (1 << 20) as f64;

/// Mean spacing in diameters up to which shells are faster than cells (measured).
const DENSE: f64 = 1.35;

/// Radius of a shell in diameters where the mean spacing is a diameter, and what it gains with that; measured to be best, and flat
/// around.
const SHELL: [f64; 2] = [0.3, 0.5];

/// Words in a line of memory.
const WORDS_PER_LINE: usize = 16;

/// Where a record has the number of neighbours; the centre stands before it.
const LENGTH: usize = 3;

/// Where a record has its first neighbour.
const HEAD: usize = 4;

/// Neighbours of every ball.
#[derive(Clone, Debug)]
pub struct Shells {
    /// Radius of a shell \[length\].
    shell: f64,
    /// Distance of centres up to which balls are neighbours \[length\].
    reach: f64,
    centers: Centers,
    /// Of each ball a record of so many words: its shell's centre in f32, the number of its neighbours, and these, each at the
    /// image that is near. Side by side, because memory comes in lines.
    records: Vec<u32>,
    words: usize,
    /// By how much each image is moved \[length\].
    shifts: [DVec3; IMAGES],
    /// What was found around a place.
    found: Vec<Seen>,
}

/// Radius of the shells \[length\] for `count` balls of this radius in a volume; `None` where cells are faster.
pub fn radius_for(volume: f64, count: usize, radius: f64) -> Option<f64> {
    let diameter = 2.0 * radius;
    let spacing = (volume / count.max(1) as f64).cbrt() / diameter;
    (spacing < DENSE).then(|| (SHELL[0] + SHELL[1] * (spacing - 1.0)) * diameter)
}

/// Words of a record \[4 bytes\] that hold the longest list chance brings about among `count` balls of this radius in a volume, with
/// shells of this radius; a dense gas leaves chance little room.
pub fn words_for(volume: f64, count: usize, radius: f64, shell: f64) -> usize {
    const SPHERE: f64 = 4.0 / 3.0 * std::f64::consts::PI;
    let density = count as f64 / volume;
    let open = 1.0 - (density * SPHERE * radius.powi(3)).min(1.0);
    let neighbours = density * SPHERE * (2.0 * (radius + shell)).powi(3);
    let longest = neighbours + 8.0 * neighbours.sqrt() * open * open;
    (HEAD + longest as usize).next_multiple_of(WORDS_PER_LINE)
}

impl Shells {
    /// For balls that are all alike, in a box without planes; `None` where cells are faster, or a ball could see two images of
    /// another.
    pub fn fitting(state: &State) -> Option<Self> {
        let radius = state.bodies.mean_radius();
        let shell = radius_for(state.domain.volume(), state.ball_count(), radius)?;
        Self::with_shell(state, shell)
    }

    /// With shells of this radius \[length\].
    pub fn with_shell(state: &State, shell: f64) -> Option<Self> {
        let (domain, radius) = (&state.domain, state.bodies.mean_radius());
        let reach = 2.0 * (radius + shell);
        let roomy = domain.half_size.min_element() > 2.0 * reach;
        let possible = roomy && state.ball_count() < 1 << IMAGE_SHIFT;
        possible.then(|| Self {
            shell: shell * (1.0 - SLACK),
            found: Vec::new(),
            reach,
            centers: Centers::new(domain, reach),
            records: Vec::new(),
            words: words_for(domain.volume(), state.ball_count(), radius, shell),
            shifts: std::array::from_fn(|image| {
                DVec3::from_array(steps_of(image).map(f64::from)) * domain.period()
            }),
        })
    }

    #[inline(always)]
    fn record(&self, ball: usize) -> &[u32] {
        &self.records[ball * self.words..][..self.words]
    }

    #[inline(always)]
    fn center(&self, ball: usize) -> DVec3 {
        let record = self.record(ball);
        Vec3::from_array([0, 1, 2].map(|axis| f32::from_bits(record[axis]))).as_dvec3()
    }

    #[inline(always)]
    fn neighbours(&self, ball: usize) -> &[Seen] {
        let record = self.record(ball);
        &record[HEAD..][..record[LENGTH] as usize]
    }

    fn insert(&mut self, ball: usize, other: Seen) {
        let length = self.record(ball)[LENGTH] as usize;
        if HEAD + length == self.words {
            self.widen();
        }
        let record = &mut self.records[ball * self.words..][..self.words];
        record[HEAD + length] = other;
        record[LENGTH] += 1;
    }

    fn remove(&mut self, ball: usize, other: usize) {
        let record = &mut self.records[ball * self.words..][..self.words];
        let last = record[LENGTH] as usize - 1;
        let neighbours = &mut record[HEAD..];
        let place = neighbours
            .iter()
            .position(|&seen| number_of(seen) as usize == other)
            .expect("neighbours know each other");
        neighbours[place] = neighbours[last];
        record[LENGTH] -= 1;
    }

    /// Enlarges every record.
    #[cold]
    fn widen(&mut self) {
        let words = self.words + WORDS_PER_LINE;
        self.records = widened(&self.records, self.words, words);
        self.words = words;
    }

    /// A ball gets a shell around another place.
    fn move_shell(&mut self, ball: usize, position: DVec3) {
        let center = position.as_vec3();
        self.centers.relocate(ball as u32, center);
        self.settle(ball, center);
    }

    /// Gives a ball a shell around a place and brings its list and those of the others up to date.
    fn settle(&mut self, ball: usize, center: Vec3) {
        for axis in 0..3 {
            self.records[ball * self.words + axis] = center[axis].to_bits();
        }
        let mut found = std::mem::take(&mut self.found);
        let mut count = 0;
        let reach_squared = self.reach * self.reach;
        self.centers.for_each_cell_near(center, |others, image| {
            let from = center.as_dvec3() + self.shifts[image as usize];
            if count + others.len() > found.len() {
                found.resize(count + others.len(), 0);
            }
            // Most are too far away, and which are cannot be foreseen: so all are written down, some in vain.
            for other in others {
                let apart = from - other.place.as_dvec3();
                let near = apart.length_squared() < reach_squared;
                found[count] = other.ball | image << IMAGE_SHIFT;
                count += usize::from(near & (other.ball != ball as u32));
            }
        });
        self.bring_up_to_date(ball, &found[..count]);
        self.found = found;
    }

    /// Makes these the neighbours of a ball, and it theirs.
    fn bring_up_to_date(&mut self, ball: usize, found: &[Seen]) {
        let mut place = 0;
        while let Some(&seen) = self.neighbours(ball).get(place) {
            if found.contains(&seen) {
                place += 1;
            } else {
                self.remove(ball, number_of(seen) as usize);
                self.remove(number_of(seen) as usize, ball);
            }
        }
        for &seen in found {
            if !self.neighbours(ball).contains(&seen) {
                let back = image_at(steps_of(image_of(seen)).map(|step| -step));
                self.insert(ball, seen);
                self.insert(number_of(seen) as usize, ball as u32 | back << IMAGE_SHIFT);
            }
        }
    }
}

impl<N: Needs> Surroundings<N> for Shells {
    fn clear(&mut self, state: &State) {
        self.centers = Centers::new(&state.domain, self.reach);
        self.records.clear();
        self.records.reserve_exact(state.ball_count() * self.words);
    }

    fn push(&mut self, state: &State, ball: usize) {
        let center = state.trajectories[ball].position_at(state.now).as_vec3();
        self.centers.push(center);
        self.records.resize((ball + 1) * self.words, 0);
        self.settle(ball, center);
    }

    /// Along which axis says nothing here: a shell is round.
    #[inline]
    fn crossing(&self, state: &State, ball: usize) -> Option<(f64, usize)> {
        let Trajectory {
            position, velocity, ..
        } = state.trajectories[ball];
        let from_center = position - self.center(ball);
        let speed_squared = velocity.length_squared();
        let radial = from_center.dot(velocity);
        let inside = self.shell * self.shell - from_center.length_squared();
        let root = (radial * radial + speed_squared * inside).max(0.0).sqrt();
        (speed_squared > 0.0).then(|| ((root - radial) / speed_squared, 0))
    }

    #[inline]
    fn may_reach(&self, state: &State, ball: usize, Wall { axis, upper }: Wall) -> bool {
        let ahead = self.center(ball)[axis];
        let ahead = if upper { ahead } else { -ahead };
        // In a periodic box it is the centre that counts; then this asks a little early.
        let radius = N::body(&state.bodies, ball).radius;
        ahead + radius + 1.1 * self.shell > state.domain.half_size[axis]
    }

    fn cross(&mut self, state: &State, ball: usize, _axis: usize, best: &mut Candidate) {
        let center = state.trajectories[ball].position_at(state.now);
        self.move_shell(ball, center);
        *best = Surroundings::<N>::look(self, state, ball);
    }

    #[inline]
    fn turn(&mut self, _state: &State, _ball: usize) {}

    fn wrap(&mut self, state: &State, ball: usize) {
        self.move_shell(ball, state.trajectories[ball].position);
    }

    #[inline]
    fn prefetch(&self, ball: usize) {
        for word in (0..self.words).step_by(WORDS_PER_LINE) {
            prefetch_index(&self.records, ball * self.words + word);
        }
    }

    #[inline]
    fn prefetch_places(&self, state: &State, ball: usize, axis: Option<usize>) {
        if axis.is_some() {
            let center = state.trajectories[ball].position_at(state.now).as_vec3();
            self.centers.prefetch_near(center);
        }
    }

    #[inline]
    fn prefetch_known(&self, state: &State, ball: usize, _axis: Option<usize>) {
        for &seen in self.neighbours(ball) {
            prefetch_index(&state.trajectories, number_of(seen) as usize);
        }
    }

    #[inline]
    fn look(&self, state: &State, ball: usize) -> Candidate {
        let mut best = Candidate::NONE;
        let others = self.neighbours(ball);
        if others.iter().all(|&seen| image_of(seen) == 0) {
            let view = View::<false>::of::<N>(self, state);
            look_at(state, ball, others, &view, &mut best);
        } else {
            let view = View::<true>::of::<N>(self, state);
            look_at(state, ball, others, &view, &mut best);
        }
        best
    }
}

/// A ball's view of its neighbours, perhaps at images.
struct View<'a, const AT_IMAGES: bool> {
    flights: &'a [Trajectory],
    contact: f64,
    shifts: &'a [DVec3; IMAGES],
}

impl<'a, const AT_IMAGES: bool> View<'a, AT_IMAGES> {
    #[inline(always)]
    fn of<N: Needs>(shells: &'a Shells, state: &'a State) -> Self {
        Self {
            flights: &state.trajectories,
            contact: 2.0 * N::body(&state.bodies, 0).radius,
            shifts: &shells.shifts,
        }
    }
}

impl<const AT_IMAGES: bool> Sight for View<'_, AT_IMAGES> {
    const AT_IMAGES: bool = AT_IMAGES;

    #[inline(always)]
    fn flight(&self, seen: u32) -> &Trajectory {
        &self.flights[number_of(seen) as usize]
    }

    #[inline(always)]
    fn contact(&self, _seen: u32) -> f64 {
        self.contact
    }

    #[inline(always)]
    fn shift(&self, seen: u32) -> DVec3 {
        self.shifts[image_of(seen)]
    }
}
