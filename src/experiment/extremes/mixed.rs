//! Rows 16 to 18 and 34: balls of very different kinds, and a gas of nearly nothing.

use std::f64::consts::PI;

use glam::DVec3;

use super::Verdict;
use crate::event::Participants;
use crate::experiment::gases::{
    body_of, container, face_centred, generator, normal, place_in, random, with_normal_velocities,
};
use crate::experiment::theory::mixture_contact_value;
use crate::experiment::trial::{EVENT, Trial, WINDOWED, processor_seconds, resident_memory};
use crate::state::Body;

/// Row 16.
pub fn heavy() -> Verdict {
    let mut verdict = Verdict::default();
    let place = |site: usize| {
        let site = [site / 64, site / 8 % 8, site % 8].map(|index| 2.0 * (index as f64 - 3.5));
        DVec3::from_array(site)
    };
    let mut places: Vec<_> = (0..512)
        .map(place)
        .filter(|place| place.length() > 3.0)
        .collect();
    places.push(DVec3::ZERO);
    let last = places.len() - 1;
    let mut gas = with_normal_velocities(container(DVec3::splat(8.0), places), 16);
    gas.bodies.push(Body {
        radius: 2.0,
        mass: 1e12,
    });
    gas.body_of = vec![0; last];
    gas.body_of.push(1);
    gas.velocities[last] = DVec3::X * 1e-6;
    let mut trial = Trial::new(EVENT, &gas);
    trial.run_for_events(1_000_000, 10.0);
    let moved = trial.state().placement().positions[last].length();
    verdict.at_most("energy", trial.energy_drift(), 1e-12);
    verdict.at_most("way of the heavy ball, finite", moved, 6.0);
    verdict.note(format!("{last} light balls, {} collisions", trial.events()));
    verdict
}

/// Row 17.
pub fn large() -> Verdict {
    let mut verdict = Verdict::default();
    let memory = resident_memory();
    let half = DVec3::splat(1.2e4);
    let mut random = generator(17);
    let mut places = vec![DVec3::ZERO];
    while places.len() < 1001 {
        let place = place_in(half - 1.0, &mut random);
        let free = |other: &DVec3| other.distance(place) > 2.0;
        if place.length() > 1e4 + 1.0 && places[1..].iter().all(free) {
            places.push(place);
        }
    }
    let mut gas = container(half, places);
    let small = Body {
        radius: 1.0,
        mass: 1.0,
    };
    gas.bodies = vec![
        Body {
            radius: 1e4,
            mass: 1e6,
        },
        small,
    ];
    gas.body_of = vec![1; 1001];
    gas.body_of[0] = 0;
    gas.velocities[1..].fill_with(|| 1e3 * normal(&mut random));
    let began = processor_seconds();
    let mut trial = Trial::new(EVENT, &gas);
    let (mut overlap, mut step) = (0.0_f64, 0.0);
    while trial.events() < 200_000 {
        step += 10.0;
        trial
            .try_run(step, &mut |collision| {
                if let Participants::Pair(first, second) = collision.participants {
                    let contact = [first, second].map(|ball| body_of(&gas, ball as usize).radius);
                    overlap = overlap.max(-collision.gap * (contact[0] + contact[1]));
                }
            })
            .expect("room to move");
    }
    let rate = trial.events() as f64 / (processor_seconds() - began);
    verdict.at_most("overlap in small radii", overlap, 1e-11);
    match memory.zip(resident_memory()) {
        Some((before, now)) => {
            let grown = now.saturating_sub(before) as f64 / 1e6;
            verdict.at_most("memory that this row took, MB", grown, 200.0);
        }
        None => verdict.not_run("memory: the system does not tell"),
    }
    verdict.at_least("collisions per second of the processor", rate, 1e4);
    let pairs = trial.engine.counters().pair_collisions;
    verdict.note(format!(
        "{pairs} of {} collisions between balls",
        trial.events()
    ));
    verdict
}

/// Row 18.
pub fn dilute() -> Verdict {
    let mut verdict = Verdict::default();
    let count = 1000.0;
    let volume: f64 = count * PI / 6.0 / 1e-8;
    let gas = random(1000, DVec3::splat(0.5 * volume.cbrt()), 18);
    // Ten thousand walls between two collisions of a ball: the engine without a queue is the faster.
    let mut trial = Trial::new(WINDOWED, &gas);
    let state = trial.state();
    let deviation =
        (state.totals().thermal_energy().expect("balls that move") * state.units.energy()).sqrt();
    let expected = 0.5 * (count - 1.0) * 4.0 * PI.sqrt() * (count / volume) * deviation;
    let pairs = |trial: &Trial| trial.engine.counters().pair_collisions;
    let mut slices = 0_u32;
    while pairs(&trial) < 10_000 {
        slices += 1;
        trial.run(f64::from(slices) * 100.0 / expected);
    }
    let rate = pairs(&trial) as f64 / trial.time();
    verdict.near("collision rate over theory", rate / expected, 1.0, 0.03);
    let end = trial.state().placement();
    let mut vectors = end.positions.iter().chain(&end.velocities);
    let finite = vectors.all(|vector| vector.is_finite());
    verdict.holds("every number finite", finite, "yes");
    let walls = trial.engine.counters().wall_collisions;
    verdict.note(format!("{} collisions, {walls} with walls", pairs(&trial)));
    verdict
}

/// Row 34.
pub fn mixture() -> Verdict {
    let mut verdict = Verdict::default();
    let (count, diameters, masses) = (1372, [0.5, 1.0], [1.0, 16.0]);
    let mut gas = face_centred(7, 0.5, 34);
    gas.bodies = vec![0, 1]
        .into_iter()
        .map(|kind: usize| Body {
            radius: 0.5 * diameters[kind],
            mass: masses[kind],
        })
        .collect();
    gas.body_of = (0..count).map(|ball| ball % 2).collect();
    let mut momentum = DVec3::ZERO;
    for ball in 0..count as usize {
        let mass = masses[ball % 2];
        gas.velocities[ball] /= mass.sqrt();
        momentum += gas.velocities[ball] * mass;
    }
    let total = 0.5 * f64::from(count) * (masses[0] + masses[1]);
    gas.velocities
        .iter_mut()
        .for_each(|velocity| *velocity -= momentum / total);
    let mut trial = Trial::new(EVENT, &gas);
    trial.run_for_events(500_000, 1.0);
    let (start, before) = (trial.time(), trial.events());
    let (mut energies, mut samples) = ([0.0; 2], 0_u32);
    while samples < 400 {
        samples += 1;
        trial.run(start + f64::from(samples));
        for (ball, velocity) in trial.state().placement().velocities.iter().enumerate() {
            energies[ball % 2] += masses[ball % 2] * velocity.length_squared();
        }
    }
    let density = 0.5 * f64::from(count) / gas.domain.volume();
    let moment =
        |power: i32| PI / 6.0 * density * diameters.iter().map(|d| d.powi(power)).sum::<f64>();
    let moments = [moment(1), moment(2), moment(3)];
    let state = trial.state();
    let energy = state.totals().thermal_energy().expect("balls that move") * state.units.energy();
    let rate_of = |i: usize, j: usize| {
        let distance = 0.5 * (diameters[i] + diameters[j]);
        let reduced = masses[i] * masses[j] / (masses[i] + masses[j]);
        let value = mixture_contact_value([diameters[i], diameters[j]], moments);
        let both =
            density * density * distance * distance * value * (8.0 * PI * energy / reduced).sqrt();
        if i == j { 0.5 * both } else { both }
    };
    let expected = (rate_of(0, 0) + rate_of(0, 1) + rate_of(1, 1)) * gas.domain.volume();
    let rate = (trial.events() - before) as f64 / (trial.time() - start);
    verdict.near(
        "temperature of light over heavy",
        energies[0] / energies[1],
        1.0,
        0.02,
    );
    verdict.near("collision rate over theory", rate / expected, 1.0, 0.01);
    verdict.note(format!(
        "{} collisions, packing fraction {:.4}",
        trial.events(),
        moments[2]
    ));
    verdict
}
