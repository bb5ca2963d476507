//! How much smaller an update is in columns than as plain postcard under zstd.

use glam::{Quat, Vec3};
use shadecast_protocol::{
    Block, Level, ObjectId, PatchId, Placement, Slot, ToClient, Update, Vertex, VertexId,
};

use crate::samples;

/// Cells along one side of the surface; two triangles each.
const SIDE: u32 = 120;

/// A wavy welded surface of pairs, three quarters of which are placed: about
/// what a client is sent when it looks at a scene for the first time.
fn first_sight() -> Update {
    let mut vertices = Vec::new();
    for z in 0..=SIDE {
        for x in 0..=SIDE {
            let (u, v) = (x as f32 * 0.083, z as f32 * 0.117);
            let height = (u * 3.1).sin() * 0.4 + (v * 1.7 + u).cos() * 0.6;
            vertices.push(Vertex {
                id: VertexId(z * (SIDE + 1) + x),
                position: Quat::from_rotation_y(0.3) * Vec3::new(u, height, v),
            });
        }
    }
    let (mut patches, mut placements) = (Vec::new(), Vec::new());
    let mut next = [0_u16; 8];
    for z in 0..SIDE {
        for x in (0..SIDE).filter(|x| (x / 7 + z / 5) % 4 != 0) {
            let id = z * SIDE + x;
            let corner = z * (SIDE + 1) + x;
            let corners = [corner, corner + 1, corner + SIDE + 2, corner + SIDE + 1];
            let mut patch = samples::patch(id, &corners);
            (patch.object, patch.double_sided) = (ObjectId::WORLD, false);
            patches.push(patch);

            // Nearer rows get larger blocks; blocks of a level fill a
            // superblock of 64 texels column by column.
            let height = 4 - (z / 40) as u8;
            let level = Level {
                width: height + u8::from((x * 7 + z * 3) % 5 < 2),
                height,
            };
            let index = &mut next[usize::from(level.width + level.height - 2) % 8];
            let (width, height) = level.size();
            let (rows, columns) = (64 / height as u16, 64 / width as u16);
            let superblock = *index / (rows * columns) * 8 + u16::from(level.width);
            let (column, row) = (*index / rows % columns, *index % rows);
            *index += 1;
            placements.push(Placement {
                patch: PatchId(id),
                slot: Slot::Block(Block {
                    x: superblock % 32 * 64 + column * width as u16,
                    y: superblock / 32 * 64 + row * height as u16,
                    level,
                }),
            });
        }
    }
    Update {
        vertices,
        patches,
        removals: vec![],
        placements,
        masks: vec![],
        ..samples::update()
    }
}

fn per_patch(bytes: &[u8], update: &Update) -> f64 {
    bytes.len() as f64 / update.placements.len() as f64
}

#[test]
fn columns_take_less_than_half_of_plain_bytes() {
    let first_sight = first_sight();
    let moved = Update {
        vertices: vec![],
        patches: vec![],
        ..first_sight.clone()
    };
    for update in [first_sight, moved] {
        let plain = postcard::to_stdvec(&update).unwrap();
        let plain = zstd::bulk::compress(&plain, 3).unwrap();
        let columns = ToClient::Update(update.clone()).encode().unwrap();
        println!(
            "{} vertices, {} patches, {} placements: {:.2} bytes a placement, plain {:.2}",
            update.vertices.len(),
            update.patches.len(),
            update.placements.len(),
            per_patch(&columns, &update),
            per_patch(&plain, &update),
        );
        assert!(columns.len() * 2 < plain.len());
    }
}
