//! There and back: scenes as TOML, as the seed's text and as CSV states hold the same bits.

use std::path::{Path, PathBuf};

use glam::DVec3;
use moltop::convert::convert;
use moltop::error::Error;
use moltop::scene::Scene;
use moltop::state::Placement;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use tempfile::TempDir;

fn balls(path: &Path) -> Placement {
    let scene = Scene::load(path).expect("a good scene");
    scene.place().expect("a good scene")
}

fn bits(vectors: &[DVec3]) -> Vec<u64> {
    let numbers = vectors.iter().flat_map(DVec3::to_array);
    numbers.map(f64::to_bits).collect()
}

#[track_caller]
fn same(found: &Placement, expected: &Placement) {
    assert_eq!(bits(&found.positions), bits(&expected.positions));
    assert_eq!(bits(&found.velocities), bits(&expected.velocities));
    assert_eq!(
        (&found.bodies, &found.body_of),
        (&expected.bodies, &expected.body_of)
    );
}

/// Converts along a chain of file names in a directory of its own; the last one's path.
fn chain(directory: &TempDir, first: &Path, names: &[&str]) -> PathBuf {
    let mut from = first.to_owned();
    for name in names {
        let to = directory.path().join(name);
        convert(&from, &to, None, false).expect("a scene that can be written");
        from = to;
    }
    from
}

/// Half a million random bit patterns as positions of points and half a million as velocities: whatever is finite and not so
/// large that a scene refuses it, subnormal numbers and -0 among them.
#[test]
fn a_million_random_numbers_survive_every_format() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(5);
    let mut number = |largest: f64| loop {
        let number = f64::from_bits(random.random());
        if number.abs() < largest {
            return number;
        }
    };
    let mut text = String::from("B 166667\n-0.0 0 5e-324 0 -0.0 -5e-324 1 0\n");
    for _ in 1..166_667 {
        let place = [(); 3].map(|()| number(1e300));
        let velocity = [(); 3].map(|()| number(1e150));
        let words = place.into_iter().chain(velocity).map(|x| format!("{x:?} "));
        text.extend(words);
        text += "1 0\n";
    }
    let directory = tempfile::tempdir().expect("a temporary directory");
    let first = directory.path().join("first.txt");
    std::fs::write(&first, &text).expect("a file");
    let expected = balls(&first);
    assert_eq!(expected.positions.len(), 166_667);
    let last = chain(
        &directory,
        &first,
        &["a.toml", "b.seed", "c.csv", "d.txt", "e.toml", "f.txt"],
    );
    same(&balls(&last), &expected);
    let [b, d] = ["b.seed", "d.txt"]
        .map(|name| std::fs::read(directory.path().join(name)).expect("it was written"));
    let f = std::fs::read(last).expect("it was written");
    assert!(b == d && d == f, "the same balls give the same bytes");
}

#[test]
fn every_scene_keeps_its_bits_and_its_domain_as_toml_and_as_seed_text() {
    for name in [
        "seed-512",
        "wedge",
        "cradle",
        "piston",
        "ideal-gas",
        "mixture",
        "crystal",
    ] {
        let path = PathBuf::from(format!("configs/{name}.toml"));
        let expected = balls(&path);
        let directory = tempfile::tempdir().expect("a temporary directory");
        let toml = balls(&chain(&directory, &path, &["a.toml"]));
        same(&toml, &expected);
        assert_eq!(toml.domain, expected.domain);
        let is_periodic = ["mixture", "crystal"].contains(&name);
        if !is_periodic {
            let seed = balls(&chain(&directory, &path, &["b.txt"]));
            same(&seed, &expected);
            assert_eq!(seed.domain, expected.domain);
        }
        let state = directory.path().join("c.csv");
        convert(&path, &state, None, false).expect("it can be written");
        let back = directory.path().join("d.toml");
        convert(&state, &back, Some(&path), false).expect("it can be read back");
        let found = balls(&back);
        same(&found, &expected);
        assert_eq!(found.domain, expected.domain);
    }
}

#[test]
fn si_units_names_and_fixed_balls_survive() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let path = directory.path().join("scene.toml");
    let text = "title = \"a \\\"b\\\"\\n\"\nunits = \"si\"\n[domain]\nkind = \"open\"\nsize = [1e-7, 1e-7, 1e-7]\n\
                [[ball]]\nname = \"pollen\"\nposition = [0, 0, 0]\nradius = 1e-8\nfixed = true\n\
                [[ball]]\nposition = [3e-8, 0, 0]\nvelocity = [1, 2, 3]\nradius = 0\nmass = 1e-26\n";
    std::fs::write(&path, text).expect("a file");
    let found = Scene::load(&chain(&directory, &path, &["a.toml"])).expect("a good scene");
    assert_eq!(
        (found.title.as_str(), found.named_balls()),
        ("a \"b\"\n", vec![("pollen".to_owned(), 0)])
    );
    let seed = Scene::load(&chain(&directory, &path, &["b.txt"])).expect("a good scene");
    assert_eq!(seed.units, found.units);
    same(&seed.place().expect("it can be placed"), &balls(&path));
}

#[test]
fn what_cannot_be_written_is_refused_and_nothing_is_overwritten() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let path = |name: &str| directory.path().join(name);
    let refused = |input: &str, output: &str, why: &str| {
        let found = convert(Path::new(input), &path(output), None, false);
        match found {
            Err(Error::Usage(words)) => assert!(words.contains(why), "{words}"),
            other => panic!("{input} to {output}: {other:?}"),
        }
    };
    std::fs::write(path("taken.txt"), "mine").expect("a file");
    refused("configs/cradle.toml", "taken.txt", "--force");
    refused(
        "configs/cradle.toml",
        "cradle.json",
        "must end in .toml, .txt, .seed or .csv",
    );
    refused("configs/crystal.toml", "crystal.txt", "no periodic boxes");
    assert_eq!(
        std::fs::read(path("taken.txt")).expect("still there"),
        b"mine"
    );
    assert!(!path("crystal.txt").exists());
    convert(
        Path::new("configs/cradle.toml"),
        &path("taken.txt"),
        None,
        true,
    )
    .expect("--force");
    assert_eq!(balls(&path("taken.txt")).positions.len(), 5);
}
