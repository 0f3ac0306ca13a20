//! What the filter asks about pairs of pieces, in f32, and with what margins.
//!
//! All is in grid lengths and windows: the window lasts from time 0 to time 1.

use std::f64::consts::PI;

use pulp::Simd;

use super::sheet::{ALL_MARKS, Columns, Row};

/// Share of `|r|^2 |v|^2` by which f32 rounding can change `(r . v)^2 - |v|^2 |r|^2`: some thirty roundings of 2^-24 each at
/// the most, with a margin.
const ROUNDING: f64 = 2.5e-6;

/// Rounding of the times `r . v / v^2`, as a share of `|r| / |v|`: some eight roundings of 2^-24, with a margin.
const TIME_ROUNDING: f32 = 1e-6;

/// Share of a cell's pairs that are within reach of each other up to which it pays to ask for that first; measured, and flat around.
const FEW_WITHIN_REACH: f64 = 0.2;

/// What the filter compares with, margins included, in grid lengths.
#[derive(Clone, Copy, Debug, Default)]
pub struct Limits {
    /// Widths of a cell.
    pub edges: [f32; 3],
    /// Largest distance of a contact point, as seen here, from the middle.
    pub off_middle: f32,
    pub contact_squared: f32,
    /// Square of a distance at which any two pieces surely touch.
    pub inside_squared: f32,
    /// By how much the way between two pieces, and their relative velocity, may be wrong.
    pub place_error: f32,
    pub velocity_error: f32,
    /// Square of the largest distance from which two pieces can meet in a window.
    pub reach_squared: f32,
    /// Least `r . v` of two pieces within reach that surely recede.
    pub receding: f32,
    /// Whether so few pairs are within reach that the first test asks for that and not whether their lines touch.
    pub by_distance: bool,
}

/// What the filter's margins are made from, in grid lengths.
#[derive(Clone, Copy, Debug, Default)]
pub struct Margins {
    /// Largest contact distance.
    pub contact: f64,
    /// Smallest contact distance.
    pub least_contact: f64,
    /// Largest distance of a contact point from the middle between the two centres.
    pub off_middle: f64,
    /// By how much a position may be wrong.
    pub position: f64,
    /// Widths of a cell.
    pub edges: [f32; 3],
    /// Largest speed of any piece.
    pub fastest: f32,
}

impl Limits {
    /// With these margins.
    pub fn new(margins: Margins) -> Self {
        let fastest = f64::from(margins.fastest);
        // Two positions, and two velocities for at most the window's length.
        let velocity_error = 4.0 * f64::from(f32::EPSILON) * fastest;
        let place_error = 2.0 * margins.position + velocity_error;
        let contact = margins.contact + place_error;
        let inside = (margins.least_contact - place_error).max(0.0);
        // A piece passes the cell in the window, so at its beginning it is no farther than it flies in it.
        let farthest: f64 = margins
            .edges
            .iter()
            .map(|&edge| {
                let apart = f64::from(edge) + margins.contact + 2.0 * fastest;
                apart * apart
            })
            .sum();
        let reach = contact + 2.0 * fastest;
        let within_reach = 4.0 / 3.0 * PI * reach.powi(3);
        let room: f64 = margins
            .edges
            .iter()
            .map(|&edge| f64::from(edge) + margins.contact)
            .product();
        Self {
            edges: margins.edges,
            off_middle: (margins.off_middle + 4.0 * margins.position) as f32,
            contact_squared: (contact * contact + ROUNDING * farthest) as f32,
            inside_squared: (inside * inside - ROUNDING * farthest).max(0.0) as f32,
            place_error: place_error as f32,
            velocity_error: velocity_error as f32,
            reach_squared: ((1.0 + ROUNDING) * reach * reach) as f32,
            receding: (2.0 * fastest * (place_error + ROUNDING * reach) + velocity_error * reach)
                as f32,
            by_distance: within_reach < FEW_WITHIN_REACH * room,
        }
    }
}

/// Which pairs of pieces, whose lines touch, cannot do so within the window, after both have begun and within the cell of this
/// `middle`, or belong to one ball. In doubt they can.
#[inline(always)]
pub fn cannot_meet_here<S: Simd>(
    simd: S,
    one_of: Columns<S>,
    other_of: Columns<S>,
    middle: [S::f32s; 3],
    limits: &Limits,
) -> S::m32s {
    let (zero, one, half) = (
        simd.splat_f32s(0.0),
        simd.splat_f32s(1.0),
        simd.splat_f32s(0.5),
    );
    let (position, other_position) = (one_of.position, other_of.position);
    let (velocity, other_velocity) = (one_of.velocity, other_of.velocity);
    let apart = difference(simd, position, other_position);
    let relative = difference(simd, velocity, other_velocity);
    let (recession, speed_squared) = (dot(simd, apart, relative), dot(simd, relative, relative));
    let per_speed_squared = simd.div_f32s(one, speed_squared);
    let distance_squared = dot(simd, apart, apart);
    let beyond = simd.sub_f32s(distance_squared, simd.splat_f32s(limits.contact_squared));
    let closest = simd.neg_f32s(simd.mul_f32s(recession, per_speed_squared));
    // For a pair without a relative velocity these are no numbers, and nothing is rejected.
    let share = simd.mul_f32s(distance_squared, per_speed_squared);
    let time_apart = simd.sqrt_f32s(share);
    let time_margin = simd.mul_f32s(simd.splat_f32s(TIME_ROUNDING), time_apart);
    // No later than the contact.
    let before_squared = simd.sub_f32s(
        simd.mul_f32s(closest, closest),
        simd.mul_f32s(beyond, per_speed_squared),
    );
    let before = simd.sqrt_f32s(simd.max_f32s(before_squared, zero));
    let touch = simd.max_f32s(simd.sub_f32s(closest, before), zero);
    let mut miss = simd.greater_than_f32s(touch, simd.add_f32s(one, time_margin));
    // Who is not within the contact distance yet and recedes will never be.
    let outside = simd.greater_than_f32s(beyond, zero);
    let recede = simd.less_than_f32s(closest, simd.neg_f32s(time_margin));
    miss = simd.or_m32s(miss, simd.and_m32s(outside, recede));
    miss = simd.or_m32s(miss, simd.equal_u32s(one_of.ball, other_of.ball));
    // No earlier than the contact, but for those that touch when the later one begins.
    let inside = simd.sub_f32s(distance_squared, simd.splat_f32s(limits.inside_squared));
    let before_squared = simd.sub_f32s(
        simd.mul_f32s(closest, closest),
        simd.mul_f32s(inside, per_speed_squared),
    );
    let before = simd.sqrt_f32s(simd.max_f32s(before_squared, zero));
    let mut latest = simd.max_f32s(simd.sub_f32s(closest, before), touch);
    // By how much the time may be wrong at which they are closest: by the rounding of what it is computed from, too.
    let per_speed = simd.sqrt_f32s(per_speed_squared);
    let error = simd.mul_add_e_f32s(
        simd.splat_f32s(limits.velocity_error),
        time_apart,
        simd.splat_f32s(limits.place_error),
    );
    let error = simd.mul_f32s(error, per_speed);
    let error = simd.add_f32s(error, simd.splat_f32s(f32::EPSILON));
    let last = simd.add_f32s(closest, simd.add_f32s(error, time_margin));
    let mut later_begin = zero;
    for begin in [one_of.begin, other_of.begin] {
        // Who recedes when the later one begins will never meet.
        miss = simd.or_m32s(miss, simd.less_than_f32s(last, begin));
        let later = simd.less_than_f32s(later_begin, begin);
        later_begin = simd.select_f32s(later, begin, later_begin);
    }
    let later = simd.less_than_f32s(latest, later_begin);
    latest = simd.select_f32s(later, later_begin, latest);
    // Who is inside the other then has met it before, or what it comes from has: not both of them come about. How far a scene's balls
    // may overlap is far below the margin.
    let way = simd.mul_f32s(later_begin, speed_squared);
    let change = simd.add_f32s(way, simd.add_f32s(recession, recession));
    let inside_then = simd.mul_add_e_f32s(later_begin, change, inside);
    miss = simd.or_m32s(miss, simd.less_than_f32s(inside_then, zero));
    // The contact lies between the two times.
    for axis in 0..3 {
        let place = |position: S::f32s| simd.sub_f32s(position, middle[axis]);
        let middle = simd.add_f32s(place(position[axis]), place(other_position[axis]));
        let drift = simd.add_f32s(velocity[axis], other_velocity[axis]);
        let least_margin = simd.splat_f32s(0.5 * limits.edges[axis] + limits.off_middle);
        let limit = simd.mul_add_e_f32s(time_margin, simd.abs_f32s(drift), least_margin);
        let at_touch = simd.mul_f32s(half, simd.mul_add_e_f32s(drift, touch, middle));
        let at_latest = simd.mul_f32s(half, simd.mul_add_e_f32s(drift, latest, middle));
        let least = simd.min_f32s(at_touch, at_latest);
        let most = simd.max_f32s(at_touch, at_latest);
        let above = simd.greater_than_f32s(least, limit);
        let below = simd.less_than_f32s(most, simd.neg_f32s(limit));
        miss = simd.or_m32s(miss, simd.or_m32s(above, below));
    }
    miss
}

#[inline(always)]
fn difference<S: Simd>(simd: S, a: [S::f32s; 3], b: [S::f32s; 3]) -> [S::f32s; 3] {
    [
        simd.sub_f32s(a[0], b[0]),
        simd.sub_f32s(a[1], b[1]),
        simd.sub_f32s(a[2], b[2]),
    ]
}

#[inline(always)]
fn dot<S: Simd>(simd: S, a: [S::f32s; 3], b: [S::f32s; 3]) -> S::f32s {
    let sum = simd.mul_f32s(a[0], b[0]);
    let sum = simd.mul_add_e_f32s(a[1], b[1], sum);
    simd.mul_add_e_f32s(a[2], b[2], sum)
}

/// What all pairs are asked first.
pub trait Test<S: Simd> {
    /// Which pieces may meet the ones in the same lanes, as far as this tells: the same either way.
    fn passes(&self, simd: S, one: Columns<S>, other: Columns<S>) -> S::m32s;
}

/// Are they near enough for meeting in the window, and do they not recede?
pub struct WithinReach<S: Simd> {
    pub reach_squared: S::f32s,
    /// Least `- r . v` of those that may approach.
    pub least_approach: S::f32s,
}

impl<S: Simd> Test<S> for WithinReach<S> {
    #[inline(always)]
    fn passes(&self, simd: S, one: Columns<S>, other: Columns<S>) -> S::m32s {
        let [apart, velocity] = between(simd, one, other);
        let near = simd.less_than_f32s(dot(simd, apart, apart), self.reach_squared);
        let approach = simd.greater_than_f32s(dot(simd, apart, velocity), self.least_approach);
        simd.and_m32s(near, approach)
    }
}

/// Are two flights so near each other at the beginning of a window that they can meet in it, whatever happens to them, and is the cell
/// the first along each axis for one of them at least?
pub struct Near<S: Simd> {
    reach_squared: S::f32s,
}

impl<S: Simd> Near<S> {
    /// With these limits, of which the largest speed is one that no flight exceeds.
    #[inline(always)]
    pub fn new(simd: S, limits: &Limits) -> Self {
        Self {
            reach_squared: simd.splat_f32s(limits.reach_squared),
        }
    }
}

impl<S: Simd> Test<S> for Near<S> {
    #[inline(always)]
    fn passes(&self, simd: S, one: Columns<S>, other: Columns<S>) -> S::m32s {
        let apart = difference(simd, other.position, one.position);
        let near = simd.less_than_f32s(dot(simd, apart, apart), self.reach_squared);
        let marks = simd.or_u32s(
            simd.transmute_u32s_f32s(one.begin),
            simd.transmute_u32s_f32s(other.begin),
        );
        simd.and_m32s(near, simd.equal_u32s(marks, simd.splat_u32s(ALL_MARKS)))
    }
}

/// Do their lines touch, and do they approach each other? By minus the square of the contact distance.
pub struct LinesTouch<S: Simd>(pub S::f32s);

impl<S: Simd> Test<S> for LinesTouch<S> {
    #[inline(always)]
    fn passes(&self, simd: S, one: Columns<S>, other: Columns<S>) -> S::m32s {
        let [apart, velocity] = between(simd, one, other);
        let [approach, speed, beyond] = encounter(simd, apart, velocity, self.0);
        // (r . v)^2 against |v|^2 (|r|^2 - contact^2).
        let closeness = simd.mul_f32s(approach, simd.max_f32s(approach, simd.splat_f32s(0.0)));
        simd.less_than_f32s(simd.mul_f32s(speed, beyond), closeness)
    }
}

/// The question for pieces that begin at collisions: do they touch in the window, after the later one has begun with them clear of
/// each other and not receding?
pub struct BallsTouch<S: Simd> {
    minus_contact_squared: S::f32s,
    /// How much less than that the square of a distance is at which any two pieces surely touch.
    minus_margin: S::f32s,
    /// Least `- r . v` of those that may approach.
    least_approach: S::f32s,
}

impl<S: Simd> BallsTouch<S> {
    /// With these limits.
    #[inline(always)]
    pub fn new(simd: S, limits: &Limits) -> Self {
        let margin = limits.contact_squared - limits.inside_squared;
        Self {
            minus_contact_squared: simd.splat_f32s(-limits.contact_squared),
            minus_margin: simd.splat_f32s(-(1.0 + 2.0 * f32::EPSILON) * margin),
            least_approach: simd.splat_f32s(-limits.receding),
        }
    }

    /// Which pairs of flights may meet, both from the beginning of the window on.
    #[inline(always)]
    pub fn at_first(&self, simd: S, one: Columns<S>, other: Columns<S>) -> S::m32s {
        let [apart, velocity] = between(simd, one, other);
        let [approach, speed, beyond] =
            encounter(simd, apart, velocity, self.minus_contact_squared);
        let when = simd.min_f32s(approach, speed);
        let twice = simd.add_f32s(approach, simd.sub_f32s(approach, when));
        let touch = simd.less_than_f32s(simd.mul_f32s(speed, beyond), simd.mul_f32s(when, twice));
        simd.and_m32s(touch, simd.greater_than_f32s(approach, self.least_approach))
    }

    /// Which of the [`others`] may meet a piece, as far as this tells.
    #[inline(always)]
    pub fn passes(&self, simd: S, row: &Row, columns: Columns<S>) -> S::m32s {
        let [apart, velocity] = between(simd, Columns::all_like(simd, row), columns);
        let [approach, speed, beyond] =
            encounter(simd, apart, velocity, self.minus_contact_squared);
        let begin = simd.splat_f32s(row.begin());
        let not_before = simd.greater_than_or_equal_f32s(columns.begin, begin);
        let later_begin = simd.select_f32s(not_before, columns.begin, begin);
        // From the later begin on: what is left of the approach, and of the distance.
        let way = simd.mul_f32s(later_begin, speed);
        let left = simd.sub_f32s(approach, way);
        let passed = simd.mul_f32s(later_begin, simd.add_f32s(approach, left));
        let beyond = simd.sub_f32s(beyond, passed);
        let clear = simd.greater_than_or_equal_f32s(beyond, self.minus_margin);
        let approaching = simd.greater_than_f32s(left, self.least_approach);
        // When they are closest then, times |v|^2; and how much closer than at the later begin, squared.
        let when = simd.min_f32s(left, simd.sub_f32s(speed, way));
        let twice = simd.add_f32s(left, simd.sub_f32s(left, when));
        let touch = simd.less_than_f32s(simd.mul_f32s(speed, beyond), simd.mul_f32s(when, twice));
        simd.and_m32s(simd.and_m32s(touch, clear), approaching)
    }
}

/// Which pieces may meet one that began where its ball met a `partner` at all: not those of its own ball, nor what the partner was on
/// before.
#[inline(always)]
pub fn others<S: Simd>(simd: S, row: &Row, partner: u32, columns: Columns<S>) -> S::m32s {
    let begin = simd.splat_f32s(row.begin());
    let not_before = simd.greater_than_or_equal_f32s(columns.begin, begin);
    let of_partner = simd.equal_u32s(columns.ball, simd.splat_u32s(partner));
    let ended = simd.and_m32s(of_partner, simd.not_m32s(not_before));
    let one_ball = simd.equal_u32s(columns.ball, simd.splat_u32s(row.ball()));
    simd.not_m32s(simd.or_m32s(one_ball, ended))
}

/// The way from one to the other, and the velocity with which the one moves towards it.
#[inline(always)]
fn between<S: Simd>(simd: S, one: Columns<S>, other: Columns<S>) -> [[S::f32s; 3]; 2] {
    [
        difference(simd, other.position, one.position),
        difference(simd, one.velocity, other.velocity),
    ]
}

/// Of pieces at a distance `r` and with a relative velocity `v`: `- r . v`, positive if they approach; `|v|^2`; and `|r|^2` but for
/// the square of the contact distance.
#[inline(always)]
fn encounter<S: Simd>(
    simd: S,
    apart: [S::f32s; 3],
    velocity: [S::f32s; 3],
    minus_contact_squared: S::f32s,
) -> [S::f32s; 3] {
    let beyond = simd.mul_add_e_f32s(apart[0], apart[0], minus_contact_squared);
    let beyond = simd.mul_add_e_f32s(apart[1], apart[1], beyond);
    let beyond = simd.mul_add_e_f32s(apart[2], apart[2], beyond);
    [
        dot(simd, apart, velocity),
        dot(simd, velocity, velocity),
        beyond,
    ]
}
