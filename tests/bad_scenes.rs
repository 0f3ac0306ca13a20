//! Scenes that are refused: every file of `tests/bad` says in its own comments, after `#^ `, what is wrong with it.
//!
//! Each such line is one expected fault, whole and in order; a file whose faults differ fails. Random text must never panic.

use std::path::Path;

use moltop::error::Error;
use moltop::scene::Scene;
use proptest::prelude::*;

fn faults(path: &Path) -> Vec<String> {
    match Scene::load(path).and_then(|scene| scene.place()) {
        Err(Error::Scene(lines)) => lines,
        Err(error) => panic!("{}: {error}", path.display()),
        Ok(_) => Vec::new(),
    }
}

#[test]
fn every_bad_scene_is_refused_in_its_own_words() {
    let mut paths: Vec<_> = std::fs::read_dir("tests/bad")
        .expect("the directory of bad scenes")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| {
            path.extension()
                .is_some_and(|extension| extension == "toml" || extension == "txt")
        })
        .collect();
    paths.sort();
    assert!(paths.len() > 20, "the corpus is there");
    let mut wrong = Vec::new();
    for path in paths {
        let text = std::fs::read_to_string(&path).expect("a readable file");
        let expected: Vec<&str> = text
            .lines()
            .filter_map(|line| line.strip_prefix("#^ "))
            .collect();
        // Directories are the test's business, not the message's.
        let found: Vec<String> = faults(&path)
            .iter()
            .map(|line| line.replace("tests/bad/", ""))
            .collect();
        if found.is_empty() || found != expected {
            let lines: Vec<String> = found.iter().map(|line| format!("#^ {line}")).collect();
            wrong.push(format!("{}:\n{}", path.display(), lines.join("\n")));
        }
    }
    assert!(
        wrong.is_empty(),
        "these files are refused in other words:\n{}",
        wrong.join("\n\n")
    );
}

#[track_caller]
fn check_bytes(bytes: &[u8], expected: &str) {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let path = directory.path().join("scene.toml");
    std::fs::write(&path, bytes).expect("a file");
    assert_eq!(
        faults(&path)
            .join("\n")
            .replace(&format!("{}/", directory.path().display()), ""),
        expected
    );
}

#[test]
fn a_binary_file_is_refused() {
    check_bytes(
        b"\x7fELF\0\0",
        "scene.toml: not a scene: it holds NUL bytes, so it is binary or UTF-16",
    );
}

#[test]
fn text_that_is_not_utf_8_is_refused() {
    check_bytes(
        b"title = \"caf\xe9\"",
        "scene.toml: not text: byte 12 is not UTF-8",
    );
}

#[test]
fn a_huge_file_is_refused_before_it_is_parsed() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let path = directory.path().join("scene.toml");
    let file = std::fs::File::create(&path).expect("a file");
    file.set_len(1 << 30).expect("a sparse file");
    assert!(faults(&path)[0].contains("more than the limit of 64 MiB"));
}

#[test]
fn a_missing_file_and_a_directory_are_refused() {
    assert_eq!(
        faults(Path::new("nowhere.toml")),
        ["nowhere.toml: cannot read: No such file or directory (os error 2)"]
    );
    assert_eq!(
        faults(Path::new("tests")),
        ["tests: cannot read: Is a directory (os error 21)"]
    );
}

#[test]
fn faults_are_capped() {
    let text = "x = 1\n".to_owned() + &"[[ball]]\n".repeat(100);
    let Err(Error::Scene(lines)) = Scene::parse(Path::new("s.toml"), &text) else {
        panic!("it is bad")
    };
    assert_eq!(lines.len(), 21);
    assert!(lines[20].starts_with("s.toml: and "));
}

#[test]
fn more_balls_than_memory_holds_are_refused_before_anything_is_allocated() {
    let text = "units = \"reduced\"\n[domain]\nkind = \"container\"\nsize = [10, 10, 10]\n\
                [[species]]\ncount = 3_900_000_000\nradius = 1e-5\nmass = 1\n";
    let Err(Error::Scene(lines)) = Scene::parse(Path::new("s.toml"), text) else {
        panic!("1.56 TB are too much")
    };
    assert_eq!(lines.len(), 1);
    assert!(
        lines[0].starts_with("s.toml:6: count = 3_900_000_000: needs 1560.0 GB of memory, and "),
        "{}",
        lines[0]
    );
}

/// Lines that scenes are made of, so that random text gets past the first key now and then.
const LINES: &[&str] = &[
    "units = \"si\"",
    "units = \"reduced\"",
    "seed = 7",
    "[domain]",
    "kind = \"container\"",
    "kind = \"random\"",
    "size = [1e-7, 1e-7, 1e-7]",
    "size = [10, 1e308, 10]",
    "center = [1e30, 0, -1]",
    "[[species]]",
    "count = 1000000000000",
    "count = 9",
    "radius = 1e-320",
    "radius = 0.5",
    "mass = 1e300",
    "mass = 1",
    "placement = { kind = \"random\" }",
    "placement = { kind = \"lattice\", cell = \"fcc\" }",
    "placement.spacing = 1e-9",
    "placement = { kind = \"file\", path = \"/\" }",
    "velocity = { kind = \"maxwell\", temperature = 1e308 }",
    "velocity = { kind = \"speed\", value = 0 }",
    "[[ball]]",
    "position = [0, 0, 0]",
    "position = [inf, nan, 0]",
    "[[plane]]",
    "point = [0, 1, 2]",
    "normal = [0, 1e-320, 1]",
    "kind = \"periodic\"",
    "kind = \"open\"",
    "fixed = true",
    "radius = 0",
    "[run]",
    "until = 1e-300",
    "sample = 1e300",
    "[",
];

/// Lines that files of the seed are made of.
const SEED_LINES: &[&str] = &[
    "1 0 1 0",
    "0 0 30 0 0 0 45 1",
    "C 1",
    "C 0",
    "0 0 0 10 10 10",
    "W 1",
    "0 0 0 0 0 1",
    "B 2",
    "B 18446744073709551615",
    "1 1 1 0 0 0 1 0.5",
    "-1 -1 -1 0 0 0 inf 0",
    "1e300\t-1e300 0 0 0 0 1e-320 1e300\t",
    "nan 0,5",
    "# units = \"si\"",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn shuffled_seed_texts_never_panic(lines in prop::collection::vec(prop::sample::select(SEED_LINES), 0..12)) {
        if let Ok(scene) = Scene::parse(Path::new("s.txt"), &lines.join("\n")) {
            let _ = scene.place();
        }
    }

    #[test]
    fn cut_seed_texts_never_panic(length in 0_usize..90) {
        let whole = "1 0 1 0\r\n0 0 30 0 0 0 45 1\r\nC 1\r\n0 0 0 9 9 9\r\nB 1\r\n1 1 1 0 0 0 1 0.5\r\n";
        let _ = Scene::parse(Path::new("s.txt"), &whole[..length.min(whole.len())]);
    }

    #[test]
    fn arbitrary_text_never_panics(letters in prop::collection::vec(any::<char>(), 0..200)) {
        let text: String = letters.into_iter().collect();
        let _ = Scene::parse(Path::new("s.toml"), &text);
    }

    #[test]
    fn shuffled_scenes_never_panic(picks in prop::collection::vec(0..LINES.len(), 0..16)) {
        let text: String = picks.into_iter().map(|pick| LINES[pick].to_owned() + "\n").collect();
        let _ = Scene::parse(Path::new("s.toml"), &text).and_then(|scene| scene.place());
    }
}
