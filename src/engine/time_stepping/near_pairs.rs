//! Pairs of balls that may touch in the next steps, from a cell list and good for several steps.
//!
//! What always holds: a pair that is not listed was farther apart than its contact distance plus the skin when the list was
//! made. Distances change by at most twice the fastest ball's way, which is taken off the margin step by step; the list is
//! made anew before the margin is used up. So no pair that touches, even in the middle of a step, is missing.
//!
//! Source: Verlet, Phys. Rev. 159, 98 (1967), for the list and its skin.

use glam::{DVec3, IVec3};

use crate::cell_list::CellList;
use crate::domain::Boundary;
use crate::state::State;

/// Largest distance of listed pairs, usually: in mean diameters, at least.
const USUAL_DIAMETERS: f64 = 1.4;

/// Largest distance of listed pairs, usually: in mean spacings, at least. Puts about one pair per ball on a dilute gas's list.
const USUAL_SPACINGS: f64 = 0.8;

/// How much farther than usual pairs may be listed when a step is long.
const WIDEST: f64 = 2.5;

/// Cell width over the usual largest distance.
const REACHES_PER_CELL: f64 = 2.5;

/// Share of the skin that is kept for rounding.
const ROUNDING: f64 = 1.0 / (1 << 20) as f64;

/// The list.
#[derive(Clone, Debug)]
pub struct NearPairs {
    cells: CellList,
    /// Each pair once, the lower index first, in ascending order.
    pairs: Vec<[u32; 2]>,
    /// In a periodic box: boxes by which the first ball is moved to meet the second, were neither to leave through a face any
    /// more; with the balls' own counts this stays true when they do. Else empty.
    offsets: Vec<IVec3>,
    /// How much nearer balls that are not listed may come without touching; negative for a list that must be made anew.
    margin: f64,
    usual_skin: f64,
    widest_skin: f64,
    found: Vec<(u32, [i32; 3])>,
}

impl NearPairs {
    /// No list yet; the grid for these balls at these places.
    pub fn new(state: &State, places: &[DVec3]) -> Self {
        let count = state.ball_count();
        let diameter = 2.0 * state.bodies.mean_radius();
        let spacing = (state.domain.volume() / count.max(1) as f64).cbrt();
        let reach = (USUAL_DIAMETERS * diameter).max(USUAL_SPACINGS * spacing);
        let mut cells = CellList::new(&state.domain, REACHES_PER_CELL * reach, count);
        for (ball, &place) in places.iter().enumerate() {
            cells.push(place, state.bodies.of(ball).radius);
        }
        Self {
            cells,
            pairs: Vec::new(),
            offsets: Vec::new(),
            margin: -1.0,
            usual_skin: reach - diameter,
            widest_skin: WIDEST * reach - diameter,
            found: Vec::new(),
        }
    }

    /// How much nearer balls that are not listed may come without touching; negative for a list that must be made anew.
    pub fn margin(&self) -> f64 {
        self.margin
    }

    /// Lists the pairs anew so that the list is good exactly as far as one that was left.
    pub fn restore(&mut self, margin: f64, state: &State, places: &[DVec3]) {
        if margin >= 0.0 {
            self.list(margin * (1.0 + 4.0 * ROUNDING), state, places);
        }
        self.margin = margin;
    }

    /// Makes the list unfit for use.
    pub fn invalidate(&mut self) {
        self.margin = -1.0;
    }

    /// Whether the list is still good when distances have changed by at most `way`; if so, it counts as changed.
    pub fn take(&mut self, way: f64) -> bool {
        let good = way <= self.margin;
        if good {
            self.margin -= way;
        }
        good
    }

    /// Whether a list can be good for distances that change by `way`; else it would be too long.
    pub fn can_cover(&self, way: f64) -> bool {
        way <= self.widest_skin
    }

    /// Lists the pairs anew, good for at least `way`.
    pub fn list_for(&mut self, way: f64, state: &State, places: &[DVec3]) {
        let skin = self.usual_skin.max(way * (1.0 + 4.0 * ROUNDING));
        self.list(skin, state, places);
    }

    /// Lists the pairs that touch now, and no others: good for this moment only.
    pub fn list_touching(&mut self, state: &State, places: &[DVec3]) {
        self.list(0.0, state, places);
        self.invalidate();
    }

    /// The pairs.
    pub fn pairs(&self) -> &[[u32; 2]] {
        &self.pairs
    }

    /// Boxes by which the first ball of a pair is to be moved to meet the second, as things stand; zero but in a periodic box.
    #[inline]
    pub fn image(&self, index: usize, state: &State) -> IVec3 {
        if self.offsets.is_empty() {
            return IVec3::ZERO;
        }
        let [first, second] = self.pairs[index].map(|ball| ball as usize);
        self.offsets[index] + state.images[first] - state.images[second]
    }

    fn list(&mut self, skin: f64, state: &State, places: &[DVec3]) {
        let radius = |ball: usize| state.bodies.of(ball).radius;
        for (ball, &place) in places.iter().enumerate() {
            self.cells.relocate(ball, place, radius(ball) + 0.5 * skin);
        }
        self.pairs.clear();
        self.offsets.clear();
        let period = state.domain.period();
        let periodic = state.domain.boundary == Boundary::Periodic;
        let uniform = state.bodies.uniform().map(|body| 2.0 * body.radius);
        for first in 0..places.len() {
            let (place, first_radius) = (places[first], radius(first));
            let reach =
                |other: usize| uniform.unwrap_or_else(|| first_radius + radius(other)) + skin;
            self.found.clear();
            self.cells.for_each_company(first, |company| {
                let others = company
                    .balls
                    .iter()
                    .filter(|&&second| second as usize > first);
                let Some(cell) = company.at_face else {
                    for &second in others {
                        let (apart, reach) =
                            (place - places[second as usize], reach(second as usize));
                        if apart.length_squared() <= reach * reach {
                            self.found.push((second, [0; 3]));
                        }
                    }
                    return;
                };
                for &second in others {
                    let reach = reach(second as usize);
                    self.cells.for_each_image(cell, second, |image| {
                        let apart = place - places[second as usize] + image.as_dvec3() * period;
                        if apart.length_squared() <= reach * reach {
                            self.found.push((second, image.to_array()));
                        }
                    });
                }
            });
            // Balls that share several cells have been found several times.
            self.found.sort_unstable();
            self.found.dedup();
            for &(second, image) in &self.found {
                self.pairs.push([first as u32, second]);
                if periodic {
                    let counted = state.images[second as usize] - state.images[first];
                    self.offsets.push(IVec3::from_array(image) + counted);
                }
            }
        }
        self.margin = skin * (1.0 - ROUNDING);
    }
}
