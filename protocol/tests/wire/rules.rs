//! Impossible values: refused alike when sent and when received.

use glam::{Quat, Vec3};
use shadecast_protocol::{
    ClientTime, Codec, Hello, Motion, ObjectId, PatchId, Picture, Pose, ServerTime, SlotMask,
    ToClient, ToServer, Update, VertexId, ViewReport, Welcome, WireError,
};

use crate::samples;

/// What is invalid about a message that is refused.
#[track_caller]
fn refused<M>(encoded: Result<M, WireError>) -> &'static str {
    match encoded {
        Err(WireError::Invalid { what, .. } | WireError::TooLarge { what, .. }) => what,
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("was accepted"),
    }
}

#[track_caller]
fn bad_view(change: impl FnOnce(&mut ViewReport)) -> &'static str {
    let mut view = samples::view();
    change(&mut view);
    // The same bytes as a peer without our checks would send.
    let bytes = [&[2], &postcard::to_stdvec(&view).unwrap()[..]].concat();
    let what = refused(ToServer::decode(&bytes));
    assert_eq!(refused(ToServer::View(view).encode()), what);
    what
}

#[test]
fn views_are_finite_and_possible() {
    let nan = f32::NAN;
    assert_eq!(
        bad_view(|v| v.world_from_head.position.y = nan),
        "head pose"
    );
    assert_eq!(
        bad_view(|v| v.world_from_head.position.y = 1e30),
        "head pose"
    );
    let zero = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0);
    assert_eq!(
        bad_view(|v| v.world_from_head.orientation = zero),
        "head pose"
    );
    assert_eq!(
        bad_view(|v| v.world_from_head.orientation.w = nan),
        "head pose"
    );
    let infinite = Vec3::new(0.0, f32::INFINITY, 0.0);
    assert_eq!(
        bad_view(|v| v.linear_velocity = infinite),
        "linear velocity"
    );
    assert_eq!(bad_view(|v| v.angular_velocity.z = nan), "angular velocity");
    assert_eq!(
        bad_view(|v| v.eyes[1].head_from_eye.position.x = nan),
        "eye pose"
    );
    assert_eq!(bad_view(|v| v.eyes[0].fov.left = nan), "field of view");
    assert_eq!(bad_view(|v| v.eyes[0].fov.right = -1.0), "field of view");
    assert_eq!(bad_view(|v| v.eyes[0].fov.up = 1.6), "field of view");
    assert_eq!(bad_view(|v| v.eye_resolution[0] = 15), "eye resolution");
    assert_eq!(bad_view(|v| v.eye_resolution[1] = 8193), "eye resolution");
    assert_eq!(bad_view(|v| v.display_at = ClientTime(0)), "display time");
    let nowhere = |v: &mut ViewReport| v.hands[1].as_mut().unwrap().world_from_aim.position.x = nan;
    assert_eq!(bad_view(nowhere), "aim");
}

#[track_caller]
fn bad_welcome(change: impl FnOnce(&mut Welcome)) -> &'static str {
    let mut welcome = samples::welcome();
    change(&mut welcome);
    let body = postcard::to_stdvec(&welcome).unwrap();
    let bytes = [&b"shadecast\x04\x00\x10"[..], &body].concat();
    let what = refused(ToClient::decode(&bytes));
    assert_eq!(refused(ToClient::Welcome(welcome).encode()), what);
    what
}

#[test]
fn a_welcome_names_sizes_that_can_be() {
    for side in [0, 48, 250, 8208] {
        assert_eq!(bad_welcome(|w| w.atlas_size[0] = side), "atlas size");
        assert_eq!(bad_welcome(|w| w.atlas_size[1] = side), "atlas size");
    }
    for superblock in [0, 1, 48, 512, 32768] {
        assert_eq!(bad_welcome(|w| w.superblock = superblock), "superblock");
    }
    let play = Vec3::NAN;
    assert_eq!(
        bad_welcome(|w| w.world_from_play.position = play),
        "play space"
    );
    assert_eq!(bad_welcome(|w| w.sky.width = 0), "sky size");
    assert_eq!(bad_welcome(|w| w.sky.height = 129), "sky size");
    assert_eq!(bad_welcome(|w| w.sky.rgb.push(0)), "length of the sky");
}

#[test]
fn other_messages_are_possible() {
    let hello = |change: &dyn Fn(&mut Hello)| {
        let mut hello = samples::hello();
        change(&mut hello);
        refused(ToServer::Hello(hello).encode())
    };
    assert_eq!(hello(&|h| h.max_atlas_side = 0), "atlas side");
    assert_eq!(
        hello(&|h| h.codecs = vec![Codec::H264; 17]),
        "list of codecs"
    );

    let mut clock = samples::clock();
    clock.server_sent = ServerTime(0);
    assert_eq!(refused(ToClient::Clock(clock).encode()), "sending time");

    let picture = |size| Picture {
        bytes: vec![0; size],
        ..samples::picture()
    };
    let empty = ToClient::Picture(picture(0));
    assert_eq!(refused(empty.encode()), "empty access unit");
    assert_eq!(
        refused(ToClient::decode(&[20, 1, 1, 0])),
        "empty access unit"
    );
    let huge = ToClient::Picture(picture(8 << 20));
    assert_eq!(refused(huge.encode()), "picture");
}

#[track_caller]
fn bad_update(change: impl FnOnce(&mut Update)) -> &'static str {
    let mut update = samples::update();
    change(&mut update);
    refused(ToClient::Update(update).encode())
}

#[test]
fn an_update_is_finite() {
    let nan = f32::NAN;
    assert_eq!(
        bad_update(|u| u.world_from_head.position.x = nan),
        "head pose"
    );
    assert_eq!(
        bad_update(|u| u.vertices[1].position.z = nan),
        "vertex position"
    );
    assert_eq!(
        bad_update(|u| u.motions[0].1.pose.position.x = nan),
        "object pose"
    );
}

#[test]
fn ids_of_an_update_ascend_below_their_limits() {
    assert_eq!(bad_update(|u| u.vertices.swap(0, 1)), "vertex id");
    assert_eq!(bad_update(|u| u.vertices[1].id = VertexId(4)), "vertex id");
    assert_eq!(
        bad_update(|u| u.vertices[2].id = VertexId(8 << 20)),
        "vertex id"
    );
    assert_eq!(bad_update(|u| u.patches.swap(0, 2)), "patch id");
    assert_eq!(
        bad_update(|u| u.patches[2].id = PatchId(u32::MAX)),
        "patch id"
    );
    assert_eq!(bad_update(|u| u.removals.reverse()), "removal");
    assert_eq!(bad_update(|u| u.placements.swap(0, 1)), "placement");
    assert_eq!(bad_update(|u| u.masks.reverse()), "mask");
    assert_eq!(bad_update(|u| u.motions.reverse()), "object id");
    let world = (ObjectId::WORLD, Motion::still(Pose::IDENTITY));
    assert_eq!(bad_update(|u| u.motions[0] = world), "motion of the world");
}

#[test]
fn corners_are_vertices_and_spare_ones_repeat() {
    let far = VertexId(8 << 20);
    assert_eq!(bad_update(|u| u.patches[2].corners[4] = far), "corner");
    assert_eq!(
        bad_update(|u| u.patches[0].corners[4] = VertexId(1)),
        "spare corner"
    );
}

#[test]
fn blocks_are_inside_the_largest_atlas() {
    let block =
        |position, level| bad_update(|u| u.placements[0] = samples::placement(0, position, level));
    assert_eq!(block([0, 0], [1, 0]), "block size");
    assert_eq!(block([0, 0], [14, 2]), "block size");
    assert_eq!(block([0, 0], [2, 14]), "block size");
    assert_eq!(block([0, 0], [255, 255]), "block size");
    assert_eq!(block([1, 0], [2, 2]), "block position");
    assert_eq!(block([0, 3], [2, 2]), "block position");
    assert_eq!(block([8190, 0], [2, 2]), "block position");
    assert_eq!(
        block([8188, 0], [2, 3]),
        "block position",
        "lies on its side"
    );
    assert_eq!(block([0, 65534], [2, 2]), "block position");
}

#[test]
fn slots_of_triangles_are_inside_the_largest_atlas_and_have_weights() {
    let slot = |corners, weights| {
        bad_update(|u| {
            *u = samples::update_of_triangles();
            u.placements[0] = samples::triangle(2, corners, weights);
        })
    };
    let (small, even) = ([[4, 4], [60, 4], [4, 60]], [u16::MAX; 3]);
    assert_eq!(slot(small, [0, 65535, 65535]), "weights of a slot");
    assert_eq!(slot(small, [65534; 3]), "weights of a slot");
    assert_eq!(slot([[3, 4], [60, 4], [4, 60]], even), "slot position");
    assert_eq!(slot([[4, 4], [60, 2], [4, 60]], even), "slot position");
    let over = [[65_533, 4], [65_500, 4], [65_500, 60]];
    assert_eq!(slot(over, even), "slot position");
    let long = [[4, 4], [4 + 8 * 2048, 4], [4, 60]];
    assert_eq!(slot(long, even), "slot size");
}

#[test]
fn all_slots_are_of_one_kind() {
    let mixed = bad_update(|u| {
        u.placements[1] = samples::triangle(3, [[4, 4], [60, 4], [4, 60]], [u16::MAX; 3]);
    });
    assert_eq!(mixed, "mixture of slots");
}

#[test]
fn a_mask_fits_a_slot_of_the_same_update() {
    assert_eq!(bad_update(|u| u.masks[0].bits.push(0)), "length of a mask");
    assert_eq!(
        bad_update(|u| u.masks[1].bits.truncate(1)),
        "length of a mask"
    );
    let stray = SlotMask {
        patch: PatchId(4),
        bits: vec![0],
    };
    assert_eq!(bad_update(|u| u.masks[0] = stray), "length of a mask");
    let of_triangle = bad_update(|u| {
        *u = samples::update_of_triangles();
        u.masks[0].bits.push(0);
    });
    assert_eq!(of_triangle, "length of a mask");
}
