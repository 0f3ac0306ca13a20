//! The scene file: TOML in, a checked [`Scene`] or all its faults out.

use std::collections::HashSet;
use std::path::Path;

use clap::ValueEnum;
use glam::DVec3;
use toml::de::DeTable;

use super::reader::{At, Faults, Table, number};
use super::region::{Region, read_domain, read_plane};
use super::{Ball, Cell, Scene, Sites, Species, Velocities, memory, observe, table};
use crate::snapshot::Units;
use crate::worker::engines::EngineName;

/// Largest coordinate rounding that is accepted, in units of the smallest radius.
const COARSEST_POSITION: f64 = 1e-9;

/// Most rows of a series that a scene may ask for by `until / sample`.
const MOST_ROWS: f64 = 1e9;

/// Reads a scene, or says in one line per fault why not.
pub(super) fn parse(path: &Path, text: &str) -> Result<Scene, Vec<String>> {
    let mut faults = Faults::new(path, text);
    let document = match DeTable::parse(text) {
        Ok(document) => document,
        Err(error) => {
            faults.syntax(error.span().map_or(0, |span| span.start), error.message());
            return Err(faults.into_lines());
        }
    };
    let scene = Table::new("", 0..0, document.get_ref());
    let scene = read_scene(scene, path, text, &mut faults);
    match scene {
        Some(scene) if faults.is_empty() => Ok(scene),
        _ => Err(faults.into_lines()),
    }
}

/// `None` only after a fault.
fn read_scene(mut table: Table, path: &Path, text: &str, faults: &mut Faults) -> Option<Scene> {
    let title = table
        .text("title", faults)
        .map_or_else(|| default_title(path), |title| title.value);
    let units = read_units(&mut table, faults);
    let seed = table.count("seed", faults).map_or(1, |seed| seed.value);
    let domain = if let Some(table) = table.table("domain", "[domain]", faults) {
        read_domain(table, faults)
    } else {
        table.missing(
            "domain",
            "a scene needs [domain] with kind and size",
            faults,
        );
        None
    };
    let species_tables = table.tables("species", "[[species]]", faults);
    let mut species = Vec::with_capacity(species_tables.len());
    for table in species_tables {
        species.extend(read_species(table, path, domain.as_ref(), faults));
    }
    let ball_tables = table.tables("ball", "[[ball]]", faults);
    let mut balls = Vec::with_capacity(ball_tables.len());
    let mut names = HashSet::new();
    for table in ball_tables {
        let at = table.span.start;
        let ball = read_ball(table, faults);
        if let Some(name) = ball.as_ref().and_then(|ball| ball.name.as_ref())
            && !names.insert(name.clone())
        {
            faults.add(at, &format!("name = {name:?}: another [[ball]] has it"));
        }
        balls.extend(ball);
    }
    let center = domain.as_ref().map_or(DVec3::ZERO, |region| region.center);
    let mut planes = Vec::new();
    for table in table.tables("plane", "[[plane]]", faults) {
        planes.extend(read_plane(table, center, faults));
    }
    let (engine, until, sample) = match table.table("run", "[run]", faults) {
        Some(table) => read_run(table, units, faults),
        None => (EngineName::Auto, None, default_sample(None, units)),
    };
    let (observe, observe_at) = match table.table("observe", "[observe]", faults) {
        Some(table) => {
            let at = table.span.start;
            (observe::read(table, faults), at)
        }
        None => (observe::Observe::default(), 0),
    };
    table.finish(faults);
    let Region {
        mut domain, span, ..
    } = domain?;
    let (planes, texts): (Vec<_>, Vec<_>) = planes.into_iter().unzip();
    domain.planes = planes;
    let scene = Scene {
        title,
        units: units?,
        seed,
        domain,
        center,
        engine,
        planes: texts,
        until,
        sample,
        observe,
        species,
        balls,
        path: path.to_owned(),
        source: text.to_owned(),
    };
    check_precision(&scene, span.start, faults);
    check_memory(&scene, faults);
    if let Some(why) = observe::refusal(&scene) {
        faults.add(observe_at, &why);
    }
    Some(scene)
}

/// The file's name without its extension.
pub(super) fn default_title(path: &Path) -> String {
    path.file_stem()
        .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}

fn read_units(table: &mut Table, faults: &mut Faults) -> Option<Units> {
    let limit = "must be \"si\" (metre, second, kilogram, kelvin) or \"reduced\" (k = 1)";
    let Some(units) = table.text("units", faults) else {
        table.missing("units", limit, faults);
        return None;
    };
    match units.value.as_str() {
        "si" => Some(Units::Si),
        "reduced" => Some(Units::Reduced),
        _ => {
            faults.value("units", &units.span, limit);
            None
        }
    }
}

fn read_species(
    mut table: Table,
    path: &Path,
    domain: Option<&Region>,
    faults: &mut Faults,
) -> Option<Species> {
    let name = table.text("name", faults).map(|name| name.value);
    let count = table.count("count", faults);
    let radius = read_radius(&mut table, domain, faults);
    let fixed = read_fixed(&mut table, faults);
    let mass = read_mass(&mut table, fixed, faults);
    let lattice = Sites::Lattice {
        cell: Cell::Cubic,
        spacing: None,
    };
    let sites = match table.table("placement", "placement", faults) {
        Some(placement) => read_sites(placement, path, faults),
        None => Some(lattice.clone()),
    };
    // After a fault the default takes the place, so that the rest of the table is still judged.
    let placed = sites.is_some();
    let sites = sites.unwrap_or(lattice);
    let velocities = match table.table("velocity", "velocity", faults) {
        Some(velocity) if fixed => {
            faults.add(velocity.span.start, FIXED_MOVES);
            None
        }
        Some(velocity) => read_velocities(velocity, faults),
        None if fixed => Some(Velocities::Rest),
        None if matches!(&sites, Sites::Rows(rows) if rows.velocities.is_some()) => None,
        None => Some(Velocities::Rest),
    };
    let line = faults.line(table.span.start);
    let (row_count, row_radii, row_masses) = match &sites {
        Sites::Rows(rows) => (
            Some(rows.positions.len()),
            rows.radii.is_some(),
            rows.masses.is_some(),
        ),
        _ => (None, false, false),
    };
    let count = match (count, row_count) {
        (Some(count), Some(rows)) if count.value != rows as u64 => {
            faults.value(
                "count",
                &count.span,
                &format!("the placement's file has {rows} rows"),
            );
            None
        }
        (_, Some(rows)) => Some(rows),
        (Some(count), None) => check_count(&count, faults),
        (None, None) => {
            if placed {
                table.missing("count", "the number of balls", faults);
            }
            None
        }
    };
    if placed && !row_radii {
        table.missing("radius", "must be 0 or greater", faults);
    }
    if placed && !row_masses && !fixed {
        table.missing("mass", "must be greater than 0", faults);
    }
    table.finish(faults);
    let radius = radius.map(|radius| radius.value);
    Some(Species {
        name,
        count: count?,
        radius,
        mass,
        sites,
        velocities,
        line,
    })
}

/// Balls are numbered in 32 bits, with some numbers left for marks.
fn check_count(count: &At<u64>, faults: &mut Faults) -> Option<usize> {
    const MOST: u64 = 4_000_000_000;
    let needed = u128::from(count.value) * u128::from(memory::BYTES_PER_BALL);
    if count.value > MOST {
        faults.value("count", &count.span, &format!("must be at most {MOST}"));
        return None;
    }
    if memory::available().is_some_and(|free| needed > u128::from(free)) {
        let free = memory::available().unwrap_or(0) as f64 / 1e9;
        let words = format!(
            "needs {:.1} GB of memory, and {free:.1} GB are free",
            needed as f64 / 1e9
        );
        faults.value("count", &count.span, &words);
        return None;
    }
    Some(count.value as usize)
}

fn read_radius(table: &mut Table, domain: Option<&Region>, faults: &mut Faults) -> Option<At<f64>> {
    let radius = table.number_where(
        "radius",
        |radius| radius == 0.0 || radius >= f64::MIN_POSITIVE,
        "must be 0, a point, or greater",
        faults,
    )?;
    if let Some(words) = table.underflow("radius") {
        faults.value("radius", &radius.span, words);
        return None;
    }
    let (room, why) = domain.map_or((f64::INFINITY, ""), Region::room);
    if radius.value > room {
        let limit = format!("must be at most {}, {why}", number(room));
        faults.value("radius", &radius.span, &limit);
        return None;
    }
    Some(radius)
}

const FIXED_MOVES: &str = "velocity: a fixed ball has none: leave it out";

fn read_fixed(table: &mut Table, faults: &mut Faults) -> bool {
    table.flag("fixed", faults).is_some_and(|fixed| fixed.value)
}

/// The mass; infinite for a ball that never moves.
fn read_mass(table: &mut Table, fixed: bool, faults: &mut Faults) -> Option<f64> {
    if fixed {
        if let Some(mass) = table.number("mass", faults) {
            let words = "a fixed ball has no mass: leave it out";
            faults.value("mass", &mass.span, words);
        }
        return Some(f64::INFINITY);
    }
    let normal = |mass: f64| mass >= f64::MIN_POSITIVE;
    let mass = table.number_where("mass", normal, "must be greater than 0", faults)?;
    Some(mass.value)
}

fn read_sites(mut table: Table, path: &Path, faults: &mut Faults) -> Option<Sites> {
    let limit = "must be \"lattice\", \"random\" or \"file\"";
    let Some(kind) = table.text("kind", faults) else {
        table.missing("kind", limit, faults);
        return None;
    };
    let sites = match kind.value.as_str() {
        "lattice" => {
            let cell = match table.text("cell", faults) {
                None => Some(Cell::Cubic),
                Some(cell) if cell.value == "cubic" => Some(Cell::Cubic),
                Some(cell) if cell.value == "fcc" => Some(Cell::Fcc),
                Some(cell) => {
                    faults.value("cell", &cell.span, "must be \"cubic\" or \"fcc\"");
                    None
                }
            };
            let spacing = table
                .positive("spacing", faults)
                .map(|spacing| spacing.value);
            cell.map(|cell| Sites::Lattice { cell, spacing })
        }
        "random" => Some(Sites::Random),
        "file" => {
            if let Some(name) = table.text("path", faults) {
                let beside = path.parent().unwrap_or(Path::new("")).join(&name.value);
                match table::read(&beside) {
                    Ok(rows) => Some(Sites::Rows(rows)),
                    Err(lines) => {
                        faults.add_lines(name.span.start, lines);
                        None
                    }
                }
            } else {
                table.missing(
                    "path",
                    "the name of a CSV file with the columns x, y, z, or of a trajectory",
                    faults,
                );
                None
            }
        }
        _ => {
            faults.value("kind", &kind.span, limit);
            return None; // which keys belong here is not known either
        }
    };
    table.finish(faults);
    sites
}

fn read_velocities(mut table: Table, faults: &mut Faults) -> Option<Velocities> {
    let limit = "must be \"maxwell\", \"normal\", \"speed\" or \"rest\"";
    let Some(kind) = table.text("kind", faults) else {
        table.missing("kind", limit, faults);
        return None;
    };
    let mut parameter = |key: &'static str| {
        let number = table.number_where(key, |x| x >= 0.0, "must be 0 or greater", faults);
        table.missing(key, &format!("{} needs it", kind.value), faults);
        number.map(|number| number.value)
    };
    let velocities = match kind.value.as_str() {
        "maxwell" => {
            parameter("temperature").map(|temperature| Velocities::Maxwell { temperature })
        }
        "normal" => parameter("deviation").map(|deviation| Velocities::Normal { deviation }),
        "speed" => parameter("value").map(|value| Velocities::Speed { value }),
        "rest" => Some(Velocities::Rest),
        _ => {
            faults.value("kind", &kind.span, limit);
            return None; // which keys belong here is not known either
        }
    };
    table.finish(faults);
    velocities
}

fn read_ball(mut table: Table, faults: &mut Faults) -> Option<Ball> {
    let name = table.text("name", faults).map(|name| name.value);
    let position = table.vector("position", faults);
    let fixed = read_fixed(&mut table, faults);
    let velocity = table.vector("velocity", faults);
    if let Some(velocity) = velocity.as_ref().filter(|_| fixed) {
        faults.add(velocity.span.start, FIXED_MOVES);
    }
    let velocity = velocity.map_or(DVec3::ZERO, |velocity| velocity.value);
    let radius = read_radius(&mut table, None, faults);
    let mass = read_mass(&mut table, fixed, faults);
    table.missing("position", "[x, y, z]", faults);
    table.missing("radius", "must be 0 or greater", faults);
    if !fixed {
        table.missing("mass", "must be greater than 0", faults);
    }
    let line = faults.line(table.span.start);
    table.finish(faults);
    let (position, radius, mass) = (position?.value, radius?.value, mass?);
    Some(Ball {
        name,
        position,
        velocity,
        radius,
        mass,
        line,
    })
}

/// Engine, end of the run and time between two rows of the series.
type ReadRun = (EngineName, Option<f64>, f64);

fn read_run(mut table: Table, units: Option<Units>, faults: &mut Faults) -> ReadRun {
    let mut engine = EngineName::Auto;
    if let Some(name) = table.text("engine", faults) {
        match EngineName::from_str(&name.value, false) {
            Ok(known) => engine = known,
            Err(_) => faults.value("engine", &name.span, &unknown_engine()),
        }
    }
    let until = table.positive("until", faults);
    let sample = table.positive("sample", faults);
    if let (Some(until), Some(sample)) = (&until, &sample)
        && until.value / sample.value > MOST_ROWS
    {
        faults.value(
            "sample",
            &sample.span,
            &format!("until / sample must be at most {MOST_ROWS:e} rows"),
        );
    }
    table.finish(faults);
    let until = until.map(|until| until.value);
    (
        engine,
        until,
        sample.map_or_else(|| default_sample(until, units), |sample| sample.value),
    )
}

fn unknown_engine() -> String {
    let names = EngineName::value_variants()
        .iter()
        .filter_map(EngineName::to_possible_value)
        .map(|value| value.get_name().to_owned());
    format!(
        "not in this version, which has {}",
        names.collect::<Vec<_>>().join(", ")
    )
}

/// A thousand rows until the end of the run; without an end, one row per nanosecond or per tenth of the unit of time.
pub(super) fn default_sample(until: Option<f64>, units: Option<Units>) -> f64 {
    let open_end = if units == Some(Units::Si) { 1e-9 } else { 0.1 };
    until.map_or(open_end, |until| until / 1000.0)
}

/// Far from the origin, positions are coarse; against a small ball's radius that would be felt.
pub(super) fn check_precision(scene: &Scene, size_at: usize, faults: &mut Faults) {
    let from_rows = scene
        .species
        .iter()
        .filter_map(|species| match &species.sites {
            Sites::Rows(rows) => rows.radii.as_ref(),
            _ => None,
        });
    let radii = scene.species.iter().filter_map(|species| species.radius);
    let radii = radii
        .chain(from_rows.flatten().copied())
        .chain(scene.balls.iter().map(|ball| ball.radius));
    let smallest = radii
        .filter(|radius| *radius > 0.0)
        .fold(f64::INFINITY, f64::min);
    let farthest = (scene.center.abs() + scene.domain.half_size).max_element();
    let step = farthest.next_up() - farthest;
    if !farthest.is_finite() || step > COARSEST_POSITION * smallest {
        faults.add(
            size_at,
            &format!(
                "size: coordinates reach {}, where they are rounded to {}: must be at most {COARSEST_POSITION:e} of the \
                 smallest radius, {}: move the domain to the origin or make it smaller",
                number(farthest),
                number(step),
                number(smallest)
            ),
        );
    }
}

/// Each species fits by itself; together they must, too.
pub(super) fn check_memory(scene: &Scene, faults: &mut Faults) {
    let needed = scene.ball_count() as u64 * memory::BYTES_PER_BALL;
    if let Some(free) = memory::available().filter(|&free| needed > free) {
        let (needed, free) = (needed as f64 / 1e9, free as f64 / 1e9);
        let count = scene.ball_count();
        faults.add(
            0,
            &format!("{count} balls need {needed:.1} GB of memory, and {free:.1} GB are free"),
        );
    }
}
