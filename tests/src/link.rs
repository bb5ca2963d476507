//! One direction of a simulated network: each message takes a time of its own,
//! drawn from a seeded generator.

use std::{collections::BTreeMap, time::Duration};

/// What a message's arrival owes to those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// It arrives after all that were sent in order before it, as on a stream.
    InOrder,
    /// It may overtake and be overtaken, as a datagram or a stream of its own.
    Free,
}

/// Messages on their way.
#[derive(Clone, Debug)]
pub struct Link {
    delay: Duration,
    jitter: Duration,
    random: u64,
    /// By arrival, and by sending where two arrive together.
    in_transit: BTreeMap<(Duration, u64), Vec<u8>>,
    sent: u64,
    last_in_order: Duration,
}

impl Link {
    /// A link on which a message takes `delay` and up to `jitter` more.
    #[must_use]
    pub fn new(seed: u64, delay: Duration, jitter: Duration) -> Self {
        Self {
            delay,
            jitter,
            random: seed,
            in_transit: BTreeMap::new(),
            sent: 0,
            last_in_order: Duration::ZERO,
        }
    }

    /// Sends a message at `now`; tells when it will arrive.
    pub fn send(&mut self, now: Duration, order: Order, bytes: Vec<u8>) -> Duration {
        let mut arrival = now + self.delay + self.jitter.mul_f64(self.uniform());
        if order == Order::InOrder {
            arrival = arrival.max(self.last_in_order);
            self.last_in_order = arrival;
        }
        self.in_transit.insert((arrival, self.sent), bytes);
        self.sent += 1;
        arrival
    }

    /// The next message that has arrived by `now`.
    pub fn receive(&mut self, now: Duration) -> Option<Vec<u8>> {
        let first = self.in_transit.first_entry()?;
        (first.key().0 <= now).then(|| first.remove())
    }

    /// The next of SplitMix64's numbers, in [0, 1).
    fn uniform(&mut self) -> f64 {
        self.random = self.random.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.random;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (((z ^ (z >> 31)) >> 11) as f64) / (1_u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    /// Numbered messages, one a millisecond; those that arrived by the end, in order.
    fn arrivals(seed: u64, order: Order) -> Vec<u8> {
        let mut link = Link::new(seed, 5 * MS, 20 * MS);
        for number in 0..100 {
            let now = MS * u32::from(number);
            let arrival = link.send(now, order, vec![number]);
            assert!(arrival >= now + 5 * MS);
        }
        assert_eq!(link.receive(4 * MS), None);
        std::iter::from_fn(|| link.receive(1000 * MS))
            .flatten()
            .collect()
    }

    #[test]
    fn nothing_is_lost_and_order_is_kept_where_it_is_promised() {
        let numbers: Vec<u8> = (0..100).collect();
        assert_eq!(arrivals(1, Order::InOrder), numbers);
        let mut free = arrivals(1, Order::Free);
        assert_ne!(free, numbers);
        free.sort_unstable();
        assert_eq!(free, numbers);
    }

    #[test]
    fn a_seed_is_a_run() {
        assert_eq!(arrivals(7, Order::Free), arrivals(7, Order::Free));
        assert_ne!(arrivals(7, Order::Free), arrivals(8, Order::Free));
    }
}
