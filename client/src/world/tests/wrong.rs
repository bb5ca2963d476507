//! Every update that is wrong.

use super::*;

/// Every way of being wrong, beside things that are right and must not be taken.
#[test]
fn a_wrong_update_is_named_and_changes_nothing() {
    let right = || Update {
        vertices: vec![vertex(60), vertex(61), vertex(62)],
        patches: vec![patch(6, PatchShape::Solo)],
        removals: vec![PatchId(1)],
        placements: vec![placement(6, 32, 0, [1, 1])],
        motions: vec![(ObjectId(1), Motion::still(Pose::IDENTITY))],
        ..update(1)
    };
    let wrong = |change: fn(&mut Update)| {
        let mut update = right();
        change(&mut update);
        update
    };
    let order = |list| WorldError::Order { list };
    let cases = [
        (
            wrong(|u| u.epoch = Epoch(0)),
            WorldError::OldEpoch {
                update: Epoch(0),
                current: Epoch(1),
            },
        ),
        (wrong(|u| u.vertices.swap(0, 1)), order("vertices")),
        (wrong(|u| u.vertices.push(vertex(62))), order("vertices")),
        (
            wrong(|u| u.patches.push(patch(6, PatchShape::Solo))),
            order("patches"),
        ),
        (wrong(|u| u.removals.push(PatchId(1))), order("removals")),
        (
            wrong(|u| u.placements.push(placement(6, 0, 0, [1, 1]))),
            order("placements"),
        ),
        (
            wrong(|u| u.vertices[0] = vertex(10).moved()),
            WorldError::VertexChanged(VertexId(10)),
        ),
        (
            wrong(|u| u.patches[0] = patch(1, PatchShape::Pair)),
            WorldError::PatchChanged(PatchId(1)),
        ),
        (
            wrong(|u| u.patches[0].corners[2] = VertexId(99)),
            WorldError::UnknownVertex {
                patch: PatchId(6),
                vertex: VertexId(99),
            },
        ),
        (
            wrong(|u| u.placements.push(placement(8, 0, 0, [1, 1]))),
            WorldError::UnknownPatch(PatchId(8)),
        ),
        (
            wrong(|u| u.removals.push(PatchId(6))),
            WorldError::NotPlaced(PatchId(6)),
        ),
        (
            wrong(|u| u.epoch = Epoch(2)),
            WorldError::NotPlaced(PatchId(1)),
        ),
        (
            wrong(|u| u.placements[0] = placement(6, 62, 0, [2, 1])),
            WorldError::SlotOutside(PatchId(6)),
        ),
        (
            wrong(|u| u.placements[0] = placement(6, 0, u16::MAX, [1, 1])),
            WorldError::SlotOutside(PatchId(6)),
        ),
        (
            wrong(|u| u.placements[0] = placement(6, 0, 0, [255, 1])),
            WorldError::SlotOutside(PatchId(6)),
        ),
        (
            wrong(|u| u.placements[0].slot = triangle_slot()),
            WorldError::SlotKind {
                patch: PatchId(6),
                method: Method::Sas,
            },
        ),
        (
            wrong(|u| u.masks.push(mask(2, 1))),
            WorldError::MaskWithoutPlacement(PatchId(2)),
        ),
        (
            wrong(|u| u.masks.push(mask(6, 2))),
            WorldError::MaskSize {
                patch: PatchId(6),
                bytes: 2,
                expected: 1,
            },
        ),
        (
            wrong(|u| u.masks.extend([mask(6, 1), mask(6, 1)])),
            order("masks"),
        ),
        (
            wrong(|u| {
                u.motions
                    .push((ObjectId::WORLD, Motion::still(Pose::IDENTITY)))
            }),
            WorldError::WorldMoved,
        ),
    ];
    let mut world = world();
    let before = format!("{world:?}");
    for (update, error) in cases {
        assert_eq!(world.apply(&update), Err(error));
        assert_eq!(format!("{world:?}"), before, "{error}");
    }
    world.apply(&right()).unwrap();
}

#[test]
fn more_vertices_than_a_session_may_know_are_refused() {
    let mut world = World::new([64, 64], Method::Sas);
    world.positions.push(Vec3::ZERO);
    world.vertices = (0..MAX_VERTICES).map(|id| (VertexId(id), 0)).collect();
    let one_more = Update {
        vertices: vec![vertex(MAX_VERTICES)],
        ..update(0)
    };
    let error = WorldError::TooMany {
        what: "vertices",
        limit: MAX_VERTICES,
    };
    assert_eq!(world.apply(&one_more), Err(error));
}

trait Moved {
    fn moved(self) -> Self;
}

impl Moved for Vertex {
    fn moved(mut self) -> Self {
        self.position.y += 1.0;
        self
    }
}

fn mask(id: u32, bytes: usize) -> SlotMask {
    SlotMask {
        patch: PatchId(id),
        bits: vec![0; bytes],
    }
}

fn triangle_slot() -> Slot {
    Slot::Triangle(TriangleSlot {
        corners: [[4, 4], [28, 4], [4, 28]],
        weights: [65535; 3],
    })
}

#[test]
fn the_slot_of_one_triangle_does_not_hold_two() {
    let mut world = World::new([64, 64], Method::Tss);
    let update = Update {
        vertices: (20..25).map(vertex).collect(),
        patches: vec![patch(2, PatchShape::Pair)],
        placements: vec![Placement {
            patch: PatchId(2),
            slot: triangle_slot(),
        }],
        ..update(1)
    };
    let refused = world.apply(&update);
    assert_eq!(refused, Err(WorldError::SlotOfOneTriangle(PatchId(2))));
    assert_eq!(world.epoch(), None);
}
