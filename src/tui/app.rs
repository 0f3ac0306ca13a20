//! What the dashboard remembers between frames, and what the keys do to it.
//!
//! Always holds: the screen is a function of this value alone. The run is touched only through the commands handed out here.

mod mouse;
mod reach;

use std::sync::Arc;

use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

use crate::feed::{Access, Command};
use crate::snapshot::{ObservableName, Phase, Snapshot};
use crate::tui::Leave;
use crate::tui::camera::Camera;
use crate::tui::ceiling::{is_rate, step_above, step_below};
use crate::tui::format::{count, quantity};
use crate::tui::help::Help;
use crate::tui::keys::{Action, Keymap};
use crate::tui::link::Link;
use crate::tui::picture::Mode;
use crate::tui::span::Span;
use crate::tui::trails::Trails;
use crate::tui::visit::{Prompt, Visit};

/// A panel over the dashboard.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Overlay {
    /// The keys and what the marks mean.
    Help(Help),
    /// Stop the run and leave?
    QuitQuestion,
    /// To which past time?
    Goto(Prompt),
    /// Why the run failed.
    Failure,
}

/// A panel of the dashboard, by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Panel {
    /// The picture.
    Gas = 1,
    /// The state of the gas.
    Now,
    /// Speeds and their components.
    Speeds,
    /// How the run fares.
    Run,
    /// Charts of every observable.
    History,
    /// What happens how often.
    Events,
    /// The accuracy card.
    Trust,
    /// What watching costs.
    Link,
    /// What is observed on demand.
    Observables,
}

impl Panel {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 9] = [
        Self::Gas,
        Self::Now,
        Self::Speeds,
        Self::Run,
        Self::History,
        Self::Events,
        Self::Trust,
        Self::Link,
        Self::Observables,
    ];

    /// How many stand side by side in a large enough window.
    pub const OVERVIEW: usize = 4;
}

/// Degrees that a picture turns by itself.
const TURN: i32 = 5;

/// What only the terminal's holder can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Write the screen to files.
    Copy,
    /// Draw the whole screen again.
    Redraw,
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
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is a switch of the user's, and any may be on with any other"
)]
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
    /// Whether the picture turns by itself.
    pub turning: bool,
    /// The panel that fills the window.
    pub enlarged: Option<Panel>,
    /// The observable that the keys are for.
    pub observable: ObservableName,
    /// The panel that the tabulator key chose.
    pub chosen: Option<Panel>,
    /// Which part of the history the charts show.
    pub span: Span,
    /// Simulated times that the user marked and the run does not know of yet, or never will.
    own_marks: Vec<f64>,
    /// The past that is shown instead of the run, or is on its way.
    pub visit: Option<Visit>,
    /// Checkpoints written when one more was asked for.
    checkpoint_wish: Option<u64>,
    /// Which key does what.
    pub keymap: Keymap,
    /// Words at the foot until the next key.
    pub message: Option<String>,
    /// What the user asked for and only the terminal's holder can do.
    pub request: Option<Request>,
    failure_shown: bool,
    /// Time rate while no ceiling held the run back.
    free_rate: Option<f64>,
    pause_wish: Option<Wish<bool>>,
    limit_wish: Option<Wish<Option<f64>>>,
    /// Where the pointer was when it last dragged the picture.
    dragged: Option<(u16, u16)>,
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
            turning: false,
            enlarged: None,
            observable: ObservableName::RadialDistribution,
            chosen: None,
            span: Span::default(),
            own_marks: Vec::new(),
            visit: None,
            checkpoint_wish: None,
            keymap: Keymap::default(),
            message: None,
            request: None,
            failure_shown: false,
            free_rate: None,
            pause_wish: None,
            limit_wish: None,
            dragged: None,
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
        let past = self.visit.and(self.latest.past.as_ref());
        self.numbers = past.unwrap_or(&self.latest).clone();
        if picture {
            self.pictured = self.numbers.clone();
            self.trails = match past {
                Some(_) => Trails::default(),
                None => self.newest_trails.clone(),
            };
        }
    }

    /// Simulated times that are marked in the charts.
    pub fn marks(&self) -> Vec<f64> {
        let own = self.own_marks.iter();
        let unknown = own.filter(|mark| !self.latest.marks.contains(mark));
        self.latest.marks.iter().chain(unknown).copied().collect()
    }

    /// Takes in a snapshot; says whether the run's state changed, which is shown at once.
    pub fn observe(&mut self, snapshot: Arc<Snapshot>) -> bool {
        let past = |of: &Snapshot| of.past.as_ref().map(|past| past.phase.clone());
        let new_state = snapshot.phase != self.latest.phase
            || snapshot.reversed != self.latest.reversed
            || self.visit.is_some() && past(&snapshot) != past(&self.latest);
        let before = std::mem::replace(&mut self.latest, snapshot);
        self.tell_news(&before);
        // The panel opens on what is observed, if that is not what was chosen.
        if before.observables.is_empty() && self.latest.observed(self.observable).is_none() {
            let observed = |name: &ObservableName| self.latest.observed(*name).is_some();
            let first = ObservableName::ALL.into_iter().find(observed);
            self.observable = first.unwrap_or(self.observable);
        }
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

    /// Says at the foot what has happened to the run beside its course.
    fn tell_news(&mut self, before: &Snapshot) {
        let latest = &self.latest;
        if let Some(new) = latest
            .warnings
            .last()
            .filter(|_| latest.warnings != before.warnings)
        {
            self.message = Some(format!("warning: {}", new.words));
        }
        if latest.notice.is_some() && latest.notice != before.notice {
            self.message.clone_from(&latest.notice);
        }
        if self
            .checkpoint_wish
            .is_some_and(|before| latest.checkpoints > before)
        {
            self.checkpoint_wish = None;
            let time = quantity(latest.last_checkpoint, "s", latest.scene.units, 4);
            self.message = Some(format!("checkpoint at {time} is on the disk"));
        }
        if let Some(visit) = self.visit
            && let Some(why) = visit.failure(latest)
        {
            self.visit = None;
            self.message = Some(format!("no way back: {why}"));
        }
    }

    /// Obeys a key: hands commands to `send`, and says when it is time to leave.
    pub fn press(&mut self, key: KeyEvent, send: &mut dyn FnMut(Command)) -> Option<Leave> {
        if key.kind == KeyEventKind::Release {
            return None;
        }
        self.message = None;
        let control = key.modifiers.contains(KeyModifiers::CONTROL);
        if control && matches!(key.code, KeyCode::Char('c' | 'C')) {
            return Some(match self.access {
                Access::Owner => Leave::Quit,
                _ => Leave::Detach,
            });
        }
        let action = self.keymap.action(&key);
        match &mut self.overlay {
            Some(Overlay::QuitQuestion) => return self.answer(key.code),
            Some(Overlay::Help(help)) => {
                if !help.press(key.code) {
                    self.overlay = None;
                }
                return None;
            }
            Some(Overlay::Goto(prompt)) => {
                match prompt.press(key.code, &self.latest) {
                    None => {}
                    Some(None) => self.overlay = None,
                    Some(Some(time)) => {
                        self.overlay = None;
                        self.go_to(time, send);
                    }
                }
                return None;
            }
            Some(Overlay::Failure) if action != Some(Action::Quit) => {
                self.overlay = None;
                return None;
            }
            Some(Overlay::Failure) | None => {}
        }
        self.act(action?, send)
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
        if let Some(why) = self.refusal(action) {
            self.message = Some(why.to_owned());
            return None;
        }
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
            Action::Rotate => self.turning = !self.turning,
            Action::Thinner => self.camera.thicken(-1),
            Action::Thicker => self.camera.thicken(1),
            Action::Nearer => self.camera.move_slab(-1),
            Action::Farther => self.camera.move_slab(1),
            Action::ResetCamera => self.camera = Camera::default(),
            Action::Panel(number) => {
                self.enlarge(Panel::ALL.get(usize::from(number.max(1) - 1)).copied())
            }
            Action::NextObservable => self.next_observable(),
            Action::Observe => self.switch_observable(send),
            Action::NextPanel => self.choose(1),
            Action::PreviousPanel => self.choose(-1),
            Action::Enlarge => self.enlarge(self.chosen.or(self.enlarged)),
            Action::Back if (self.enlarged, self.chosen) == (None, None) => self.come_back(send),
            Action::Back => (self.enlarged, self.chosen) = (None, None),
            Action::HistoryLonger => self.span.halve(false),
            Action::HistoryShorter => self.span.halve(true),
            Action::Earlier => self.travel(true),
            Action::Later => self.travel(false),
            Action::Live => {
                self.span.end = None;
                self.come_back(send);
            }
            Action::Mark => self.mark(send),
            Action::Goto => self.overlay = Some(Overlay::Goto(Prompt::default())),
            Action::Checkpoint => {
                self.checkpoint_wish = Some(self.latest.checkpoints);
                self.message = Some("writing a checkpoint".into());
                send(Command::Checkpoint);
            }
            Action::Copy => self.request = Some(Request::Copy),
            Action::Redraw => self.request = Some(Request::Redraw),
            Action::SwitchView => {
                self.mode = match self.mode {
                    Mode::Slab => Mode::Depth,
                    Mode::Depth => Mode::Slab,
                }
            }
            Action::Freeze => self.freeze(),
            Action::Help => self.overlay = Some(Overlay::Help(Help::default())),
            Action::Quit | Action::Detach if !self.going_on() => return Some(Leave::Quit),
            Action::Quit | Action::Detach => return self.leave(action),
        }
        None
    }

    /// Fills the window with a panel, or goes back if it does already.
    fn enlarge(&mut self, panel: Option<Panel>) {
        self.enlarged = panel.filter(|panel| self.enlarged != Some(*panel));
    }

    /// Goes to the next panel: of those side by side the next is chosen, an enlarged one gives way to the next.
    fn choose(&mut self, step: isize) {
        let (place, count) = match (self.enlarged, self.chosen) {
            (Some(panel), _) => (Some(panel), Panel::ALL.len()),
            (None, chosen) => (chosen, Panel::OVERVIEW),
        };
        let place = place.and_then(|panel| Panel::ALL.iter().position(|other| *other == panel));
        let next = match place {
            Some(place) => place.saturating_add_signed(step + count.cast_signed()) % count,
            None if step > 0 => 0,
            None => count - 1,
        };
        if self.enlarged.is_some() {
            self.enlarged = Some(Panel::ALL[next]);
        } else {
            self.chosen = Some(Panel::ALL[next]);
        }
    }

    /// Shows the observables, and chooses the next one if they are shown already.
    fn next_observable(&mut self) {
        if self.enlarged.replace(Panel::Observables) == Some(Panel::Observables) {
            let all = ObservableName::ALL;
            let place = all.iter().position(|name| *name == self.observable);
            self.observable = all[place.map_or(0, |place| (place + 1) % all.len())];
        }
    }

    /// Has the chosen observable observed, or no more, where it can be seen what happens.
    fn switch_observable(&mut self, send: &mut dyn FnMut(Command)) {
        if self.enlarged == Some(Panel::Observables) && self.going_on() {
            let on = self.latest.observed(self.observable).is_some();
            send(Command::Observe(self.observable, !on));
        } else {
            self.enlarged = Some(Panel::Observables);
        }
    }

    fn travel(&mut self, earlier: bool) {
        if let Some(bounds) = self.numbers.history.bounds() {
            self.span.go(earlier, bounds);
        }
    }

    fn mark(&mut self, send: &mut dyn FnMut(Command)) {
        let time = self.numbers.time; // what the user sees
        if !self.marks().contains(&time) {
            self.own_marks.push(time);
            send(Command::Mark(time));
        }
        let shown = quantity(Some(time), "s", self.latest.scene.units, 4);
        self.message = Some(format!(
            "mark {} at {shown}, drawn in the charts",
            count(self.marks().len() as u64)
        ));
    }

    fn go_to(&mut self, time: f64, send: &mut dyn FnMut(Command)) {
        self.frozen = false;
        self.visit = Some(Visit::to(time, self.latest.sequence));
        send(Command::Goto(Some(time)));
    }

    /// Comes back from the past.
    fn come_back(&mut self, send: &mut dyn FnMut(Command)) {
        if self.visit.take().is_some() {
            send(Command::Goto(None));
            self.refresh(true);
        }
    }

    /// Turns the picture a little if it turns by itself.
    pub fn turn_by_itself(&mut self) {
        if self.turning && !self.frozen {
            self.camera.turn(TURN, 0);
        }
    }

    /// Leaves a run that goes on, or asks before.
    fn leave(&mut self, action: Action) -> Option<Leave> {
        match (self.access, action) {
            (Access::ReadOnly | Access::Replay, _) | (Access::Watcher, Action::Detach) => {
                Some(Leave::Detach)
            }
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
