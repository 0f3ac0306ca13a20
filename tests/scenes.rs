//! Scenes that are good: what they mean, where their balls are, and that a seed fixes every bit.

use std::path::Path;

use glam::DVec3;
use moltop::scene::Scene;
use moltop::snapshot::Units;
use moltop::state::Placement;

fn scene(text: &str) -> Scene {
    Scene::parse(Path::new("scene.toml"), text).expect("a good scene")
}

fn placed(text: &str) -> Placement {
    scene(text).place().expect("a scene that can be placed")
}

/// A box of edge 10 in reduced units with the given rest of the file.
fn in_a_box(rest: &str) -> String {
    format!("units = \"reduced\"\n[domain]\nkind = \"container\"\nsize = [10, 10, 10]\n{rest}")
}

/// A hash of bit patterns (FNV-1a), the same on every machine.
fn hash(vectors: &[DVec3]) -> u64 {
    let bytes = vectors
        .iter()
        .flat_map(DVec3::to_array)
        .flat_map(|x| x.to_bits().to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

#[test]
fn the_files_in_configs_are_good_and_the_embedded_scene_is_one_of_them() {
    let mut names = Vec::new();
    for entry in std::fs::read_dir("configs").expect("the directory of scenes") {
        let path = entry.expect("an entry").path();
        let scene = Scene::load(&path).expect("a good scene");
        scene.place().expect("a scene that can be placed");
        if path.ends_with("oxygen.toml") {
            assert_eq!(scene.source, Scene::oxygen().source);
        }
        names.push(
            path.file_name()
                .expect("a name")
                .to_string_lossy()
                .into_owned(),
        );
    }
    names.sort();
    let expected = [
        "brownian.toml",
        "cradle.toml",
        "crystal.toml",
        "dense-fluid.toml",
        "ideal-gas.toml",
        "mixture.toml",
        "oxygen.toml",
        "piston.toml",
        "relaxation.toml",
        "seed-15625.toml",
        "seed-512.toml",
        "wedge.toml",
    ];
    assert_eq!(names, expected);
}

#[test]
fn oxygen_is_a_centred_lattice_of_maxwell_velocities() {
    let scene = Scene::oxygen();
    let placement = scene.place().expect("the embedded scene can be placed");
    let count = 89 * 89 * 89;
    assert_eq!(
        (scene.units, scene.until, scene.sample),
        (Units::Si, Some(2e-5), 1e-9)
    );
    assert_eq!(
        (placement.positions.len(), placement.velocities.len()),
        (count, count)
    );
    assert_eq!((placement.bodies.len(), placement.body_of.len()), (1, 0));

    let half_lattice = 44.0 * 3.353_473e-9;
    let (low, high) = placement.positions.iter().fold(
        (DVec3::INFINITY, DVec3::NEG_INFINITY),
        |(low, high), position| (low.min(*position), high.max(*position)),
    );
    assert!((low + half_lattice).abs().max_element() < 1e-22 && (low + high).length() < 1e-22);

    // Standard error of a sample deviation: 1 / sqrt(2 n).
    let expected = (1.380_649e-23_f64 * 273.15 / 5.3e-26).sqrt();
    for axis in 0..3 {
        let squares: f64 = placement.velocities.iter().map(|v| v[axis] * v[axis]).sum();
        let deviation = (squares / count as f64).sqrt();
        assert!(
            (deviation / expected - 1.0).abs() < 4.0 / (2.0 * count as f64).sqrt(),
            "axis {axis}: {deviation}"
        );
    }
}

#[test]
fn value_stability_the_oxygen_scene_has_these_bits_on_every_machine() {
    let placement = Scene::oxygen()
        .place()
        .expect("the embedded scene can be placed");
    assert_eq!(hash(&placement.positions), 4_795_233_198_225_222_565);
    assert_eq!(hash(&placement.velocities), 13_615_080_258_551_541_596);
}

#[test]
fn another_seed_gives_other_velocities_and_the_same_seed_the_same() {
    let mut scene = Scene::load(Path::new("configs/seed-512.toml")).expect("a good scene");
    let first = scene.place().expect("it can be placed");
    assert_eq!(scene.place().expect("it can be placed"), first);
    scene.seed = 2;
    let other = scene.place().expect("it can be placed");
    assert_eq!(other.positions, first.positions);
    assert_ne!(other.velocities, first.velocities);
}

#[test]
fn a_lattice_without_spacing_fills_the_domain() {
    let balls = placed(&in_a_box("[[species]]\ncount = 8\nradius = 2.5\nmass = 1"));
    assert_eq!(
        (balls.positions[0], balls.positions[7]),
        (DVec3::splat(-2.5), DVec3::splat(2.5))
    );
    assert_eq!(
        balls.velocities,
        [DVec3::ZERO; 8],
        "balls rest unless the scene says otherwise"
    );
}

#[test]
fn species_come_in_the_order_of_the_file_and_explicit_balls_last() {
    let scene = scene(&in_a_box(
        "[[ball]]\nname = \"pollen\"\nposition = [0, 0, 0]\nradius = 1\nmass = 7\n\
         [[species]]\ncount = 8\nradius = 0.5\nmass = 2\nvelocity = { kind = \"speed\", value = 3 }\n\
         [[species]]\ncount = 20\nradius = 0.25\nmass = 1\nplacement = { kind = \"random\" }",
    ));
    let balls = scene.place().expect("it can be placed");
    let masses: Vec<f64> = balls
        .body_of
        .iter()
        .map(|&body| balls.bodies[body as usize].mass)
        .collect();
    assert_eq!(masses, [[2.0; 8].as_slice(), &[1.0; 20], &[7.0]].concat());
    assert_eq!(scene.named_balls(), [("pollen".to_owned(), 28)]);
    assert!(
        balls.velocities[..8]
            .iter()
            .all(|v| (v.length() - 3.0).abs() < 1e-14)
    );
}

#[test]
fn random_placement_reaches_three_tenths_of_the_volume() {
    // 1000 balls of radius 0.415 in 10^3: packing fraction 0.299.
    let balls = placed(&in_a_box(
        "[[species]]\ncount = 1000\nradius = 0.415\nmass = 1\nplacement = { kind = \"random\" }",
    ));
    assert_eq!(balls.positions.len(), 1000); // place() itself checks overlaps
}

#[test]
fn a_file_of_balls_lies_beside_its_scene() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let path = directory.path().join("scene.toml");
    let species = "[[species]]\nplacement = { kind = \"file\", path = \"balls.csv\" }";
    std::fs::write(&path, in_a_box(species)).expect("a small file");
    let rows = "index,x,y,z,vx,vy,vz,radius,mass,collisions\n0,1,2,3,0.5,0,0,0.25,4,9\n1,-1,2,3,0,0,0,1,4,0\n";
    std::fs::write(directory.path().join("balls.csv"), rows).expect("a small file");
    let balls = Scene::load(&path)
        .and_then(|scene| scene.place())
        .expect("it can be placed");
    assert_eq!(
        balls.positions,
        [DVec3::new(1.0, 2.0, 3.0), DVec3::new(-1.0, 2.0, 3.0)]
    );
    assert_eq!(balls.velocities, [DVec3::new(0.5, 0.0, 0.0), DVec3::ZERO]);
    assert_eq!(
        (balls.bodies[0].radius, balls.bodies[1].radius),
        (0.25, 1.0)
    );
}

#[test]
fn touching_is_not_overlapping() {
    placed(&in_a_box(
        "[[species]]\ncount = 1000\nradius = 0.5\nmass = 1",
    ));
}

#[test]
fn the_card_says_how_full_the_box_is() {
    let scene = scene(&in_a_box("[[species]]\ncount = 8\nradius = 2.5\nmass = 1"));
    let card = scene.card(&scene.place().expect("it can be placed"));
    assert!((card.packing_fraction - std::f64::consts::PI / 6.0 * 0.125 * 8.0).abs() < 1e-15);
    assert_eq!(
        (card.ball_count, card.size, card.radius),
        (8, [10.0; 3], 2.5)
    );
}

#[test]
fn a_periodic_box_takes_balls_in_at_the_opposite_face() {
    let text = "units = \"reduced\"\n[domain]\nkind = \"periodic\"\nsize = [10, 10, 10]\ncenter = [5, 5, 5]\n\
                [[ball]]\nposition = [12, -1, 3]\nradius = 1\nmass = 1\n";
    assert_eq!(placed(text).positions, [DVec3::new(2.0, 9.0, 3.0)]);
}

#[test]
fn a_periodic_lattice_without_spacing_closes_through_the_faces() {
    // Touching neighbours everywhere, across the faces as well.
    let text = "units = \"reduced\"\n[domain]\nkind = \"periodic\"\nsize = [10, 10, 10]\n\
                [[species]]\ncount = 1000\nradius = 0.5\nmass = 1\n";
    let positions = placed(text).positions;
    assert_eq!(positions[0], DVec3::splat(-4.5));
    assert_eq!(positions[999], DVec3::splat(4.5));
}

#[test]
fn random_balls_keep_clear_of_planes_and_of_images() {
    let text = "units = \"reduced\"\n[domain]\nkind = \"periodic\"\nsize = [10, 10, 10]\n\
                [[species]]\ncount = 500\nradius = 0.5\nmass = 1\nplacement = { kind = \"random\" }\n";
    placed(text); // place() itself checks overlaps through the faces
    let planes = "[[plane]]\npoint = [1, 0, 0]\nnormal = [1, 2, 3]\n[[plane]]\npoint = [0, 0, 0]\nnormal = [0, 0, -1e-9]\n";
    let container = text.replace("periodic", "container").replace("500", "200") + planes;
    placed(&container); // and planes
}

#[test]
fn sizes_ten_thousand_apart_are_checked_in_no_time() {
    let text = "units = \"reduced\"\n[domain]\nkind = \"container\"\nsize = [10, 10, 10]\n\
                [[species]]\ncount = 100000\nradius = 1e-4\nmass = 1e-12\nplacement = { kind = \"random\" }\n\
                [[species]]\ncount = 20000\nradius = 0.0\nmass = 1e-12\nplacement = { kind = \"random\" }\n\
                [[species]]\ncount = 20\nradius = 1.0\nmass = 1.0\nplacement = { kind = \"random\" }\n";
    let began = std::time::Instant::now();
    assert_eq!(placed(text).bodies.len(), 3);
    assert!(began.elapsed().as_secs_f64() < 5.0, "{:?}", began.elapsed());
}

#[test]
fn a_fixed_ball_has_an_infinite_mass_and_a_point_no_radius() {
    let balls = placed(&in_a_box(
        "[[species]]\ncount = 8\nradius = 0\nmass = 1\nvelocity = { kind = \"maxwell\", temperature = 1 }\n\
         [[ball]]\nposition = [0, 0, 0]\nradius = 1\nfixed = true\n",
    ));
    assert_eq!(
        (balls.bodies[0].radius, balls.bodies[1].mass),
        (0.0, f64::INFINITY)
    );
    assert_eq!(balls.velocities[8], DVec3::ZERO);
}
