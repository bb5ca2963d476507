//! What happens before the eye: how the head goes, and how a lamp does.

use std::{
    f32::consts::{PI, TAU},
    time::Duration,
};

use glam::{Quat, Vec3, vec3};
use shadecast_protocol::{ObjectId, Pose};
use shadecast_server::scene::{Material, RigidObject, Scene};

/// Updates a second.
const RATE: u32 = 30;
/// Updates of a trace.
pub(super) const UPDATES: u32 = 60;
/// Update at which the lamp jumps.
const JUMP: u32 = 30;
/// Half of the lamp's side and its distance from the eye, metres.
const LAMP_HALF_SIDE: f32 = 0.08;
const LAMP_DISTANCE: f32 = 2.2;
/// Irradiance that the lamp brings at its own distance, in that of a surface of
/// middling brightness.
const LAMP_STRENGTH: f32 = 4.0;

/// What moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Motion {
    /// The head looks about and sways.
    Head,
    /// A lamp circles before the eye.
    Lamp,
    /// A lamp jumps in the middle of the trace.
    Jump,
}

impl Motion {
    pub(super) const ALL: [Self; 3] = [Self::Head, Self::Lamp, Self::Jump];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Head => "head",
            Self::Lamp => "lamp",
            Self::Jump => "jump",
        }
    }

    /// Updates after which pictures are compared.
    pub(super) fn compared(self, few: bool) -> Vec<u32> {
        let all = match self {
            Self::Head | Self::Lamp => (5..UPDATES).step_by(6).collect(),
            // The last ones are half a second and more after the jump.
            Self::Jump => vec![
                26,
                JUMP - 1,
                JUMP,
                33,
                36,
                40,
                JUMP + RATE / 2,
                50,
                UPDATES - 1,
            ],
        };
        if few {
            all.into_iter().skip(1).step_by(3).collect()
        } else {
            all
        }
    }

    /// The scene as this motion has it.
    pub(super) fn scene(self, scene: &Scene, brightness: f32) -> Scene {
        let mut scene = scene.clone();
        if self != Self::Head {
            add_lamp(&mut scene, brightness, self == Self::Jump);
        }
        scene
    }

    /// Where the eye is at an update.
    pub(super) fn eye(self, scene: &Scene, update: u32) -> Pose {
        let first = scene.first_eye();
        if self != Self::Head {
            return first;
        }
        let turns = time_of(update).as_secs_f32() * TAU;
        let sway = Pose {
            position: vec3(
                0.4 * (turns / 3.0).sin(),
                0.04 * (turns / 1.1).sin(),
                -0.3 * (1.0 - (turns / 4.0).cos()),
            ),
            orientation: Quat::from_rotation_y(0.35 * (turns / 4.0).sin())
                * Quat::from_rotation_x(0.08 * (turns / 2.3).sin()),
        };
        first.then(sway)
    }
}

/// Since the trace began.
pub(super) fn time_of(update: u32) -> Duration {
    Duration::from_secs(1) * update / RATE
}

/// A small glowing box before the first eye.
fn add_lamp(scene: &mut Scene, brightness: f32, jumps: bool) {
    // A cube of half side h shows about 6 h² to any side, on average over directions.
    let shown_area = 6.0 * LAMP_HALF_SIDE * LAMP_HALF_SIDE;
    let irradiance = LAMP_STRENGTH * PI * brightness;
    let radiance = irradiance * LAMP_DISTANCE * LAMP_DISTANCE / shown_area;
    let glow = scene.add_material(Material {
        name: "lamp".to_owned(),
        emissive: Vec3::splat(radiance),
        metallic: 0.0,
        ..Material::default()
    });
    let before = scene.triangles.len();
    scene.add_box(Vec3::ZERO, Vec3::splat(LAMP_HALF_SIDE), glow);
    let eye = scene.first_eye();
    let at = |x: f32, y: f32| Pose {
        position: eye.transform_point(vec3(x, y, -LAMP_DISTANCE)),
        orientation: Quat::IDENTITY,
    };
    let keys = if jumps {
        let moment = time_of(JUMP);
        let just_before = moment - Duration::from_millis(1);
        vec![
            (Duration::ZERO, at(-0.4, 0.1)),
            (just_before, at(-0.4, 0.1)),
            (moment, at(0.4, 0.1)),
            (time_of(2 * UPDATES), at(0.4, 0.1)),
        ]
    } else {
        (0..=32_u32)
            .map(|step| {
                let turn = step as f32 / 32.0 * TAU;
                (
                    Duration::from_millis(125) * step,
                    at(0.45 * turn.cos(), 0.25 * turn.sin()),
                )
            })
            .collect()
    };
    scene.objects.push(RigidObject {
        name: "lamp".to_owned(),
        keys,
    });
    let object = ObjectId(scene.objects.len() as u16);
    for triangle in &mut scene.triangles[before..] {
        triangle.object = object;
    }
}
