//! What comes in from the terminal: keys, the mouse, and receipts.
//!
//! Always holds: reading never waits, whatever the terminal sends or leaves out. crossterm's own reader waits for ever after a
//! sequence that it does not know, and spins after a hang-up (crossterm#793), so the bytes are read here.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::time::Duration;

use ratatui::crossterm::event::{
    Event, KeyCode, KeyEvent, KeyModifiers, MouseButton, MouseEvent, MouseEventKind,
};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use termina::Parser;
use termina::event as raw;

/// Longest wait for the rest of a sequence that begins as the escape key does.
const ESCAPE: Duration = Duration::from_millis(30);

/// The keyboard's end of a terminal.
pub struct Input {
    terminal: OwnedFd,
    parser: Parser,
}

/// What has come in.
#[derive(Debug, Default)]
pub struct Arrived {
    /// Keys and the mouse, in their order.
    pub events: Vec<Event>,
    /// Whether the terminal said where its cursor is.
    pub receipt: bool,
}

impl Input {
    /// Reads from a non-blocking description of a terminal.
    pub fn new(terminal: OwnedFd) -> Self {
        Self {
            terminal,
            parser: Parser::default(),
        }
    }

    /// What to poll before reading.
    pub fn terminal(&self) -> BorrowedFd<'_> {
        self.terminal.as_fd()
    }

    /// Takes in what is there.
    pub fn read(&mut self) -> Arrived {
        let mut bytes = [0; 1024];
        loop {
            let count = rustix::io::read(&self.terminal, &mut bytes[..]).unwrap_or(0);
            if count == 0 {
                break;
            }
            self.parser.parse(&bytes[..count], true);
            // On its own, an escape is the key; with more to come, it begins a sequence.
            if bytes[count - 1] == 0x1b && !self.more_comes() {
                self.parser.parse(&[], false);
            }
        }
        let mut arrived = Arrived::default();
        while let Some(event) = self.parser.pop() {
            match event {
                termina::Event::Key(key) => arrived.events.extend(key_events(&key)),
                termina::Event::Mouse(mouse) => arrived.events.extend(mouse_event(mouse)),
                termina::Event::Csi(_) => arrived.receipt = true,
                _ => {}
            }
        }
        arrived
    }

    fn more_comes(&self) -> bool {
        let wait = Timespec {
            tv_sec: 0,
            tv_nsec: i64::from(ESCAPE.subsec_nanos()),
        };
        let mut fds = [PollFd::new(&self.terminal, PollFlags::IN)];
        poll(&mut fds, Some(&wait)).is_ok_and(|ready| ready > 0)
    }
}

/// A key as events. A letter that comes with an escape is two keys, pressed one soon after the other: on a slow line, or in
/// haste, a terminal cannot tell that from the letter with Alt, which does nothing here.
fn key_events(key: &raw::KeyEvent) -> Vec<Event> {
    let alt = raw::Modifiers::ALT;
    if !key.modifiers.contains(alt) {
        return key_event(key).into_iter().collect();
    }
    let escape = Event::Key(KeyEvent::new(KeyCode::Esc, KeyModifiers::NONE));
    let bare = raw::KeyEvent {
        modifiers: key.modifiers.difference(alt),
        ..*key
    };
    key_event(&bare).map_or(Vec::new(), |key| vec![escape, key])
}

fn key_event(key: &raw::KeyEvent) -> Option<Event> {
    use raw::KeyCode as Raw;
    let code = match key.code {
        Raw::Char(letter) => KeyCode::Char(letter),
        Raw::Enter => KeyCode::Enter,
        Raw::Backspace => KeyCode::Backspace,
        Raw::Tab => KeyCode::Tab,
        Raw::BackTab => KeyCode::BackTab,
        Raw::Escape => KeyCode::Esc,
        Raw::Left => KeyCode::Left,
        Raw::Right => KeyCode::Right,
        Raw::Up => KeyCode::Up,
        Raw::Down => KeyCode::Down,
        Raw::Home => KeyCode::Home,
        Raw::End => KeyCode::End,
        Raw::PageUp => KeyCode::PageUp,
        Raw::PageDown => KeyCode::PageDown,
        Raw::Insert => KeyCode::Insert,
        Raw::Delete => KeyCode::Delete,
        Raw::Function(number) => KeyCode::F(number),
        _ => return None,
    };
    let pressed = key.kind != raw::KeyEventKind::Release;
    pressed.then(|| Event::Key(KeyEvent::new(code, modifiers(key.modifiers))))
}

fn mouse_event(mouse: raw::MouseEvent) -> Option<Event> {
    let button = |button| match button {
        raw::MouseButton::Left => MouseButton::Left,
        raw::MouseButton::Right => MouseButton::Right,
        raw::MouseButton::Middle => MouseButton::Middle,
    };
    let kind = match mouse.kind {
        raw::MouseEventKind::Down(which) => MouseEventKind::Down(button(which)),
        raw::MouseEventKind::Drag(which) => MouseEventKind::Drag(button(which)),
        raw::MouseEventKind::ScrollUp => MouseEventKind::ScrollUp,
        raw::MouseEventKind::ScrollDown => MouseEventKind::ScrollDown,
        _ => return None,
    };
    Some(Event::Mouse(MouseEvent {
        kind,
        column: mouse.column,
        row: mouse.row,
        modifiers: modifiers(mouse.modifiers),
    }))
}

fn modifiers(raw: raw::Modifiers) -> KeyModifiers {
    let pairs = [
        (raw::Modifiers::SHIFT, KeyModifiers::SHIFT),
        (raw::Modifiers::CONTROL, KeyModifiers::CONTROL),
        (raw::Modifiers::ALT, KeyModifiers::ALT),
    ];
    let held = pairs.into_iter().filter(|(from, _)| raw.contains(*from));
    held.fold(KeyModifiers::NONE, |all, (_, to)| all | to)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::pipe::{PipeFlags, pipe_with};

    /// What a terminal that sends some bytes is taken to say.
    fn arrived(bytes: &[u8]) -> Arrived {
        let (reader, writer) = pipe_with(PipeFlags::NONBLOCK).expect("a pipe");
        rustix::io::write(&writer, bytes).expect("room");
        Input::new(reader).read()
    }

    #[track_caller]
    fn check(bytes: &[u8], code: KeyCode, modifiers: KeyModifiers) {
        let key = Event::Key(KeyEvent::new(code, modifiers));
        assert_eq!(arrived(bytes).events, [key]);
    }

    #[test]
    fn keys_are_what_terminals_send_for_them() {
        check(b"q", KeyCode::Char('q'), KeyModifiers::NONE);
        check("µ".as_bytes(), KeyCode::Char('µ'), KeyModifiers::NONE);
        check(b"\x1b", KeyCode::Esc, KeyModifiers::NONE);
        check(b"\x1b[A", KeyCode::Up, KeyModifiers::NONE);
        check(b"\x1bOD", KeyCode::Left, KeyModifiers::NONE);
        check(b"\x1b[5~", KeyCode::PageUp, KeyModifiers::NONE);
        check(b"\x1b[Z", KeyCode::BackTab, KeyModifiers::SHIFT);
        check(b"\r", KeyCode::Enter, KeyModifiers::NONE);
        check(b"\x03", KeyCode::Char('c'), KeyModifiers::CONTROL);
    }

    #[test]
    fn a_letter_right_after_an_escape_is_a_key_of_its_own() {
        let key = |code| Event::Key(KeyEvent::new(code, KeyModifiers::NONE));
        let both = [key(KeyCode::Esc), key(KeyCode::Char('d'))];
        assert_eq!(arrived(b"\x1bd").events, both);
    }

    #[test]
    fn a_receipt_is_no_key_and_hides_none() {
        let arrived = arrived(b"a\x1b[24;80Rb");
        assert!(arrived.receipt);
        assert_eq!(arrived.events.len(), 2);
    }

    #[test]
    fn the_wheel_is_where_the_pointer_is() {
        let Some(Event::Mouse(mouse)) = arrived(b"\x1b[<64;10;5M").events.pop() else {
            panic!("no mouse")
        };
        assert_eq!((mouse.column, mouse.row), (9, 4));
        assert_eq!(mouse.kind, MouseEventKind::ScrollUp);
    }

    #[test]
    fn any_bytes_are_read_without_waiting() {
        const ALPHABET: &[u8] = b"\x1b[]O<?0123;AMRmu~^P\\\x07\xc3\xff ";
        let mut seed = 7_u64;
        for _ in 0..500 {
            let bytes: Vec<u8> = (0..40)
                .map(|_| {
                    seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                    ALPHABET[(seed >> 40) as usize % ALPHABET.len()]
                })
                .collect();
            arrived(&[&bytes[..], b"q"].concat());
        }
    }
}
