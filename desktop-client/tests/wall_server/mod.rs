//! A server whose scene is one red wall under a blue sky, and which fails in a
//! chosen way after a second.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use glam::{Quat, Vec3};
use openh264::encoder::Encoder;
use openh264::formats::YUVBuffer;
use shadecast_protocol::{
    Block, ClientTime, ClockReply, Codec, Epoch, FrameId, Level, Method, ObjectId, PatchGeometry,
    PatchId, PatchShape, Picture, Placement, Pose, Refusal, ServerTime, Sky, Slot, ToClient,
    ToServer, Update, UpdateTiming, Vertex, VertexId, ViewReport, Welcome,
};
use shadecast_transport::{Identity, Listener, ServerEnd, TransportError};

/// Atlas side, which the wall's block fills.
const LOG2_SIDE: u8 = 6;
const BETWEEN_UPDATES: Duration = Duration::from_millis(100);
const UNTIL_MISHAP: Duration = Duration::from_secs(1);

/// What befalls the first connection.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Mishap {
    /// It is closed, as by a server that restarts.
    HangsUp,
    /// The whole server stands still for two seconds.
    Stalls,
}

/// Serves until the test ends.
pub(crate) struct WallServer {
    /// What a client is started with.
    pub(crate) line: String,
    connections: Arc<AtomicU32>,
}

impl WallServer {
    pub(crate) fn start(mishap: Mishap) -> Self {
        let (sender, line) = mpsc::channel();
        let connections = Arc::<AtomicU32>::default();
        let counter = Arc::clone(&connections);
        std::thread::spawn(move || {
            tokio::runtime::Builder::new_current_thread()
                .enable_all()
                .build()
                .expect("a runtime")
                .block_on(serve(&sender, &counter, mishap));
        });
        Self {
            line: line.recv().expect("the server listens"),
            connections,
        }
    }

    /// Clients that it has welcomed.
    pub(crate) fn connections(&self) -> u32 {
        self.connections.load(Relaxed)
    }
}

async fn serve(line: &mpsc::Sender<String>, connections: &AtomicU32, mishap: Mishap) {
    let identity = Identity::ephemeral().expect("an identity");
    let listener = Listener::bind(([127, 0, 0, 1], 0).into(), &identity).expect("a port is free");
    let secret = listener.line().secret;
    line.send(listener.line().to_string())
        .expect("the test waits");
    while let Some(client) = listener.accept().await {
        let Ok(ToServer::Hello(hello)) = client.receive().await else {
            continue;
        };
        if hello.secret.matches(&secret) {
            let first = connections.fetch_add(1, Relaxed) == 0;
            // It ends when the client leaves or is left.
            let _ = stream(&client, first.then_some(mishap)).await;
        } else {
            let _ = client.send(&ToClient::Refused(Refusal::Secret)).await;
        }
        client.close("over");
        client.closed().await;
    }
}

async fn stream(client: &ServerEnd, mut mishap: Option<Mishap>) -> Result<(), TransportError> {
    client.send(&ToClient::Welcome(welcome())).await?;
    let start = Instant::now();
    let now = || ServerTime(start.elapsed().as_nanos() as u64);
    let mut encoder = Encoder::new().expect("an encoder");
    let mut tick = tokio::time::interval(BETWEEN_UPDATES);
    let mut view = None;
    let mut next = FrameId(0);
    loop {
        if start.elapsed() > UNTIL_MISHAP {
            match mishap.take() {
                Some(Mishap::HangsUp) => return Ok(()),
                Some(Mishap::Stalls) => std::thread::sleep(Duration::from_secs(2)),
                None => {}
            }
        }
        tokio::select! {
            message = client.receive() => match message? {
                ToServer::View(report) => {
                    let received = now();
                    client.send(&ToClient::Clock(ClockReply {
                        client_sent: report.sampled_at,
                        server_received: received,
                        server_sent: now(),
                    })).await?;
                    view = Some((report, received));
                }
                ToServer::Bye => return Ok(()),
                _ => {}
            },
            _ = tick.tick() => {
                client.send(&ToClient::Update(update(next, view, now()))).await?;
                client.send(&ToClient::Picture(picture(&mut encoder, next))).await?;
                next.0 += 1;
            }
        }
    }
}

fn welcome() -> Welcome {
    Welcome {
        codec: Codec::H264,
        method: Method::Sas,
        atlas_size: [1 << LOG2_SIDE; 2],
        superblock: 1 << LOG2_SIDE,
        world_from_play: Pose::IDENTITY,
        sky: Sky {
            width: 2,
            height: 1,
            rgb: [0, 128, 255].repeat(2),
        },
    }
}

/// The first frame brings the wall; all are made for a head that looks away
/// from it.
fn update(frame: FrameId, view: Option<(ViewReport, ServerTime)>, now: ServerTime) -> Update {
    let mut update = Update {
        frame,
        epoch: Epoch(0),
        timing: UpdateTiming {
            view: view.map_or_else(Default::default, |(report, _)| report.seq),
            view_sampled: view.map_or(ClientTime(0), |(report, _)| report.sampled_at),
            view_received: view.map_or(now, |(_, received)| received),
            started: now,
            finished: now,
        },
        world_from_head: Pose {
            position: Vec3::new(0.0, 1.6, 0.0),
            orientation: Quat::from_rotation_y(std::f32::consts::PI),
        },
        scene_time: now.0,
        objects_lead: 0,
        vertices: vec![],
        patches: vec![],
        removals: vec![],
        placements: vec![],
        masks: vec![],
        motions: vec![],
    };
    if frame == FrameId(0) {
        let corners = [(-1.0, 0.6), (1.0, 0.6), (1.0, 2.6), (-1.0, 2.6)];
        update.vertices = (0..)
            .zip(corners)
            .map(|(id, (x, y))| Vertex {
                id: VertexId(id),
                position: Vec3::new(x, y, -2.0),
            })
            .collect();
        update.patches = vec![PatchGeometry {
            id: PatchId(0),
            object: ObjectId::WORLD,
            shape: PatchShape::Pair,
            double_sided: false,
            corners: [0, 1, 2, 3, 3].map(VertexId),
        }];
        update.placements = vec![Placement {
            patch: PatchId(0),
            slot: Slot::Block(Block {
                x: 0,
                y: 0,
                level: Level {
                    width: LOG2_SIDE,
                    height: LOG2_SIDE,
                },
            }),
        }];
    }
    update
}

fn picture(encoder: &mut Encoder, frame: FrameId) -> Picture {
    let side = 1_usize << LOG2_SIDE;
    let quarter = side * side / 4;
    // Red in limited-range BT.709.
    let yuv = [
        vec![63; quarter * 4],
        vec![102; quarter],
        vec![240; quarter],
    ]
    .concat();
    let source = YUVBuffer::from_vec(yuv, side, side);
    let bytes = encoder.encode(&source).expect("it encodes").to_vec();
    Picture {
        frame,
        epoch: Epoch(0),
        idr: frame == FrameId(0),
        bytes,
    }
}
