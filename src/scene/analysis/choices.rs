//! What of a scene will be modelled, and why: looked at once, before the run.

use super::body;
use crate::domain::Boundary;
use crate::engine::windowed::Windowed;
use crate::state::Placement;

/// Balls that a scene may have before cells save anything.
const FEW: usize = 64;

/// What will be modelled and what will be left out, one sentence each.
pub fn choices(placement: &Placement) -> Vec<String> {
    let count = placement.positions.len();
    let engine = if Windowed::pays(placement) {
        "engine auto takes windowed: many balls of like size"
    } else {
        "engine auto takes event: from collision to collision"
    };
    let mut choices = vec![engine.to_owned(), bodies(placement), pairs(placement)];
    if placement.bodies.iter().any(|body| body.mass.is_infinite()) {
        let fixed = (0..count)
            .filter(|&ball| body(placement, ball).mass.is_infinite())
            .count();
        choices.push(format!(
            "{fixed} fixed: others bounce off, nothing moves them"
        ));
    }
    choices.push(
        match placement.domain.boundary {
            Boundary::Container => "six hard walls; no periodic images",
            Boundary::Periodic => {
                "periodic: no walls; images are looked at in the cells at the faces only"
            }
            Boundary::Open => {
                "open space: no walls, no periodic images; balls that leave do not return"
            }
        }
        .to_owned(),
    );
    choices.push(match placement.domain.planes.len() {
        0 => "no planes: none are looked for".to_owned(),
        1 => "one plane: each ball stays on its side".to_owned(),
        planes => format!("{planes} planes: each ball stays on its side of each"),
    });
    choices
}

fn bodies(placement: &Placement) -> String {
    match placement.bodies.as_slice() {
        [] => "no balls".to_owned(),
        [_] => "one radius and mass for all balls: kept once".to_owned(),
        bodies => {
            let radii = || bodies.iter().map(|body| body.radius).filter(|r| *r > 0.0);
            let ratio = radii().fold(0.0, f64::max) / radii().fold(f64::INFINITY, f64::min);
            let sizes = if ratio > 8.0 {
                "; large balls are listed in every cell that they reach into"
            } else {
                ""
            };
            format!(
                "{} different radii and masses: an index per ball{sizes}",
                bodies.len()
            )
        }
    }
}

fn pairs(placement: &Placement) -> String {
    let count = placement.positions.len();
    let sized = (0..count)
        .filter(|&ball| body(placement, ball).radius > 0.0)
        .count();
    let moving = (0..count)
        .filter(|&ball| body(placement, ball).mass.is_finite())
        .count();
    if count < 2 {
        "no collisions between balls: there are no pairs".to_owned()
    } else if sized == 0 {
        "no collisions between balls: all are points; no cells, nothing to look for".to_owned()
    } else if moving == 0 {
        "no collisions between balls: none can move".to_owned()
    } else if count <= FEW {
        "collisions between balls, event by event; few balls, few cells".to_owned()
    } else {
        "collisions between balls, event by event; partners are found in cells".to_owned()
    }
}
