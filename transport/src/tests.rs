//! Both ends over loopback, and each end against a peer that misbehaves.

mod exchange;
mod hostile;

use std::{future::Future, net::SocketAddr, time::Duration};

use glam::Vec3;
use shadecast_protocol::{
    ClientTime, Codec, Epoch, EyeView, Fov, FrameId, Hello, Method, Picture, Pose, Secret, Sky,
    ToServer, Update, UpdateTiming, ViewReport, ViewSeq, Welcome,
};
use tokio::time::timeout;

use crate::{ClientEnd, Identity, Listener, ServerEnd};

/// Far more than anything here takes; a test that hangs fails instead.
const PATIENCE: Duration = Duration::from_secs(20);

async fn soon<T>(what: impl Future<Output = T>) -> T {
    timeout(PATIENCE, what).await.expect("does not hang")
}

fn loopback() -> SocketAddr {
    "127.0.0.1:0".parse().unwrap()
}

fn listener() -> Listener {
    Listener::bind(loopback(), &Identity::ephemeral().unwrap()).unwrap()
}

/// Two ends after the client's hello.
async fn pair() -> (Listener, ServerEnd, ClientEnd) {
    let listener = listener();
    let client = soon(ClientEnd::connect(&listener.line())).await.unwrap();
    client.send(&hello(&listener)).await.unwrap();
    let server = soon(listener.accept()).await.unwrap();
    let first = soon(server.receive()).await.unwrap();
    assert_eq!(first, hello(&listener));
    (listener, server, client)
}

fn hello(listener: &Listener) -> ToServer {
    hello_with(listener.line().secret)
}

fn hello_with(secret: Secret) -> ToServer {
    ToServer::Hello(Hello {
        secret,
        max_atlas_side: 4096,
        codecs: vec![Codec::H264],
    })
}

fn welcome() -> Welcome {
    Welcome {
        codec: Codec::H264,
        method: Method::Sas,
        atlas_size: [512, 512],
        superblock: 64,
        world_from_play: Pose::IDENTITY,
        sky: Sky {
            width: 256,
            height: 128,
            rgb: vec![200; 3 * 256 * 128],
        },
    }
}

fn view(seq: u32) -> ToServer {
    let eye = EyeView {
        head_from_eye: Pose::IDENTITY,
        fov: Fov::symmetric(1.5),
    };
    ToServer::View(ViewReport {
        seq: ViewSeq(seq),
        sampled_at: ClientTime(1_000),
        display_at: ClientTime(2_000),
        world_from_head: Pose::IDENTITY,
        linear_velocity: Vec3::ZERO,
        angular_velocity: Vec3::Y,
        eyes: [eye, eye],
        eye_resolution: [256, 256],
        hands: [None; 2],
    })
}

fn update(frame: u32) -> Update {
    Update {
        frame: FrameId(frame),
        epoch: Epoch(0),
        timing: UpdateTiming::default(),
        world_from_head: Pose::IDENTITY,
        scene_time: 0,
        objects_lead: 0,
        vertices: vec![],
        patches: vec![],
        removals: vec![],
        placements: vec![],
        masks: vec![],
        motions: vec![],
    }
}

fn picture(frame: u32, size: usize) -> Picture {
    Picture {
        frame: FrameId(frame),
        epoch: Epoch(0),
        idr: frame == 0,
        bytes: (0..size).map(|i| (i * 31 + frame as usize) as u8).collect(),
    }
}
