//! What the dashboard remembers between frames, and what the keys do to it.
//!
//! Always holds: the screen is a function of this value alone. The run is touched only through the commands handed out here.

use std::sync::Arc;

use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

use crate::feed::{Access, Command};
use crate::snapshot::{Phase, Snapshot};
use crate::tui::Leave;
use crate::tui::camera::Camera;
use crate::tui::keys::{self, Action};
use crate::tui::link::Link;
use crate::tui::picture::Mode;
use crate::tui::trails::Trails;

/// A panel over the dashboard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Overlay {
    /// The keys and what the marks mean.
    Help,
    /// Stop the run and leave?
    QuitQuestion,
    /// Why the run failed.
    Failure,
}

/// A wish handed to the run that its snapshots may not show yet.
#[derive(Clone, Copy, Debug)]
struct Wish<T> {
    value: T,
    sequence: u64,
}

/// Snapshots after which a wish counts as answered, whatever the run does.
const PATIENCE: u64 = 3;

/// The dashboard's state.
pub struct App {
    /// The newest snapshot: what the run's state is known from.
    pub latest: Arc<Snapshot>,
    /// The snapshot whose numbers are on the screen.
    pub numbers: Arc<Snapshot>,
    /// The snapshot whose picture is on the screen.
    pub pictured: Arc<Snapshot>,
    /// Whether numbers and picture rest while the run goes on.
    pub frozen: bool,
    /// What watching costs.
    pub link: Link,
    /// Where the picture is seen from.
    pub camera: Camera,
    /// What the picture shows.
    pub mode: Mode,
    /// The panel over the dashboard.
    pub overlay: Option<Overlay>,
    /// Paths of the tagged molecules up to the picture on the screen.
    pub trails: Trails,
    /// What leaving means, and whether keys reach the run.
    pub access: Access,
    /// Paths up to the newest snapshot.
    newest_trails: Trails,
    /// Whether the screen may use 7-bit characters only.
    pub ascii: bool,
    failure_shown: bool,
    /// Time rate while no ceiling held the run back.
    free_rate: Option<f64>,
    pause_wish: Option<Wish<bool>>,
    limit_wish: Option<Wish<Option<f64>>>,
}

impl App {
    /// A dashboard that shows a first snapshot.
    pub fn new(first: Arc<Snapshot>, ascii: bool) -> Self {
        let mut app = Self {
            latest: first.clone(),
            numbers: first.clone(),
            pictured: first.clone(),
            frozen: false,
            link: Link::default(),
            camera: Camera::default(),
            mode: Mode::Slab,
            overlay: None,
            trails: Trails::default(),
            access: Access::default(),
            newest_trails: Trails::default(),
            ascii,
            failure_shown: false,
            free_rate: None,
            pause_wish: None,
            limit_wish: None,
        };
        app.observe(first);
        app.refresh(true);
        app
    }

    /// The snapshot whose numbers are on the screen.
    pub fn shown(&self) -> &Snapshot {
        &self.numbers
    }

    /// Puts the newest numbers on the screen, and the newest picture too; nothing while the screen is frozen.
    pub fn refresh(&mut self, picture: bool) {
        if self.frozen {
            return;
        }
        self.numbers = self.latest.clone();
        if picture {
            self.pictured = self.latest.clone();
            self.trails.clone_from(&self.newest_trails);
        }
    }

    /// Takes in a snapshot; says whether the run's state changed, which is shown at once.
    pub fn observe(&mut self, snapshot: Arc<Snapshot>) -> bool {
        let new_state =
            snapshot.phase != self.latest.phase || snapshot.reversed != self.latest.reversed;
        self.latest = snapshot;
        let sequence = self.latest.sequence;
        let stale = |since: u64| sequence > since + PATIENCE;
        let paused = self.latest.phase == Phase::Paused;
        let limit = self.latest.time_rate_limit;
        self.pause_wish = self
            .pause_wish
            .filter(|wish| wish.value != paused && !stale(wish.sequence));
        self.limit_wish = self
            .limit_wish
            .filter(|wish| wish.value != limit && !stale(wish.sequence));
        if limit.is_none() && self.limit_wish.is_none() && self.latest.phase == Phase::Running {
            self.free_rate = self.latest.time_rate.or(self.free_rate);
        }
        if matches!(self.latest.phase, Phase::Failed(_)) && !self.failure_shown {
            self.failure_shown = true;
            self.overlay = Some(Overlay::Failure);
        }
        self.newest_trails.record(&self.latest);
        new_state
    }

    /// Obeys a key: hands commands to `send`, and says when it is time to leave.
    pub fn press(&mut self, key: KeyEvent, send: &mut dyn FnMut(Command)) -> Option<Leave> {
        if key.kind == KeyEventKind::Release {
            return None;
        }
        let control = key.modifiers.contains(KeyModifiers::CONTROL);
        if control && matches!(key.code, KeyCode::Char('c' | 'C')) {
            return Some(match self.access {
                Access::Owner => Leave::Quit,
                Access::Watcher | Access::ReadOnly => Leave::Detach,
            });
        }
        if control || key.modifiers.contains(KeyModifiers::ALT) {
            return None;
        }
        match self.overlay {
            Some(Overlay::QuitQuestion) => return self.answer(key.code),
            Some(Overlay::Help) => {
                self.overlay = None;
                return None;
            }
            Some(Overlay::Failure) if keys::action(key.code) != Some(Action::Quit) => {
                self.overlay = None;
                return None;
            }
            Some(Overlay::Failure) | None => {}
        }
        self.act(keys::action(key.code)?, send)
    }

    fn answer(&mut self, code: KeyCode) -> Option<Leave> {
        let owner = self.access == Access::Owner;
        match code {
            KeyCode::Char('y' | 'Y') => return Some(Leave::Quit),
            KeyCode::Enter if owner => return Some(Leave::Quit),
            KeyCode::Char('d' | 'D') | KeyCode::Enter if !owner => return Some(Leave::Detach),
            KeyCode::Char('n' | 'N') | KeyCode::Esc => self.overlay = None,
            _ => {}
        }
        None
    }

    fn act(&mut self, action: Action, send: &mut dyn FnMut(Command)) -> Option<Leave> {
        match action {
            Action::Pause => self.pause(send),
            Action::Reverse => send(Command::Reverse),
            Action::Step => send(Command::Step),
            Action::Slower => self.slower(send),
            Action::Faster => self.faster(send),
            Action::TurnLeft => self.camera.turn(-10, 0),
            Action::TurnRight => self.camera.turn(10, 0),
            Action::TurnUp => self.camera.turn(0, 10),
            Action::TurnDown => self.camera.turn(0, -10),
            Action::ZoomIn => self.camera.zoom_by(1),
            Action::ZoomOut => self.camera.zoom_by(-1),
            Action::Thinner => self.camera.thicken(-1),
            Action::Thicker => self.camera.thicken(1),
            Action::ResetCamera => self.camera = Camera::default(),
            Action::SwitchView => {
                self.mode = match self.mode {
                    Mode::Slab => Mode::Depth,
                    Mode::Depth => Mode::Slab,
                }
            }
            Action::Freeze => self.freeze(),
            Action::Help => self.overlay = Some(Overlay::Help),
            Action::Quit | Action::Detach if !self.going_on() => return Some(Leave::Quit),
            Action::Quit | Action::Detach => return self.leave(action),
        }
        None
    }

    /// Leaves a run that goes on, or asks before.
    fn leave(&mut self, action: Action) -> Option<Leave> {
        match (self.access, action) {
            (Access::ReadOnly, _) | (Access::Watcher, Action::Detach) => Some(Leave::Detach),
            _ => {
                self.overlay = Some(Overlay::QuitQuestion);
                None
            }
        }
    }

    /// Whether there is a run to stop.
    fn going_on(&self) -> bool {
        !matches!(self.latest.phase, Phase::Finished | Phase::Failed(_))
    }

    fn pause(&mut self, send: &mut dyn FnMut(Command)) {
        if !self.going_on() {
            return;
        }
        let paused = self
            .pause_wish
            .map_or(self.latest.phase == Phase::Paused, |wish| wish.value);
        send(if paused {
            Command::Resume
        } else {
            Command::Pause
        });
        self.pause_wish = Some(Wish {
            value: !paused,
            sequence: self.latest.sequence,
        });
    }

    fn freeze(&mut self) {
        self.frozen = !self.frozen;
        self.refresh(true);
    }

    /// The ceiling as the user last set it.
    pub fn limit(&self) -> Option<f64> {
        self.limit_wish
            .map_or(self.latest.time_rate_limit, |wish| wish.value)
    }

    fn slower(&mut self, send: &mut dyn FnMut(Command)) {
        if let Some(rate) = self
            .limit()
            .or(self.latest.time_rate)
            .filter(|rate| is_rate(*rate))
        {
            self.set_limit(Some(step_below(rate)), send);
        }
    }

    fn faster(&mut self, send: &mut dyn FnMut(Command)) {
        if let Some(limit) = self.limit().filter(|rate| is_rate(*rate)) {
            let next = step_above(limit);
            // A ceiling the run has never reached is none.
            let useful = self.free_rate.is_none_or(|free| next <= free);
            self.set_limit(useful.then_some(next), send);
        }
    }

    fn set_limit(&mut self, limit: Option<f64>, send: &mut dyn FnMut(Command)) {
        send(Command::LimitTimeRate(limit));
        self.limit_wish = Some(Wish {
            value: limit,
            sequence: self.latest.sequence,
        });
    }
}

fn is_rate(rate: f64) -> bool {
    rate.is_normal() && rate > 0.0
}

/// Next lower number of the row 1, 2, 5, 10, ... ; a number of the row goes to the one before.
pub fn step_below(value: f64) -> f64 {
    let exponent = value.log10().floor() as i32;
    row(exponent)
        .rev()
        .find(|step| *step < value * (1.0 - 1e-9))
        .unwrap_or(value / 2.0)
}

/// Next higher number of that row.
pub fn step_above(value: f64) -> f64 {
    let exponent = value.log10().floor() as i32;
    row(exponent)
        .find(|step| *step > value * (1.0 + 1e-9))
        .unwrap_or(value * 2.0)
}

fn row(exponent: i32) -> impl DoubleEndedIterator<Item = f64> {
    (exponent - 1..=exponent + 1)
        .flat_map(|power| [1.0, 2.0, 5.0].map(|digit| decimal_power(digit, power)))
}

/// `digit * 10^power`, correctly rounded, which a product is not.
fn decimal_power(digit: f64, power: i32) -> f64 {
    format!("{digit}e{power}")
        .parse()
        .expect("a digit and a power of ten make a number")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ceilings_go_down_and_up_the_row_of_one_two_five() {
        assert_eq!(step_below(2.9e-10), 2e-10);
        assert_eq!(step_below(2e-10), 1e-10);
        assert_eq!(step_below(1e-10), 5e-11);
        assert_eq!(step_above(5e-11), 1e-10);
        assert_eq!(step_above(2.9e-10), 5e-10);
        assert_eq!(step_below(1.0), 0.5);
        assert_eq!(step_above(5.0), 10.0);
    }
}
