//! Hostile scene files: good and bad ones, mutated. Each either makes a scene whose balls are good, or is refused in words;
//! within a second, in little memory, without a panic.
//!
//! `MOLTOP_FUZZ_CASES=1000000 cargo test --release --test fuzz_loaders` fuzzes for longer than the everyday tests do.

use std::fmt::Write as _;
use std::path::Path;
use std::time::Duration;

use moltop::domain::Boundary;
use moltop::error::Error;
use moltop::scene::Scene;
use proptest::prelude::*;
use proptest::sample::Index;

/// Scenes with more balls than this are good or bad as they stand; placing them is another test's business.
const MOST_PLACED: usize = 200;

/// Longest that the processor may take over one file.
const LONGEST: Duration = Duration::from_secs(1);

/// Most memory that reading files may take beyond what the test itself holds \[bytes\].
const MOST_MEMORY: u64 = 64 << 20;

/// What is put into files: pieces of their languages, numbers at their limits, what editors and other programs leave.
const PIECES: &[&str] = &[
    "\n",
    "\r\n",
    "\t",
    " ",
    ",",
    "=",
    "[",
    "]",
    "[[",
    "]]",
    "{",
    "}",
    "\"",
    "'''",
    "#",
    ".",
    "-",
    "+",
    "\u{feff}",
    "\0",
    "é",
    "−1",
    "１",
    "0",
    "-0.0",
    "1",
    "2",
    "1e-320",
    "1e308",
    "1e400",
    "-1e300",
    "5e-324",
    "nan",
    "inf",
    "-inf",
    "0x7f",
    "1_000",
    "0,5",
    "9223372036854775808",
    "18446744073709551615",
    "1e-9",
    "0.49999999999999994",
    "true",
    "false",
    "1979-05-27",
    "units = \"si\"\n",
    "units = \"reduced\"\n",
    "[domain]\n",
    "kind = \"container\"\n",
    "kind = \"periodic\"\n",
    "kind = \"open\"\n",
    "size = [1, 2, 3]\n",
    "size = [1e-9, 1e-9, 1e-9]\n",
    "center = [1e9, -1e9, 0]\n",
    "[[species]]\n",
    "count = 1\n",
    "count = 64\n",
    "count = 1000000000\n",
    "radius = 0\n",
    "radius = 0.1\n",
    "mass = 1\n",
    "fixed = true\n",
    "placement = { kind = \"random\" }\n",
    "placement = { kind = \"lattice\", cell = \"fcc\", spacing = 1.0 }\n",
    "placement = { kind = \"file\", path = \"../tests/bad/two.csv\" }\n",
    "placement = { kind = \"file\", path = \"/dev/zero\" }\n",
    "velocity = { kind = \"maxwell\", temperature = 1 }\n",
    "velocity = { kind = \"speed\", value = 1e200 }\n",
    "[[ball]]\n",
    "position = [0, 0, 0]\n",
    "velocity = [1, 0, 0]\n",
    "name = \"a\"\n",
    "[[plane]]\n",
    "point = [0, 0, 0]\n",
    "normal = [0, 0, 1]\n",
    "[run]\n",
    "until = 1\n",
    "sample = 1e-12\n",
    "engine = \"step\"\n",
    "C 1\n",
    "W 1\n",
    "B 1\n",
    "B 1000000000000\n",
    "0 0 0 10 10 10\n",
    "1 1 1 0 0 0 1 0.5\n",
    "0 0 0 0 0 1\n",
    "# units = \"si\"\n",
];

/// One change of a file.
#[derive(Clone, Debug)]
enum Edit {
    Insert(Index, &'static str),
    Remove(Index, u8),
    Repeat(Index, u8, u8),
    Letter(Index, char),
    /// Goes on with another file from there.
    Graft(Index, Index, Index),
}

fn edit() -> impl Strategy<Value = Edit> {
    let at = any::<Index>;
    prop_oneof![
        4 => (at(), prop::sample::select(PIECES)).prop_map(|(at, piece)| Edit::Insert(at, piece)),
        3 => (at(), any::<u8>()).prop_map(|(at, length)| Edit::Remove(at, length)),
        1 => (at(), any::<u8>(), any::<u8>()).prop_map(|(at, length, times)| Edit::Repeat(at, length, times)),
        2 => (at(), any::<char>()).prop_map(|(at, letter)| Edit::Letter(at, letter)),
        1 => (at(), at(), at()).prop_map(|(at, file, from)| Edit::Graft(at, file, from)),
    ]
}

impl Edit {
    fn apply(&self, text: &mut Vec<char>, corpus: &[String]) {
        let place = |at: &Index, text: &[char]| at.index(text.len() + 1);
        match self {
            Self::Insert(at, piece) => {
                let at = place(at, text);
                text.splice(at..at, piece.chars());
            }
            Self::Remove(at, length) => {
                let at = place(at, text);
                text.drain(at..(at + usize::from(*length)).min(text.len()));
            }
            Self::Repeat(at, length, times) => {
                let at = place(at, text);
                let piece = text[at..(at + usize::from(*length)).min(text.len())].to_vec();
                text.splice(at..at, piece.repeat(usize::from(*times)));
            }
            Self::Letter(at, letter) => {
                let at = place(at, text);
                if let Some(old) = text.get_mut(at) {
                    *old = *letter;
                }
            }
            Self::Graft(at, file, from) => {
                text.truncate(place(at, text));
                let other: Vec<char> = corpus[file.index(corpus.len())].chars().collect();
                text.extend(&other[place(from, &other)..]);
            }
        }
    }
}

/// The texts of a directory's files with one of these extensions.
fn texts(directory: &str, extensions: &[&str]) -> Vec<String> {
    let mut paths: Vec<_> = std::fs::read_dir(directory)
        .expect("a directory of scenes")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| {
            extensions
                .iter()
                .any(|extension| path.extension().is_some_and(|found| found == *extension))
        })
        .collect();
    paths.sort();
    paths
        .iter()
        .map(|path| std::fs::read_to_string(path).expect("text"))
        .collect()
}

/// What this thread has used of a processor: other programs on the machine do not count.
fn processor_time() -> Duration {
    let statistics = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = statistics
        .split(' ')
        .next()
        .and_then(|word| word.parse().ok());
    Duration::from_nanos(nanoseconds.unwrap_or(0))
}

fn peak_memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))
        .unwrap_or("0 kB");
    line.trim()
        .trim_end_matches(" kB")
        .parse::<u64>()
        .unwrap_or(0)
        * 1024
}

/// Good, or refused in words, and quickly.
fn judge(found: Result<Scene, Error>, began: Duration) {
    let outcome = found.and_then(|scene| {
        let few = scene.ball_count() <= MOST_PLACED;
        let balls = few.then(|| scene.place()).transpose()?;
        Ok((scene, balls))
    });
    let took = processor_time().saturating_sub(began);
    match outcome {
        Ok((scene, Some(balls))) => {
            let count = scene.ball_count();
            assert_eq!(
                (balls.positions.len(), balls.velocities.len()),
                (count, count)
            );
            assert!(balls.body_of.is_empty() || balls.body_of.len() == count);
            let mut vectors = balls.positions.iter().chain(&balls.velocities);
            assert!(
                vectors.all(|vector| vector.is_finite()),
                "a vector that is not finite"
            );
            for body in &balls.bodies {
                assert!(
                    body.radius >= 0.0 && body.radius.is_finite() && body.mass > 0.0,
                    "{body:?}"
                );
            }
            if scene.domain.boundary != Boundary::Open {
                let half = scene.domain.half_size * (1.0 + 1e-9);
                let inside =
                    |position: &glam::DVec3| (*position - scene.center).abs().cmple(half).all();
                assert!(balls.positions.iter().all(inside), "a ball outside");
            }
        }
        Ok((scene, None)) => {
            assert!(scene.sample > 0.0 && scene.until.is_none_or(|until| until > 0.0))
        }
        Err(Error::Scene(lines)) => {
            assert!((1..=21).contains(&lines.len()), "{} lines", lines.len());
            for line in lines {
                assert!(
                    !line.is_empty() && line.len() < 1000 && !line.contains(char::is_control),
                    "{line:?}"
                );
            }
        }
        Err(error) => panic!("not about the scene: {error}"),
    }
    assert!(took < LONGEST, "{took:?}");
}

/// Mutates files of a corpus and judges what `load` makes of them.
fn fuzz(corpus: &[String], load: impl Fn(&[u8]) -> Result<Scene, Error>) {
    let cases = std::env::var("MOLTOP_FUZZ_CASES")
        .ok()
        .and_then(|cases| cases.parse().ok());
    let config = ProptestConfig {
        failure_persistence: None,
        ..ProptestConfig::with_cases(cases.unwrap_or(500))
    };
    let before = peak_memory();
    let mut runner = proptest::test_runner::TestRunner::new(config);
    let strategy = (any::<Index>(), prop::collection::vec(edit(), 1..12));
    let result = runner.run(&strategy, |(file, edits)| {
        let mut text: Vec<char> = corpus[file.index(corpus.len())].chars().collect();
        for edit in &edits {
            edit.apply(&mut text, corpus);
        }
        let text: String = text.into_iter().collect();
        let began = processor_time();
        let judged = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            judge(load(text.as_bytes()), began)
        }));
        judged.map_err(|panic| {
            let words = panic.downcast_ref::<String>().cloned();
            let mut words = words
                .or(panic
                    .downcast_ref::<&str>()
                    .map(|words| (*words).to_owned()))
                .unwrap_or_default();
            let _ = write!(words, " in:\n{text}\n<end>");
            TestCaseError::fail(words)
        })
    });
    if let Err(error) = result {
        panic!("{error}");
    }
    let grown = peak_memory().saturating_sub(before);
    assert!(grown < MOST_MEMORY, "{grown} bytes");
}

#[test]
fn mutated_scenes_are_good_or_refused() {
    let corpus = [texts("configs", &["toml"]), texts("tests/bad", &["toml"])].concat();
    fuzz(&corpus, |bytes| {
        Scene::parse(
            Path::new("configs/s.toml"),
            str::from_utf8(bytes).expect("text"),
        )
    });
}

#[test]
fn mutated_seed_texts_are_good_or_refused() {
    let good = "1 0 1 0\r\n0 0 30 0 0 0 45 1\r\nC 1\r\n0 0 0 9 9 9\r\nW 1\n-9 0 0 1 0.5 0\nB 2\r\n1 1 1 0 0 0 1 0.5\t\r\n-1 1 1 1 2 3 inf 0.5\n";
    let corpus = [texts("tests/bad", &["txt"]), vec![good.to_owned()]].concat();
    fuzz(&corpus, |bytes| {
        Scene::parse(Path::new("s.txt"), str::from_utf8(bytes).expect("text"))
    });
}

#[test]
fn mutated_tables_are_good_or_refused() {
    let good = "index,x,y,z,vx,vy,vz,radius,mass,collisions\n0,0.5,0,-1e-3,1,2,3,0.1,1,7\n1,1.5,0,0,1,-2,3,0.1,inf,7\n";
    let corpus = [
        texts("tests/bad", &["csv"]),
        vec![good.to_owned(), "x,y,z\n1,2,3\n".to_owned()],
    ]
    .concat();
    let directory = tempfile::tempdir().expect("a temporary directory");
    let path = directory.path().join("balls.csv");
    let scene = "units = \"reduced\"\n[domain]\nkind = \"container\"\nsize = [8, 8, 8]\n\
                 [[species]]\nplacement = { kind = \"file\", path = \"balls.csv\" }\n";
    let keys = [
        "",
        "radius = 0.1\n",
        "mass = 1\n",
        "radius = 0.1\nmass = 1\nvelocity = { kind = \"rest\" }\n",
    ];
    fuzz(&corpus, |bytes| {
        std::fs::write(&path, bytes).expect("a small file");
        let text = scene.to_owned() + keys[bytes.len() % keys.len()];
        Scene::parse(&directory.path().join("s.toml"), &text)
    });
}
