//! The runtime's time: virtual, which costs none, or the system's.

use std::time::Duration;

use crate::ClockKind;

/// Nanoseconds of a time that never goes back.
#[derive(Debug)]
pub(crate) enum Clock {
    Virtual(i64),
    System,
}

impl Clock {
    pub(crate) fn new(kind: ClockKind) -> Self {
        match kind {
            // Not zero, which is no time in OpenXR.
            ClockKind::Virtual => Self::Virtual(1_000_000_000),
            ClockKind::System => Self::System,
        }
    }

    pub(crate) fn now(&self) -> i64 {
        match self {
            Self::Virtual(now) => *now,
            Self::System => monotonic(),
        }
    }

    /// Lets time pass until `time`.
    pub(crate) fn wait_until(&mut self, time: i64) {
        match self {
            Self::Virtual(now) => *now = (*now).max(time),
            Self::System => {
                let left = time.saturating_sub(monotonic()).max(0);
                std::thread::sleep(Duration::from_nanos(left as u64));
            }
        }
    }

    /// Lets virtual time pass; the system's does by itself.
    pub(crate) fn pass(&mut self, nanos: i64) {
        if let Self::Virtual(now) = self {
            *now += nanos;
        }
    }
}

fn monotonic() -> i64 {
    let mut time = libc::timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    // SAFETY: `time` is written to and outlives the call.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &mut time) };
    time.tv_sec * 1_000_000_000 + time.tv_nsec
}
