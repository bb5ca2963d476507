//! When a display shows its pictures.

use shadecast_protocol::ClientTime;

/// A display that shows a picture every period, whether there is a new one or not.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DisplayClock {
    period: u64,
    next: ClientTime,
    missed: u64,
}

impl DisplayClock {
    /// Ticks `rate` times a second from `now` on.
    pub(crate) fn new(now: ClientTime, rate: f64) -> Self {
        Self {
            period: (1e9 / rate) as u64,
            next: now,
            missed: 0,
        }
    }

    /// When the next tick is due.
    pub(crate) fn next_tick(&self) -> ClientTime {
        self.next
    }

    /// Begins the tick that is due at `now`; those that have gone by are
    /// missed. The picture that is drawn in a tick is shown at the next one,
    /// whose time is returned.
    pub(crate) fn begin(&mut self, now: ClientTime) -> ClientTime {
        let late = now.0.saturating_sub(self.next.0) / self.period;
        self.missed += late;
        self.next.0 += (late + 1) * self.period;
        self.next
    }

    /// Ticks at which nothing was drawn.
    pub(crate) fn missed(&self) -> u64 {
        self.missed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn ticks_keep_their_places_and_those_gone_by_are_missed() {
        let mut display = DisplayClock::new(ClientTime(100 * MS), 100.0);
        assert_eq!(display.begin(ClientTime(100 * MS)), ClientTime(110 * MS));
        assert_eq!(display.begin(ClientTime(119 * MS)), ClientTime(120 * MS));
        assert_eq!(display.missed(), 0);
        // The ticks at 120 and 130 go by, the one at 140 is drawn late.
        assert_eq!(display.begin(ClientTime(145 * MS)), ClientTime(150 * MS));
        assert_eq!(display.missed(), 2);
        assert_eq!(display.next_tick(), ClientTime(150 * MS));
    }
}
