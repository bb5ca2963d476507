//! What a walking head asks of an atlas, frame by frame.
//!
//! A patch is asked for where it faces the eye and its middle lies within the
//! enlarged picture; walls hide nothing. That asks for more than an eye would see,
//! of the same sizes and as coherently, and needs no rasteriser.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::{Quat, Vec3, vec3};
use shadecast_protocol::{PatchShape, Pose};
use shadecast_server::{
    patches::{Patch, PatchedScene},
    scene::Scene,
};
use shadecast_shaders::atlas::{Seen, footprint};

/// Updates a second.
const RATE: f32 = 30.0;
/// Metres a second, and radius of the round that the head walks.
const SPEED: f32 = 1.2;
const RADIUS: f32 = 1.5;
/// The head looks about by so much either way, radians, so often a second.
const LOOK: f32 = 0.7;
const LOOKS: f32 = 0.4;
/// Pixels of the picture that levels are chosen for, and its opening: SAS 2018,
/// section 5.
const WIDTH: f32 = 1920.0;
const HEIGHT: f32 = 1080.0;
const OPENING: f32 = FRAC_PI_2;
/// Of the image plane for what may be seen, there as well.
const ENLARGEMENT: f32 = 1.2;

/// Pixels of the picture per radian, as footprints count them.
pub(super) const PIXELS_PER_RADIAN: f32 = WIDTH / OPENING;

/// Where the head is at a time.
pub(super) fn head(scene: &Scene, seconds: f32) -> Pose {
    let start = scene.first_eye();
    let along = SPEED / RADIUS * seconds;
    let offset = vec3(along.sin(), 0.0, 1.0 - along.cos()) * RADIUS;
    let look = LOOK * (seconds * LOOKS * TAU).sin();
    Pose {
        position: start.position + start.orientation * offset,
        orientation: start.orientation * Quat::from_rotation_y(look - along),
    }
}

/// What the head asks for in a frame, by ascending patch.
pub(super) fn seen(scene: &PatchedScene, frame: u32) -> Vec<Seen> {
    let head = head(&scene.scene, frame as f32 / RATE);
    let time = std::time::Duration::from_secs_f32(frame as f32 / RATE);
    let from_world: Vec<Pose> = std::iter::once(Pose::IDENTITY)
        .chain(
            scene
                .scene
                .objects
                .iter()
                .map(|o| o.world_from_object(time)),
        )
        .map(|pose| pose.inverse())
        .collect();
    (0..)
        .zip(&scene.patches)
        .filter_map(|(id, patch)| {
            let object_from_world = from_world[usize::from(patch.object.0)];
            let eye = object_from_world.transform_point(head.position);
            let turned = object_from_world.orientation * head.orientation;
            seen_patch(scene, patch, id, eye, turned)
        })
        .collect()
}

fn seen_patch(
    scene: &PatchedScene,
    patch: &Patch,
    id: u32,
    eye: Vec3,
    turned: Quat,
) -> Option<Seen> {
    let corners = patch.corners.map(|c| scene.scene.positions[c as usize]);
    let [a, b, c] = patch.shape.triangles()[0].map(|corner| corners[corner]);
    if !patch.double_sided && (b - a).cross(c - a).dot(eye - a) <= 0.0 {
        return None;
    }
    let middle = (corners[0] + corners[2]) * 0.5;
    let in_head = turned.inverse() * (middle - eye);
    let (x, y) = (
        (OPENING * 0.5).tan() * ENLARGEMENT,
        (OPENING * 0.5).tan() * ENLARGEMENT * HEIGHT / WIDTH,
    );
    let depth = -in_head.z;
    if depth <= 0.0 || in_head.x.abs() > x * depth || in_head.y.abs() > y * depth {
        return None;
    }
    let shape = match patch.shape {
        PatchShape::Solo => 0,
        PatchShape::Pair => 1,
        PatchShape::Triple => 2,
    };
    let wish = footprint(shape, &corners, eye, PIXELS_PER_RADIAN);
    let pixels = 1 + (wish.area() as f32 / 256.0).exp2() as u32;
    Some(Seen {
        patch: id,
        pixels,
        wish,
    })
}
