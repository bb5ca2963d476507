//! The client's own time: monotonic, and the same for all its threads. Only
//! what runs a client reads it; everything else is told the time.

use std::time::{Duration, Instant};

use shadecast_protocol::ClientTime;

/// Counts nanoseconds since it was started.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    start: Instant,
}

impl Clock {
    /// From zero.
    #[must_use]
    pub fn start() -> Self {
        Self {
            start: Instant::now(),
        }
    }

    /// What it shows.
    #[must_use]
    pub fn now(self) -> ClientTime {
        ClientTime(self.start.elapsed().as_nanos() as u64)
    }

    /// Sleeps until `time`, or not at all when it has passed.
    pub fn sleep_until(self, time: ClientTime) {
        let left = time.0.saturating_sub(self.now().0);
        std::thread::sleep(Duration::from_nanos(left));
    }
}
