//! A session behind a network that loses, delays, reorders and repeats.

use std::collections::VecDeque;

use proptest::prelude::*;

use super::*;

const TICK: u64 = 10 * MS;

/// What the network does with a message.
#[derive(Clone, Copy, Debug)]
enum Fate {
    Lost,
    Delayed { ticks: u64 },
    Twice { ticks: u64 },
}

fn fate() -> impl Strategy<Value = Fate> {
    prop_oneof![
        1 => Just(Fate::Lost),
        12 => (0_u64..4).prop_map(|ticks| Fate::Delayed { ticks }),
        1 => (4_u64..40).prop_map(|ticks| Fate::Delayed { ticks }),
        2 => (0_u64..9).prop_map(|ticks| Fate::Twice { ticks }),
    ]
}

/// Whether updates share the fate of pictures, or come reliably and in order as
/// on a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Updates {
    AsPictures,
    InOrder,
}

/// Two ends, the network between them, a decoder, and what was seen.
struct Simulation {
    client: Client,
    server: Server,
    updates: Updates,
    downstream: Vec<(u64, ToClient)>,
    /// When requests for a reset reach the server.
    upstream: VecDeque<u64>,
    decoder: VecDeque<(u64, crate::AccessUnit)>,
    decoded: Option<FrameId>,
    shown: Vec<u32>,
    asked_at: Vec<u64>,
}

impl Simulation {
    fn new(updates: Updates) -> Self {
        let mut server = Server::default();
        server.repeats = updates == Updates::AsPictures;
        Self {
            client: Client::welcomed(),
            server,
            updates,
            downstream: Vec::new(),
            upstream: VecDeque::new(),
            decoder: VecDeque::new(),
            decoded: None,
            shown: Vec::new(),
            asked_at: Vec::new(),
        }
    }

    fn tick(&mut self, fates: [Fate; 2], decoding_ticks: u64) {
        self.client.now += TICK;
        let now = self.client.now;
        while self.upstream.pop_front_if(|at| *at <= now).is_some() {
            self.server.reset();
        }
        if (now / TICK).is_multiple_of(3) {
            let (update, picture) = self.server.frame();
            match self.updates {
                Updates::AsPictures => self.send(update, fates[0]),
                Updates::InOrder => self.send(update, Fate::Delayed { ticks: 2 }),
            }
            self.send(picture, fates[1]);
        }

        let mut outputs = self.client.input(Input::Tick);
        let in_transit = std::mem::take(&mut self.downstream).into_iter();
        let (due, later): (Vec<_>, _) = in_transit.partition(|(at, _)| *at <= now);
        self.downstream = later;
        for (_, message) in due {
            outputs.extend(self.client.message(message));
        }
        while let Some((_, unit)) = self.decoder.pop_front_if(|(at, _)| *at <= now) {
            let decoded = self.decode(&unit);
            outputs.extend(self.client.input(Input::Decoded(decoded)));
        }
        self.take(outputs, decoding_ticks);
    }

    fn send(&mut self, message: ToClient, fate: Fate) {
        let now = self.client.now;
        match fate {
            Fate::Lost => {}
            Fate::Delayed { ticks } => self.downstream.push((now + ticks * TICK, message)),
            Fate::Twice { ticks } => {
                self.downstream.push((now, message.clone()));
                self.downstream.push((now + ticks * TICK, message));
            }
        }
    }

    /// A real decoder's demand: an IDR first, then every picture in turn.
    fn decode(&mut self, unit: &crate::AccessUnit) -> Decoded {
        let frame = unit.ticket.frame;
        let follows = self.decoded.is_some_and(|last| last.0 + 1 == frame.0);
        let is_start = self.server.starts_epoch_at(frame);
        assert!(follows || is_start, "frame {frame:?} is fed out of order");
        assert!(!unit.restart || is_start);
        self.decoded = Some(frame);
        Decoded {
            ticket: unit.ticket,
            picture: Ok(picture_of(&unit.bytes).into()),
        }
    }

    fn take(&mut self, outputs: Vec<Output>, decoding_ticks: u64) {
        let now = self.client.now;
        self.shown.extend(self.server.check(&outputs));
        for output in outputs {
            match output {
                Output::Decode(unit) => {
                    self.decoder.push_back((now + decoding_ticks * TICK, unit));
                }
                Output::Send(ToServer::RequestReset(_)) => {
                    self.asked_at.push(now);
                    self.upstream.push_back(now + 3 * TICK);
                }
                Output::Present(_) | Output::Status(_) => {}
                other => panic!("unexpected {other:?}"),
            }
        }
    }
}

fn survives(updates: Updates, fates: &[[Fate; 2]], decoding_ticks: u64) {
    let mut simulation = Simulation::new(updates);
    for &fates in fates {
        simulation.tick(fates, decoding_ticks);
    }
    // A slow update is given up after 2 s, and then a reset is answered.
    let calm = [Fate::Delayed { ticks: 1 }; 2];
    for _ in 0..500 {
        simulation.tick(calm, decoding_ticks);
    }
    let Simulation {
        server,
        shown,
        asked_at,
        ..
    } = simulation;
    assert!(shown.is_sorted_by(|a, b| a < b), "in order and once each");
    let newest = shown.last().copied().unwrap();
    assert!(newest + 5 >= server.frames(), "caught up");
    assert!(
        asked_at
            .windows(2)
            .all(|pair| pair[1] - pair[0] >= 300 * MS)
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn frames_take_effect_whole_and_in_order_whatever_is_lost(
        fates in prop::collection::vec([fate(), fate()], 0..600),
        decoding_ticks in 0_u64..6,
    ) {
        survives(Updates::AsPictures, &fates, decoding_ticks);
    }

    #[test]
    fn geometry_of_lost_frames_is_known_to_later_ones(
        fates in prop::collection::vec([fate(), fate()], 0..600),
        decoding_ticks in 0_u64..6,
    ) {
        survives(Updates::InOrder, &fates, decoding_ticks);
    }
}

#[test]
fn a_perfect_network_loses_no_frame() {
    let mut simulation = Simulation::new(Updates::InOrder);
    for _ in 0..300 {
        simulation.tick([Fate::Delayed { ticks: 1 }; 2], 1);
    }
    let frames = simulation.server.frames();
    assert_eq!(simulation.shown, (0..frames - 1).collect::<Vec<_>>());
    assert!(simulation.asked_at.is_empty());
}
