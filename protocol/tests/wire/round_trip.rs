//! Whatever may be sent arrives as it was.

use std::collections::{BTreeMap, BTreeSet};

use glam::{Quat, Vec3};
use proptest::{array::uniform2, collection::vec, prelude::*, sample::select};
use shadecast_protocol::{
    Acknowledgement, Block, ClientTime, ClockReply, Codec, Epoch, EyeView, Fov, FrameId, Hand,
    Hello, Level, MAX_PATCHES, MAX_VERTICES, Method, Motion, ObjectId, PatchGeometry, PatchId,
    PatchShape, Picture, Placement, Pose, Refusal, ResetReason, Secret, ServerTime, Sky, Slot,
    SlotMask, ToClient, ToServer, TriangleSlot, Update, UpdateTiming, Vertex, VertexId, ViewReport,
    ViewSeq, Welcome,
};

use crate::samples::{to_client, to_server};

#[test]
fn samples_survive() {
    for message in to_server() {
        let bytes = message.encode().unwrap();
        assert_eq!(ToServer::decode(&bytes), Ok(message));
    }
    for message in to_client() {
        let bytes = message.encode().unwrap();
        assert_eq!(ToClient::decode(&bytes), Ok(message));
    }
}

proptest! {
    #[test]
    fn every_message_to_the_server_survives(message in to_server_message()) {
        let bytes = message.encode().unwrap();
        prop_assert_eq!(ToServer::decode(&bytes), Ok(message));
    }

    #[test]
    fn every_message_to_the_client_survives(message in to_client_message()) {
        let bytes = message.encode().unwrap();
        prop_assert_eq!(ToClient::decode(&bytes), Ok(message));
    }

    #[test]
    fn every_update_survives(update in update()) {
        let message = ToClient::Update(update);
        let bytes = message.encode().unwrap();
        prop_assert_eq!(ToClient::decode(&bytes), Ok(message));
    }
}

fn to_server_message() -> impl Strategy<Value = ToServer> {
    let hello = (any::<[u8; 16]>(), 64_u16.., 0..16_usize).prop_map(|(secret, side, codecs)| {
        ToServer::Hello(Hello {
            secret: Secret(secret),
            max_atlas_side: side,
            codecs: vec![Codec::H264; codecs],
        })
    });
    let acknowledge = (any::<u32>(), any::<u64>()).prop_map(|(frame, motion_to_photon)| {
        ToServer::Acknowledge(Acknowledgement {
            frame: FrameId(frame),
            motion_to_photon,
        })
    });
    prop_oneof![
        hello,
        view(),
        acknowledge,
        select(vec![
            ToServer::RequestReset(ResetReason::Decoder),
            ToServer::RequestReset(ResetReason::Gap),
            ToServer::Bye,
        ]),
    ]
}

fn view() -> impl Strategy<Value = ToServer> {
    let eye = (
        pose(),
        -1.5..0.0_f32,
        0.01..1.5_f32,
        0.01..1.5_f32,
        -1.5..0.0_f32,
    );
    let eye = eye.prop_map(|(head_from_eye, left, right, up, down)| EyeView {
        head_from_eye,
        fov: Fov {
            left,
            right,
            up,
            down,
        },
    });
    let times = uniform2(any::<u64>());
    let velocities = (point(), point());
    let resolution = uniform2(16..=8192_u16);
    let hand = (pose(), any::<bool>(), any::<u16>());
    let hand = hand.prop_map(|(world_from_aim, pressed, presses)| Hand {
        world_from_aim,
        pressed,
        presses,
    });
    let hands = uniform2(prop::option::of(hand));
    (
        any::<u32>(),
        times,
        pose(),
        velocities,
        uniform2(eye),
        (resolution, hands),
    )
        .prop_map(
            |(seq, times, world_from_head, (linear, angular), eyes, (eye_resolution, hands))| {
                ToServer::View(ViewReport {
                    seq: ViewSeq(seq),
                    sampled_at: ClientTime(times[0].min(times[1])),
                    display_at: ClientTime(times[0].max(times[1])),
                    world_from_head,
                    linear_velocity: linear,
                    angular_velocity: angular,
                    eyes,
                    eye_resolution,
                    hands,
                })
            },
        )
}

fn to_client_message() -> impl Strategy<Value = ToClient> {
    let refusal = prop_oneof![
        any::<u16>().prop_map(Refusal::Version),
        select(vec![Refusal::Secret, Refusal::Capabilities, Refusal::Busy]),
    ];
    let clock = (any::<u64>(), uniform2(any::<u64>())).prop_map(|(sent, times)| ClockReply {
        client_sent: ClientTime(sent),
        server_received: ServerTime(times[0].min(times[1])),
        server_sent: ServerTime(times[0].max(times[1])),
    });
    let bytes = vec(any::<u8>(), 1..2000);
    let picture = (any::<u32>(), any::<u32>(), any::<bool>(), bytes);
    let picture = picture.prop_map(|(frame, epoch, idr, bytes)| Picture {
        frame: FrameId(frame),
        epoch: Epoch(epoch),
        idr,
        bytes,
    });
    prop_oneof![
        welcome().prop_map(ToClient::Welcome),
        refusal.prop_map(ToClient::Refused),
        clock.prop_map(ToClient::Clock),
        picture.prop_map(ToClient::Picture),
        Just(ToClient::Bye),
    ]
}

fn welcome() -> impl Strategy<Value = Welcome> {
    let sky = (1..=256_u16, 1..=128_u16, any::<u8>()).prop_map(|(width, height, color)| Sky {
        width,
        height,
        rgb: vec![color; 3 * usize::from(width) * usize::from(height)],
    });
    let atlas = uniform2((4..=512_u16).prop_map(|macroblocks| 16 * macroblocks));
    let method = select(Method::ALL.to_vec());
    (atlas, 1..=6_u32, pose(), sky, method).prop_map(
        |(atlas_size, log2, world_from_play, sky, method)| Welcome {
            codec: Codec::H264,
            method,
            atlas_size,
            superblock: 1 << log2,
            world_from_play,
            sky,
        },
    )
}

fn update() -> impl Strategy<Value = Update> {
    let vertices = prop::collection::btree_map(0..MAX_VERTICES, point(), 0..60);
    let patches = prop::collection::btree_map(0..MAX_PATCHES, geometry(), 0..60);
    let removals = prop::collection::btree_set(0..MAX_PATCHES, 0..60);
    let of_one_kind = |slot: BoxedStrategy<Slot>| {
        prop::collection::btree_map(0..MAX_PATCHES, (slot, any::<Option<u8>>()), 0..60)
    };
    let blocks = block().prop_map(Slot::Block).boxed();
    let triangles = triangle().prop_map(Slot::Triangle).boxed();
    let placements = prop_oneof![of_one_kind(blocks), of_one_kind(triangles)];
    let motions = prop::collection::btree_map(1..=u16::MAX, motion(), 0..4);
    let head = (any::<[u32; 3]>(), any::<[u64; 6]>(), pose());
    (head, vertices, patches, removals, placements, motions).prop_map(assemble)
}

type Head = ([u32; 3], [u64; 6], Pose);
type Patch = (u16, PatchShape, bool, [u32; 5]);

type Parts = (
    Head,
    BTreeMap<u32, Vec3>,
    BTreeMap<u32, Patch>,
    BTreeSet<u32>,
    BTreeMap<u32, (Slot, Option<u8>)>,
    BTreeMap<u16, Motion>,
);

fn assemble(parts: Parts) -> Update {
    let (head, vertices, patches, removals, placements, motions) = parts;
    let (ids, times, world_from_head) = head;
    let vertex = |(id, position)| Vertex {
        id: VertexId(id),
        position,
    };
    let mask = |(&id, &(slot, byte)): (&u32, &(Slot, Option<u8>))| {
        let bytes = slot.bounds().area().div_ceil(8) as usize;
        byte.filter(|_| bytes < 4096).map(|byte| SlotMask {
            patch: PatchId(id),
            bits: vec![byte; bytes],
        })
    };
    Update {
        frame: FrameId(ids[0]),
        epoch: Epoch(ids[1]),
        timing: UpdateTiming {
            view: ViewSeq(ids[2]),
            view_sampled: ClientTime(times[0]),
            view_received: ServerTime(times[1]),
            started: ServerTime(times[2]),
            finished: ServerTime(times[3]),
        },
        world_from_head,
        scene_time: times[4],
        objects_lead: times[5],
        vertices: vertices.into_iter().map(vertex).collect(),
        patches: patches.into_iter().map(patch).collect(),
        removals: removals.into_iter().map(PatchId).collect(),
        masks: placements.iter().filter_map(mask).collect(),
        placements: placements
            .into_iter()
            .map(|(id, (slot, _))| Placement {
                patch: PatchId(id),
                slot,
            })
            .collect(),
        motions: motions
            .into_iter()
            .map(|(id, motion)| (ObjectId(id), motion))
            .collect(),
    }
}

fn patch((id, (object, shape, double_sided, corners)): (u32, Patch)) -> PatchGeometry {
    let last = shape.corners().len() - 1;
    PatchGeometry {
        id: PatchId(id),
        object: ObjectId(object),
        shape,
        double_sided,
        corners: [0, 1, 2, 3, 4].map(|i: usize| VertexId(corners[i.min(last)])),
    }
}

fn geometry() -> impl Strategy<Value = Patch> {
    let shape = select(vec![PatchShape::Solo, PatchShape::Pair, PatchShape::Triple]);
    let corners = prop::array::uniform5(0..MAX_VERTICES);
    (any::<u16>(), shape, any::<bool>(), corners)
}

fn block() -> impl Strategy<Value = Block> {
    (1..=13_u8, 1..=13_u8, uniform2(0.0..1.0_f64)).prop_map(|(a, b, position)| {
        let level = Level {
            width: a,
            height: b,
        };
        let (width, height) = level.size();
        let even = |t: f64, side: u32| (t * f64::from((8192 - side) / 2)) as u16 * 2;
        Block {
            x: even(position[0], width),
            y: even(position[1], height),
            level,
        }
    })
}

fn triangle() -> impl Strategy<Value = TriangleSlot> {
    let place = uniform2(4..=49_000_u16);
    let corners = prop::array::uniform3(uniform2(0..=8 * 2000_u16));
    let weights = (uniform2(1..=u16::MAX), 0..3_usize);
    (place, corners, weights).prop_map(|(place, corners, (smaller, largest))| {
        let mut weights = [smaller[0], smaller[1], u16::MAX];
        weights.swap(2, largest);
        TriangleSlot {
            corners: corners.map(|corner| [0, 1].map(|axis| place[axis] + corner[axis])),
            weights,
        }
    })
}

fn motion() -> impl Strategy<Value = Motion> {
    (pose(), point(), point()).prop_map(|(pose, linear_velocity, angular_velocity)| Motion {
        pose,
        linear_velocity,
        angular_velocity,
    })
}

fn pose() -> impl Strategy<Value = Pose> {
    (point(), point()).prop_map(|(position, axis)| Pose {
        position,
        orientation: Quat::from_scaled_axis(axis.clamp_length_max(10.0)).normalize(),
    })
}

fn point() -> impl Strategy<Value = Vec3> {
    prop::array::uniform3(-1e4..1e4_f32).prop_map(Vec3::from_array)
}
