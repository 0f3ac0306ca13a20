//! What watching costs: bytes on the line, frames that had to be left out, time of the processor.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use rustix::time::{ClockId, clock_gettime};

use crate::feed::Access;

/// What the screen says of itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Link {
    /// Bytes sent per second, lately; `None` in the first second.
    pub bytes_per_s: Option<f64>,
    /// Bytes sent since the start.
    pub bytes: u64,
    /// Frames drawn since the start.
    pub frames: u64,
    /// Frames left out because the terminal had not yet taken the one before.
    pub dropped: u64,
    /// Share of one core that watching takes, lately.
    pub cpu_share: Option<f64>,
    /// Most bytes per second.
    pub budget: f64,
    /// Time from a frame to the terminal's receipt; `None` where it gives none.
    pub round_trip: Option<Duration>,
}

/// How far back "lately" reaches.
const LATELY: Duration = Duration::from_secs(10);

/// Keeps count of what watching costs.
#[derive(Debug)]
pub struct Meter {
    link: Link,
    clock: ClockId,
    /// Moments with the bytes sent and the processor time taken up to then.
    marks: VecDeque<(Instant, u64, Duration)>,
}

impl Meter {
    /// Starts to count; in the run's own process only what this thread takes.
    pub fn new(budget: f64, access: Access, now: Instant) -> Self {
        let clock = match access {
            Access::Owner => ClockId::ThreadCPUTime,
            _ => ClockId::ProcessCPUTime,
        };
        let link = Link {
            budget,
            ..Link::default()
        };
        Self {
            link,
            clock,
            marks: VecDeque::from([(now, 0, processor_time(clock))]),
        }
    }

    /// Notes a frame.
    pub fn drew(&mut self, bytes: usize) {
        self.link.bytes += bytes as u64;
        self.link.frames += u64::from(bytes > 0);
    }

    /// Notes a frame that was due while the terminal had no room for it.
    pub fn dropped(&mut self) {
        self.link.dropped += 1;
    }

    /// The figures now.
    pub fn read(&mut self, now: Instant) -> Link {
        let spent = processor_time(self.clock);
        while self.marks.len() > 1 && now.saturating_duration_since(self.marks[1].0) > LATELY {
            self.marks.pop_front();
        }
        let (since, bytes, time) = self.marks[0];
        let seconds = now.saturating_duration_since(since).as_secs_f64();
        if seconds >= 1.0 {
            self.link.bytes_per_s = Some((self.link.bytes - bytes) as f64 / seconds);
            self.link.cpu_share = Some(spent.saturating_sub(time).as_secs_f64() / seconds);
        }
        self.marks.push_back((now, self.link.bytes, spent));
        self.link
    }
}

/// Processor time so far.
fn processor_time(clock: ClockId) -> Duration {
    let time = clock_gettime(clock);
    Duration::new(
        time.tv_sec.unsigned_abs(),
        time.tv_nsec.unsigned_abs() as u32,
    )
}
