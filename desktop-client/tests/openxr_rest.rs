//! A client that is paused leaves its server, draws on with what it has, and comes
//! back.

#[allow(dead_code, reason = "other tests need the rest of it")]
mod wall_server;

use std::time::{Duration, Instant};

use shadecast_client::network::Event;
use shadecast_client::openxr::{Headset, HeadsetConfig, api};
use shadecast_client::worn::{HeadsetClient, IDLE, Turn};
use shadecast_client::{OpenH264Decoder, Status};
use shadecast_simulated_runtime::{Image, Runtime, Script};
use wall_server::{Mishap, WallServer};

/// Longest wait for anything.
const PATIENCE: Duration = Duration::from_secs(60);

struct Worn {
    client: HeadsetClient<Headset>,
    runtime: Runtime,
    statuses: Vec<Status>,
    fresh: u32,
}

impl Worn {
    fn turn(&mut self) {
        let statuses = &mut self.statuses;
        let turn = self.client.turn(&mut |event| {
            if let Event::Status(status) = event {
                statuses.push(status.clone());
            }
        });
        match turn.expect("the client goes on") {
            Turn::Frame(frame) => self.fresh += u32::from(frame.fresh),
            _ => self.runtime.pass(IDLE),
        }
        // Virtual frames cost no time, and the network's are real.
        std::thread::sleep(Duration::from_millis(1));
    }

    #[track_caller]
    fn turn_until(&mut self, what: &str, done: impl Fn(&Self) -> bool) {
        let began = Instant::now();
        while !done(self) {
            assert!(began.elapsed() < PATIENCE, "{what}: {:?}", self.statuses);
            self.turn();
        }
    }

    /// What the left eye sees in the next frame.
    fn look(&mut self) -> Image {
        let next = self.runtime.waited() + 1;
        self.runtime.rewrite(|script| script.keep.push(next));
        while self.runtime.waited() <= next {
            self.turn();
        }
        let log = self.runtime.log();
        let (_, [left, _]) = log.images.last().expect("it was kept").clone();
        left
    }
}

/// Pixels that are red.
fn red(image: &Image) -> usize {
    let pixels = image.bytes.chunks_exact(4);
    pixels
        .filter(|pixel| pixel[0] > 150 && pixel[1] < 60 && pixel[2] < 60)
        .count()
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_paused_client_leaves_its_server_keeps_its_world_and_comes_back() {
    let server = WallServer::start(Mishap::HangsUp);
    let mut script = Script::default();
    script.headset.eyes.size = [48; 2];
    let runtime = Runtime::new(script);
    // SAFETY: the simulation answers as OpenXR says.
    let entry = unsafe { api::Entry::from_get_instance_proc_addr(runtime.entry(), &()) };
    let entry = entry.expect("its functions");
    let mut client =
        HeadsetClient::open(|frames| Headset::open(entry, (), HeadsetConfig::default(), frames))
            .expect("a headset");
    let line = server.line.parse().expect("a server's line");
    client
        .connect(line, OpenH264Decoder::new(), 4096)
        .expect("a client");
    let mut worn = Worn {
        client,
        runtime,
        statuses: Vec::new(),
        fresh: 0,
    };
    worn.turn_until("pictures come", |worn| worn.fresh >= 2);
    let before = red(&worn.look());
    assert!(before > 50, "{before}");

    worn.client.set_paused(true);
    worn.turn_until("it rests", |worn| {
        worn.statuses.last() == Some(&Status::Resting)
    });
    let (connections, fresh) = (server.connections(), worn.fresh);
    let began = Instant::now();
    while began.elapsed() < Duration::from_millis(1_500) {
        worn.turn();
    }
    assert_eq!(server.connections(), connections, "it stays away");
    assert!(worn.fresh <= fresh + 1, "but for what was on its way");
    let meanwhile = red(&worn.look());
    assert!(meanwhile > 50, "the world is still there: {meanwhile}");

    worn.client.set_paused(false);
    let fresh = worn.fresh;
    worn.turn_until("it comes back", |worn| worn.fresh >= fresh + 2);
    assert!(server.connections() > connections);
    assert_eq!(worn.runtime.log().broken_rules(), []);
}
