//! The layers hold: physics knows no clock, file, thread or screen, and the screen sees only feed, snapshot and error.
//!
//! The sources are read as text; comments and the unit tests at a file's end do not count.

use std::fs;
use std::path::{Path, PathBuf};

/// What physics may not name: the world outside.
const WORLD: [&str; 5] = ["fs", "net", "io", "time", "thread"];

/// Where engines may start threads, by themselves or with [`THREADS`]: their results do not depend on how many.
const THREADED: [&str; 2] = ["src/engine/windowed/team.rs", "src/engine/statistical.rs"];

/// The dependency that is there for threads.
const THREADS: &str = "rayon";

/// What the screen may name of the crate, beside itself.
const SEEN_BY_SCREEN: [&str; 4] = ["tui", "feed", "snapshot", "error"];

fn is_threaded(path: &Path) -> bool {
    THREADED.iter().any(|file| path == Path::new(file))
}

/// Modules that `src/lib.rs` lists under a heading, a comment of one word.
fn layer(heading: &str) -> Vec<String> {
    let library = fs::read_to_string("src/lib.rs").expect("the library");
    let section = library
        .split(&format!("// {heading}.\n"))
        .nth(1)
        .expect("the layer's heading");
    let section = section.split("\n\n").next().expect("its lines");
    let names = section
        .lines()
        .filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';'));
    names.map(str::to_owned).collect()
}

fn sources(module: &str) -> Vec<PathBuf> {
    let file = Path::new("src").join(module).with_extension("rs");
    let mut found: Vec<PathBuf> = file.is_file().then_some(file).into_iter().collect();
    let mut directories = vec![Path::new("src").join(module)];
    while let Some(directory) = directories.pop() {
        let Ok(entries) = fs::read_dir(directory) else {
            continue;
        };
        for entry in entries {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                directories.push(path)
            } else {
                found.push(path)
            }
        }
    }
    found.sort();
    found
}

/// The code of a file without comments and unit tests.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).expect("a readable source");
    without_comments(text.split("#[cfg(test)]").next().unwrap_or_default())
}

fn without_comments(text: &str) -> String {
    let code = text
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default());
    code.collect::<Vec<_>>().join("\n")
}

/// Modules below `root` (`crate`, `std`) that the code names, through paths and through `use` groups.
fn named_below(code: &str, root: &str) -> Vec<String> {
    let mut names = Vec::new();
    for (offset, found) in code.match_indices(&format!("{root}::")) {
        let before = code[..offset].chars().next_back();
        if before.is_some_and(|letter| letter.is_alphanumeric() || letter == '_') {
            continue;
        }
        let rest = &code[offset + found.len()..];
        if let Some(group) = rest.strip_prefix('{') {
            names.extend(group_heads(group));
        } else {
            names.push(identifier(rest));
        }
    }
    names
}

/// First names of the members of a `use` group; nested groups belong to their member.
fn group_heads(group: &str) -> Vec<String> {
    let (mut depth, mut heads, mut member) = (0, Vec::new(), String::new());
    for letter in group.chars() {
        match letter {
            '{' => depth += 1,
            '}' if depth == 0 => break,
            '}' => depth -= 1,
            ',' if depth == 0 => heads.push(std::mem::take(&mut member)),
            _ if depth == 0 => member.push(letter),
            _ => {}
        }
    }
    heads.push(member);
    heads
        .iter()
        .map(|member| identifier(member.trim_start()))
        .filter(|name| !name.is_empty())
        .collect()
}

fn identifier(text: &str) -> String {
    text.chars()
        .take_while(|letter| letter.is_alphanumeric() || *letter == '_')
        .collect()
}

#[test]
fn physics_imports_physics_only() {
    let physics = layer("Physics");
    let mut broken = Vec::new();
    for path in physics.iter().flat_map(|module| sources(module)) {
        let code = code(&path);
        for name in named_below(&code, "crate") {
            if !physics.contains(&name) {
                broken.push(format!("{} names crate::{name}", path.display()));
            }
        }
        for name in named_below(&code, "std") {
            let threaded = name == "thread" && is_threaded(&path);
            if WORLD.contains(&name.as_str()) && !threaded {
                broken.push(format!("{} names std::{name}", path.display()));
            }
        }
    }
    assert_eq!(broken, [] as [String; 0]);
}

#[test]
fn every_module_has_its_layer() {
    let mut listed = [layer("Physics"), layer("Edges"), layer("Screen")].concat();
    listed.extend(["error", "lib", "main"].map(str::to_owned));
    listed.sort();
    let files = fs::read_dir("src")
        .expect("the sources")
        .map(|entry| entry.expect("an entry").path());
    let files = files.filter(|path| path.extension().is_some_and(|extension| extension == "rs"));
    let mut found: Vec<String> = files
        .map(|path| {
            path.file_stem()
                .expect("a name")
                .to_string_lossy()
                .into_owned()
        })
        .collect();
    found.sort();
    assert_eq!(listed, found);
    let physics = layer("Physics");
    assert!(
        ["collision", "engine", "state"]
            .iter()
            .all(|name| physics.iter().any(|module| module == name))
    );
}

#[test]
fn physics_stands_on_std_arithmetic_and_serdes_derives_alone() {
    let manifest = fs::read_to_string("Cargo.toml").expect("the manifest");
    let dependencies = manifest
        .split("[dependencies]")
        .nth(1)
        .expect("a table")
        .split("\n[")
        .next()
        .expect("its lines");
    let crates: Vec<String> = (dependencies.lines())
        .filter_map(|line| line.split_once('='))
        .map(|(name, _)| name.trim().replace('-', "_"))
        .filter(|name| {
            const ALLOWED: [&str; 5] = ["glam", "libm", "prefetch_index", "pulp", "serde"];
            !ALLOWED.contains(&name.as_str()) && !name.starts_with('#')
        })
        .collect();
    assert!(
        crates.contains(&"serde_json".to_owned()),
        "the manifest was read"
    );
    for path in layer("Physics").iter().flat_map(|module| sources(module)) {
        let code = code(&path);
        let foreign: Vec<&String> = crates
            .iter()
            .filter(|name| *name != THREADS || !is_threaded(&path))
            .filter(|name| !named_below(&code, name).is_empty())
            .collect();
        assert!(foreign.is_empty(), "{} names {foreign:?}", path.display());
    }
}

#[test]
fn the_screen_sees_feed_snapshot_and_error_only() {
    let mut broken = Vec::new();
    for path in sources("tui") {
        for name in named_below(&code(&path), "crate") {
            if !SEEN_BY_SCREEN.contains(&name.as_str()) {
                broken.push(format!("{} names crate::{name}", path.display()));
            }
        }
    }
    assert_eq!(broken, [] as [String; 0]);
}

#[test]
fn imports_are_found_in_paths_and_in_groups() {
    let code = without_comments(
        "use crate::{state::{Body, Time}, feed}; // crate::comment\nlet x = crate::tui::run(my_crate::y);",
    );
    assert_eq!(named_below(&code, "crate"), ["state", "feed", "tui"]);
}
