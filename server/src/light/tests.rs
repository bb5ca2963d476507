//! What a block holds is what its patch has there, however it lies.

mod bent;
mod samplers;
mod triangles;

use glam::{Affine2, Vec2, Vec3, Vec4, vec2};
use shadecast_protocol::{Block, Epoch, Level, ObjectId, PatchId, Placement, Slot};
use shadecast_shaders::light::{PatchPoint, patch_point, texel_coordinates};

use super::*;
use crate::{
    atlas::AtlasStats,
    gpu::Integrator,
    patches::{self, PatchLimits, PatchedScene},
    scene::{Corner, Image, Material, Scene, TextureRef, Triangle, Wrap},
};

const ATLAS: u16 = 64;
const EYE: Vec3 = Vec3::new(0.5, 0.5, 2.0);
const VIEWER: Viewer = Viewer {
    eye: EYE,
    pixels_per_radian: 100.0,
    exposure: 1.0,
};

/// A square that glows in four colours, one a quarter.
fn four_quarters(method: Method) -> PatchedScene {
    let uvs = [vec2(0., 0.), vec2(1., 0.), vec2(1., 1.), vec2(0., 1.)];
    let mut scene = Scene {
        materials: vec![Material {
            base_color: Vec4::W,
            emissive: Vec3::ONE,
            emissive_texture: Some(TextureRef {
                image: 0,
                uv_set: 0,
                transform: Affine2::IDENTITY,
                wrap: [Wrap::Clamp; 2],
                linear: false,
            }),
            ..Material::default()
        }],
        images: vec![Image {
            name: "quarters".to_owned(),
            width: 2,
            height: 2,
            rgba: [
                [255, 0, 0, 255],
                [0, 255, 0, 255],
                [0, 0, 255, 255],
                [255; 4],
            ]
            .concat(),
        }],
        ..Scene::default()
    };
    for uv in uvs {
        scene.positions.push(uv.extend(0.0));
        scene.corners.push(Corner {
            normal: Vec3::Z,
            tangent: Vec4::ZERO,
            uv: [uv; 2],
            color: Vec4::ONE,
        });
    }
    for corners in [[0, 1, 2], [0, 2, 3]] {
        scene.triangles.push(Triangle {
            positions: corners,
            corners,
            material: 0,
            object: ObjectId::WORLD,
        });
    }
    let limits = PatchLimits {
        longest_edge: 10.0,
        most_triangles: 10,
    };
    patches::cut_for(method, scene, limits)
}

/// What the square glows with at patch coordinates, and whether that is well
/// inside a quarter.
fn glow(scene: &PatchedScene, patch_uv: Vec2) -> (Vec3, bool) {
    glow_at(scene, patch_point(1, patch_uv))
}

/// The same by one of the square's triangles.
fn glow_at(scene: &PatchedScene, point: PatchPoint) -> (Vec3, bool) {
    let corners = scene.scene.triangles[point.triangle as usize].corners;
    let [a, b, c] = corners.map(|corner| scene.scene.corners[corner as usize].uv[0]);
    let uv = a + (b - a) * point.weights.x + (c - a) * point.weights.y;
    let color = match (uv.x < 0.5, uv.y < 0.5) {
        (true, true) => Vec3::X,
        (false, true) => Vec3::Y,
        (true, false) => Vec3::Z,
        (false, false) => Vec3::ONE,
    };
    (color, (uv - 0.5).abs().min_element() > 0.2)
}

fn placed(slot: Slot, old: Option<Slot>) -> Placed {
    let patch = PatchId(0);
    Placed {
        epoch: Epoch(1),
        reset: false,
        out_of_memory: false,
        visible: Vec::new(),
        removals: Vec::new(),
        placements: vec![Placement { patch, slot }],
        moved: old.map(|old| (patch, old, slot)).into_iter().collect(),
        bias: 0.0,
        unplaced: 0,
        stats: AtlasStats::default(),
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_patch_on_its_side_is_lit_as_itself_and_keeps_its_light_when_it_is_turned() {
    let scene = four_quarters(Method::Sas);
    let gpu = Gpu::open().expect("a GPU");
    let gpu_scene = GpuScene::new(&gpu, &scene.scene, Integrator::with_bounces(1), &mut |_| ())
        .expect("a scene");
    let mut light = Light::new(&gpu, &gpu_scene, [ATLAS; 2], Method::Sas).expect("an atlas");
    let schedule = Schedule::new(vec![Lasting {
        longest_history: 64.0,
        point: Vec3::ZERO,
        alpha: 1.0,
        shine: 0.0,
    }]);
    let bytes = light.shown().size();

    let at = |x, width, height| Block {
        x,
        y: 8,
        level: Level { width, height },
    };
    let blocks = [at(0, 3, 4), at(16, 4, 3), at(40, 3, 4), at(0, 2, 4)];
    let mut old = None;
    for block in blocks {
        let slot = Slot::Block(block);
        let placed = placed(slot, old);
        let mut encoder = (gpu.device).create_command_encoder(&Default::default());
        light
            .record_moves(&gpu, &mut encoder, &placed)
            .expect("room");
        gpu.queue.submit([encoder.finish()]);
        // Only the first block is traced; the others are resampled from it.
        let job = [schedule.job(&scene.patches, PatchId(0), slot, &[EYE])];
        if old.is_none() {
            light.trace(&gpu, &gpu_scene, &job, VIEWER);
        }
        light
            .show(&gpu, &gpu_scene, &[], &job, VIEWER)
            .expect("light");
        let shown: Vec<Vec4> = gpu
            .read(light.shown(), 0..bytes)
            .expect("the device answers");

        let (width, height) = block.level.size();
        let mut compared = 0;
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let uv = texel_coordinates(x, y, width, height).to_array();
            let (expected, is_inside) = glow(&scene, block.level.turn(uv).into());
            let row = usize::from(ATLAS) * (usize::from(block.y) + y as usize);
            let found = shown[row + usize::from(block.x) + x as usize].truncate();
            if is_inside {
                assert!(
                    found.abs_diff_eq(expected, 0.02),
                    "{block:?} {x} {y}: {found}"
                );
                compared += 1;
            }
        }
        assert!(compared > width * height / 4);
        old = Some(slot);
    }
}
