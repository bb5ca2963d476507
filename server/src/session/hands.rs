//! What a client's controllers do, out of view reports of which any may be lost.

use shadecast_protocol::Hand;

/// A count that grew by more than this between two reports began anew: nobody
/// presses that fast.
const MOST_AT_ONCE: u16 = 100;

/// Both controllers. Left, then right.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hands {
    /// As the newest report has them; none for one that is not there.
    pub now: [Option<Hand>; 2],
    /// How often each button was pressed since the session began.
    pub presses: [u64; 2],
    /// The counts that were told last.
    told: [Option<u16>; 2],
}

impl Hands {
    /// Takes what a report says.
    pub(super) fn take(&mut self, now: [Option<Hand>; 2]) {
        self.now = now;
        for (side, hand) in now.into_iter().enumerate() {
            let Some(hand) = hand else { continue };
            // Before the first report there was no press, whatever the count is: a
            // client that comes back counts on.
            let before = self.told[side].replace(hand.presses);
            let grown = hand.presses.wrapping_sub(before.unwrap_or(hand.presses));
            let new = if grown > MOST_AT_ONCE {
                hand.presses
            } else {
                grown
            };
            self.presses[side] += u64::from(new);
        }
    }
}

#[cfg(test)]
mod tests {
    use shadecast_protocol::Pose;

    use super::*;

    fn right(presses: u16) -> [Option<Hand>; 2] {
        let hand = Hand {
            world_from_aim: Pose::IDENTITY,
            pressed: false,
            presses,
        };
        [None, Some(hand)]
    }

    #[test]
    fn presses_are_counted_across_lost_reports_pauses_and_wraps() {
        let mut hands = Hands::default();
        let mut after = |now| {
            hands.take(now);
            hands.presses
        };
        assert_eq!(after(right(u16::MAX - 1)), [0, 0], "of before");
        assert_eq!(after(right(u16::MAX)), [0, 1]);
        assert_eq!(after(right(2)), [0, 4], "two reports were lost");
        assert_eq!(after([None; 2]), [0, 4], "it was put down");
        assert_eq!(after(right(2)), [0, 4]);
        assert_eq!(after(right(0)), [0, 4], "the client counts anew");
        assert_eq!(after(right(1)), [0, 5]);
    }
}
