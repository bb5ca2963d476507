//! What a world makes of updates.

mod wrong;

use std::sync::Arc;

use glam::{Quat, Vec3};
use proptest::prelude::*;
use shadecast_protocol::{
    Block, ClientTime, FrameId, Level, MAX_VERTICES, Motion, PatchGeometry, PatchShape, Placement,
    ServerTime, SlotMask, TriangleSlot, UpdateTiming, Vertex,
};

use super::*;
use crate::YuvPicture;

fn update(epoch: u32) -> Update {
    Update {
        frame: FrameId(0),
        epoch: Epoch(epoch),
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

fn vertex(id: u32) -> Vertex {
    Vertex {
        id: VertexId(id),
        position: Vec3::new(id as f32, 0.5, -1.0),
    }
}

/// A patch on the vertices from ten times its id on.
fn patch(id: u32, shape: PatchShape) -> PatchGeometry {
    let last = shape.corners().len() as u32 - 1;
    PatchGeometry {
        id: PatchId(id),
        object: ObjectId::WORLD,
        shape,
        double_sided: false,
        corners: [0, 1, 2, 3, 4].map(|corner| VertexId(10 * id + corner.min(last))),
    }
}

fn placement(id: u32, x: u16, y: u16, log2: [u8; 2]) -> Placement {
    let level = Level {
        width: log2[0],
        height: log2[1],
    };
    Placement {
        patch: PatchId(id),
        slot: Slot::Block(Block { x, y, level }),
    }
}

/// Patches 1 (solo), 2 (pair) and 3 (triple), all placed.
fn three_patches() -> Update {
    let shapes = [PatchShape::Solo, PatchShape::Pair, PatchShape::Triple];
    Update {
        vertices: (1..=3)
            .flat_map(|id| (0..5).map(move |corner| vertex(10 * id + corner)))
            .collect(),
        patches: (1..).zip(shapes).map(|(id, s)| patch(id, s)).collect(),
        placements: vec![
            placement(1, 0, 0, [3, 2]),
            placement(2, 8, 0, [1, 1]),
            placement(3, 16, 32, [4, 4]),
        ],
        ..update(1)
    }
}

fn world() -> World {
    let mut world = World::new([64, 64], Method::Sas);
    world.apply(&three_patches()).unwrap();
    world
}

fn picture() -> DecodedPicture {
    DecodedPicture::from(YuvPicture {
        width: 0,
        height: 0,
        y: vec![],
        u: vec![],
        v: vec![],
    })
}

fn frame(world: &mut World) -> ClientFrame {
    world.frame(&update(1), picture(), ClientTiming::default())
}

/// Texel coordinates of a corner in a block.
fn texel(vertex: &DrawVertex) -> [f32; 2] {
    let [x, y, w] = vertex.texel;
    assert_eq!(w, 1.0);
    [x, y]
}

#[test]
fn corners_lie_on_texel_centres_of_their_block() {
    let frame = frame(&mut world());
    let texels: Vec<_> = frame.vertices.iter().map(texel).collect();
    let expected = [
        // Solo in 8x4 at (0, 0).
        [0.5, 0.5],
        [7.5, 0.5],
        [0.5, 3.5],
        // Pair in 2x2 at (8, 0).
        [8.5, 0.5],
        [9.5, 0.5],
        [9.5, 1.5],
        [8.5, 1.5],
        // Triple in 16x16 at (16, 32).
        [16.5, 32.5],
        [24.0, 32.5],
        [31.5, 32.5],
        [31.5, 47.5],
        [16.5, 47.5],
    ];
    assert_eq!(texels, expected);
    assert_eq!(frame.opaque_indices as usize, frame.indices.len());
    let indices = [
        0, 1, 2, // solo
        3, 4, 6, 4, 5, 6, // pair
        7, 8, 11, 8, 10, 11, 8, 9, 10, // triple
    ];
    assert_eq!(*frame.indices, indices);
    assert_eq!(frame.patches, 3);
    assert_eq!(frame.vertices[3].position, [20.0, 0.5, -1.0]);
}

#[test]
fn an_upright_patch_lies_on_its_side() {
    let mut world = world();
    let update = Update {
        placements: vec![placement(2, 8, 16, [1, 3])],
        ..update(1)
    };
    world.apply(&update).unwrap();
    let frame = frame(&mut world);
    let texels: Vec<_> = frame.vertices[3..7].iter().map(texel).collect();
    assert_eq!(
        texels,
        [[8.5, 16.5], [8.5, 17.5], [15.5, 17.5], [15.5, 16.5]]
    );
}

/// A world of triangles by themselves, with two of them in each other's bounds.
fn world_of_triangles() -> World {
    let mut world = World::new([64, 64], Method::Tss);
    let slot = |patch: u32, corners, weights| Placement {
        patch: PatchId(patch),
        slot: Slot::Triangle(TriangleSlot { corners, weights }),
    };
    let update = Update {
        vertices: [10, 11, 12, 20, 21, 22].map(vertex).to_vec(),
        patches: vec![patch(1, PatchShape::Solo), patch(2, PatchShape::Solo)],
        placements: vec![
            slot(1, [[4, 4], [28, 4], [4, 28]], [65535; 3]),
            slot(2, [[52, 28], [28, 28], [52, 4]], [65535, 13107, 65535]),
        ],
        masks: vec![
            SlotMask {
                patch: PatchId(1),
                bits: vec![0, 0],
            },
            SlotMask {
                patch: PatchId(2),
                bits: vec![0xff, 0xff],
            },
        ],
        ..update(1)
    };
    world.apply(&update).unwrap();
    world
}

#[test]
fn corners_of_a_triangle_slot_are_homogeneous() {
    let frame = frame(&mut world_of_triangles());
    let texels: Vec<_> = frame.vertices.iter().map(|vertex| vertex.texel).collect();
    let expected = [
        [0.5, 0.5, 1.0],
        [3.5, 0.5, 1.0],
        [0.5, 3.5, 1.0],
        [6.5, 3.5, 1.0],
        [17.5, 17.5, 5.0],
        [6.5, 0.5, 1.0],
    ];
    assert_eq!(texels, expected);
    assert!(frame.foreshortened);
}

#[test]
fn masks_of_triangles_leave_each_other_alone() {
    let masks = frame(&mut world_of_triangles()).masks.unwrap();
    let absent = (0..64 * 64).filter(|&i| masks.coverage[i] == 0).count();
    assert_eq!(
        absent,
        4 + 4 + 3 + 2,
        "all of the first, none of the second"
    );
}

#[test]
fn double_sided_triangles_appear_in_both_windings() {
    let mut solo = patch(7, PatchShape::Solo);
    solo.double_sided = true;
    let update = Update {
        vertices: vec![vertex(70), vertex(71), vertex(72)],
        patches: vec![solo],
        placements: vec![placement(7, 0, 0, [1, 1])],
        ..update(0)
    };
    let mut world = World::new([64, 64], Method::Sas);
    world.apply(&update).unwrap();
    assert_eq!(*frame(&mut world).indices, [0, 1, 2, 0, 2, 1]);
}

#[test]
fn what_does_not_change_is_shared() {
    let mut world = world();
    let first = frame(&mut world);
    world.apply(&update(1)).unwrap();
    let second = frame(&mut world);
    assert!(Arc::ptr_eq(&first.vertices, &second.vertices));
    assert!(Arc::ptr_eq(&first.indices, &second.indices));
    assert!(Arc::ptr_eq(&first.motions, &second.motions));

    let removal = Update {
        removals: vec![PatchId(2)],
        ..update(1)
    };
    world.apply(&removal).unwrap();
    let third = frame(&mut world);
    assert_eq!((third.patches, third.vertices.len()), (2, 8));
    assert_eq!(first.vertices.len(), 12, "an older frame stays as it was");
}

#[test]
fn a_new_epoch_drops_placements_and_masks_and_keeps_geometry() {
    let mut world = world();
    let masked = Update {
        placements: vec![placement(2, 8, 0, [1, 1])],
        masks: vec![SlotMask {
            patch: PatchId(2),
            bits: vec![0b0110],
        }],
        ..update(1)
    };
    world.apply(&masked).unwrap();
    assert!(frame(&mut world).masks.is_some());

    world.apply(&update(2)).unwrap();
    let empty = frame(&mut world);
    assert_eq!(world.epoch(), Some(Epoch(2)));
    assert_eq!((empty.patches, empty.vertices.len()), (0, 0));
    assert!(empty.masks.is_none());

    let again = Update {
        placements: vec![placement(3, 0, 0, [2, 2])],
        ..update(2)
    };
    world.apply(&again).unwrap();
    assert_eq!(frame(&mut world).vertices.len(), 5);
}

#[test]
fn masks_cover_their_blocks_and_go_with_them() {
    let mut world = world();
    assert!(frame(&mut world).masks.is_none());
    let masked = Update {
        placements: vec![placement(2, 62, 10, [1, 1])],
        masks: vec![SlotMask {
            patch: PatchId(2),
            bits: vec![0b0110],
        }],
        ..update(1)
    };
    world.apply(&masked).unwrap();
    let masks = frame(&mut world).masks.unwrap();
    let absent: Vec<_> = (0..64 * 64).filter(|&i| masks.coverage[i] == 0).collect();
    assert_eq!(absent, [10 * 64 + 62, 11 * 64 + 63]);
    assert!(Arc::ptr_eq(&masks, &frame(&mut world).masks.unwrap()));

    let moved = Update {
        placements: vec![placement(2, 0, 20, [1, 1])],
        ..update(1)
    };
    world.apply(&moved).unwrap();
    assert!(frame(&mut world).masks.is_none());
}

#[test]
fn objects_stand_still_until_they_move() {
    let mut on_object = patch(4, PatchShape::Solo);
    on_object.object = ObjectId(2);
    let mut world = world();
    let update = Update {
        vertices: vec![vertex(40), vertex(41), vertex(42)],
        patches: vec![on_object],
        placements: vec![placement(4, 40, 40, [1, 1])],
        ..update(1)
    };
    world.apply(&update).unwrap();
    assert_eq!(
        *frame(&mut world).motions,
        [Motion::still(Pose::IDENTITY); 3]
    );
    assert_eq!(frame(&mut world).vertices.last().unwrap().object, 2);

    let motion = Motion {
        pose: Pose {
            position: Vec3::X,
            orientation: Quat::from_rotation_y(1.0),
        },
        linear_velocity: Vec3::Z,
        angular_velocity: Vec3::ZERO,
    };
    let moved = Update {
        motions: vec![(ObjectId(2), motion)],
        ..self::update(1)
    };
    world.apply(&moved).unwrap();
    assert_eq!(frame(&mut world).motions[2], motion);
}

#[test]
fn motion_goes_on_until_it_is_not_believed_any_more() {
    let second = 1_000_000_000;
    let update = Update {
        scene_time: 20 * second,
        objects_lead: second / 4,
        timing: UpdateTiming {
            started: ServerTime(3 * second),
            ..UpdateTiming::default()
        },
        ..update(1)
    };
    let timing = ClientTiming {
        client_minus_server: 2 * second as i64,
        ..ClientTiming::default()
    };
    let frame = world().frame(&update, picture(), timing);
    let at = |quarters: u64| ClientTime(5 * second + quarters * second / 4);
    assert_eq!(frame.scene_seconds(at(2)), 20.5);
    for (quarters, expected) in [(0, -0.25), (1, 0.0), (2, 0.25), (3, 0.5), (100, 0.5)] {
        assert_eq!(frame.seconds_of_motion(at(quarters)), expected);
    }
    // Clocks that make no sense move nothing far.
    assert_eq!(frame.seconds_of_motion(ClientTime(0)), -0.5);
    assert_eq!(frame.seconds_of_motion(ClientTime(u64::MAX)), 0.5);
}

#[test]
fn known_geometry_may_be_sent_again() {
    let mut world = world();
    world.apply(&three_patches()).unwrap();
    assert_eq!(world.positions.len(), 15);
}

#[test]
fn learning_takes_geometry_and_leaves_placements() {
    let mut world = world();
    let before = frame(&mut world);
    let skipped = Update {
        vertices: vec![vertex(50), vertex(51), vertex(52)],
        patches: vec![patch(5, PatchShape::Solo)],
        removals: vec![PatchId(1)],
        placements: vec![placement(5, 0, 0, [1, 1])],
        ..update(9)
    };
    world.learn(&skipped).unwrap();
    assert_eq!(world.epoch(), Some(Epoch(1)));
    assert_eq!(frame(&mut world).vertices, before.vertices);
    let placed = Update {
        placements: vec![placement(5, 0, 0, [1, 1])],
        ..update(10)
    };
    world.apply(&placed).unwrap();
}

proptest! {
    /// Whatever order patches come and go in, what is drawn is a function of
    /// what is placed.
    #[test]
    fn what_is_drawn_does_not_depend_on_history(
        steps in prop::collection::vec((1_u32..20, any::<bool>()), 0..60),
    ) {
        let geometry = Update {
            vertices: (1..20).flat_map(|id| (0..3).map(move |c| vertex(10 * id + c))).collect(),
            patches: (1..20).map(|id| patch(id, PatchShape::Solo)).collect(),
            ..update(0)
        };
        let place = |id: u32| placement(id, 2 * id as u16, 4, [1, 1]);
        let mut world = World::new([64, 64], Method::Sas);
        world.apply(&geometry).unwrap();
        let mut placed = std::collections::BTreeSet::new();
        for (id, is_placed) in steps {
            let mut step = update(0);
            if is_placed {
                placed.insert(id);
                step.placements.push(place(id));
            } else if placed.remove(&id) {
                step.removals.push(PatchId(id));
            }
            world.apply(&step).unwrap();
            let _ = frame(&mut world);
        }
        let mut at_once = World::new([64, 64], Method::Sas);
        let placements = placed.iter().map(|&id| place(id)).collect();
        at_once.apply(&Update { placements, ..geometry }).unwrap();
        let (a, b) = (frame(&mut world), frame(&mut at_once));
        prop_assert_eq!(&a.vertices, &b.vertices);
        prop_assert_eq!(a.indices, b.indices);
    }
}

/// `cargo test -p shadecast-client ten_thousand -- --ignored --nocapture`
#[test]
#[ignore = "a benchmark: prints how long it took"]
fn ten_thousand_patches() {
    let count = 10_000;
    let all = Update {
        vertices: (0..count)
            .flat_map(|id| (0..4).map(move |corner| vertex(10 * id + corner)))
            .collect(),
        patches: (0..count).map(|id| patch(id, PatchShape::Pair)).collect(),
        placements: (0..count)
            .map(|id| placement(id, (id % 500 * 4) as u16, (id / 500 * 4) as u16, [2, 2]))
            .collect(),
        ..update(0)
    };
    let mut world = World::new([2048, 2048], Method::Sas);
    let start = std::time::Instant::now();
    world.apply(&all).unwrap();
    let applied = start.elapsed();
    let first = frame(&mut world);
    println!("apply {applied:?}, build {:?}", start.elapsed() - applied);
    assert_eq!(first.vertices.len(), 40_000);
    let one = Update {
        removals: vec![PatchId(77)],
        ..update(0)
    };
    let start = std::time::Instant::now();
    world.apply(&one).unwrap();
    let second = frame(&mut world);
    println!("apply and build again {:?}", start.elapsed());
    assert_eq!(second.vertices.len(), 39_996);
}
