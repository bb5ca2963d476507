//! One message of every kind, with something in every field.

use glam::{Quat, Vec3};
use shadecast_protocol::{
    Acknowledgement, Block, ClientTime, ClockReply, Codec, Epoch, EyeView, Fov, FrameId, Hand,
    Hello, Level, Method, Motion, ObjectId, PatchGeometry, PatchId, PatchShape, Picture, Placement,
    Pose, Refusal, ResetReason, Secret, ServerTime, Sky, Slot, SlotMask, ToClient, ToServer,
    TriangleSlot, Update, UpdateTiming, Vertex, VertexId, ViewReport, ViewSeq, Welcome,
};

pub(crate) fn pose() -> Pose {
    Pose {
        position: Vec3::new(0.5, 1.75, -3.0),
        orientation: Quat::from_xyzw(0.0, 0.6, 0.0, 0.8),
    }
}

pub(crate) fn hello() -> Hello {
    Hello {
        secret: Secret([0xa5; 16]),
        max_atlas_side: 4096,
        codecs: vec![Codec::H264],
    }
}

pub(crate) fn view() -> ViewReport {
    let eye = |x| EyeView {
        head_from_eye: Pose {
            position: Vec3::new(x, 0.0, 0.0),
            orientation: Quat::IDENTITY,
        },
        fov: Fov {
            left: -0.75,
            right: 0.5,
            up: 0.625,
            down: -0.875,
        },
    };
    ViewReport {
        seq: ViewSeq(300),
        sampled_at: ClientTime(1_000_000),
        display_at: ClientTime(21_000_000),
        world_from_head: pose(),
        linear_velocity: Vec3::new(0.25, 0.0, -1.5),
        angular_velocity: Vec3::new(0.0, 2.0, 0.0),
        eyes: [eye(-0.03125), eye(0.03125)],
        eye_resolution: [2064, 2208],
        hands: [
            None,
            Some(Hand {
                world_from_aim: pose(),
                pressed: true,
                presses: 300,
            }),
        ],
    }
}

pub(crate) fn welcome() -> Welcome {
    Welcome {
        codec: Codec::H264,
        method: Method::Sas,
        atlas_size: [512, 256],
        superblock: 64,
        world_from_play: pose(),
        sky: Sky {
            width: 2,
            height: 1,
            rgb: vec![10, 20, 30, 40, 50, 60],
        },
    }
}

pub(crate) fn clock() -> ClockReply {
    ClockReply {
        client_sent: ClientTime(1_000_000),
        server_received: ServerTime(5_000_000_000),
        server_sent: ServerTime(5_000_100_000),
    }
}

pub(crate) fn picture() -> Picture {
    Picture {
        frame: FrameId(77),
        epoch: Epoch(2),
        idr: true,
        bytes: vec![0, 0, 0, 1, 0x67, 0x42],
    }
}

/// A placement by patch, corner and log2 of the sides.
pub(crate) fn placement(patch: u32, [x, y]: [u16; 2], [width, height]: [u8; 2]) -> Placement {
    Placement {
        patch: PatchId(patch),
        slot: Slot::Block(Block {
            x,
            y,
            level: Level { width, height },
        }),
    }
}

/// A placement by patch, corners and weights.
pub(crate) fn triangle(patch: u32, corners: [[u16; 2]; 3], weights: [u16; 3]) -> Placement {
    Placement {
        patch: PatchId(patch),
        slot: Slot::Triangle(TriangleSlot { corners, weights }),
    }
}

/// A patch by its corners, which say its shape.
pub(crate) fn patch(id: u32, corners: &[u32]) -> PatchGeometry {
    let shape = match corners.len() {
        3 => PatchShape::Solo,
        4 => PatchShape::Pair,
        _ => PatchShape::Triple,
    };
    let corner = |i: usize| VertexId(corners[i.min(corners.len() - 1)]);
    PatchGeometry {
        id: PatchId(id),
        object: ObjectId((id % 3) as u16),
        shape,
        double_sided: id % 2 == 1,
        corners: [0, 1, 2, 3, 4].map(corner),
    }
}

pub(crate) fn update() -> Update {
    let vertex = |id, x| Vertex {
        id: VertexId(id),
        position: Vec3::new(x, 0.5, -x),
    };
    Update {
        frame: FrameId(77),
        epoch: Epoch(2),
        timing: UpdateTiming {
            view: ViewSeq(300),
            view_sampled: ClientTime(1_000_000),
            view_received: ServerTime(5_000_000_000),
            started: ServerTime(5_001_000_000),
            finished: ServerTime(5_051_000_000),
        },
        world_from_head: pose(),
        scene_time: 123_456_789,
        objects_lead: 250_000_000,
        vertices: vec![vertex(4, 0.25), vertex(5, 0.75), vertex(900, -8.0)],
        patches: vec![
            patch(2, &[4, 5, 900]),
            patch(3, &[5, 4, 900, 1]),
            patch(70_000, &[1, 2, 3, 4, 5]),
        ],
        removals: vec![PatchId(0), PatchId(9), PatchId(10)],
        placements: vec![
            placement(2, [0, 0], [1, 1]),
            placement(3, [64, 32], [4, 2]),
            placement(9, [80, 32], [4, 2]),
            placement(70_000, [8160, 8190], [5, 1]),
        ],
        masks: vec![
            SlotMask {
                patch: PatchId(2),
                bits: vec![0b1011],
            },
            SlotMask {
                patch: PatchId(9),
                bits: vec![0xff, 0x00, 0x81, 0x7e, 1, 2, 3, 4],
            },
        ],
        motions: vec![
            (
                ObjectId(1),
                Motion {
                    pose: pose(),
                    linear_velocity: Vec3::new(0.5, -0.25, 0.0),
                    angular_velocity: Vec3::Y,
                },
            ),
            (ObjectId(5), Motion::still(Pose::IDENTITY)),
        ],
    }
}

/// The same with slots of triangles.
pub(crate) fn update_of_triangles() -> Update {
    let even = [u16::MAX; 3];
    Update {
        placements: vec![
            triangle(2, [[4, 4], [60, 4], [4, 60]], even),
            triangle(3, [[92, 60], [36, 60], [92, 4]], [65535, 30000, 60001]),
            triangle(9, [[100, 76], [164, 76], [130, 68]], [40000, 65535, 1]),
            triangle(70_000, [[65_500, 4], [65_532, 4], [65_500, 12]], even),
        ],
        masks: vec![SlotMask {
            patch: PatchId(9),
            bits: vec![0xff, 0x7f, 0x03],
        }],
        ..update()
    }
}

pub(crate) fn to_server() -> Vec<ToServer> {
    vec![
        ToServer::Hello(hello()),
        ToServer::View(view()),
        ToServer::Acknowledge(Acknowledgement {
            frame: FrameId(77),
            motion_to_photon: 48_000_000,
        }),
        ToServer::RequestReset(ResetReason::Decoder),
        ToServer::RequestReset(ResetReason::Gap),
        ToServer::Bye,
    ]
}

pub(crate) fn to_client() -> Vec<ToClient> {
    vec![
        ToClient::Welcome(welcome()),
        ToClient::Refused(Refusal::Secret),
        ToClient::Refused(Refusal::Version(513)),
        ToClient::Refused(Refusal::Capabilities),
        ToClient::Refused(Refusal::Busy),
        ToClient::Clock(clock()),
        ToClient::Update(update()),
        ToClient::Update(update_of_triangles()),
        ToClient::Picture(picture()),
        ToClient::Bye,
    ]
}
