use super::*;
use crate::snapshot::{Boundary, Units};
use crate::tui::theme;

fn scene(ball_count: usize, radius: f64) -> SceneCard {
    SceneCard {
        title: "test".into(),
        units: Units::Reduced,
        ball_count,
        packing_fraction: 0.1,
        boundary: Boundary::Container,
        size: [10.0; 3],
        planes: Vec::new(),
        center: [0.0; 3],
        radius,
        sample: 1.0,
    }
}

fn level() -> Camera {
    Camera {
        azimuth: 0,
        elevation: 0,
        ..Camera::default()
    }
}

fn draw(
    scene: &SceneCard,
    positions: &[[f32; 3]],
    camera: &Camera,
    mode: Mode,
    pane: (u16, u16),
) -> Picture {
    let sample = Sample {
        positions: positions.to_vec(),
        radii: vec![scene.radius as f32; positions.len()],
        names: Vec::new(),
    };
    Picture::draw(
        scene,
        &sample,
        &Trails::default(),
        (camera, mode),
        pane,
        &theme::ASCII,
    )
}

/// Cell of the first tagged molecule.
fn tag(picture: &Picture) -> (usize, usize) {
    let cell = picture
        .cells
        .iter()
        .position(|(_, layer)| *layer == Layer::Tag(0))
        .expect("the tag is on the pane");
    (cell % picture.width, cell / picture.width)
}

/// A seeded cloud that fills the box evenly.
fn cloud(count: u32) -> Vec<[f32; 3]> {
    // Source: Roberts' additive recurrence from the plastic number's cousin in three dimensions.
    let steps = [0.819_172_5_f64, 0.671_043_6, 0.549_700_5];
    (0..count)
        .map(|i| steps.map(|step| ((f64::from(i) * step).fract() * 10.0 - 5.0) as f32))
        .collect()
}

#[test]
fn a_ball_at_the_centre_lands_in_the_middle() {
    for camera in [level(), Camera::default()] {
        let picture = draw(&scene(1, 0.1), &[[0.0; 3]], &camera, Mode::Slab, (41, 21));
        assert_eq!(tag(&picture), (20, 10));
    }
}

#[test]
fn a_quarter_turn_brings_depth_to_the_side() {
    let ball = [[0.0, 4.0, 0.0]];
    let mut camera = level();
    let picture = draw(&scene(1, 0.1), &ball, &camera, Mode::Slab, (41, 21));
    assert_eq!(tag(&picture), (20, 10));
    camera.turn(90, 0);
    let picture = draw(&scene(1, 0.1), &ball, &camera, Mode::Slab, (41, 21));
    assert_eq!(tag(&picture).1, 10);
    assert!(tag(&picture).0 > 33);
}

#[test]
fn the_prefix_rests_while_molecules_move() {
    let scene = scene(700_000, 0.001);
    let moved: Vec<_> = cloud(20_000)
        .iter()
        .map(|[x, y, z]| [*z, *x, -*y])
        .collect();
    let first = draw(&scene, &cloud(20_000), &level(), Mode::Slab, (60, 20));
    let second = draw(&scene, &moved, &level(), Mode::Slab, (60, 20));
    assert_eq!(first.portion, second.portion);
    assert!(first.portion.prefix < 20_000);
}

#[test]
fn the_slab_fills_a_fifth_of_the_cells_it_covers() {
    let picture = draw(
        &scene(700_000, 0.001),
        &cloud(20_000),
        &level(),
        Mode::Slab,
        (60, 30),
    );
    let inside = |column: usize, row: usize| (3..57).contains(&column) && (2..28).contains(&row);
    let molecules = (0..1800).filter(|cell| {
        inside(cell % 60, cell / 60) && matches!(picture.cells[*cell].1, Layer::Molecule(_))
    });
    let share = molecules.count() as f64 / (54.0 * 26.0);
    assert!((0.1..0.25).contains(&share), "{share}");
}

#[test]
fn an_even_gas_is_evenly_shaded() {
    let picture = draw(
        &scene(700_000, 0.001),
        &cloud(20_000),
        &level(),
        Mode::Depth,
        (40, 20),
    );
    for row in 4..16 {
        for column in 6..34 {
            let shade = picture.at(column, row);
            assert!("-=+*O@#&A".contains(shade), "{shade} at {column}, {row}");
        }
    }
}

#[test]
fn a_large_ball_is_a_disc_of_cells() {
    let picture = draw(&scene(1, 2.0), &[[0.0; 3]], &level(), Mode::Slab, (40, 20));
    let cells = picture
        .cells
        .iter()
        .filter(|(_, layer)| matches!(layer, Layer::Molecule(_)));
    let area = std::f64::consts::PI * 4.0 * picture.scale * picture.scale / 2.0;
    assert!((cells.count() as f64 / area - 1.0).abs() < 0.15);
}

#[test]
fn the_box_keeps_its_shape_on_high_cells() {
    let picture = draw(&scene(1, 0.1), &[[0.0; 3]], &level(), Mode::Slab, (80, 20));
    let edge = |cell: &usize| picture.cells[*cell].1 == Layer::Edge;
    let columns: Vec<_> = (0..1600).filter(edge).map(|cell| cell % 80).collect();
    let width = columns.iter().max().unwrap() - columns.iter().min().unwrap();
    assert!((37..=40).contains(&width), "{width}");
}

#[test]
fn each_ball_has_its_own_size() {
    let mut sample = Sample {
        positions: cloud(1000),
        radii: vec![0.001; 1000],
        names: vec!["grain".into()],
    };
    sample.positions[0] = [0.0; 3];
    sample.radii[0] = 2.0;
    let picture = Picture::draw(
        &scene(1000, 2.0),
        &sample,
        &Trails::default(),
        (&level(), Mode::Slab),
        (80, 40),
        &theme::ASCII,
    );
    let in_a_disc = |glyph: char| theme::SHADES[1..].contains(&glyph);
    assert!(in_a_disc(picture.at(35, 18)) && in_a_disc(picture.at(45, 22)));
    let grains = picture
        .cells
        .iter()
        .filter(|(glyph, _)| "-=+#%@".contains(*glyph));
    let disc = std::f64::consts::PI * 4.0 * picture.scale * picture.scale / 2.0;
    assert!((grains.count() as f64) < 1.2 * disc + 160.0); // the edges are drawn with some of these, too
}
