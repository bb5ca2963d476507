//! Host structs of the scene's records; see `scene.wgsl`.

use bytemuck::{Pod, Zeroable};
use glam::{Mat3, Vec3};

/// Marks an absent texture or tree.
pub const NO_TEXTURE: u32 = u32::MAX;

/// What is the same for all of a frame.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Globals {
    /// Radiance straight up.
    pub sky_zenith: [f32; 3],
    /// Length of the list of lights.
    pub light_count: u32,
    /// Radiance at eye level.
    pub sky_horizon: [f32; 3],
    /// Of those, how many are no triangles; the others ascend by triangle.
    pub punctual_count: u32,
    /// Radiance from below.
    pub sky_ground: [f32; 3],
    /// Length of the list of instances.
    pub instance_count: u32,
    /// Unit vector towards the sun.
    pub sun_direction: [f32; 3],
    /// Cosine of the sun's half angle.
    pub sun_cos: f32,
    /// W/m² on a surface that faces the sun.
    pub sun_irradiance: [f32; 3],
    /// Indirect bounces.
    pub bounces: u32,
    /// Luminance of a contribution too faint to always be worth a shadow ray.
    pub faint: f32,
    /// Side in pixels of a cell of the picture of all directions.
    pub environment_cell: u32,
    /// Of that picture, pixels; zero where the sky is no picture.
    pub environment_size: [u32; 2],
}

/// Where a texture's texels are and how they are read.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct TextureRecord {
    /// First texel, or [`NO_TEXTURE`].
    pub offset: u32,
    /// Width, and height in the upper half.
    pub size: u32,
    /// Bits 0-1 and 2-3: wrap of u and v (0 repeat, 1 mirror, 2 clamp); 4:
    /// bilinear; 5: second coordinate set; 6: sRGB.
    pub flags: u32,
    /// Mip levels, each a quarter of the one before it.
    pub levels: u32,
    /// Columns of the coordinate transform.
    pub matrix: [f32; 4],
    /// Its translation.
    pub translation: [f32; 2],
    /// Zero.
    pub padding: [f32; 2],
}

impl TextureRecord {
    /// No texture.
    pub const NONE: Self = Self {
        offset: NO_TEXTURE,
        size: 0,
        flags: 0,
        levels: 0,
        matrix: [1.0, 0.0, 0.0, 1.0],
        translation: [0.0; 2],
        padding: [0.0; 2],
    };
}

/// In place of a mask's cutoff.
pub const BLENDED: f32 = 3.0e38;

/// glTF metallic-roughness.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Material {
    /// Linear.
    pub base_color: [f32; 4],
    /// Radiance.
    pub emissive: [f32; 3],
    /// 0 to 1.
    pub metallic: f32,
    /// Perceptual.
    pub roughness: f32,
    /// Scales x and y of the normal map.
    pub normal_scale: f32,
    /// Negative where all of the surface is there, [`BLENDED`] where each ray
    /// finds as much of it there as alpha says.
    pub alpha_cutoff: f32,
    /// Reflectance of the dielectric at normal incidence.
    pub f0: f32,
    /// 1 where seen from both sides.
    pub double_sided: u32,
    /// Zero.
    pub spare: f32,
    /// Zero.
    pub padding: [f32; 2],
    /// Base colour, metallic-roughness, normal, emissive.
    pub textures: [TextureRecord; 4],
}

/// A lamp. Kinds: 0 emissive triangle, 1 point, 2 spot, 3 directional.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct LightRecord {
    /// See above.
    pub kind: u32,
    /// Of an emissive triangle.
    pub triangle: u32,
    /// What an emissive triangle moves with.
    pub instance: u32,
    /// Bit `n` says which child of the light node at depth `n` leads to it.
    pub trail: u32,
    /// Metres.
    pub position: [f32; 3],
    /// Zero.
    pub padding: u32,
    /// W/sr, or W/m² of a directional light.
    pub intensity: [f32; 3],
    /// Metres.
    pub range: f32,
    /// Unit vector along which it shines.
    pub direction: [f32; 3],
    /// Of the cone's edge.
    pub cos_outer: f32,
    /// Within which a spot shines fully.
    pub cos_inner: f32,
    /// Of an emissive triangle, m².
    pub area: f32,
    /// Zero.
    pub spare: [f32; 2],
}

/// Marks a [`LightNode`]'s child as a light.
pub const LIGHT_LEAF: u32 = 0x8000_0000;

/// A node of the tree over the lamps: a sphere and a cone of directions about them.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct LightNode {
    /// Metres, in the world.
    pub centre: [f32; 3],
    /// Metres; negative where the lamps are infinitely far.
    pub radius: f32,
    /// Middle of the directions that they shine to.
    pub axis: [f32; 3],
    /// Of the angle about the axis beyond which no surface's normal lies.
    pub cos_spread: f32,
    /// Sum of their greatest intensities.
    pub power: f32,
    /// The first of two, or [`LIGHT_LEAF`] and the light.
    pub child: u32,
    /// Zero.
    pub padding: [u32; 2],
}

/// The world, or a moving object.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Instance {
    /// Rows of the affine transform.
    pub world_from_object: [[f32; 4]; 3],
    /// Rows of its inverse.
    pub object_from_world: [[f32; 4]; 3],
    /// Of its tree, or [`NO_TEXTURE`] when it has no triangle.
    pub root_node: u32,
    /// Of its triangles in tree order.
    pub first_triangle: u32,
    /// Zero.
    pub padding: [u32; 2],
}

/// The rows of an affine transform as WGSL's `mat3x4` holds them.
#[must_use]
pub fn rows_of_affine(matrix: Mat3, translation: Vec3) -> [[f32; 4]; 3] {
    let rows = matrix.transpose();
    [
        rows.x_axis.extend(translation.x).to_array(),
        rows.y_axis.extend(translation.y).to_array(),
        rows.z_axis.extend(translation.z).to_array(),
    ]
}
