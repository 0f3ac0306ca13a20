//! Which of many flights a ball may meet first: what [`crate::collision::may_meet`] asks of two, asked of as many at a time as the
//! machine's vectors hold; and of those it may meet, which one surely meets later than another.
//!
//! The arithmetic is the same, step by step, and so are the answers, whatever the width of the vectors.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::__m256d;

use glam::DVec3;
use pulp::{Arch, Simd, WithSimd};
#[cfg(target_arch = "x86_64")]
use pulp::{bytemuck, cast, x86::V3};

use crate::collision::REJECTION_MARGIN;
#[cfg(target_arch = "x86_64")]
use crate::engine::turn::as_v3;
use crate::state::{Time, Trajectory};

/// Most flights of which it is asked in one go.
pub const AT_ONCE: usize = 64;

/// Most numbers in a vector.
const MOST_LANES: usize = 8;

/// How a ball sees others.
pub trait Sight {
    /// Whether any of them may be seen at an image.
    const AT_IMAGES: bool;

    /// The flight of one.
    fn flight(&self, seen: u32) -> &Trajectory;

    /// How far apart the two centres are at contact \[length\].
    fn contact(&self, seen: u32) -> f64;

    /// The way to the image by which the looking ball meets it \[length\]; zero if there are no images.
    fn shift(&self, seen: u32) -> DVec3;
}

/// Share of a time, and of an epoch, by which rounding may change it, with a wide margin.
const TIME_MARGIN: f64 = 1e-12;

/// Writes down which of some others, [`AT_ONCE`] at the most, a flight may meet first, and no later than `before`; gives how many.
///
/// A ball may be among the others: it never may meet itself, as it does not approach.
#[inline]
pub fn sift(
    flight: &Trajectory,
    others: &[u32],
    sight: &impl Sight,
    before: Option<Time>,
    possible: &mut [u32; AT_ONCE],
) -> usize {
    let sift = Sift {
        flight,
        others,
        sight,
        bound: before.map_or(f64::INFINITY, |time| {
            let flown = time.since(flight.begin);
            flown + TIME_MARGIN * (flown + 1.0)
        }),
        possible,
    };
    // The few others of a cell would not fill wider vectors.
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V3::try_new() {
        return Simd::vectorize(simd, sift);
    }
    Arch::new().dispatch(sift)
}

struct Sift<'a, T> {
    flight: &'a Trajectory,
    others: &'a [u32],
    sight: &'a T,
    /// In how many epochs since the flight's beginning it must meet one that is written down.
    bound: f64,
    possible: &'a mut [u32; AT_ONCE],
}

impl<T: Sight> WithSimd for Sift<'_, T> {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> usize {
        let looking = Looking {
            simd,
            flight: self.flight,
            position: splat(simd, self.flight.position),
            velocity: splat(simd, self.flight.velocity),
            sight: self.sight,
        };
        let possible = self.possible;
        let mut count = 0;
        // Nobody can foresee who may meet, least of all the processor: so all are written down, some in vain.
        let mut note = |others: &[u32], may: [u64; MOST_LANES]| {
            for (&other, may) in others.iter().zip(may) {
                possible[count % AT_ONCE] = other;
                count += may as usize;
            }
        };
        let vectors = self.others.chunks_exact(S::F64_LANES);
        let rest = vectors.remainder();
        for others in vectors {
            note(others, looking.may_meet(|lane| others[lane]));
        }
        if let Some(last) = rest.len().checked_sub(1) {
            note(rest, looking.may_meet(|lane| rest[lane.min(last)]));
        }
        if count > 1 || self.bound < f64::INFINITY {
            looking.keep_first(possible, count, self.bound)
        } else {
            count
        }
    }
}

/// A ball that looks at others.
struct Looking<'a, S: Simd, T> {
    simd: S,
    flight: &'a Trajectory,
    position: Columns<S>,
    velocity: Columns<S>,
    sight: &'a T,
}

/// How a ball sees some others: a vector of each, as of the later of the begins of the two flights.
struct View<S: Simd> {
    /// When that is, in epochs since the looking ball's flight began.
    flown: S::f64s,
    /// `r . v`, negative if they approach.
    radial: S::f64s,
    speed_squared: S::f64s,
    /// Square of the distance, less that at contact.
    beyond: S::f64s,
    /// By how much rounding may change that, with a wide margin.
    margin: S::f64s,
}

impl<S: Simd, T: Sight> Looking<'_, S, T> {
    #[inline(always)]
    fn see(&self, seen: impl Fn(usize) -> u32) -> View<S> {
        let Self { simd, sight, .. } = *self;
        let (mut shift, mut contact) = (EMPTY, [0.0; MOST_LANES]);
        for (lane, contact) in contact.iter_mut().enumerate().take(S::F64_LANES) {
            let seen = seen(lane);
            *contact = sight.contact(seen);
            if T::AT_IMAGES {
                set(&mut shift, lane, sight.shift(seen));
            }
        }
        let contact = S::as_simd_f64s(&contact).0[0];
        let (place, speed, lead) =
            columns(simd, |lane| sight.flight(seen(lane)), self.flight.begin);
        let zero = simd.splat_f64s(0.0);
        // One ball is at its reference, the other has flown since its own.
        let flown = simd.max_f64s(simd.neg_f64s(lead), zero);
        let other_flown = simd.max_f64s(lead, zero);
        let own = moved(simd, self.position, self.velocity, flown);
        let mut apart = difference(simd, own, moved(simd, place, speed, other_flown));
        if T::AT_IMAGES {
            let [x, y, z] = vectors::<S>(&shift);
            apart = [
                simd.add_f64s(apart[0], x),
                simd.add_f64s(apart[1], y),
                simd.add_f64s(apart[2], z),
            ];
        }
        let relative = difference(simd, self.velocity, speed);
        let distance_squared = dot(simd, apart, apart);
        View {
            flown,
            radial: dot(simd, apart, relative),
            speed_squared: dot(simd, relative, relative),
            beyond: simd.sub_f64s(distance_squared, simd.mul_f64s(contact, contact)),
            margin: simd.mul_f64s(simd.splat_f64s(REJECTION_MARGIN), distance_squared),
        }
    }

    /// For as many others as a vector holds, one if the ball may meet it, else zero.
    #[inline(always)]
    fn may_meet(&self, seen: impl Fn(usize) -> u32) -> [u64; MOST_LANES] {
        let simd = self.simd;
        let View {
            radial,
            speed_squared,
            beyond,
            margin,
            ..
        } = self.see(seen);
        let closeness = simd.add_f64s(
            simd.mul_f64s(radial, radial),
            simd.mul_f64s(margin, speed_squared),
        );
        let misses = simd.less_than_f64s(closeness, simd.mul_f64s(speed_squared, beyond));
        let approach = simd.less_than_f64s(radial, simd.splat_f64s(0.0));
        let rejected = simd.or_m64s(misses, simd.not_m64s(approach));
        let mut may = [0; MOST_LANES];
        S::as_mut_simd_u64s(&mut may).0[0] =
            simd.select_u64s(rejected, simd.splat_u64s(0), simd.splat_u64s(1));
        may
    }

    /// Keeps those of some others, all of which the ball may meet, that it may meet before it surely has met another or the time
    /// that bounds it; gives how many.
    #[inline(always)]
    fn keep_first(&self, possible: &mut [u32; AT_ONCE], count: usize, mut bound: f64) -> usize {
        let mut earliest = [0.0; AT_ONCE];
        for first in (0..count).step_by(S::F64_LANES) {
            let [from, to] = self.contact_between(|lane| possible[(first + lane).min(count - 1)]);
            earliest[first..][..S::F64_LANES].copy_from_slice(&from[..S::F64_LANES]);
            bound = to[..S::F64_LANES].iter().fold(bound, |a, &b| a.min(b));
        }
        let mut kept = 0;
        for place in 0..count {
            possible[kept] = possible[place];
            // A time that is no number says nothing.
            kept += usize::from(!(earliest[place] > bound));
        }
        kept
    }

    /// For as many others as a vector holds, all of which the ball may meet, between which times it meets each, in epochs since its
    /// flight began; the second one infinite if it may miss it.
    ///
    /// Derived here: two points that approach at `-r . v` are in contact after `(r^2 - c^2) / (-r . v + root)`, the root that of
    /// `(r . v)^2 - v^2 (r^2 - c^2)`.
    #[inline(always)]
    fn contact_between(&self, seen: impl Fn(usize) -> u32) -> [[f64; MOST_LANES]; 2] {
        let simd = self.simd;
        let zero = simd.splat_f64s(0.0);
        let View {
            flown,
            radial,
            speed_squared,
            beyond,
            margin,
        } = self.see(seen);
        let below = simd.mul_f64s(margin, speed_squared);
        let discriminant = simd.sub_f64s(
            simd.mul_f64s(radial, radial),
            simd.mul_f64s(speed_squared, beyond),
        );
        let most = simd.add_f64s(discriminant, below);
        let least = simd.sub_f64s(discriminant, below);
        let after = |beyond: S::f64s, square: S::f64s| {
            let root = simd.sqrt_f64s(simd.max_f64s(square, zero));
            let duration = simd.div_f64s(beyond, simd.sub_f64s(root, radial));
            simd.add_f64s(flown, simd.max_f64s(duration, zero))
        };
        let [from, to] = [
            after(simd.sub_f64s(beyond, margin), most),
            after(simd.add_f64s(beyond, margin), least),
        ];
        let hits = simd.less_than_f64s(below, least);
        let to = simd.select_f64s(hits, to, simd.splat_f64s(f64::INFINITY));
        let rounding = |time: S::f64s| {
            let times = simd.add_f64s(time, simd.splat_f64s(1.0));
            simd.mul_f64s(simd.splat_f64s(TIME_MARGIN), times)
        };
        let mut between = [[0.0; MOST_LANES]; 2];
        S::as_mut_simd_f64s(&mut between[0]).0[0] = simd.sub_f64s(from, rounding(from));
        S::as_mut_simd_f64s(&mut between[1]).0[0] = simd.add_f64s(to, rounding(to));
        between
    }
}

/// Three numbers for each lane.
type Columns<S> = [<S as Simd>::f64s; 3];

/// The same, before they are vectors.
const EMPTY: [[f64; MOST_LANES]; 3] = [[0.0; MOST_LANES]; 3];

/// Positions and velocities of as many flights as a vector holds, and for how long each has flown at a time.
#[inline(always)]
fn columns<'a, S: Simd>(
    simd: S,
    flight: impl Fn(usize) -> &'a Trajectory,
    time: Time,
) -> (Columns<S>, Columns<S>, S::f64s) {
    #[cfg(target_arch = "x86_64")]
    if let Some(v3) = as_v3(simd) {
        let (place, speed, flown) = turned(v3, std::array::from_fn(flight), time);
        return (
            place.map(bytemuck::cast),
            speed.map(bytemuck::cast),
            bytemuck::cast(flown),
        );
    }
    let (mut place, mut speed, mut flown) = (EMPTY, EMPTY, [0.0; MOST_LANES]);
    for (lane, flown) in flown.iter_mut().enumerate().take(S::F64_LANES) {
        let flight = flight(lane);
        set(&mut place, lane, flight.position);
        set(&mut speed, lane, flight.velocity);
        *flown = time.since(flight.begin);
    }
    (
        vectors::<S>(&place),
        vectors::<S>(&speed),
        S::as_simd_f64s(&flown).0[0],
    )
}

/// The same with vectors of four, by halves of rows.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn turned(
    V3 { avx, avx2, .. }: V3,
    [a, b, c, d]: [&Trajectory; 4],
    time: Time,
) -> ([__m256d; 3], [__m256d; 3], __m256d) {
    let turn = |a: [f64; 2], b: [f64; 2], c: [f64; 2], d: [f64; 2]| {
        let even = avx._mm256_set_m128d(cast(c), cast(a));
        let odd = avx._mm256_set_m128d(cast(d), cast(b));
        [
            avx._mm256_unpacklo_pd(even, odd),
            avx._mm256_unpackhi_pd(even, odd),
        ]
    };
    let xy = |flight: &Trajectory| [flight.position.x, flight.position.y];
    let zu = |flight: &Trajectory| [flight.position.z, flight.velocity.x];
    let vw = |flight: &Trajectory| [flight.velocity.y, flight.velocity.z];
    let begin = |flight: &Trajectory| [f64::from_bits(flight.begin.epoch), flight.begin.local];
    let [x, y] = turn(xy(a), xy(b), xy(c), xy(d));
    let [z, u] = turn(zu(a), zu(b), zu(c), zu(d));
    let [v, w] = turn(vw(a), vw(b), vw(c), vw(d));
    let [epoch, local] = turn(begin(a), begin(b), begin(c), begin(d));
    let epochs = avx2._mm256_sub_epi64(cast([time.epoch; 4]), cast(epoch));
    // To f64: the lower half of a whole number in the last digits of 2^52, the upper one, which has the sign, in those of 2^84.
    let [low, high] = [exponent_of(52), exponent_of(84) | 1 << 31].map(|bits| [bits; 4]);
    let offset = [exponent_of(84) | 1 << 31 | 1 << 20; 4];
    let low = avx2._mm256_blend_epi32::<0b1010_1010>(epochs, cast(low));
    let high = avx2._mm256_xor_si256(avx2._mm256_srli_epi64::<32>(epochs), cast(high));
    let epochs = avx._mm256_add_pd(avx._mm256_sub_pd(cast(high), cast(offset)), cast(low));
    let rest = avx._mm256_sub_pd(cast([time.local; 4]), local);
    ([x, y, z], [u, v, w], avx._mm256_add_pd(epochs, rest))
}

/// The bits of a power of two.
#[cfg(target_arch = "x86_64")]
const fn exponent_of(power: u64) -> u64 {
    (1023 + power) << 52
}

#[inline(always)]
fn set(columns: &mut [[f64; MOST_LANES]; 3], lane: usize, vector: DVec3) {
    columns[0][lane] = vector.x;
    columns[1][lane] = vector.y;
    columns[2][lane] = vector.z;
}

#[inline(always)]
fn vectors<S: Simd>([x, y, z]: &[[f64; MOST_LANES]; 3]) -> Columns<S> {
    [
        S::as_simd_f64s(x).0[0],
        S::as_simd_f64s(y).0[0],
        S::as_simd_f64s(z).0[0],
    ]
}

#[inline(always)]
fn splat<S: Simd>(simd: S, vector: DVec3) -> Columns<S> {
    [
        simd.splat_f64s(vector.x),
        simd.splat_f64s(vector.y),
        simd.splat_f64s(vector.z),
    ]
}

#[inline(always)]
fn moved<S: Simd>(simd: S, from: Columns<S>, velocity: Columns<S>, time: S::f64s) -> Columns<S> {
    [
        simd.add_f64s(from[0], simd.mul_f64s(velocity[0], time)),
        simd.add_f64s(from[1], simd.mul_f64s(velocity[1], time)),
        simd.add_f64s(from[2], simd.mul_f64s(velocity[2], time)),
    ]
}

#[inline(always)]
fn difference<S: Simd>(simd: S, a: Columns<S>, b: Columns<S>) -> Columns<S> {
    [
        simd.sub_f64s(a[0], b[0]),
        simd.sub_f64s(a[1], b[1]),
        simd.sub_f64s(a[2], b[2]),
    ]
}

#[inline(always)]
fn dot<S: Simd>(simd: S, a: Columns<S>, b: Columns<S>) -> S::f64s {
    let sum = simd.add_f64s(simd.mul_f64s(a[0], b[0]), simd.mul_f64s(a[1], b[1]));
    simd.add_f64s(sum, simd.mul_f64s(a[2], b[2]))
}

#[cfg(test)]
mod tests {
    use pulp::{Scalar, Scalar128b, Scalar256b, Scalar512b};
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;
    use crate::collision::{contact_time, may_meet, separation_at_later_begin};

    /// Flights seen each at an image of its own.
    struct Around(Vec<Trajectory>);

    impl Sight for Around {
        const AT_IMAGES: bool = true;

        fn flight(&self, seen: u32) -> &Trajectory {
            &self.0[seen as usize]
        }

        fn contact(&self, seen: u32) -> f64 {
            0.5 + 0.1 * f64::from(seen % 7)
        }

        fn shift(&self, seen: u32) -> DVec3 {
            DVec3::new(f64::from(seen % 3) - 1.0, 0.0, 0.0)
        }
    }

    #[test]
    fn vectors_of_every_width_keep_what_comes_first_and_little_else() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(7);
        let mut vector = |size: f64| {
            DVec3::from_array(std::array::from_fn(|_| random.random_range(-size..size)))
        };
        let flights = (0..AT_ONCE as u64).map(|number| Trajectory {
            position: vector(2.0),
            velocity: vector(1.0),
            // Some began long before the one that looks, some after it.
            begin: Time {
                epoch: if number % 9 == 8 {
                    7
                } else {
                    (1 << 40) + number % 2
                },
                local: (number % 5) as f64 / 8.0,
            },
        });
        let around = Around(flights.collect());
        let seen: Vec<u32> = (0..AT_ONCE as u32).collect();
        let (mut possible_at_all, mut kept_at_all) = (0, 0);
        for looking in &around.0 {
            let some = [&seen[..], &seen[20..27], &[]];
            for others in some.into_iter().chain(seen.chunks(1)) {
                let sees = |seen: u32| {
                    let other = around.flight(seen);
                    let (begin, apart) = separation_at_later_begin(looking, other);
                    let velocity = looking.velocity - other.velocity;
                    (begin, apart + around.shift(seen), velocity)
                };
                let may = |seen: &&u32| {
                    let (_, apart, velocity) = sees(**seen);
                    may_meet(apart, velocity, around.contact(**seen))
                };
                let may: Vec<u32> = others.iter().filter(may).copied().collect();
                let meets = |&seen: &u32| {
                    let (begin, apart, velocity) = sees(seen);
                    begin.after(contact_time(apart, velocity, around.contact(seen))?)
                };
                let first = |&seen: &u32| Some((meets(&seen)?.since(looking.begin), seen));
                let first = may
                    .iter()
                    .filter_map(first)
                    .min_by(|a, b| a.0.total_cmp(&b.0));
                let late = first.map(|(time, _)| 0.5 * time);
                for bound in [f64::INFINITY].into_iter().chain(late) {
                    let kept = |sift: &dyn Fn(Sift<Around>) -> usize| {
                        let mut possible = [0; AT_ONCE];
                        let count = sift(Sift {
                            flight: looking,
                            others,
                            sight: &around,
                            bound,
                            possible: &mut possible,
                        });
                        possible[..count].to_vec()
                    };
                    let one = kept(&|sift| sift.with_simd(Scalar));
                    assert_eq!(one, kept(&|sift| sift.with_simd(Scalar128b)));
                    assert_eq!(one, kept(&|sift| sift.with_simd(Scalar256b)));
                    assert_eq!(one, kept(&|sift| sift.with_simd(Scalar512b)));
                    assert_eq!(one, kept(&|sift| Arch::new().dispatch(sift)));
                    #[cfg(target_arch = "x86_64")]
                    if let Some(simd) = pulp::x86::V3::try_new() {
                        assert_eq!(one, kept(&|sift| Simd::vectorize(simd, sift)));
                    }
                    assert!(one.iter().all(|seen| may.contains(seen)));
                    // One alone has nobody before it: it is kept if it may be met at all.
                    assert!(others.len() != 1 || bound.is_finite() || one == may);
                    if let Some((time, seen)) = first {
                        let in_time = time <= bound;
                        assert_eq!(one.contains(&seen), in_time || time < 1e-9);
                        assert!(
                            in_time || one.iter().all(|seen| meets(seen).is_none() || time < 1e-9)
                        );
                    }
                    if others.len() > 1 {
                        possible_at_all += may.len();
                        kept_at_all += one.len();
                    }
                }
            }
        }
        assert!(
            kept_at_all > 50 && 2 * kept_at_all < possible_at_all,
            "{kept_at_all} of {possible_at_all}"
        );
    }
}
