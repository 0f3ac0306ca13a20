//! Files of the seed that are good, and files that are not.

use super::*;

fn read(text: &str) -> Result<Scene, Vec<String>> {
    assert!(is_seed_text(text));
    parse(Path::new("seed.txt"), text)
}

#[track_caller]
fn refused(text: &str, why: &str) {
    assert_eq!(read(text).expect_err("it is bad"), [why]);
}

const ONE: &str = "C 1\n0 0 0 10 10 10\nB 1\n1 2 3 0.5 0 -0.5 4 0.25\n";

#[test]
fn a_container_and_a_ball_are_read() {
    let scene = read(ONE).expect("a good file");
    assert_eq!(scene.domain, Domain::container(DVec3::splat(5.0)));
    let ball = &scene.balls[0];
    assert_eq!(
        (ball.position, ball.velocity),
        (DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.5, 0.0, -0.5))
    );
    assert_eq!((ball.mass, ball.radius, ball.line), (4.0, 0.25, 4));
    assert_eq!(scene.units, Units::Reduced);
}

#[test]
fn header_tabs_carriage_returns_and_comments_make_no_difference() {
    let expected = read(ONE).expect("a good file").balls;
    let header = format!("1 0 1 1\n0 0 30 0 0 0 45 0.1\n{ONE}");
    let tabs = header.replace(' ', "\t").replace('\n', "\t\r\n");
    let old = ONE.replace('\n', "\r");
    let commented = format!(
        "\u{feff}# a gas\n\n{}",
        ONE.replace("B 1", "B 1 # one ball")
    );
    for text in [header.as_str(), &tabs, &old, &commented, ONE.trim_end()] {
        let mut balls = read(text).expect("a good file").balls;
        balls[0].line = 4;
        assert_eq!(balls, expected, "{text:?}");
    }
}

#[test]
fn without_a_container_space_is_open_and_planes_keep_their_numbers() {
    let scene =
        read("W 1\n0 0 0 0 0 2\nB 2\n0 0 3 0 0 0 1 1\n4 0 3 0 0 0 inf 1").expect("a good file");
    assert_eq!(scene.domain.boundary, Boundary::Open);
    assert_eq!(scene.planes[0].normal, DVec3::new(0.0, 0.0, 2.0));
    assert_eq!(scene.domain.planes[0].normal, DVec3::Z);
    scene
        .place()
        .expect("balls above the plane, one of them fixed");
}

#[test]
fn the_comment_on_units_makes_them_si() {
    let text = format!("{SI_COMMENT}\n{ONE}");
    assert_eq!(read(&text).expect("a good file").units, Units::Si);
}

#[test]
fn counts_are_doubted_before_anything_is_allocated() {
    refused(
        "B 1000000000000\n",
        "seed.txt:1: B 1000000000000: the file ends before so many rows",
    );
    refused(
        "B -5\n",
        "seed.txt:1: B -5: must be followed by the number of its rows",
    );
    refused(
        "B 3.5\n",
        "seed.txt:1: B 3.5: must be followed by the number of its rows",
    );
    refused(
        "B\n",
        "seed.txt:1: B : must be followed by the number of its rows",
    );
    refused(
        "B 99999999999999999999\n",
        "seed.txt:1: B 99999999999999999999: must be followed by the number of its rows",
    );
}

#[test]
fn what_is_missing_or_too_much_is_named_by_its_line() {
    refused(
        "B 1\n1 2 3 0.5 0 -0.5 4.000000000",
        "seed.txt:2: B: row 1 has 7 numbers: must be 8",
    );
    refused(
        &format!("{ONE}7\n"),
        "seed.txt:5: 7: more numbers than section B declares",
    );
    refused(
        &format!("{ONE}X 1\n"),
        "seed.txt:5: X: unknown section: known are C (containers), W (planes), B (balls)",
    );
    refused(
        "b 0\n",
        "seed.txt:1: b: unknown section: known are C (containers), W (planes), B (balls)",
    );
    refused(
        &format!("{ONE}{ONE}"),
        "seed.txt:5: C: the section is there twice",
    );
    refused(
        "C 2\n0 0 0 1 1 1\n0 0 0 1 1 1\n",
        "seed.txt:1: C 2: must be 0 or 1 container",
    );
    refused(
        "1 0 2 1\n",
        "seed.txt:1: 2: a switch of the header must be 0 or 1",
    );
    refused(
        "1 0 1 1\n0 0 B\n",
        "seed.txt:2: B: a number of the header's camera must be finite; without a header, C, W or B comes first",
    );
}

#[test]
fn numbers_that_are_none_are_refused() {
    let bad = |word: &str| ONE.replace("0.25", word);
    let at = |word: &str, limit: &str| format!("seed.txt:4: B: row 1: {word}: {limit}");
    for word in ["0,5", "one", "\u{2212}1", "0x10", "1_0"] {
        refused(
            &bad(word),
            &at(word, "must be a number, with a dot and not a comma"),
        );
    }
    for word in ["nan", "inf", "1e400", "-1"] {
        refused(
            &bad(word),
            &at(word, "must be a finite number, 0 or greater"),
        );
    }
    let zero = ONE.replace(" 4 ", " 0 ");
    refused(
        &zero,
        &at(
            "0",
            "must be greater than 0, or inf for a ball that never moves",
        ),
    );
}

#[test]
fn toml_is_not_taken_for_seed_text() {
    for text in [
        "units = \"si\"\n",
        "# C 1\n[domain]\n",
        "",
        "C = 1\n",
        "x\ny\n",
        "[[ball]]\n",
    ] {
        assert!(!is_seed_text(text) || text == "x\ny\n", "{text:?}");
    }
}
