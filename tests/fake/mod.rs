//! A run that is none: seeded snapshots of free flight in a box, for the screen's tests.

use std::sync::{Arc, Mutex};

use moltop::feed::{Command, Feed};
use moltop::snapshot::{
    Boundary, Counts, Expected, History, Observable, Phase, Pressure, Sample, SceneCard, Snapshot,
    Speeds, Stretch, Units,
};

/// Numbers in `[0, 1)` from a seed. Source: Steele, Lea and Flood, `SplitMix64`.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }
}

/// Oxygen near standard conditions.
pub fn oxygen() -> SceneCard {
    SceneCard {
        title: "Oxygen near standard conditions".into(),
        units: Units::Si,
        ball_count: 704_969,
        packing_fraction: 5.663e-4,
        boundary: Boundary::Container,
        size: [3.0e-7; 3],
        planes: Vec::new(),
        center: [0.0; 3],
        radius: 1.73e-10,
        sample: 1.0e-9,
    }
}

/// A small dense gas in reduced units.
pub fn small_gas() -> SceneCard {
    SceneCard {
        title: "512 hard spheres".into(),
        units: Units::Reduced,
        ball_count: 512,
        packing_fraction: 0.2,
        boundary: Boundary::Container,
        size: [11.0; 3],
        planes: Vec::new(),
        center: [0.0; 3],
        radius: 0.5,
        sample: 1.0,
    }
}

/// A snapshot of a run that has just been started: nothing exists yet.
pub fn starting(scene: SceneCard) -> Snapshot {
    Snapshot {
        sequence: 1,
        ..Snapshot::starting(Arc::new(scene), "event", Some(2.0e-5))
    }
}

/// A snapshot in the middle of the oxygen run, after so many frames.
pub fn running(scene: SceneCard, frame: u64) -> Snapshot {
    let si = scene.units == Units::Si;
    let (time_unit, pressure_unit, heat) = if si {
        (1e-9, 98_800.0, 273.15)
    } else {
        (10.0, 0.7, 1.0)
    };
    let time = time_unit * (12.48 + 0.029 * frame as f64);
    let mut random = Random(7);
    let mut history = History::default();
    for i in 1..=300 {
        let end = |i: u32| time * f64::from(i) / 300.0;
        let mut around = |mean: f64, deviation: f64| Some(mean + deviation * random.normal());
        let stretch = Stretch::new(end(i - 1), end(i), 0.5 * f64::from(i))
            .with(Observable::Temperature, Some(heat))
            .with(
                Observable::PressureWall,
                around(pressure_unit, 0.02 * pressure_unit),
            )
            .with(Observable::PairRate, around(2.087e15, 0.004 * 2.087e15))
            .with(Observable::QueueLength, around(47_300.0, 80.0));
        history.push(stretch);
    }
    Snapshot {
        sequence: 2 + frame,
        phase: Phase::Running,
        time,
        until: si.then_some(2.0e-5),
        wall_time_s: 43.0 + frame as f64 / 10.0,
        setup_time_s: Some(0.8),
        time_rate: Some(0.29 * time_unit),
        collisions_per_wall_second: Some(602_000.0),
        time_left_s: si.then_some((67_800.0, 70_800.0)),
        counts: Counts {
            pair_collisions: 26_060_000 + frame * 60_000,
            wall_collisions: 18_780_000,
            cell_crossings: 1_200_000_000,
            ..Counts::default()
        },
        temperature: Some(heat),
        kinetic_energy: 3.988e-15,
        pressure: Pressure {
            wall: Some(pressure_unit * 1.0003),
            virial: Some(pressure_unit * 1.0002),
            standard_error: Some(pressure_unit * 0.0003),
        },
        compressibility_factor: Some(1.002_29),
        collision_rate: Some(5.92e9),
        pair_rate: Some(2.088e15),
        wall_rate: Some(1.505e15),
        mean_free_path: Some(if si { 7.18e-8 } else { 1.2 }),
        expected: Expected {
            pressure: Some(pressure_unit),
            pair_rate: Some(2.087e15),
            wall_rate: Some(1.5045e15),
        },
        energy_drift: Some(4.1e-14),
        momentum_drift: Some(2.0e-13),
        virial_residual: Some(-1.2e-13),
        echo_horizon: Some(0.55 * time_unit),
        max_overlap: Some(3.2e-13),
        speeds: Some(Arc::new(speeds(si, &mut random))),
        queue_length: 47_312,
        queue_length_max: 49_001,
        peak_rss_bytes: Some(212_000_000),
        history: Arc::new(history),
        sample: Some(Arc::new(sample(&scene, time / time_unit))),
        ..starting(scene)
    }
}

fn speeds(si: bool, random: &mut Random) -> Speeds {
    let most_probable = if si { 377.0 } else { 1.41 };
    let bin_width = 4.0 * most_probable / 128.0;
    let maxwell: Vec<f64> = (0..128)
        .map(|bin| {
            let v = (f64::from(bin) + 0.5) / 32.0;
            704_969.0 * 4.0 / std::f64::consts::PI.sqrt() * v * v * (-v * v).exp() / 32.0
        })
        .collect();
    let normal: Vec<f64> = (0..64)
        .map(|bin| {
            let v = (f64::from(bin) - 31.5) / 8.0;
            704_969.0 * (-v * v / 2.0).exp() / (8.0 * (2.0 * std::f64::consts::PI).sqrt())
        })
        .collect();
    Speeds {
        bin_width,
        counts: maxwell
            .iter()
            .map(|expected| (expected + 2.0 * expected.sqrt() * random.normal()).max(0.0) as u64)
            .collect(),
        maxwell,
        ks: 0.001_65,
        ks_critical: 0.002_32,
        component_bin_width: most_probable / 2.0_f64.sqrt() / 8.0,
        components: [0, 1, 2].map(|_| {
            let counts = normal.iter();
            counts
                .map(|expected| (expected + expected.sqrt() * random.normal()).max(0.0) as u64)
                .collect()
        }),
        component_ks: [0.000_9, 0.001_2, 0.000_7],
        normal,
    }
}

/// Balls in free flight between the walls.
fn sample(scene: &SceneCard, time: f64) -> Sample {
    let mut random = Random(1);
    let count = scene.ball_count.min(20_000);
    let positions = (0..count).map(|_| {
        scene.size.map(|edge| {
            let (start, speed) = (random.unit(), 0.8 * random.normal());
            let unfolded = (start + speed * time).rem_euclid(2.0);
            ((unfolded - 1.0).abs() - 0.5) as f32 * edge as f32
        })
    });
    Sample {
        radii: vec![scene.radius as f32; count],
        positions: positions.collect(),
        names: Vec::new(),
    }
}

/// A feed that shows what it is given and remembers what it was told.
pub struct FakeFeed {
    pub snapshot: Mutex<Arc<Snapshot>>,
    pub commands: Mutex<Vec<Command>>,
}

impl FakeFeed {
    #[allow(dead_code, reason = "not every user of this file has a feed")]
    pub fn new(snapshot: Snapshot) -> Self {
        Self {
            snapshot: Mutex::new(Arc::new(snapshot)),
            commands: Mutex::new(Vec::new()),
        }
    }
}

impl Feed for FakeFeed {
    fn latest(&self) -> Arc<Snapshot> {
        self.snapshot.lock().expect("no holder panics").clone()
    }

    fn send(&self, command: Command) {
        self.commands
            .lock()
            .expect("no holder panics")
            .push(command);
    }
}
