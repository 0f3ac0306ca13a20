//! Golden screens, every size, and what the keys do.

mod fake;

use std::sync::Arc;

use moltop::feed::{Access, Command};
use moltop::snapshot::{
    Boundary, Column, Echo, Figure, Observable, ObservableName, Observed, Phase, SceneCard,
    Snapshot, Stretch, Warning,
};
use moltop::tui::Leave;
use moltop::tui::app::{App, Overlay, Panel};
use moltop::tui::camera::Camera;
use moltop::tui::picture::Mode;
use moltop::tui::view;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::buffer::Buffer;
use ratatui::crossterm::event::{
    KeyCode, KeyEvent, KeyModifiers, MouseButton, MouseEvent, MouseEventKind,
};
use ratatui::layout::Rect;

use fake::{Random, oxygen, running, small_gas, starting};

/// A dashboard that has watched a run for some frames, so that trails exist.
fn watching(phase: &Phase, reversed: bool) -> App {
    let mut app = App::new(Arc::new(running(oxygen(), 0)), false);
    for frame in 1..12 {
        let mut snapshot = running(oxygen(), frame);
        if frame == 11 {
            snapshot.phase = phase.clone();
            snapshot.reversed = reversed;
            snapshot.echo = reversed.then_some(Echo {
                turned_at: 7.85e-9,
                retraced: 0.63,
                error: None,
            });
        }
        show(&mut app, snapshot);
    }
    app
}

/// Takes in a snapshot and puts it on the screen, unless that is frozen.
fn show(app: &mut App, snapshot: Snapshot) {
    app.observe(Arc::new(snapshot));
    app.refresh(true);
}

fn press(app: &mut App, code: KeyCode) -> (Option<Leave>, Vec<Command>) {
    let mut commands = Vec::new();
    let key = KeyEvent::new(code, KeyModifiers::NONE);
    let leave = app.press(key, &mut |command| commands.push(command));
    (leave, commands)
}

fn screen(app: &App, width: u16, height: u16) -> String {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).expect("a test backend");
    terminal
        .draw(|frame| view::draw(app, frame.area(), frame.buffer_mut()))
        .expect("a test backend takes every frame");
    terminal.backend().to_string()
}

#[track_caller]
fn golden(name: &str, app: &App, width: u16, height: u16) {
    insta::assert_snapshot!(
        format!("{name}_{width}x{height}"),
        screen(app, width, height)
    );
}

#[test]
fn a_run_that_has_just_begun() {
    let app = App::new(Arc::new(starting(oxygen())), false);
    golden("starting", &app, 80, 24);
    golden("starting", &app, 40, 12);
}

#[test]
fn a_running_run_at_every_layout() {
    let app = watching(&Phase::Running, false);
    for (width, height) in [(80, 24), (40, 12), (60, 30), (120, 40), (200, 60)] {
        golden("running", &app, width, height);
    }
}

#[test]
fn a_paused_run() {
    golden("paused", &watching(&Phase::Paused, false), 80, 24);
}

#[test]
fn a_reversed_run() {
    golden("reversed", &watching(&Phase::Running, true), 80, 24);
}

#[test]
fn a_run_that_has_found_back() {
    let mut app = watching(&Phase::Running, true);
    let mut back = running(oxygen(), 12);
    back.reversed = true;
    back.echo = Some(Echo {
        turned_at: 6.4e-9,
        retraced: 1.0,
        error: Some(3.1e-13),
    });
    show(&mut app, back);
    golden("came_back", &app, 80, 24);
}

#[test]
fn a_run_that_has_lost_its_way_back_says_by_how_much() {
    let mut lost = running(oxygen(), 12);
    lost.echo = Some(Echo {
        turned_at: 6.4e-9,
        retraced: 1.0,
        error: Some(8.3),
    });
    let app = App::new(Arc::new(lost), false);
    assert!(screen(&app, 80, 24).contains("lost, 8.3 d off"));
}

#[test]
fn a_run_that_needs_a_look() {
    let mut drifted = running(oxygen(), 12);
    drifted.energy_drift = Some(3.0e-9);
    drifted.momentum_drift = Some(2.0e-10);
    let app = App::new(Arc::new(drifted), false);
    golden("look", &app, 80, 24);
    golden("look", &app, 120, 40);
    golden("look", &app, 40, 12);
}

#[test]
fn fixed_steps_say_what_they_miss() {
    let mut stepped = running(small_gas(), 12);
    stepped.engine = "step".into();
    stepped.max_overlap = Some(3.0e-2);
    stepped.counts.audited_steps = 40;
    stepped.counts.missed_collisions = 12;
    stepped.counts.double_bounces = 3;
    let app = App::new(Arc::new(stepped), false);
    golden("step", &app, 80, 24);
    golden("step", &app, 120, 40);
}

#[test]
fn integers_remember() {
    let mut exact = running(small_gas(), 12);
    exact.engine = "reversible".into();
    exact.echo_horizon = None;
    exact.counts.remembered_events = 44;
    let app = App::new(Arc::new(exact), false);
    golden("reversible", &app, 80, 24);
    golden("reversible", &app, 120, 40);
}

#[test]
fn a_finished_run() {
    golden("finished", &watching(&Phase::Finished, false), 80, 24);
}

#[test]
fn a_failed_run_says_why_in_full() {
    let why = "balls 3121 and 55120 overlap by 1.2e-3 of the contact distance at t = 12.48 ns, \
               more than round-off explains; this is a fault of the engine, please report it with the scene file";
    let app = watching(&Phase::Failed(why.into()), false);
    golden("failed", &app, 80, 24);
    golden("failed", &app, 40, 12);
}

#[test]
fn the_help() {
    let mut app = watching(&Phase::Running, false);
    press(&mut app, KeyCode::Char('?'));
    golden("help", &app, 80, 24);
    golden("help", &app, 40, 12);
}

#[test]
fn the_question_before_leaving() {
    let mut app = watching(&Phase::Running, false);
    press(&mut app, KeyCode::Char('q'));
    golden("question", &app, 80, 24);
}

#[test]
fn a_frozen_screen_rests_while_the_run_goes_on() {
    let mut app = watching(&Phase::Running, false);
    press(&mut app, KeyCode::Char('f'));
    let before = screen(&app, 80, 24);
    show(&mut app, running(oxygen(), 90));
    assert_eq!(screen(&app, 80, 24), before);
    golden("frozen", &app, 80, 24);
}

#[test]
fn the_whole_depth() {
    let mut app = watching(&Phase::Running, false);
    press(&mut app, KeyCode::Char('v'));
    assert_eq!(app.mode, Mode::Depth);
    golden("depth", &app, 120, 40);
}

#[test]
fn large_balls_in_reduced_units() {
    let app = App::new(Arc::new(running(small_gas(), 3)), false);
    golden("small_gas", &app, 120, 40);
}

/// A small gas in another domain, for the picture; a periodic box and open space have no walls to hit.
fn in_domain(boundary: Boundary, planes: Vec<([f64; 3], f64)>) -> App {
    let scene = SceneCard {
        boundary,
        planes,
        ..small_gas()
    };
    let mut snapshot = running(scene, 3);
    if boundary != Boundary::Container {
        snapshot.pressure.wall = None;
        snapshot.wall_rate = None;
        snapshot.expected.wall_rate = None;
    }
    App::new(Arc::new(snapshot), false)
}

#[test]
fn domains_and_planes() {
    let half = 0.5_f64.sqrt();
    let wedge = vec![([half, 0.0, half], -3.0), ([-half, 0.0, half], -3.0)];
    let app = in_domain(Boundary::Container, wedge);
    golden("planes", &app, 80, 24);
    golden("planes", &app, 120, 40);
    let periodic = in_domain(Boundary::Periodic, Vec::new());
    golden("periodic", &periodic, 80, 24);
    golden("periodic", &periodic, 120, 40);
    golden("open", &in_domain(Boundary::Open, Vec::new()), 80, 24);
}

#[test]
fn seven_bits_are_enough() {
    for (width, height) in [(80, 24), (120, 40), (40, 12)] {
        let mut half_way = running(oxygen(), 0);
        half_way.until = Some(2.51e-8);
        let app = App::new(Arc::new(half_way), true);
        let text = screen(&app, width, height);
        assert!(text.is_ascii(), "{text}");
        // Only the help key is a question mark: every glyph of ours has its stand-in.
        assert_eq!(text.matches('?').count(), 1, "{text}");
    }
    let mut app = watching(&Phase::Running, false);
    app.ascii = true;
    golden("ascii", &app, 80, 24);
}

#[test]
fn a_small_window_says_what_it_needs() {
    let app = watching(&Phase::Running, false);
    golden("one_row", &app, 39, 4);
    golden("one_row", &app, 80, 1);
    assert!(screen(&app, 12, 2).contains("needs 40x12"));
}

/// A snapshot whose every number is as bad as numbers get.
fn hostile() -> Snapshot {
    let mut snapshot = running(oxygen(), 1);
    snapshot.time = f64::NAN;
    snapshot.until = Some(0.0);
    snapshot.wall_time_s = f64::INFINITY;
    snapshot.time_rate = Some(-1.0);
    snapshot.time_left_s = Some((f64::NAN, f64::INFINITY));
    snapshot.temperature = Some(f64::NAN);
    snapshot.pressure.standard_error = Some(0.0);
    snapshot.expected.pair_rate = Some(0.0);
    snapshot.kinetic_energy = f64::MAX;
    let history = Arc::make_mut(&mut snapshot.history);
    for index in 0..300 {
        let time = [1.0, f64::NAN, 0.5, -1.0][index % 4];
        let temperature = [f64::NAN, f64::MAX, -f64::MAX, 0.0][index % 4];
        let stretch = Stretch::new(f64::NAN, time, f64::INFINITY)
            .with(Observable::Temperature, Some(temperature))
            .with(Observable::PressureWall, Some(f64::NAN));
        history.push(stretch);
    }
    let speeds = Arc::make_mut(snapshot.speeds.as_mut().expect("a running run has speeds"));
    speeds.ks_critical = 0.0;
    speeds.maxwell[3] = f64::NAN;
    let sample = Arc::make_mut(
        snapshot
            .sample
            .as_mut()
            .expect("a watched run has a sample"),
    );
    sample.positions.truncate(500);
    sample.positions[7] = [f32::NAN, f32::INFINITY, 0.0];
    sample.names = ["pollen", "", "花粉"].map(String::from).to_vec();
    snapshot
}

#[test]
fn nothing_that_is_no_number_reaches_the_screen() {
    let app = App::new(Arc::new(hostile()), false);
    for (width, height) in [(80, 24), (40, 12), (200, 60)] {
        let text = screen(&app, width, height);
        assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
    }
}

#[test]
fn no_size_and_no_key_ends_in_a_panic() {
    let keys: Vec<KeyCode> = " rs,.+-v[]<>0f?/ynqatTmwhcg12345678%"
        .chars()
        .map(KeyCode::Char)
        .chain([
            KeyCode::Left,
            KeyCode::Up,
            KeyCode::Down,
            KeyCode::Right,
            KeyCode::Esc,
            KeyCode::Enter,
            KeyCode::Tab,
            KeyCode::BackTab,
            KeyCode::PageUp,
            KeyCode::PageDown,
            KeyCode::Home,
        ])
        .collect();
    let mut random = Random(3);
    let failed = watching(&Phase::Failed("because".into()), false);
    let apps = [
        App::new(Arc::new(starting(oxygen())), false),
        App::new(Arc::new(running(small_gas(), 0)), true),
        App::new(Arc::new(hostile()), false),
        failed,
    ];
    // MOLTOP_EVERY_SIZE=1 cargo test --test screens no_size: all of them, which takes minutes.
    let every = std::env::var_os("MOLTOP_EVERY_SIZE").is_some();
    let (across, down) = if every { (1, 1) } else { (7, 9) };
    for mut app in apps {
        for width in (0..=250).step_by(across).chain([1, 39, 40, 79, 80, 81]) {
            for height in (0..=80).step_by(down).chain([1, 2, 11, 12, 23, 24]) {
                let area = Rect::new(0, 0, width, height);
                view::draw(&app, area, &mut Buffer::empty(area));
                press(&mut app, keys[random.next() as usize % keys.len()]);
            }
        }
    }
}

#[test]
fn every_state_in_every_character_set() {
    let frozen = {
        let mut app = watching(&Phase::Running, false);
        press(&mut app, KeyCode::Char('f'));
        app
    };
    let states = [
        ("starting", App::new(Arc::new(starting(oxygen())), false)),
        ("running", watching(&Phase::Running, false)),
        ("paused", watching(&Phase::Paused, false)),
        ("reversed", watching(&Phase::Running, true)),
        ("frozen", frozen),
        ("failed", watching(&Phase::Failed("a bug".into()), false)),
        ("finished", watching(&Phase::Finished, false)),
    ];
    for (name, mut app) in states {
        golden(&format!("state_{name}"), &app, 132, 43);
        app.ascii = true;
        golden(&format!("state_{name}_ascii"), &app, 80, 24);
        assert!(screen(&app, 200, 60).is_ascii());
    }
}

#[test]
fn every_panel_fills_the_window_and_gives_it_back() {
    let mut app = watching(&Phase::Running, false);
    press(&mut app, KeyCode::Char('m'));
    show(&mut app, running(oxygen(), 300));
    for (number, panel) in Panel::ALL.into_iter().enumerate() {
        let key = KeyCode::Char(char::from(b'1' + number as u8));
        press(&mut app, key);
        assert_eq!(app.enlarged, Some(panel));
        for (width, height) in [(80, 24), (132, 43), (40, 12)] {
            golden(&format!("panel_{}", number + 1), &app, width, height);
        }
        app.ascii = true;
        assert!(screen(&app, 80, 24).is_ascii());
        app.ascii = false;
        press(&mut app, key);
        assert_eq!(app.enlarged, None);
    }
}

#[test]
fn a_panel_is_chosen_enlarged_and_left() {
    let mut app = watching(&Phase::Running, false);
    press(&mut app, KeyCode::Tab);
    press(&mut app, KeyCode::Tab);
    assert_eq!(app.chosen, Some(Panel::Now));
    golden("chosen", &app, 80, 24);
    press(&mut app, KeyCode::Enter);
    assert_eq!(app.enlarged, Some(Panel::Now));
    press(&mut app, KeyCode::BackTab);
    assert_eq!(app.enlarged, Some(Panel::Gas));
    press(&mut app, KeyCode::BackTab);
    assert_eq!(app.enlarged, Some(Panel::Observables));
    press(&mut app, KeyCode::Esc);
    assert_eq!((app.enlarged, app.chosen), (None, None));
}

#[test]
fn the_charts_go_back_in_time_and_come_back() {
    let mut app = watching(&Phase::Running, false);
    for key in ['5', ']', ']', '<'] {
        press(&mut app, KeyCode::Char(key));
    }
    golden("past", &app, 80, 24);
    press(&mut app, KeyCode::Char('0'));
    assert!(screen(&app, 80, 24).contains("the last"));
    press(&mut app, KeyCode::Char('['));
    press(&mut app, KeyCode::Char('['));
    assert!(screen(&app, 80, 24).contains("the whole run"));
}

/// The run after so many frames, with a past at 5 ns.
fn with_past(frame: u64, phase: Phase) -> Snapshot {
    let mut past = running(oxygen(), 0);
    past.time = 5e-9;
    past.until = Some(past.time);
    past.phase = phase;
    Snapshot {
        past: Some(Arc::new(past)),
        ..running(oxygen(), frame)
    }
}

#[test]
fn the_past_is_seen_beside_the_run_which_no_key_reaches_meanwhile() {
    let mut app = watching(&Phase::Running, false);
    press(&mut app, KeyCode::Char('g'));
    golden("goto", &app, 80, 24);
    golden("goto", &app, 40, 12);
    for key in "5 m".chars() {
        press(&mut app, KeyCode::Char(key));
    }
    press(&mut app, KeyCode::Enter);
    assert!(screen(&app, 80, 24).contains("no unit of time here"));
    press(&mut app, KeyCode::Backspace);
    for key in "ns".chars() {
        assert_eq!(press(&mut app, KeyCode::Char(key)).1, []);
    }
    let (_, commands) = press(&mut app, KeyCode::Enter);
    assert_eq!(commands, [Command::Goto(Some(5.0 * 1e-9))]);
    show(&mut app, with_past(20, Phase::Running));
    assert!(screen(&app, 80, 24).contains("going back to 5.00 ns, run running"));
    show(&mut app, with_past(21, Phase::Finished));
    golden("past_run", &app, 80, 24);
    assert_eq!(app.numbers.time, 5e-9);
    for key in " rs,.cm".chars() {
        assert_eq!(press(&mut app, KeyCode::Char(key)).1, [], "{key}");
        assert!(screen(&app, 80, 24).contains("0 comes back to the run"));
    }
    assert_eq!(press(&mut app, KeyCode::Char('0')).1, [Command::Goto(None)]);
    assert_eq!(app.numbers.time, app.latest.time);
    assert!(screen(&app, 80, 24).contains("● running"));
}

#[test]
fn a_past_that_cannot_be_made_again_is_no_past() {
    let mut app = watching(&Phase::Running, false);
    for key in "g0".chars() {
        press(&mut app, KeyCode::Char(key));
    }
    press(&mut app, KeyCode::Enter);
    show(
        &mut app,
        with_past(20, Phase::Failed("no checkpoint is that old".into())),
    );
    assert_eq!(app.visit, None);
    assert!(screen(&app, 80, 24).contains("no way back: no checkpoint is that old"));
}

#[test]
fn a_checkpoint_is_asked_for_and_said_to_be_on_the_disk() {
    let mut app = watching(&Phase::Running, false);
    assert_eq!(press(&mut app, KeyCode::Char('c')).1, [Command::Checkpoint]);
    assert!(screen(&app, 80, 24).contains("writing a checkpoint"));
    let mut saved = running(oxygen(), 20);
    saved.checkpoints = 1;
    saved.last_checkpoint = Some(1.3e-8);
    show(&mut app, saved);
    assert!(screen(&app, 80, 24).contains("checkpoint at 13.00 ns is on the disk"));
}

#[test]
fn a_reader_is_told_that_the_run_does_not_hear_it() {
    let mut app = watching(&Phase::Running, false);
    app.access = Access::ReadOnly;
    for key in " rs,.cg".chars() {
        assert_eq!(press(&mut app, KeyCode::Char(key)).1, [], "{key}");
        assert!(screen(&app, 80, 24).contains("read-only"));
    }
}

#[test]
fn marks_are_the_runs_and_the_readers_own() {
    let mut app = watching(&Phase::Running, false);
    let (_, commands) = press(&mut app, KeyCode::Char('m'));
    assert_eq!(commands, [Command::Mark(app.latest.time)]);
    let mut marked = running(oxygen(), 20);
    marked.marks = vec![1e-9, app.latest.time];
    let known = marked.marks.clone();
    show(&mut app, marked);
    assert_eq!(app.marks(), known);
}

#[test]
fn warnings_are_told_at_once_and_listed() {
    let mut app = watching(&Phase::Running, false);
    let mut warned = running(oxygen(), 20);
    let warning = |wall_time_s, words: &str| Warning {
        wall_time_s,
        words: words.into(),
    };
    warned.warnings = vec![
        warning(
            12.0,
            "slow: 3.019e5 collisions per second, 68 % of what is usual in this run",
        ),
        warning(44.0, "checkpoint: cannot write: no space left on device"),
    ];
    show(&mut app, warned);
    golden("warned", &app, 80, 24);
    press(&mut app, KeyCode::Char('4'));
    golden("warned_panel", &app, 80, 24);
    golden("warned_panel", &app, 40, 12);
}

#[test]
fn the_help_is_searched_and_scrolled() {
    let mut app = watching(&Phase::Running, false);
    for key in ['?', '/', 'h', 'i', 's', 't'] {
        press(&mut app, KeyCode::Char(key));
    }
    golden("help_search", &app, 80, 24);
    press(&mut app, KeyCode::Esc);
    press(&mut app, KeyCode::Down);
    assert!(
        screen(&app, 40, 12).contains(" 2-"),
        "{}",
        screen(&app, 40, 12)
    );
    press(&mut app, KeyCode::Char('x'));
    assert_eq!(app.overlay, None);
}

fn mouse(kind: MouseEventKind, column: u16, row: u16) -> MouseEvent {
    MouseEvent {
        kind,
        column,
        row,
        modifiers: KeyModifiers::NONE,
    }
}

#[test]
fn the_mouse_turns_enlarges_and_zooms() {
    let mut app = watching(&Phase::Running, false);
    let left = MouseButton::Left;
    app.point(
        &mouse(MouseEventKind::Down(left), 20, 10),
        Some(Panel::Gas),
        false,
    );
    app.point(
        &mouse(MouseEventKind::Drag(left), 25, 9),
        Some(Panel::Gas),
        false,
    );
    assert_eq!((app.camera.azimuth, app.camera.elevation), (15, 14));
    app.point(
        &mouse(MouseEventKind::ScrollUp, 20, 10),
        Some(Panel::Gas),
        false,
    );
    assert_eq!(app.camera.zoom_steps, 1);
    app.point(
        &mouse(MouseEventKind::ScrollUp, 60, 10),
        Some(Panel::Now),
        false,
    );
    assert_eq!(app.span.halvings, 1);
    app.point(
        &mouse(MouseEventKind::Down(left), 60, 2),
        Some(Panel::Now),
        true,
    );
    assert_eq!(app.enlarged, Some(Panel::Now));
}

#[test]
fn a_slice_moves_through_the_gas_and_the_picture_turns_by_itself() {
    let mut app = watching(&Phase::Running, false);
    press(&mut app, KeyCode::PageUp);
    press(&mut app, KeyCode::PageUp);
    press(&mut app, KeyCode::Char('a'));
    app.turn_by_itself();
    press(&mut app, KeyCode::Char('1'));
    golden("slice", &app, 80, 24);
    press(&mut app, KeyCode::Home);
    assert_eq!(app.camera, Camera::default());
}

#[test]
fn an_area_beyond_the_buffer_is_cut() {
    let app = watching(&Phase::Running, false);
    let mut buffer = Buffer::empty(Rect::new(0, 0, 50, 14));
    view::draw(&app, Rect::new(10, 5, 200, 60), &mut buffer);
}

#[test]
fn space_pauses_and_resumes_also_faster_than_the_run_answers() {
    let mut app = watching(&Phase::Running, false);
    assert_eq!(press(&mut app, KeyCode::Char(' ')).1, [Command::Pause]);
    assert_eq!(press(&mut app, KeyCode::Char(' ')).1, [Command::Resume]);
    app.observe(Arc::new(Snapshot {
        phase: Phase::Paused,
        ..running(oxygen(), 40)
    }));
    assert_eq!(press(&mut app, KeyCode::Char(' ')).1, [Command::Resume]);
}

#[test]
fn the_ceiling_starts_at_the_present_rate_and_is_lifted_above_the_highest_useful_one() {
    let mut app = watching(&Phase::Running, false); // at 0.29 ns per second
    assert_eq!(press(&mut app, KeyCode::Char('.')).1, []);
    let ceiling = |rate| [Command::LimitTimeRate(rate)];
    assert_eq!(press(&mut app, KeyCode::Char(',')).1, ceiling(Some(2e-10)));
    assert_eq!(press(&mut app, KeyCode::Char(',')).1, ceiling(Some(1e-10)));
    assert_eq!(press(&mut app, KeyCode::Char('.')).1, ceiling(Some(2e-10)));
    assert_eq!(press(&mut app, KeyCode::Char('.')).1, ceiling(None));
}

#[test]
fn leaving_a_run_that_goes_on_needs_a_yes() {
    let mut app = watching(&Phase::Running, false);
    assert_eq!(press(&mut app, KeyCode::Char('q')).0, None);
    assert_eq!(press(&mut app, KeyCode::Esc).0, None);
    assert_eq!(app.overlay, None);
    press(&mut app, KeyCode::Char('q'));
    assert_eq!(app.overlay, Some(Overlay::QuitQuestion));
    assert_eq!(press(&mut app, KeyCode::Enter).0, Some(Leave::Quit));
}

#[test]
fn leaving_a_finished_run_needs_no_yes() {
    let mut app = watching(&Phase::Finished, false);
    assert_eq!(press(&mut app, KeyCode::Char('q')).0, Some(Leave::Quit));
    let mut app = watching(&Phase::Failed("because".into()), false);
    assert_eq!(press(&mut app, KeyCode::Char('q')).0, Some(Leave::Quit));
}

#[test]
fn control_c_leaves_at_once() {
    let mut app = watching(&Phase::Running, false);
    let key = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
    assert_eq!(app.press(key, &mut |_| {}), Some(Leave::Quit));
}

/// What two observables have found: one with figures and a curve, one with a curve and theory.
fn observing() -> Snapshot {
    let column = |name: &str, value: &dyn Fn(f64) -> f64| Column {
        name: name.into(),
        values: (1..100).map(|row| Some(value(f64::from(row)))).collect(),
    };
    let figure = |name: &str, value: f64, error: f64, expected: f64, unit: &str| Figure {
        name: name.into(),
        value: Some(value),
        standard_error: Some(error),
        expected: Some(expected),
        unit: unit.into(),
    };
    let radial = Observed {
        name: "radial_distribution".into(),
        figures: vec![figure("contact_value", 1.0141, 0.0021, 1.0142, "")],
        columns: vec![
            column("distance", &|row| 3.46e-10 * (1.0 + row / 50.0)),
            column("radial_distribution", &|row| {
                1.0 + 0.014 * (-row / 20.0).exp()
            }),
        ],
    };
    let motion = Observed {
        name: "motion".into(),
        figures: vec![figure(
            "diffusion_coefficient.O2",
            1.412e-5,
            3e-8,
            1.409e-5,
            "m²/s",
        )],
        columns: vec![
            column("time", &|row| 1e-11 * row),
            column("mean_square_displacement.O2", &|row| {
                1e-17 * row * row / (1.0 + row / 9.0)
            }),
            column("expected.O2", &|row| {
                9.6e-18 * row * row / (1.0 + row / 9.0)
            }),
        ],
    };
    Snapshot {
        observables: Arc::new(vec![radial, motion]),
        ..running(oxygen(), 12)
    }
}

#[test]
fn observables_are_shown_and_switched_by_keys() {
    let mut app = watching(&Phase::Running, false);
    show(&mut app, observing());
    // The first press of either key shows the panel, and changes nothing.
    let (_, commands) = press(&mut app, KeyCode::Char('O'));
    assert_eq!((app.enlarged, commands), (Some(Panel::Observables), vec![]));
    golden("observables_radial", &app, 80, 24);
    golden("observables_radial", &app, 132, 43);
    golden("observables_radial", &app, 40, 12);
    let (_, commands) = press(&mut app, KeyCode::Char('O'));
    let off = Command::Observe(ObservableName::RadialDistribution, false);
    assert_eq!(commands, [off]);
    press(&mut app, KeyCode::Char('o'));
    golden("observables_off", &app, 80, 24);
    let (_, commands) = press(&mut app, KeyCode::Char('O'));
    let on = Command::Observe(ObservableName::DensityProfile, true);
    assert_eq!(commands, [on]);
    press(&mut app, KeyCode::Char('o'));
    assert_eq!(app.observable, ObservableName::Motion);
    golden("observables_motion", &app, 80, 24);
    (0..4).for_each(|_| drop(press(&mut app, KeyCode::Char('o'))));
    assert_eq!(app.observable, ObservableName::RadialDistribution);
    press(&mut app, KeyCode::Char('9'));
    assert_eq!(app.enlarged, None);
    // Where the first of the list is off, the panel opens on what is on.
    let mut app = watching(&Phase::Running, false);
    let observables = observing().observables[1..].to_vec();
    show(
        &mut app,
        Snapshot {
            observables: Arc::new(observables),
            ..observing()
        },
    );
    assert_eq!(app.observable, ObservableName::Motion);
}
