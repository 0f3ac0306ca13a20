//! Speeds against Maxwell's distribution at the measured temperature.

use crate::state::State;

/// Bins of the histogram; the last one also holds everything faster.
pub const BIN_COUNT: usize = 96;

/// Bins per thermal velocity component `sqrt(k T / m)`: the histogram reaches six of them.
const BINS_PER_DEVIATION: f64 = 16.0;

/// Bins of a component's histogram, from -4 to 4 thermal deviations; the outermost also hold everything beyond.
pub const COMPONENT_BINS: usize = 64;

/// Bins of a component per thermal deviation: half as many as of the speed.
const COMPONENT_BINS_PER_DEVIATION: f64 = 8.0;

/// Steps per bin at which the cumulative distributions are compared.
const STEPS_PER_BIN: usize = 16;

/// The speeds of all balls at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct Speeds {
    /// Width of a bin \[speed\].
    pub bin_width: f64,
    /// Balls per bin.
    pub counts: Vec<u64>,
    /// Balls per bin after Maxwell.
    pub maxwell: Vec<f64>,
    /// Kolmogorov-Smirnov distance, over 1536 equal steps.
    pub ks: f64,
    /// The distance that a Maxwellian sample of this size exceeds once in a thousand.
    ///
    /// Source: Kolmogorov's limit law, `1.949 / sqrt(n)`.
    pub ks_critical: f64,
    /// Mean speed.
    pub mean: f64,
    /// Balls per bin of each velocity component.
    pub components: [Vec<u64>; 3],
    /// Balls per bin that the normal distribution expects of each.
    pub normal: Vec<f64>,
    /// Kolmogorov-Smirnov distance of each from it, at the bin edges.
    pub component_ks: [f64; 3],
}

impl Speeds {
    /// Measures the speeds of a gas; `None` for a gas at rest.
    ///
    /// In a mixture, a ball counts with the speed that a ball of the first ball's mass would have at its kinetic energy, so
    /// that one curve holds for all.
    pub fn of(state: &State) -> Option<Self> {
        Self::at_energy(state, state.totals().kinetic_energy)
    }

    /// The same where the kinetic energy is known.
    pub fn at_energy(state: &State, energy: f64) -> Option<Self> {
        let count = state.ball_count();
        if count == 0 || energy <= 0.0 {
            return None;
        }
        let mass = state.bodies.of(0).mass;
        let deviation = (2.0 * energy / (3.0 * count as f64 * mass)).sqrt();
        let per_step = BINS_PER_DEVIATION * STEPS_PER_BIN as f64 / deviation;
        let mut steps = vec![0_u64; BIN_COUNT * STEPS_PER_BIN];
        let last = steps.len() - 1;
        let mut sum = 0.0;
        let mut components = [const { [0_u64; COMPONENT_BINS] }; 3];
        let per_bin = COMPONENT_BINS_PER_DEVIATION / deviation;
        let middle = COMPONENT_BINS as f64 / 2.0;
        for ball in 0..count {
            let velocity = state.trajectories[ball].velocity;
            let speed = velocity.length();
            let share = if state.bodies.uniform().is_some() {
                1.0
            } else {
                (state.bodies.of(ball).mass / mass).sqrt()
            };
            sum += speed;
            steps[((speed * share * per_step) as usize).min(last)] += 1;
            for (bins, component) in components.iter_mut().zip(velocity.to_array()) {
                let place = middle + component * share * per_bin;
                bins[(place.max(0.0) as usize).min(COMPONENT_BINS - 1)] += 1;
            }
        }
        let cumulative = |step: usize| {
            maxwell_cumulative(step as f64 / (BINS_PER_DEVIATION * STEPS_PER_BIN as f64))
        };
        let mut below = 0;
        let mut ks = 0.0_f64;
        for (step, &balls) in steps[..last].iter().enumerate() {
            below += balls;
            ks = ks.max((below as f64 / count as f64 - cumulative(step + 1)).abs());
        }
        let expected = |bin: usize| {
            let upper = if bin + 1 == BIN_COUNT {
                1.0
            } else {
                cumulative((bin + 1) * STEPS_PER_BIN)
            };
            count as f64 * (upper - cumulative(bin * STEPS_PER_BIN))
        };
        Some(Self {
            bin_width: deviation / BINS_PER_DEVIATION,
            counts: steps
                .chunks(STEPS_PER_BIN)
                .map(|bin| bin.iter().sum())
                .collect(),
            maxwell: (0..BIN_COUNT).map(expected).collect(),
            ks,
            ks_critical: 1.949 / (count as f64).sqrt(),
            mean: sum / count as f64,
            component_ks: components.map(|bins| ks_from_normal(&bins, count as f64)),
            components: components.map(Vec::from),
            normal: (0..COMPONENT_BINS)
                .map(|bin| count as f64 * (below_edge(bin + 1) - below_edge(bin)))
                .collect(),
        })
    }
}

/// Largest distance of the cumulative distribution of a component from the normal one, at the bin edges.
fn ks_from_normal(bins: &[u64; COMPONENT_BINS], count: f64) -> f64 {
    let mut below = 0;
    let mut ks = 0.0_f64;
    for (bin, balls) in bins.iter().enumerate() {
        below += balls;
        ks = ks.max((below as f64 / count - below_edge(bin + 1)).abs());
    }
    ks
}

/// Share of the normal distribution below the lower edge of a bin; the outermost bins reach to infinity.
fn below_edge(edge: usize) -> f64 {
    let deviations = (edge as f64 - COMPONENT_BINS as f64 / 2.0) / COMPONENT_BINS_PER_DEVIATION;
    match edge {
        0 => 0.0,
        COMPONENT_BINS => 1.0,
        _ => 0.5 * (1.0 + libm::erf(deviations / std::f64::consts::SQRT_2)),
    }
}

/// Share of a Maxwellian gas slower than `speed`, in units of `sqrt(k T / m)`.
fn maxwell_cumulative(speed: f64) -> f64 {
    let scaled = speed / std::f64::consts::SQRT_2;
    libm::erf(scaled) - std::f64::consts::FRAC_2_SQRT_PI * scaled * libm::exp(-scaled * scaled)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bins_of_a_component_are_normal_in_sum_and_in_the_middle() {
        assert_eq!(below_edge(COMPONENT_BINS / 2), 0.5);
        let one = below_edge(COMPONENT_BINS / 2 + 8) - below_edge(COMPONENT_BINS / 2 - 8);
        assert!((one - 0.682_689_492_137_086).abs() < 1e-12);
        let mut even = [0; COMPONENT_BINS];
        even[0] = 7;
        assert!((ks_from_normal(&even, 7.0) - (1.0 - below_edge(1))).abs() < 1e-12);
    }

    #[test]
    fn maxwells_median_and_mean_lie_where_the_textbook_has_them() {
        assert!((maxwell_cumulative(1.538_172_25) - 0.5).abs() < 1e-8);
        assert_eq!(maxwell_cumulative(0.0), 0.0);
        assert!((maxwell_cumulative(9.0) - 1.0).abs() < 1e-15);
    }
}
