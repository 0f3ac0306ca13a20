//! Rows 3 to 5: the prediction of a pair's meeting alone, against twice the precision.

use glam::DVec3;
use rand::RngExt;

use super::Verdict;
use crate::collision::approach_time;
use crate::experiment::double_double::DoubleDouble;
use crate::experiment::gases::{direction, generator};

/// Points, exact.
type Exact = [DoubleDouble; 3];

fn exact(vector: DVec3) -> Exact {
    vector.to_array().map(DoubleDouble::from)
}

fn dot(a: Exact, b: Exact) -> DoubleDouble {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn after(separation: DVec3, velocity: DVec3, time: DoubleDouble) -> Exact {
    let (r, v) = (exact(separation), exact(velocity));
    [0, 1, 2].map(|axis| r[axis] + v[axis] * time)
}

fn length(vector: Exact) -> DoubleDouble {
    dot(vector, vector).sqrt()
}

/// Distance of closest approach.
fn impact(separation: DVec3, velocity: DVec3) -> f64 {
    let (r, v) = (exact(separation), exact(velocity));
    let time = DoubleDouble::default() - dot(r, v) / dot(v, v);
    length(after(separation, velocity, time)).value()
}

/// Distance of the surfaces after `time`, without sign, for diameter 1.
fn gap_after(separation: DVec3, velocity: DVec3, time: f64) -> f64 {
    let distance = length(after(separation, velocity, time.into()));
    (distance - 1.0.into()).value().abs()
}

/// A pair at a distance that passes at `impact`, as closely as f64 can say it, in any direction.
fn pair(distance: f64, impact: f64, random: &mut impl FnMut() -> DVec3) -> (DVec3, DVec3) {
    let line = random();
    let across = random().cross(line).normalize();
    let speed = 0.1 + random().x.abs();
    let along = (distance * distance - impact * impact).sqrt();
    (line * along + across * impact, line * -speed)
}

/// Row 3.
pub fn random_pairs() -> Verdict {
    let mut verdict = Verdict::default();
    for (distance, bound) in [(3.0, 4e-15), (1e2, 1e-13), (1e4, 2e-11), (1e8, 2e-7)] {
        let mut random = generator(3);
        let (mut worst, mut missed, mut invented) = (0.0_f64, 0_u64, 0_u64);
        for _ in 0..250_000 {
            let aim = 1.2 * random.random::<f64>();
            let (r, v) = pair(distance, aim, &mut || direction(&mut random));
            let impact = impact(r, v);
            match approach_time(r, v, 1.0) {
                Some(time) => {
                    worst = worst.max(gap_after(r, v, time));
                    invented += u64::from(impact > 1.0 + 1e-9);
                }
                None => missed += u64::from(impact <= 1.0 - 1e-9),
            }
        }
        verdict.at_most(format!("gap at {distance:e} d"), worst, bound);
        verdict.equal(format!("missed at {distance:e} d"), &missed, &0);
        verdict.note(format!("invented at {distance:e} d: {invented}"));
    }
    verdict
}

/// Row 4.
pub fn grazing_pairs() -> Verdict {
    let mut verdict = Verdict::default();
    let mut random = generator(4);
    let (mut wrong, mut gap, mut overlap) = (0_u64, 0.0_f64, 0.0_f64);
    for exponent in 3..=15 {
        for sign in [-1.0, 1.0] {
            let aim = 1.0 + sign * 10.0_f64.powi(-exponent);
            for _ in 0..1000 {
                let (r, v) = pair(3.0, aim, &mut || direction(&mut random));
                let depth = 1.0 - impact(r, v);
                let found = approach_time(r, v, 1.0);
                wrong += u64::from(exponent <= 12 && found.is_some() != (depth > 0.0));
                match found {
                    Some(time) if exponent > 12 => gap = gap.max(gap_after(r, v, time)),
                    None if exponent > 12 => overlap = overlap.max(depth),
                    _ => {}
                }
            }
        }
    }
    verdict.equal("wrong answers to 1e-12 d", &wrong, &0);
    verdict.at_most("beyond: gap of a hit", gap, 1e-15);
    verdict.at_most("beyond: overlap of a miss", overlap, 1e-15);
    verdict
}

/// Row 5.
pub fn overlapping_pairs() -> Verdict {
    let mut verdict = Verdict::default();
    let mut random = generator(5);
    let mut wrong = [0_u64; 3];
    let mut shallowest_wrong = 0.0_f64;
    for trial in 0..30_000 {
        let depth = 10.0_f64.powf(-16.0 + 15.7 * random.random::<f64>());
        let r = direction(&mut random) * (1.0 - depth);
        let depth = 1.0 - length(exact(r)).value();
        // Rounded coordinates may have lost so small an overlap, or made it a little different.
        let kind = trial % 3;
        if depth < 1e-16 {
            continue;
        }
        let v = match kind {
            // r . v is zero without rounding: both products are the same.
            2 => DVec3::new(-r.y, r.x, 0.0),
            _ => direction(&mut random),
        };
        let approaches = r.dot(v) < 0.0;
        let (v, expected) = match kind {
            0 => (if approaches { v } else { -v }, Some(0.0)),
            1 => (if approaches { -v } else { v }, None),
            _ => (v, None),
        };
        if approach_time(r, v, 1.0) != expected {
            wrong[kind] += 1;
            shallowest_wrong = shallowest_wrong.max(depth);
        }
    }
    for (kind, wrong) in ["approaching", "receding", "tangential"].iter().zip(wrong) {
        verdict.equal(format!("wrong of 10000 {kind}"), &wrong, &0);
    }
    if shallowest_wrong > 0.0 {
        verdict.note(format!(
            "deepest overlap judged wrongly: {shallowest_wrong:e} d"
        ));
    }
    verdict
}
