//! How far the two clocks are apart.
//!
//! Every reply of the server brackets the offset between the clocks to within
//! half of its round trip, as in NTP (RFC 5905, section 8): the true offset
//! lies in `offset ± round_trip / 2` whatever the two directions took. The
//! sample of the shortest round trip in a window is the estimate. Samples whose
//! brackets do not meet contradict each other: one of them is wrong, or a clock
//! jumped. A few contradictions in a row that agree among themselves are a jump.

use std::collections::VecDeque;

use shadecast_protocol::{ClientTime, ClockReply};

/// Samples kept. With a reply a display frame this is about a second.
const WINDOW_SAMPLES: usize = 64;

/// Older samples are forgotten: at a drift of 50 ppm, which is poor for a
/// quartz, an offset is off by half a millisecond after this long.
const WINDOW_NANOS: u64 = 10_000_000_000;

/// How far two brackets may miss each other before they contradict: drift over
/// the window and the coarseness of clocks.
const SLACK_NANOS: i64 = 1_000_000;

/// Contradicting samples in a row that make a jump. One or two are a broken
/// reply; at a reply a display frame, five are still found within 0.2 s.
const JUMP_SAMPLES: usize = 5;

/// The offset between the client's and the server's clock, from samples.
#[derive(Clone, Debug, Default)]
pub struct ClockEstimate {
    samples: VecDeque<Sample>,
    /// The latest samples, if they contradict all of `samples`.
    suspects: VecDeque<Sample>,
}

#[derive(Clone, Copy, Debug)]
struct Sample {
    sent: ClientTime,
    received: ClientTime,
    client_minus_server: i64,
    round_trip: i64,
}

impl ClockEstimate {
    /// Takes the server's reply, which arrived at `now`.
    ///
    /// Impossible replies (answering the future, held longer than the round
    /// trip took) and repeated ones are ignored.
    pub fn add(&mut self, now: ClientTime, reply: ClockReply) {
        let Some(sample) = Sample::new(now, reply) else {
            return;
        };
        let mut known = self.samples.iter().chain(&self.suspects);
        if known.any(|known| known.sent == sample.sent) {
            return;
        }
        let fresh_since = now.0.saturating_sub(WINDOW_NANOS);
        self.samples.retain(|old| old.received.0 >= fresh_since);

        match self.best() {
            Some(best) if best.contradicts(&sample) => self.suspect(sample),
            _ => {
                self.suspects.clear();
                self.samples.push_back(sample);
                if self.samples.len() > WINDOW_SAMPLES {
                    self.samples.pop_front();
                }
            }
        }
    }

    /// Nanoseconds to add to a server time to get a client time; none before
    /// the first reply.
    #[must_use]
    pub fn client_minus_server(&self) -> Option<i64> {
        self.best().map(|sample| sample.client_minus_server)
    }

    /// Round trip of the sample that the estimate rests on, nanoseconds; the
    /// estimate is wrong by at most half of it.
    #[must_use]
    pub fn round_trip(&self) -> Option<u64> {
        self.best().map(|sample| sample.round_trip.unsigned_abs())
    }

    fn best(&self) -> Option<&Sample> {
        self.samples.iter().min_by_key(|sample| sample.round_trip)
    }

    fn suspect(&mut self, sample: Sample) {
        if self.suspects.iter().any(|old| old.contradicts(&sample)) {
            self.suspects.clear();
        }
        self.suspects.push_back(sample);
        if self.suspects.len() >= JUMP_SAMPLES {
            self.samples = std::mem::take(&mut self.suspects);
        }
    }
}

impl Sample {
    fn new(now: ClientTime, reply: ClockReply) -> Option<Self> {
        let [sent, server_received, server_sent, received] = [
            reply.client_sent.0,
            reply.server_received.0,
            reply.server_sent.0,
            now.0,
        ]
        .map(i128::from);
        let held = server_sent - server_received;
        let round_trip = received - sent - held;
        if held < 0 || round_trip < 0 || received < sent {
            return None;
        }
        let client_minus_server = (sent - server_received + received - server_sent) / 2;
        Some(Self {
            sent: reply.client_sent,
            received: now,
            client_minus_server: i64::try_from(client_minus_server).ok()?,
            round_trip: i64::try_from(round_trip).ok()?,
        })
    }

    fn contradicts(&self, other: &Self) -> bool {
        let reach = self.round_trip / 2 + other.round_trip / 2;
        let apart = self.client_minus_server.abs_diff(other.client_minus_server);
        apart > (reach.saturating_add(SLACK_NANOS)).unsigned_abs()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use shadecast_protocol::ServerTime;

    use super::*;

    const MS: u64 = 1_000_000;
    /// What the server's clock shows more than the client's.
    const SERVER_AHEAD: u64 = 7_000 * MS;

    /// A reply that was sent at `at`, took `up` to the server and `down` back.
    fn exchange(clock: &mut ClockEstimate, at: u64, up: u64, down: u64, server_ahead: u64) {
        let held = MS / 2;
        let reply = ClockReply {
            client_sent: ClientTime(at),
            server_received: ServerTime(at + up + server_ahead),
            server_sent: ServerTime(at + up + held + server_ahead),
        };
        clock.add(ClientTime(at + up + held + down), reply);
    }

    fn error(clock: &ClockEstimate, server_ahead: u64) -> u64 {
        let offset = clock.client_minus_server().unwrap();
        offset.abs_diff(-(server_ahead as i64))
    }

    proptest! {
        #[test]
        fn is_within_half_the_shortest_round_trip(
            trips in prop::collection::vec((MS..200 * MS, MS..200 * MS), 1..300),
        ) {
            let mut clock = ClockEstimate::default();
            for (tick, &(up, down)) in trips.iter().enumerate() {
                exchange(&mut clock, tick as u64 * 11 * MS, up, down, SERVER_AHEAD);
            }
            let latest = &trips[trips.len().saturating_sub(WINDOW_SAMPLES)..];
            let shortest = latest.iter().map(|(up, down)| up + down).min().unwrap();
            prop_assert!(error(&clock, SERVER_AHEAD) <= shortest / 2 + 1);
            prop_assert_eq!(clock.round_trip(), Some(shortest));
        }

        #[test]
        fn any_reply_is_survived(
            replies in prop::collection::vec((any::<u64>(), any::<u64>(), any::<u64>(), any::<u64>()), 0..200),
        ) {
            let mut clock = ClockEstimate::default();
            for (now, sent, received, replied) in replies {
                clock.add(ClientTime(now), ClockReply {
                    client_sent: ClientTime(sent),
                    server_received: ServerTime(received),
                    server_sent: ServerTime(replied),
                });
            }
            prop_assert!(clock.samples.len() <= WINDOW_SAMPLES);
            prop_assert!(clock.suspects.len() < JUMP_SAMPLES);
        }
    }

    #[test]
    fn knows_nothing_at_first() {
        assert_eq!(ClockEstimate::default().client_minus_server(), None);
    }

    #[test]
    fn impossible_and_repeated_replies_are_ignored() {
        let mut clock = ClockEstimate::default();
        let reply = |sent, received, replied| ClockReply {
            client_sent: ClientTime(sent),
            server_received: ServerTime(received),
            server_sent: ServerTime(replied),
        };
        clock.add(ClientTime(5), reply(6, 0, 0));
        clock.add(ClientTime(5), reply(0, 9, 8));
        clock.add(ClientTime(5), reply(0, 0, 6));
        clock.add(ClientTime(u64::MAX), reply(0, 0, 0));
        assert_eq!(clock.client_minus_server(), None);
        clock.add(ClientTime(10), reply(0, 5, 5));
        clock.add(ClientTime(1), reply(0, 0, 0));
        assert_eq!(clock.round_trip(), Some(10), "the repeated one is ignored");
    }

    #[test]
    fn an_exchange_without_duration_is_exact() {
        let mut clock = ClockEstimate::default();
        exchange(&mut clock, 50 * MS, 0, 0, SERVER_AHEAD);
        assert_eq!(error(&clock, SERVER_AHEAD), 0);
    }

    #[test]
    fn lone_outliers_change_nothing() {
        let mut clock = ClockEstimate::default();
        for tick in 0..60 {
            let lie = if tick % 3 == 2 { 500 * MS } else { 0 };
            exchange(&mut clock, tick * 11 * MS, MS, MS, SERVER_AHEAD + lie);
        }
        assert!(error(&clock, SERVER_AHEAD) <= MS);
    }

    #[test]
    fn a_jump_is_followed() {
        let mut clock = ClockEstimate::default();
        for tick in 0..60 {
            exchange(&mut clock, tick * 11 * MS, MS, MS, SERVER_AHEAD);
        }
        for tick in 60..66 {
            exchange(&mut clock, tick * 11 * MS, MS, MS, 2 * SERVER_AHEAD);
        }
        assert!(error(&clock, 2 * SERVER_AHEAD) <= MS);
    }

    #[test]
    fn drift_is_followed() {
        let mut clock = ClockEstimate::default();
        let ahead = |at: u64| SERVER_AHEAD + at / 20_000; // 50 ppm
        for tick in 0..6_000 {
            let at = tick * 11 * MS;
            exchange(&mut clock, at, MS, MS, ahead(at));
        }
        assert!(error(&clock, ahead(66_000 * MS)) <= MS);
    }
}
