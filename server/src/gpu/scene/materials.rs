//! Materials as the kernels read them.

use glam::Vec3;
use shadecast_shaders::light::{BLENDED, Material as MaterialRecord, TextureRecord};

use super::{
    luminance,
    texels::{Texels, is_srgb, mean_color, slots},
};
use crate::scene::{Alpha, Scene, TextureRef, Wrap};

/// Luminance of the mean emission, by material.
pub(super) fn mean_emissions(scene: &Scene) -> Vec<f32> {
    let mean = |texture: Option<TextureRef>| {
        texture.map_or(Vec3::ONE, |texture| {
            mean_color(&scene.images[texture.image as usize])
        })
    };
    let materials = scene.materials.iter();
    materials
        .map(|material| luminance(material.emissive * mean(material.emissive_texture)))
        .collect()
}

pub(super) fn material_records(scene: &Scene, texels: &Texels) -> Vec<MaterialRecord> {
    let wrap = |wrap: Wrap| match wrap {
        Wrap::Repeat => 0,
        Wrap::Mirror => 1,
        Wrap::Clamp => 2,
    };
    let record = |slot: usize, texture: Option<TextureRef>| {
        let srgb = is_srgb(slot);
        let place = texture.and_then(|t| texels.places[t.image as usize][usize::from(srgb)]);
        let (Some(texture), Some(place)) = (texture, place) else {
            return TextureRecord::NONE;
        };
        TextureRecord {
            offset: place.offset,
            size: place.width | place.height << 16,
            flags: wrap(texture.wrap[0])
                | wrap(texture.wrap[1]) << 2
                | u32::from(texture.linear) << 4
                | u32::from(texture.uv_set == 1) << 5
                | u32::from(srgb) << 6,
            levels: place.levels,
            matrix: texture.transform.matrix2.to_cols_array(),
            translation: texture.transform.translation.to_array(),
            padding: [0.0; 2],
        }
    };
    scene
        .materials
        .iter()
        .map(|material| {
            let textures = slots(material);
            let reflectance = ((material.ior - 1.0) / (material.ior + 1.0)).powi(2);
            MaterialRecord {
                base_color: material.base_color.to_array(),
                emissive: material.emissive.to_array(),
                metallic: material.metallic,
                roughness: material.roughness,
                normal_scale: material.normal_scale,
                alpha_cutoff: match material.alpha {
                    Alpha::Mask { cutoff } => cutoff,
                    Alpha::Opaque => -1.0,
                    Alpha::Blend => BLENDED,
                },
                f0: reflectance,
                double_sided: u32::from(material.double_sided),
                spare: 0.0,
                padding: [0.0; 2],
                textures: std::array::from_fn(|slot| record(slot, textures[slot])),
            }
        })
        .collect()
}
