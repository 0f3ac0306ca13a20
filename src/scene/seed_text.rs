//! The seed's text files: the scenes of the student program that this one takes up.
//!
//! White space separates; lines mean nothing, but messages name them. A header of 4 switches and 8 camera numbers may come
//! first and is skipped. Then sections: `C n` containers (`x y z a b c`, centre and size), `W n` planes (`x y z nx ny nz`,
//! point and normal), `B n` balls (`x y z vx vy vz mass radius`). Without a container the balls fly in open space. From `#`
//! to the end of a line is comment; the comment `# units = "si"` says that the numbers are in SI units, else they are
//! reduced. An infinite mass makes a ball that never moves.

use std::path::Path;

use glam::DVec3;

use super::observe::Observe;
use super::reader::Faults;
use super::region::{Region, plane};
use super::table::{FINITE, Limit, MASS, RADIUS};
use super::{Ball, PlaneText, Scene, format};
use crate::domain::{Boundary, Domain};
use crate::snapshot::Units;
use crate::worker::engines::EngineName;

/// The comment that makes a file's numbers SI.
pub(super) const SI_COMMENT: &str = "# units = \"si\"";

/// Bytes of the shortest row of a ball: eight digits, each with white space.
const SHORTEST_BALL: u64 = 16;

/// Faults after which the rest of a file is not read.
const MOST_FAULTS: usize = 20;

/// Whether a text is the seed's rather than TOML: its first words are a section or numbers.
pub fn is_seed_text(text: &str) -> bool {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let first = text
        .split(['\n', '\r'])
        .map(|line| line.split('#').next().unwrap_or_default().trim())
        .find(|line| !line.is_empty());
    let Some(first) = first.filter(|line| !line.contains(['=', '[', '"'])) else {
        return false;
    };
    let mut words = first.split_whitespace();
    let (word, next) = (words.next().unwrap_or_default(), words.next());
    let is_letter = word.len() == 1 && word.chars().all(char::is_alphabetic);
    word.parse::<f64>().is_ok()
        || (is_letter && next.is_none_or(|next| next.parse::<f64>().is_ok()))
}

/// Reads a scene, or says in one line per fault why not.
pub(super) fn parse(path: &Path, text: &str) -> Result<Scene, Vec<String>> {
    let mut reader = Reader {
        words: Words {
            text,
            at: 0,
            last: 0,
        },
        faults: Faults::new(path, text),
        fault_count: 0,
    };
    let contents = reader.read();
    let mut faults = reader.faults;
    let Some(contents) = contents.filter(|_| faults.is_empty()) else {
        return Err(faults.into_lines());
    };
    let scene = contents.into_scene(path, text, &mut faults);
    scene
        .filter(|_| faults.is_empty())
        .ok_or_else(|| faults.into_lines())
}

/// Words with their byte offsets; comments are skipped.
struct Words<'t> {
    text: &'t str,
    at: usize,
    /// Where the last word began.
    last: usize,
}

impl<'t> Iterator for Words<'t> {
    type Item = (usize, &'t str);

    fn next(&mut self) -> Option<Self::Item> {
        let bytes = self.text.as_bytes();
        let is_space = |byte: u8| byte.is_ascii_whitespace() || byte == 0x0b;
        loop {
            if self.at == 0 && self.text.starts_with('\u{feff}') {
                self.at = '\u{feff}'.len_utf8();
            }
            let byte = *bytes.get(self.at)?;
            if byte == b'#' {
                let line = bytes[self.at..]
                    .iter()
                    .position(|byte| [b'\n', b'\r'].contains(byte));
                self.at = line.map_or(bytes.len(), |length| self.at + length);
            } else if is_space(byte) {
                self.at += 1;
            } else {
                break;
            }
        }
        let begin = self.at;
        self.last = begin;
        let length = bytes[begin..]
            .iter()
            .position(|byte| is_space(*byte) || *byte == b'#');
        self.at = length.map_or(bytes.len(), |length| begin + length);
        Some((begin, &self.text[begin..self.at]))
    }
}

/// What a file holds.
#[derive(Default)]
struct Contents {
    containers: Vec<[f64; 6]>,
    planes: Vec<([f64; 6], usize)>,
    balls: Vec<Ball>,
}

struct Reader<'t> {
    words: Words<'t>,
    faults: Faults<'t>,
    fault_count: usize,
}

impl<'t> Reader<'t> {
    fn fault(&mut self, offset: usize, words: &str) {
        self.fault_count += 1;
        self.faults.add(offset, words);
    }

    /// `None` where the rest of the file makes no sense any more.
    fn read(&mut self) -> Option<Contents> {
        let mut contents = Contents::default();
        let mut seen = Vec::new();
        let mut next = self.words.next();
        if next.is_some_and(|(_, word)| word.parse::<f64>().is_ok()) {
            self.read_header(next?)?;
            next = self.words.next();
        }
        while let Some((offset, word)) = next {
            if !["C", "W", "B"].contains(&word) {
                self.refuse_section(offset, word, seen.last().copied());
                return None;
            }
            if seen.contains(&word) {
                self.fault(offset, &format!("{word}: the section is there twice"));
                return None;
            }
            seen.push(word);
            let count = self.read_count(word, offset)?;
            for row in 1..=count {
                match word {
                    "C" => contents
                        .containers
                        .push(self.row(word, row, offset, [FINITE; 6])?.0),
                    "W" => contents
                        .planes
                        .push(self.row(word, row, offset, [FINITE; 6])?),
                    _ => contents.balls.push(self.read_ball(row, offset)?),
                }
                if self.fault_count >= MOST_FAULTS {
                    return None;
                }
            }
            if word == "C" && count > 1 {
                self.fault(offset, &format!("C {count}: must be 0 or 1 container"));
            }
            next = self.words.next();
        }
        if seen.is_empty() {
            self.fault(
                0,
                "no section: known are C (containers), W (planes), B (balls)",
            );
        }
        Some(contents)
    }

    fn refuse_section(&mut self, offset: usize, word: &str, before: Option<&str>) {
        let shown: String = word.chars().take(40).collect();
        let words = match before {
            Some(section) if word.parse::<f64>().is_ok() => {
                format!("{shown}: more numbers than section {section} declares")
            }
            _ => {
                format!("{shown}: unknown section: known are C (containers), W (planes), B (balls)")
            }
        };
        self.fault(offset, &words);
    }

    /// Four switches and eight numbers of a camera, of which the first word has been read.
    fn read_header(&mut self, first: (usize, &'t str)) -> Option<()> {
        let mut word = Some(first);
        for index in 0..12 {
            let Some((offset, found)) = word else {
                self.fault(
                    first.0,
                    "header: must be 4 switches and 8 numbers of a camera",
                );
                return None;
            };
            let good = if index < 4 {
                ["0", "1"].contains(&found)
            } else {
                found.parse::<f64>().is_ok_and(f64::is_finite)
            };
            if !good {
                let shown: String = found.chars().take(40).collect();
                let limit = if index < 4 {
                    "a switch of the header must be 0 or 1"
                } else {
                    "a number of the header's camera must be finite; without a header, C, W or B comes first"
                };
                self.fault(offset, &format!("{shown}: {limit}"));
                return None;
            }
            if index < 11 {
                word = self.words.next();
            }
        }
        Some(())
    }

    /// How many rows a section declares, as far as the file can hold them.
    fn read_count(&mut self, section: &str, offset: usize) -> Option<usize> {
        let word = self.words.next();
        let shown: String = word.map_or("", |(_, word)| word).chars().take(40).collect();
        let room = self.words.text.len() - self.words.at;
        let shortest = if section == "B" { SHORTEST_BALL } else { 12 };
        match word.and_then(|(_, word)| word.parse::<u64>().ok()) {
            // The last row may end with the file.
            Some(count) if count.saturating_mul(shortest) <= room as u64 + 1 => {
                Some(count as usize)
            }
            Some(count) => {
                let words = format!("{section} {count}: the file ends before so many rows");
                self.fault(offset, &words);
                None
            }
            None => {
                let words =
                    format!("{section} {shown}: must be followed by the number of its rows");
                self.fault(offset, &words);
                None
            }
        }
    }

    /// The numbers of a row and where they begin; `None` where the file ends or another section begins.
    fn row<const N: usize>(
        &mut self,
        section: &str,
        row: usize,
        section_at: usize,
        limits: [Limit; N],
    ) -> Option<([f64; N], usize)> {
        let (mut values, mut begin) = ([0.0; N], section_at);
        for (index, (value, (accept, limit))) in values.iter_mut().zip(limits).enumerate() {
            let word = self.words.next();
            let Some((offset, word)) = word.filter(|(_, word)| !["C", "W", "B"].contains(word))
            else {
                let words = format!("{section}: row {row} has {index} numbers: must be {N}");
                self.fault(self.words.last, &words);
                return None;
            };
            if index == 0 {
                begin = offset;
            }
            match word.parse::<f64>() {
                Ok(number) if accept(number) => *value = number,
                parsed => {
                    let shown: String = word.chars().take(40).collect();
                    let limit = if parsed.is_err() {
                        "must be a number, with a dot and not a comma"
                    } else {
                        limit
                    };
                    self.fault(offset, &format!("{section}: row {row}: {shown}: {limit}"));
                }
            }
        }
        Some((values, begin))
    }

    fn read_ball(&mut self, row: usize, section_at: usize) -> Option<Ball> {
        const LIMITS: [Limit; 8] = [FINITE, FINITE, FINITE, FINITE, FINITE, FINITE, MASS, RADIUS];
        let ([x, y, z, vx, vy, vz, mass, radius], begin) =
            self.row("B", row, section_at, LIMITS)?;
        Some(Ball {
            name: None,
            position: DVec3::new(x, y, z),
            velocity: DVec3::new(vx, vy, vz),
            radius,
            mass,
            line: self.faults.line(begin),
        })
    }
}

impl Contents {
    fn into_scene(self, path: &Path, text: &str, faults: &mut Faults) -> Option<Scene> {
        let region = match self.containers.as_slice() {
            [[x, y, z, a, b, c], ..] => {
                let size = DVec3::new(*a, *b, *c);
                if !size.cmpgt(DVec3::ZERO).all() {
                    faults.add(0, "C: the size must be three edges, each greater than 0");
                    return None;
                }
                Region {
                    domain: Domain::container(0.5 * size),
                    center: DVec3::new(*x, *y, *z),
                    span: 0..0,
                }
            }
            [] => open_space(&self.balls),
        };
        let Region {
            mut domain, center, ..
        } = region;
        let mut planes = Vec::with_capacity(self.planes.len());
        for ([x, y, z, nx, ny, nz], begin) in self.planes {
            let (point, normal) = (DVec3::new(x, y, z), DVec3::new(nx, ny, nz));
            planes.push(PlaneText { point, normal });
            match plane(point, normal, center) {
                Some(plane) => domain.planes.push(plane),
                None => faults.add(begin, "W: the normal must have a length greater than 0"),
            }
        }
        let units = if text.lines().any(|line| line.trim() == SI_COMMENT) {
            Units::Si
        } else {
            Units::Reduced
        };
        let scene = Scene {
            title: format::default_title(path),
            units,
            seed: 1,
            domain,
            center,
            engine: EngineName::Auto,
            planes,
            until: None,
            sample: format::default_sample(None, Some(units)),
            observe: Observe::default(),
            species: Vec::new(),
            balls: self.balls,
            path: path.to_owned(),
            source: text.to_owned(),
        };
        format::check_precision(&scene, 0, faults);
        format::check_memory(&scene, faults);
        Some(scene)
    }
}

/// Open space for balls that begin anywhere: a box around them all.
pub(super) fn open_space(balls: &[Ball]) -> Region {
    let low = |ball: &Ball| ball.position - ball.radius;
    let high = |ball: &Ball| ball.position + ball.radius;
    let lowest = balls
        .iter()
        .map(low)
        .reduce(DVec3::min)
        .unwrap_or(-DVec3::ONE);
    let highest = balls
        .iter()
        .map(high)
        .reduce(DVec3::max)
        .unwrap_or(DVec3::ONE);
    // A little more than half the extent: sums round. A single point has none.
    let half = 0.5 * highest - 0.5 * lowest;
    let center = lowest + half;
    let slack = 4.0 * f64::EPSILON * (half + center.abs()).max_element();
    let least = if half.max_element() > 0.0 {
        half.max_element() * 1e-3
    } else {
        1.0_f64.max(slack)
    };
    Region {
        domain: Domain {
            boundary: Boundary::Open,
            half_size: (half + slack).max(DVec3::splat(least)),
            planes: Vec::new(),
        },
        center,
        span: 0..0,
    }
}

#[cfg(test)]
mod tests;
