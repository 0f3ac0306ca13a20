//! Random numbers as a pure function of seed, step and cell: whoever draws them, and when, they are the same.
//!
//! Source: Steele, Lea & Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014 (`SplitMix64`); a counter that
//! starts at a hash of where the numbers are drawn.

/// What the counter grows by: 2^64 over the golden ratio, odd.
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// `2^-24`: spacing of the f32 numbers just below one.
const STEP_24: f32 = 1.0 / (1 << 24) as f32;

/// `2^-32`.
const STEP_32: f64 = 1.0 / (1_u64 << 32) as f64;

/// The numbers of one cell in one step.
#[derive(Clone, Copy, Debug)]
pub struct Draws(u64);

fn mix(word: u64) -> u64 {
    let word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    word ^ (word >> 31)
}

/// What all cells have in common in a step.
pub fn key(seed: u64, step: u64) -> u64 {
    mix(mix(seed ^ GOLDEN) ^ step.wrapping_mul(GOLDEN))
}

impl Draws {
    /// The numbers of a cell in the step of this key.
    pub fn new(key: u64, cell: usize) -> Self {
        Self(mix(key.wrapping_add((cell as u64).wrapping_mul(GOLDEN))))
    }

    /// 64 random bits.
    #[inline]
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(GOLDEN);
        mix(self.0)
    }

    /// A number in `[0, 1)`.
    #[inline]
    pub fn share(&mut self) -> f64 {
        (self.bits() >> 32) as f64 * STEP_32
    }

    /// Two different numbers below `count`, which is at least 2 and at most 2^20, and a share in `[0, 1)`, from one draw.
    #[inline]
    pub fn pair(&mut self, count: usize) -> (usize, usize, f32) {
        let bits = self.bits();
        let below = |bits: u64, count: usize| (((bits & 0xf_ffff) * count as u64) >> 20) as usize;
        let first = below(bits >> 44, count);
        let other = below(bits >> 24, count - 1);
        let second = other + usize::from(other >= first);
        (first, second, (bits & 0xff_ffff) as f32 * STEP_24)
    }

    /// A direction, all alike.
    ///
    /// Source: Marsaglia, Ann. Math. Stat. 43, 645 (1972): no function but the square root.
    #[inline]
    pub fn direction(&mut self) -> [f64; 3] {
        loop {
            let bits = self.bits();
            let centred = |half: u64| (half as f64 + 0.5) * (2.0 * STEP_32) - 1.0;
            let (x, y) = (centred(bits >> 32), centred(bits & 0xffff_ffff));
            let square = x * x + y * y;
            if square < 1.0 {
                let root = 2.0 * (1.0 - square).sqrt();
                return [x * root, y * root, 1.0 - 2.0 * square];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_numbers_depend_on_seed_step_and_cell_alone() {
        let first = |seed, step, cell| Draws::new(key(seed, step), cell).bits();
        assert_eq!(first(1, 2, 3), first(1, 2, 3));
        let others = [first(2, 2, 3), first(1, 3, 3), first(1, 2, 4)];
        assert!(others.iter().all(|&other| other != first(1, 2, 3)));
    }

    #[test]
    fn every_pair_is_drawn_as_often_as_any_other() {
        let mut draws = Draws::new(key(1, 1), 0);
        let mut counts = [[0_u32; 5]; 5];
        let mut sum = 0.0;
        for _ in 0..20_000 {
            let (first, second, share) = draws.pair(5);
            counts[first][second] += 1;
            sum += f64::from(share);
        }
        for (place, &count) in counts.as_flattened().iter().enumerate() {
            if place % 6 == 0 {
                assert_eq!(count, 0, "a ball and itself");
            } else {
                let count = f64::from(count);
                assert!((count - 1000.0).abs() < 5.0 * 1000_f64.sqrt(), "{count}");
            }
        }
        assert!((sum / 20_000.0 - 0.5).abs() < 5.0 * (1.0 / 12.0 / 20_000.0_f64).sqrt());
    }

    #[test]
    fn directions_have_unit_length_and_no_bias() {
        let mut draws = Draws::new(key(7, 0), 0);
        let mut means = [0.0; 6];
        for _ in 0..20_000 {
            let [x, y, z] = draws.direction();
            assert!((x * x + y * y + z * z - 1.0).abs() < 1e-14);
            let terms = [x, y, z, x * x - 1.0 / 3.0, y * y - 1.0 / 3.0, x * y];
            means
                .iter_mut()
                .zip(terms)
                .for_each(|(mean, term)| *mean += term / 20_000.0);
        }
        assert!(
            means
                .iter()
                .all(|mean| mean.abs() < 5.0 * (1.0 / 3.0 / 20_000.0_f64).sqrt())
        );
    }
}
