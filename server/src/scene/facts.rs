//! What a scene uses, and so what it does not need.

use glam::{Vec2, Vec3, Vec4};
use serde::Serialize;

use super::{Alpha, Light, Material, Scene, TextureRef};

/// Below this roughness a lobe is narrow enough to be seen as a reflection.
const GLOSSY_BELOW: f32 = 0.5;
/// Below this GGX alpha, which is roughness squared, hardly any sample of a lamp
/// falls into a lobe. Twin: `NARROW` in `path.wgsl`.
const NARROW: f32 = 0.1;

/// What the triangles and lights of a scene use; what none of them uses need
/// not be built, bound, dispatched or sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct SceneFacts {
    /// Some material is there only where its texture's alpha says so.
    pub alpha_mask: bool,
    /// Some material is transparent to rays of light.
    pub alpha_blend: bool,
    /// Some material has a normal map.
    pub normal_maps: bool,
    /// Some material has a texture that light depends on.
    pub textures: bool,
    /// Some texture uses the second set of coordinates.
    pub second_uv_set: bool,
    /// Some corner has a colour other than white.
    pub vertex_colors: bool,
    /// Some material is seen from both sides.
    pub double_sided: bool,
    /// Triangles that radiate.
    pub emissive_triangles: usize,
    /// Directional lights.
    pub suns: usize,
    /// Point and spot lights.
    pub punctual_lights: usize,
    /// The sky radiates, be it a picture or not.
    pub sky: bool,
    /// Rigidly moving objects.
    pub moving_objects: usize,
    /// No metal, and nothing smoother than a roughness of 0.5.
    pub all_rough: bool,
    /// Some material has a lobe that hardly any sample of a lamp falls into.
    pub narrow_lobes: bool,
}

impl SceneFacts {
    /// Reads the facts off a scene. Materials that no triangle has do not count.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let mut triangles = vec![0_usize; scene.materials.len()];
        for triangle in &scene.triangles {
            triangles[triangle.material as usize] += 1;
        }
        let used = || {
            let counted = scene.materials.iter().zip(&triangles);
            counted
                .filter(|(_, count)| **count > 0)
                .map(|(material, _)| material)
        };
        let is_sun = |light: &&Light| matches!(light, Light::Directional { .. });
        let suns = scene.lights.iter().filter(is_sun).count();
        Self {
            alpha_mask: used().any(|m| matches!(m.alpha, Alpha::Mask { .. })),
            alpha_blend: used().any(|m| m.alpha == Alpha::Blend),
            normal_maps: used().any(|m| m.normal_texture.is_some()),
            textures: used().any(|m| textures(m).next().is_some()),
            second_uv_set: used().flat_map(textures).any(|texture| texture.uv_set == 1),
            vertex_colors: scene.corners.iter().any(|corner| corner.color != Vec4::ONE),
            double_sided: used().any(|m| m.double_sided),
            emissive_triangles: scene
                .materials
                .iter()
                .zip(&triangles)
                .filter(|(material, _)| material.emissive != Vec3::ZERO)
                .map(|(_, count)| count)
                .sum(),
            suns,
            punctual_lights: scene.lights.len() - suns,
            sky: scene.environment.is_some() || !scene.sky.is_black(),
            moving_objects: scene.objects.len(),
            all_rough: used().all(|m| {
                let [roughness, metal] = glossiest(m, scene);
                roughness >= GLOSSY_BELOW && metal == 0.0
            }),
            narrow_lobes: used().any(|m| glossiest(m, scene)[0].powi(2) < NARROW),
        }
    }

    /// Lamps are seen in lobes that hardly any sample of a lamp falls into, and
    /// so must be looked for there.
    #[must_use]
    pub fn lamps_in_narrow_lobes(&self) -> bool {
        self.narrow_lobes && self.emissive_triangles > 0
    }

    /// One sentence for everything that the server leaves out of its work.
    #[must_use]
    pub fn left_out(&self) -> Vec<String> {
        let sentences = [
            (
                !self.alpha_mask && !self.alpha_blend,
                "no alpha masks or blending: rays never look at a texture on their way",
            ),
            (
                !self.normal_maps,
                "no normal maps: normals come from the corners alone",
            ),
            (
                !self.textures,
                "no textures: materials are the same all over",
            ),
            (
                !self.second_uv_set,
                "no second texture coordinates: every texture uses set 0",
            ),
            (
                !self.vertex_colors,
                "no vertex colours: corners do not tint materials",
            ),
            (
                !self.double_sided,
                "nothing is double-sided: only front faces are drawn",
            ),
            (
                self.emissive_triangles == 0,
                "nothing radiates: no emissive triangle is sampled",
            ),
            (self.suns == 0, "no sun: no directional light is sampled"),
            (
                self.punctual_lights == 0,
                "no point or spot lights: none is sampled",
            ),
            (
                !self.sky,
                "the sky is black: rays that leave bring no light",
            ),
            (
                self.moving_objects == 0,
                "nothing moves: no transforms are sent",
            ),
            (
                self.all_rough,
                "nothing shines: all materials are rough and no metal",
            ),
            (
                !self.lamps_in_narrow_lobes(),
                "no lamp is seen in a mirror: paths send no ray beyond their last vertex",
            ),
        ];
        let absent = sentences.into_iter().filter(|(absent, _)| *absent);
        absent.map(|(_, sentence)| sentence.to_owned()).collect()
    }
}

/// The textures that light depends on; a path tracer finds occlusion itself.
fn textures(material: &Material) -> impl Iterator<Item = &TextureRef> {
    [
        &material.base_color_texture,
        &material.metallic_roughness_texture,
        &material.normal_texture,
        &material.emissive_texture,
    ]
    .into_iter()
    .flatten()
}

/// The least roughness and the most metalness anywhere on the material.
fn glossiest(material: &Material, scene: &Scene) -> [f32; 2] {
    let extremes = material.metallic_roughness_texture.as_ref().map(|texture| {
        let texels = scene.images[texture.image as usize].rgba.chunks_exact(4);
        let start = Vec2::new(1.0, 0.0);
        texels.fold(start, |found, texel| {
            let (roughness, metal) = (f32::from(texel[1]) / 255.0, f32::from(texel[2]) / 255.0);
            Vec2::new(found.x.min(roughness), found.y.max(metal))
        })
    });
    let extremes = extremes.unwrap_or(Vec2::ONE);
    (extremes * Vec2::new(material.roughness, material.metallic)).to_array()
}
