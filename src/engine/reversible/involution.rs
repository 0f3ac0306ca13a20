//! The collision of two balls on integer velocities: doing it twice changes nothing, and it commutes with reversing time.
//!
//! An elastic collision negates the component of the relative velocity along the line of centres. Here one component of one
//! velocity is first exchanged for that relative component (`close`), then the other five are corrected by multiples of it
//! (a lifting: it is undone by subtracting what was added), its sign is changed, and it is exchanged back. Every product is
//! rounded half away from zero, so that negated velocities give negated results. What rounding does forwards, it undoes
//! backwards, bit for bit; energy and momentum are kept to rounding.
//!
//! Source: the reversible collision of Perumalla & Protopopescu (ACM TOMACS 23(2), 2013); lifting with odd rounding as in
//! integer wavelet transforms and in the bit-reversible integrator of Levesque & Verlet (J. Stat. Phys. 72, 519, 1993).

/// Bits after the point of a coefficient.
const FRACTION_BITS: u32 = 60;

/// Largest speed in velocity units that the products have room for.
pub const SPEED_BITS: u32 = 60;

/// Velocities after an elastic collision: of the ball that takes the rounding, then of the other.
///
/// `separation` is the first centre minus the second, in any unit; `shares` are the parts of the change of the relative velocity
/// that each ball takes, `m2 / (m1 + m2)` and `m1 / (m1 + m2)`. The first ball should be the lighter one; the second may have
/// an infinite mass and share 0, and then keeps its velocity. Speeds must be below `2^SPEED_BITS`.
#[inline]
pub fn collide(
    separation: [f64; 3],
    shares: [f64; 2],
    [mut first, mut second]: [[i64; 3]; 2],
) -> [[i64; 3]; 2] {
    // The longest component, so that no slope is above one.
    let mut axis = 0;
    for other in 1..3 {
        if separation[other].abs() > separation[axis].abs() {
            axis = other;
        }
    }
    // With n the unit vector along the separation: slopes n_m / n_axis, and 1 / n_axis^2.
    let slopes = separation.map(|component| component / separation[axis]);
    let inverse_square = slopes.iter().map(|slope| slope * slope).sum::<f64>();
    let slope = slopes.map(fixed);
    let corrections =
        shares.map(|share| slopes.map(|slope| fixed(2.0 * share * slope / inverse_square)));

    let along = |first: &[i64; 3], second: &[i64; 3]| {
        let mut sum = 0;
        for component in 0..3 {
            sum -= product(slope[component], second[component]);
            if component != axis {
                sum += product(slope[component], first[component]);
            }
        }
        round(sum)
    };
    // The relative velocity along the line of centres, over n_axis.
    let close = first[axis] + along(&first, &second);
    for component in 0..3 {
        if component != axis {
            first[component] -= round(product(corrections[0][component], close));
        }
        second[component] += round(product(corrections[1][component], close));
    }
    first[axis] = -close - along(&first, &second);
    [first, second]
}

fn fixed(coefficient: f64) -> i64 {
    (coefficient * (1_u64 << FRACTION_BITS) as f64) as i64
}

#[inline]
fn product(coefficient: i64, value: i64) -> i128 {
    i128::from(coefficient) * i128::from(value)
}

/// The nearest whole number to a sum of products, halves away from zero: an odd function.
#[inline]
fn round(sum: i128) -> i64 {
    const HALF: i128 = 1 << (FRACTION_BITS - 1);
    let whole = if sum < 0 {
        -((HALF - sum) >> FRACTION_BITS)
    } else {
        (sum + HALF) >> FRACTION_BITS
    };
    debug_assert!(i64::try_from(whole).is_ok(), "the speed bound leaves room");
    whole as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    fn vector(random: &mut Xoshiro256PlusPlus, bits: u32) -> [i64; 3] {
        let size = 1_i64 << bits;
        std::array::from_fn(|_| random.random_range(-size..=size))
    }

    fn shares(masses: [f64; 2]) -> [f64; 2] {
        let sum = masses[0] + masses[1];
        [masses[1] / sum, masses[0] / sum]
    }

    fn negated(velocities: [[i64; 3]; 2]) -> [[i64; 3]; 2] {
        velocities.map(|velocity| velocity.map(|component| -component))
    }

    #[test]
    fn twice_is_nothing_and_reversed_is_reversed_for_any_masses_and_directions() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
        for case in 0..100_000 {
            let separation = vector(&mut random, 50).map(|component| component as f64);
            let bits = case % 59;
            let before = [vector(&mut random, bits), vector(&mut random, bits)];
            let ratio = [1.0, 3.0, 1e3, 1e12][case as usize % 4];
            let shares = shares([1.0, ratio]);
            let after = collide(separation, shares, before);
            assert_eq!(collide(separation, shares, after), before);
            assert_eq!(collide(separation, shares, negated(before)), negated(after));
        }
    }

    #[test]
    fn energy_and_momentum_are_kept_to_rounding() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(2);
        for case in 0..10_000 {
            let separation = vector(&mut random, 50).map(|component| component as f64);
            let before = [vector(&mut random, 58), vector(&mut random, 58)];
            let masses = [1.0, [1.0, 3.0, 1000.0][case % 3]];
            let after = collide(separation, shares(masses), before);
            let sum = |of: &dyn Fn(usize) -> f64| of(0) + of(1);
            let energy = |velocities: [[i64; 3]; 2]| {
                let square = |ball: usize| {
                    let components = velocities[ball].map(|component| component as f64);
                    masses[ball] * components.iter().map(|c| c * c).sum::<f64>()
                };
                sum(&square)
            };
            assert!((energy(after) / energy(before) - 1.0).abs() < 4e-15);
            for axis in 0..3 {
                let gained =
                    |ball: usize| masses[ball] * (after[ball][axis] - before[ball][axis]) as f64;
                let scale = 1e-15 * masses[1] * (1_i64 << 58) as f64;
                assert!(sum(&gained).abs() < 4.0 * scale);
            }
        }
    }

    #[test]
    fn equal_masses_head_on_swap_and_a_fixed_ball_stays() {
        let before = [[5, 7, -3], [-11, 2, 0]];
        let swapped = [[-11, 7, -3], [5, 2, 0]];
        assert_eq!(collide([2.0, 0.0, 0.0], [0.5, 0.5], before), swapped);
        let fixed = [[0, -4, 3], [0, 0, 0]];
        let after = collide([0.0, 0.5, 0.0], [1.0, 0.0], fixed);
        assert_eq!(after, [[0, 4, 3], [0, 0, 0]]);
    }

    #[test]
    fn the_fastest_balls_allowed_do_not_overflow() {
        let speed = (1_i64 << SPEED_BITS) / 2 + 1; // three such components are within the bound
        for signs in 0..64 {
            let sign = |bit: usize| if signs >> bit & 1 == 0 { speed } else { -speed };
            let velocity = |ball: usize| std::array::from_fn(|axis| sign(3 * ball + axis));
            let before = [velocity(0), velocity(1)];
            for separation in [[1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [0.0, 1.0, -1.0]] {
                let after = collide(separation, [1.0, 1e-12], before);
                assert_eq!(collide(separation, [1.0, 1e-12], after), before);
            }
        }
    }
}
