//! What the server knows of a scene: triangles, materials, images, lights and
//! the objects that move, flattened out of glTF's node tree.
//!
//! Everything that stands still is in world space; the triangles of a rigidly
//! moving object are in the space of that object. Space is right-handed, +Y
//! up, metres; colours are linear Rec.709.

mod build;
mod courtyard;
mod environment;
mod export;
mod facts;
mod gltf_load;
mod inspect;
mod spawn;
mod tangents;

use std::{sync::Arc, time::Duration};

use glam::{Affine2, Vec2, Vec3, Vec4};
use shadecast_protocol::{Motion, ObjectId, Pose};

pub use courtyard::courtyard;
pub use environment::{EnvironmentError, EnvironmentMap};
pub use export::write_glb;
pub use facts::SceneFacts;
pub use gltf_load::{LoadError, load};
pub use inspect::{Inspection, Memory, inspection};

/// A triangle mesh with materials, lights and moving objects, ready to be cut
/// into patches.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// For people.
    pub name: String,
    /// Positions, welded where they are bitwise equal and belong to the same
    /// object; the index is a [`VertexId`](shadecast_protocol::VertexId).
    pub positions: Vec<Vec3>,
    /// Everything else a triangle's corner has.
    pub corners: Vec<Corner>,
    /// Counter-clockwise seen from the front.
    pub triangles: Vec<Triangle>,
    /// At least one where there is a triangle.
    pub materials: Vec<Material>,
    /// Decoded pictures.
    pub images: Vec<Image>,
    /// Point, spot and directional lights.
    pub lights: Vec<Light>,
    /// What a ray meets that meets nothing.
    pub sky: SkyModel,
    /// What it meets in place of the sky; only where this is asked for beside the file.
    pub environment: Option<Arc<EnvironmentMap>>,
    /// Rigidly moving objects; `ObjectId(n)` is `objects[n - 1]`.
    pub objects: Vec<RigidObject>,
    /// Where the middle of the play space stands: floor level, facing -Z.
    pub spawn: Option<Pose>,
    /// What loading had to say.
    pub notes: LoadNotes,
}

/// Three corners and what they are made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Triangle {
    /// Into [`Scene::positions`].
    pub positions: [u32; 3],
    /// Into [`Scene::corners`].
    pub corners: [u32; 3],
    /// Into [`Scene::materials`].
    pub material: u32,
    /// What it moves with.
    pub object: ObjectId,
}

/// Attributes of a triangle's corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Unit shading normal.
    pub normal: Vec3,
    /// Unit tangent and the sign of the bitangent, as glTF has it; zero where
    /// no normal map asks for one.
    pub tangent: Vec4,
    /// The two texture coordinate sets.
    pub uv: [Vec2; 2],
    /// Linear colour, multiplied with the base colour.
    pub color: Vec4,
}

/// glTF metallic-roughness.
#[derive(Clone, Debug)]
pub struct Material {
    /// For people.
    pub name: String,
    /// Linear.
    pub base_color: Vec4,
    /// sRGB with linear alpha.
    pub base_color_texture: Option<TextureRef>,
    /// 0 is a dielectric.
    pub metallic: f32,
    /// Perceptual roughness.
    pub roughness: f32,
    /// Green is roughness, blue is metalness.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Tangent-space normals.
    pub normal_texture: Option<TextureRef>,
    /// Scales x and y of the normal map.
    pub normal_scale: f32,
    /// Red is occlusion. Loaded and reported; a path tracer finds occlusion itself.
    pub occlusion_texture: Option<TextureRef>,
    /// Radiance, W/(sr m²), strength included.
    pub emissive: Vec3,
    /// sRGB.
    pub emissive_texture: Option<TextureRef>,
    /// Opaque, masked or blended.
    pub alpha: Alpha,
    /// Seen from both sides.
    pub double_sided: bool,
    /// Index of refraction (KHR_materials_ior).
    pub ior: f32,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Vec4::ONE,
            base_color_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            occlusion_texture: None,
            emissive: Vec3::ZERO,
            emissive_texture: None,
            alpha: Alpha::Opaque,
            double_sided: false,
            ior: 1.5,
        }
    }
}

/// glTF's alphaMode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Alpha {
    /// Alpha is ignored.
    Opaque,
    /// There where alpha is at least the cutoff.
    Mask {
        /// The cutoff.
        cutoff: f32,
    },
    /// Each ray of light finds as much of it there as alpha says; a headset
    /// draws it as if opaque.
    Blend,
}

/// How a material uses an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Into [`Scene::images`].
    pub image: u32,
    /// Texture coordinate set, 0 or 1.
    pub uv_set: u8,
    /// KHR_texture_transform: applied to the coordinates.
    pub transform: Affine2,
    /// Horizontally and vertically.
    pub wrap: [Wrap; 2],
    /// False for the nearest texel.
    pub linear: bool,
}

/// What lies beyond the edge of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// The image again.
    Repeat,
    /// The image again, mirrored.
    Mirror,
    /// Its edge.
    Clamp,
}

/// Eight bits a channel, RGBA, row by row from the top.
#[derive(Clone, PartialEq, Eq)]
pub struct Image {
    /// For people.
    pub name: String,
    /// In pixels.
    pub width: u32,
    /// In pixels.
    pub height: u32,
    /// `4 * width * height` bytes.
    pub rgba: Vec<u8>,
}

impl std::fmt::Debug for Image {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Image({} {}x{})", self.name, self.width, self.height)
    }
}

/// KHR_lights_punctual. Positions and directions are in world space; a light
/// on a moving object stands where it was at time zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Radiates in all directions.
    Point {
        /// Metres.
        position: Vec3,
        /// W/sr (glTF: candela).
        intensity: Vec3,
        /// Metres beyond which it does not reach; infinity when glTF gives none.
        range: f32,
    },
    /// Radiates into a cone.
    Spot {
        /// Metres.
        position: Vec3,
        /// Unit vector along which it shines.
        direction: Vec3,
        /// W/sr (glTF: candela).
        intensity: Vec3,
        /// Metres.
        range: f32,
        /// Half angle within which it shines fully, radians.
        inner: f32,
        /// Half angle beyond which it does not shine, radians.
        outer: f32,
    },
    /// From infinity.
    Directional {
        /// Unit vector along which it shines.
        direction: Vec3,
        /// W/m² (glTF: lux).
        irradiance: Vec3,
        /// Half angle of its disc, radians; zero for a hard shadow.
        angular_radius: f32,
    },
}

/// Radiance by direction: from the horizon's colour to the zenith's, and one
/// colour for all that is below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyModel {
    /// Straight up.
    pub zenith: Vec3,
    /// At eye level.
    pub horizon: Vec3,
    /// Below eye level.
    pub ground: Vec3,
}

impl SkyModel {
    /// No light from outside.
    pub const BLACK: Self = Self {
        zenith: Vec3::ZERO,
        horizon: Vec3::ZERO,
        ground: Vec3::ZERO,
    };

    /// The same radiance from everywhere.
    #[must_use]
    pub fn constant(radiance: Vec3) -> Self {
        Self {
            zenith: radiance,
            horizon: radiance,
            ground: radiance,
        }
    }

    /// Radiance from `direction`, a unit vector. Twin of `sky_radiance` in WGSL.
    #[must_use]
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        if direction.y < 0.0 {
            let t = (-direction.y * 8.0).min(1.0);
            self.horizon.lerp(self.ground, t)
        } else {
            self.horizon.lerp(self.zenith, direction.y.sqrt())
        }
    }

    /// True when it gives no light at all.
    #[must_use]
    pub fn is_black(&self) -> bool {
        *self == Self::BLACK
    }
}

impl Default for SkyModel {
    fn default() -> Self {
        Self::BLACK
    }
}

/// Something that moves as a whole.
#[derive(Clone, Debug, Default)]
pub struct RigidObject {
    /// For people.
    pub name: String,
    /// Poses `world_from_object` at ascending times from zero; linear between
    /// them (positions straight, orientations along the great circle), and
    /// from the last to the first by starting over.
    pub keys: Vec<(Duration, Pose)>,
}

/// What loading a file had to say to the user.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LoadNotes {
    /// Extensions that the file uses and the loader honours.
    pub extensions_used: Vec<String>,
    /// Optional extensions that the loader does not know.
    pub extensions_ignored: Vec<String>,
    /// One sentence each.
    pub warnings: Vec<String>,
}

impl Scene {
    /// Where the objects are at `time` since the scene began, `ObjectId(1)` first.
    #[must_use]
    pub fn poses(&self, time: Duration) -> Vec<Pose> {
        let at_time = |object: &RigidObject| object.world_from_object(time);
        self.objects.iter().map(at_time).collect()
    }

    /// Lowest and highest coordinates of all triangles at time zero, metres;
    /// both zero where there is none.
    #[must_use]
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let poses: Vec<Pose> = std::iter::once(Pose::IDENTITY)
            .chain(self.poses(Duration::ZERO))
            .collect();
        self.triangles
            .iter()
            .flat_map(|triangle| {
                triangle
                    .positions
                    .map(|position| (triangle.object, position))
            })
            .map(|(object, position)| {
                poses[usize::from(object.0)].transform_point(self.positions[position as usize])
            })
            .map(|point| (point, point))
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
            .unwrap_or_default()
    }
}

impl RigidObject {
    /// Where the object is at `time` since the scene began.
    #[must_use]
    pub fn world_from_object(&self, time: Duration) -> Pose {
        self.pose_in_loop(self.time_in_loop(time))
    }

    /// The same with its velocities, which are means over a tenth of a second:
    /// long enough that poses far from the origin do not round them away. Where
    /// the animation begins anew, the object jumps and its velocity does not.
    #[must_use]
    pub fn motion(&self, time: Duration) -> Motion {
        const HALF_SPAN: Duration = Duration::from_millis(50);
        let time = self.time_in_loop(time);
        let before = time.saturating_sub(HALF_SPAN);
        let after = (time + HALF_SPAN).min(self.length());
        let ends = [before, after].map(|time| self.pose_in_loop(time));
        let seconds = after.saturating_sub(before).as_secs_f32();
        Motion::along(self.pose_in_loop(time), ends, seconds)
    }

    fn length(&self) -> Duration {
        self.keys.last().map_or(Duration::ZERO, |last| last.0)
    }

    fn time_in_loop(&self, time: Duration) -> Duration {
        let length = self.length().as_nanos();
        Duration::from_nanos(time.as_nanos().checked_rem(length).unwrap_or(0) as u64)
    }

    /// `time` is at most the length.
    fn pose_in_loop(&self, time: Duration) -> Pose {
        let Some(first) = self.keys.first() else {
            return Pose::IDENTITY;
        };
        if self.length().is_zero() {
            return first.1;
        }
        let next = self
            .keys
            .partition_point(|key| key.0 <= time)
            .clamp(1, self.keys.len() - 1);
        let (before, after) = (&self.keys[next - 1], &self.keys[next]);
        let span = (after.0 - before.0).as_secs_f32();
        let t = if span > 0.0 {
            (time.saturating_sub(before.0).as_secs_f32() / span).min(1.0)
        } else {
            1.0
        };
        Pose {
            position: before.1.position.lerp(after.1.position, t),
            orientation: before.1.orientation.slerp(after.1.orientation, t),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Quat;

    use super::*;

    #[test]
    fn an_object_jumps_where_its_animation_begins_anew_but_its_velocity_does_not() {
        // Far from the origin, and not a loop: 3 m at 2 m/s, then back at once.
        let at = |x: f32| Pose {
            position: Vec3::new(1e5 + x, 0.0, 0.0),
            orientation: Quat::IDENTITY,
        };
        let object = RigidObject {
            name: String::new(),
            keys: vec![
                (Duration::ZERO, at(0.0)),
                (Duration::from_millis(1500), at(3.0)),
            ],
        };
        for milliseconds in [0, 20, 700, 1499, 1500, 1510, 100_000] {
            let motion = object.motion(Duration::from_millis(milliseconds));
            let off = (motion.linear_velocity - Vec3::X * 2.0).length();
            assert!(off < 0.35, "{motion:?} after {milliseconds} ms");
            assert_eq!(motion.angular_velocity, Vec3::ZERO);
        }
        let nothing = RigidObject {
            name: String::new(),
            keys: Vec::new(),
        };
        let still = Motion::still(Pose::IDENTITY);
        assert_eq!(nothing.motion(Duration::from_secs(7)), still);
    }
}
