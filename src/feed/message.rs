//! What a run and its watchers say to one another, and how it becomes bytes.
//!
//! A message is its length (four bytes, little endian) and that many bytes of postcard. A watcher asks for each snapshot with
//! [`Request::Next`] and gets the newest one as soon as there is a new one: whoever does not ask costs nothing, and nothing
//! queues. Large parts of a snapshot that the watcher has already stay out of it.

use std::io::{self, Read};
use std::sync::Arc;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::Command;
use crate::snapshot::{History, Observed, Sample, SceneCard, Snapshot, Speeds, Stretch};

/// Number of the messages' layout: both sides must have the same.
///
/// Grows with every change of a message or of anything in a [`Snapshot`]; `Hello` and `Refused` never change.
pub const PROTOCOL: u32 = 4;

/// Longest message that is accepted \[bytes\].
const LONGEST: usize = 64 << 20;

/// What a watcher says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Request {
    /// The first message.
    Hello {
        /// The watcher's [`PROTOCOL`].
        protocol: u32,
        /// Whether it will only look: its commands are not obeyed.
        read_only: bool,
    },
    /// The next snapshot, please.
    Next,
    /// A wish.
    Obey(Command),
}

/// What a run says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Reply {
    /// The watcher is not welcome, and why.
    Refused(String),
    /// The newest snapshot.
    News(Box<Frame>),
    /// The run has ended; the last message.
    Ended(Ending),
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ending {
    /// Exit code of the run.
    pub code: u8,
    /// The summary in a few lines for people.
    pub summary: String,
    /// Outputs that could not be written, a line each.
    pub failures: Vec<String>,
}

/// A snapshot without the parts that its receiver has.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    small: Snapshot,
    scene: Part<Arc<SceneCard>>,
    speeds: Part<Option<Arc<Speeds>>>,
    history: Grown,
    observables: Part<Arc<Vec<Observed>>>,
    sample: Part<Option<Arc<Sample>>>,
    past: Option<Box<Frame>>,
}

/// A large part of a snapshot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Part<T> {
    /// As it was.
    Same,
    New(T),
}

impl<T: Clone + Default> Part<T> {
    /// What of `now` differs from `before`, by their identities.
    fn between<K: PartialEq>(before: Option<&T>, now: &T, identity: fn(&T) -> K) -> Self {
        if before.map(identity) == Some(identity(now)) {
            Self::Same
        } else {
            Self::New(now.clone())
        }
    }

    fn after(self, before: Option<&T>) -> T {
        match self {
            Self::Same => before.cloned().unwrap_or_default(),
            Self::New(value) => value,
        }
    }
}

/// A history that only grows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Grown {
    /// By these stretches.
    By(Vec<Stretch>),
    /// By more than is known one by one: all of it.
    Whole(Arc<History>),
}

impl Grown {
    fn between(before: Option<&Snapshot>, now: &Snapshot) -> Self {
        let new = before.and_then(|before| now.history.since(before.history.pushed()));
        new.map_or_else(|| Self::Whole(Arc::clone(&now.history)), Self::By)
    }

    fn after(self, before: Option<&Snapshot>) -> Arc<History> {
        match self {
            Self::Whole(history) => history,
            Self::By(stretches) => {
                let mut history = before.map(|it| Arc::clone(&it.history)).unwrap_or_default();
                if !stretches.is_empty() {
                    let grown = Arc::make_mut(&mut history);
                    for stretch in stretches {
                        grown.push(stretch);
                    }
                }
                history
            }
        }
    }
}

impl Frame {
    /// What of `now` a receiver of `before` does not have.
    pub fn between(before: Option<&Snapshot>, now: &Snapshot) -> Self {
        let mut sample = Part::between(old_sample(before), &now.sample, |part| {
            part.as_ref().map(Arc::as_ptr)
        });
        if let (Part::New(Some(new)), Some(Some(old))) = (&mut sample, old_sample(before))
            && (&new.radii, &new.names) == (&old.radii, &old.names)
        {
            // The balls are the same, and only where they are is new.
            *new = Arc::new(Sample {
                positions: new.positions.clone(),
                radii: Vec::new(),
                names: Vec::new(),
            });
        }
        Self {
            small: now.clone(),
            scene: Part::between(before.map(|it| &it.scene), &now.scene, Arc::as_ptr),
            speeds: Part::between(before.map(|it| &it.speeds), &now.speeds, |part| {
                part.as_ref().map(Arc::as_ptr)
            }),
            history: Grown::between(before, now),
            observables: Part::between(
                before.map(|it| &it.observables),
                &now.observables,
                Arc::as_ptr,
            ),
            sample,
            past: (now.past.as_ref()).map(|past| Box::new(Self::between(old_past(before), past))),
        }
    }

    /// The same, with how many processes watch.
    #[must_use]
    pub fn with_watchers(mut self, count: u32) -> Self {
        self.small.watchers = Some(count);
        self
    }

    /// The whole snapshot, for a receiver of `before`.
    pub fn after(self, before: Option<&Snapshot>) -> Snapshot {
        let mut sample = self.sample.after(old_sample(before));
        if let (Some(new), Some(Some(old))) = (&mut sample, old_sample(before))
            && new.radii.is_empty()
        {
            let new = Arc::make_mut(new);
            new.radii.clone_from(&old.radii);
            new.names.clone_from(&old.names);
        }
        Snapshot {
            scene: self.scene.after(before.map(|it| &it.scene)),
            speeds: self.speeds.after(before.map(|it| &it.speeds)),
            history: self.history.after(before),
            observables: self.observables.after(before.map(|it| &it.observables)),
            sample,
            past: (self.past).map(|past| Arc::new(past.after(old_past(before)))),
            ..self.small
        }
    }
}

fn old_sample(before: Option<&Snapshot>) -> Option<&Option<Arc<Sample>>> {
    before.map(|it| &it.sample)
}

fn old_past(before: Option<&Snapshot>) -> Option<&Snapshot> {
    before.and_then(|it| it.past.as_deref())
}

/// A message as bytes.
///
/// # Panics
/// Never: messages are bounded, and far below four gigabytes.
pub fn encode<T: Serialize>(message: &T) -> Vec<u8> {
    let bytes = postcard::to_extend(message, vec![0; 4]);
    let mut bytes = bytes.expect("memory takes every message");
    let length = u32::try_from(bytes.len() - 4).expect("a message is bounded");
    bytes[..4].copy_from_slice(&length.to_le_bytes());
    bytes
}

/// The next message of a stream that waits.
///
/// # Errors
/// What the stream answers; `InvalidData` for a message that is none.
pub fn read<T: DeserializeOwned>(stream: &mut impl Read) -> io::Result<T> {
    let mut length = [0; 4];
    stream.read_exact(&mut length)?;
    let length = checked(length)?;
    let mut bytes = Vec::new();
    if stream.take(length as u64).read_to_end(&mut bytes)? < length {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    decode(&bytes)
}

/// Takes the first message out of bytes that have arrived so far; `None` if it is not complete.
///
/// # Errors
/// `InvalidData` for a message that is none, or longer than `longest`.
pub fn take<T: DeserializeOwned>(arrived: &mut Vec<u8>, longest: usize) -> io::Result<Option<T>> {
    let Some((head, rest)) = arrived.split_first_chunk::<4>() else {
        return Ok(None);
    };
    let length = checked(*head)?;
    if length > longest {
        return Err(io::ErrorKind::InvalidData.into());
    }
    let Some(body) = rest.get(..length) else {
        return Ok(None);
    };
    let message = decode(body)?;
    arrived.drain(..4 + length);
    Ok(Some(message))
}

fn checked(length: [u8; 4]) -> io::Result<usize> {
    let length = u32::from_le_bytes(length) as usize;
    (length <= LONGEST)
        .then_some(length)
        .ok_or_else(|| io::ErrorKind::InvalidData.into())
}

fn decode<T: DeserializeOwned>(bytes: &[u8]) -> io::Result<T> {
    postcard::from_bytes(bytes).map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))
}

#[cfg(test)]
mod tests {
    use serde_reflection::{Samples, Tracer, TracerConfig};

    use super::*;
    use crate::snapshot::{Boundary, ObservableName, Phase, Units};

    fn sample(x: f32) -> Arc<Sample> {
        Arc::new(Sample {
            positions: vec![[x; 3]],
            radii: vec![0.5],
            names: vec!["pollen".to_owned()],
        })
    }

    /// Sends `now` as bytes to a receiver of `before`; gives back what arrives and how many bytes that took.
    fn sent(before: Option<&Snapshot>, now: &Snapshot) -> (Snapshot, usize) {
        let bytes = encode(&Frame::between(before, now));
        let frame: Frame = read(&mut bytes.as_slice()).expect("a good message");
        (frame.after(before), bytes.len())
    }

    #[test]
    fn a_snapshot_arrives_whole_and_what_is_known_is_not_sent_again() {
        let scene = SceneCard {
            title: "a long title".repeat(1000),
            ..SceneCard::default()
        };
        let mut first = Snapshot::starting(Arc::new(scene), "event", Some(2.5));
        first.sample = Some(sample(1.0));
        first.speeds = Some(Arc::new(Speeds {
            bin_width: 0.1,
            counts: vec![3; 1000],
            maxwell: vec![2.5; 1000],
            ks: 0.1,
            ks_critical: 0.2,
            ..Speeds::default()
        }));
        let (there, size) = sent(None, &first);
        assert_eq!(there, first);
        assert!(size > 20_000);
        // What arrives is what the sender believes it to be, also over several frames.
        let mut history = History::clone(&first.history);
        history.push(Stretch::new(0.0, 1.0, 0.5));
        let mut next = Snapshot {
            history: Arc::new(history),
            sequence: 1,
            sample: Some(sample(2.0)),
            ..first.clone()
        };
        let (there, size) = sent(Some(&first), &next);
        assert_eq!(there, next);
        assert!(size < 600, "{size}");
        next.sample = None;
        next.speeds = None;
        assert_eq!(sent(Some(&first), &next).0, next);
    }

    /// The shape of everything that is said, as one number.
    ///
    /// Source: FNV-1a (Fowler, Noll, Vo; RFC 9923).
    fn shape() -> u64 {
        let mut tracer = Tracer::new(TracerConfig::default());
        let samples = Samples::new();
        // Not the frame itself: its parts are of one name and several types.
        let whole = "it has a shape";
        tracer.trace_type::<Request>(&samples).expect(whole);
        tracer.trace_type::<Command>(&samples).expect(whole);
        tracer.trace_type::<ObservableName>(&samples).expect(whole);
        tracer.trace_type::<Ending>(&samples).expect(whole);
        tracer.trace_type::<Snapshot>(&samples).expect(whole);
        tracer.trace_type::<Phase>(&samples).expect(whole);
        tracer.trace_type::<SceneCard>(&samples).expect(whole);
        tracer.trace_type::<Units>(&samples).expect(whole);
        tracer.trace_type::<Boundary>(&samples).expect(whole);
        tracer.trace_type::<Speeds>(&samples).expect(whole);
        tracer.trace_type::<History>(&samples).expect(whole);
        tracer.trace_type::<Observed>(&samples).expect(whole);
        tracer.trace_type::<Sample>(&samples).expect(whole);
        let registry = format!("{:?}", tracer.registry().expect("all of it is known"));
        (registry.bytes()).fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        })
    }

    #[test]
    fn whoever_changes_a_message_raises_the_protocol() {
        assert_eq!(
            (PROTOCOL, shape()),
            (4, 14_701_740_361_899_684_964),
            "a request or a part of a snapshot has changed: raise PROTOCOL, then note number and shape here"
        );
    }

    #[test]
    fn messages_come_out_of_any_pieces_and_rubbish_is_refused() {
        let message = Request::Obey(Command::LimitTimeRate(Some(1e-9)));
        let bytes = [encode(&Request::Next), encode(&message)].concat();
        let mut arrived = Vec::new();
        let mut taken = Vec::new();
        for byte in bytes {
            arrived.push(byte);
            taken.extend(take::<Request>(&mut arrived, 100).expect("good messages"));
        }
        assert_eq!(taken, [Request::Next, message]);
        assert!(take::<Request>(&mut vec![1, 0, 0, 0, 99], 100).is_err());
        assert!(take::<Request>(&mut vec![200, 0, 0, 0], 100).is_err());
        assert!(read::<Reply>(&mut [255; 100].as_slice()).is_err());
        assert!(read::<Reply>(&mut [9, 0, 0, 0, 1].as_slice()).is_err());
    }
}
