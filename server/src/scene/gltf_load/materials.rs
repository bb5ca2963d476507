//! Materials and how they use pictures.

use glam::{Affine2, Mat2, Vec2, Vec3, Vec4};
use gltf::material::AlphaMode;
use gltf::texture::{MagFilter, Texture, WrappingMode};
use serde_json::Value;

use super::LoadError;
use super::accessor::Data;
use super::container::Container;
use super::images::Pictures;
use crate::scene::{Alpha, Material, Scene, TextureRef, Wrap};

/// Reads all materials with the pictures that they use. Where a primitive has
/// no material, glTF's default one is added at the end.
pub(super) fn read(
    container: &Container,
    data: &Data<'_>,
    scene: &mut Scene,
) -> Result<(), LoadError> {
    let mut pictures = Pictures::new(container, data);
    for (index, material) in container.document.materials().enumerate() {
        let mut reader = Reader {
            place: format!("materials[{index}]"),
            json: &container.materials[index],
            pictures: &mut pictures,
            scene: &mut *scene,
        };
        let material = reader.material(&material)?;
        scene.materials.push(material);
    }
    let primitives = container
        .document
        .meshes()
        .flat_map(|mesh| mesh.primitives());
    if primitives
        .into_iter()
        .any(|primitive| primitive.material().index().is_none())
    {
        scene.materials.push(Material {
            name: "default".to_owned(),
            ..Material::default()
        });
    }
    Ok(())
}

struct Reader<'a, 'b> {
    place: String,
    /// The material as it stands in the file: the parser keeps texture
    /// transforms of some slots only.
    json: &'a Value,
    pictures: &'a mut Pictures<'b>,
    scene: &'a mut Scene,
}

impl Reader<'_, '_> {
    fn material(&mut self, material: &gltf::Material<'_>) -> Result<Material, LoadError> {
        let pbr = material.pbr_metallic_roughness();
        let normal = material.normal_texture();
        let strength = material.emissive_strength().unwrap_or(1.0);
        let result = Material {
            name: material.name().unwrap_or_default().to_owned(),
            base_color: Vec4::from_array(pbr.base_color_factor()),
            base_color_texture: self.texture(
                pbr.base_color_texture().map(|info| info.texture()),
                "/pbrMetallicRoughness/baseColorTexture",
            )?,
            metallic: pbr.metallic_factor(),
            roughness: pbr.roughness_factor(),
            metallic_roughness_texture: self.texture(
                pbr.metallic_roughness_texture().map(|info| info.texture()),
                "/pbrMetallicRoughness/metallicRoughnessTexture",
            )?,
            normal_scale: normal.as_ref().map_or(1.0, |normal| normal.scale()),
            normal_texture: self.texture(normal.map(|info| info.texture()), "/normalTexture")?,
            occlusion_texture: self.texture(
                material.occlusion_texture().map(|info| info.texture()),
                "/occlusionTexture",
            )?,
            emissive: Vec3::from_array(material.emissive_factor()) * strength,
            emissive_texture: self.texture(
                material.emissive_texture().map(|info| info.texture()),
                "/emissiveTexture",
            )?,
            alpha: self.alpha(material),
            double_sided: material.double_sided(),
            ior: material.ior().unwrap_or(1.5),
        };
        let factors = [
            result.metallic,
            result.roughness,
            result.normal_scale,
            result.ior,
        ];
        let finite = factors.iter().all(|factor| factor.is_finite())
            && result.base_color.is_finite()
            && result.emissive.is_finite();
        if !finite {
            return Err(LoadError::invalid(&*self.place, "a factor is not finite"));
        }
        if result.emissive.min_element() < 0.0 || result.ior < 0.0 {
            let fault = "its emission or its index of refraction is negative";
            return Err(LoadError::invalid(&*self.place, fault));
        }
        let base_color = result.base_color.clamp(Vec4::ZERO, Vec4::ONE);
        if base_color != result.base_color {
            self.warn("has a base colour beyond 0 to 1, which would make light: it is kept within");
        }
        Ok(Material {
            base_color,
            ..result
        })
    }

    fn alpha(&mut self, material: &gltf::Material<'_>) -> Alpha {
        match material.alpha_mode() {
            AlphaMode::Opaque => Alpha::Opaque,
            AlphaMode::Mask => Alpha::Mask {
                cutoff: material.alpha_cutoff().unwrap_or(0.5),
            },
            AlphaMode::Blend => {
                self.warn("has alphaMode BLEND: rays of light go through it, a headset draws it as if opaque");
                Alpha::Blend
            }
        }
    }

    fn warn(&mut self, what: &str) {
        let warning = format!("{} {what}", self.place);
        self.scene.notes.warnings.push(warning);
    }

    /// A texture and what the JSON at `slot` says of its use.
    fn texture(
        &mut self,
        texture: Option<Texture<'_>>,
        slot: &str,
    ) -> Result<Option<TextureRef>, LoadError> {
        let Some(texture) = texture else {
            return Ok(None);
        };
        let info = self.json.pointer(slot).unwrap_or(&Value::Null);
        let transform = &info["extensions"]["KHR_texture_transform"];
        let set = transform["texCoord"].as_u64().or(info["texCoord"].as_u64());
        let uv_set = match set.unwrap_or(0) {
            set @ (0 | 1) => set as u8,
            set => {
                self.warn(&format!("uses texture coordinate set {set}: set 0 is used"));
                0
            }
        };
        let image = self.pictures.image(texture.source().index(), self.scene)?;
        let sampler = texture.sampler();
        Ok(Some(TextureRef {
            image,
            uv_set,
            transform: uv_transform(transform, &self.place)?,
            wrap: [wrap(sampler.wrap_s()), wrap(sampler.wrap_t())],
            linear: !matches!(sampler.mag_filter(), Some(MagFilter::Nearest)),
        }))
    }
}

/// KHR_texture_transform: counter-clockwise as seen in the picture, whose v
/// runs down; so it is in the reference viewer, though the matrix printed in
/// the extension's text turns the other way.
fn uv_transform(json: &Value, place: &str) -> Result<Affine2, LoadError> {
    let number = |value: &Value, default: f64| value.as_f64().unwrap_or(default) as f32;
    let pair = |key: &str, default: f64| {
        Vec2::new(
            number(&json[key][0], default),
            number(&json[key][1], default),
        )
    };
    let rotation = Mat2::from_angle(-number(&json["rotation"], 0.0));
    let scale = Mat2::from_diagonal(pair("scale", 1.0));
    let transform = Affine2::from_mat2_translation(rotation * scale, pair("offset", 0.0));
    if transform.is_finite() {
        Ok(transform)
    } else {
        Err(LoadError::invalid(
            place,
            "a texture transform is not finite",
        ))
    }
}

fn wrap(mode: WrappingMode) -> Wrap {
    match mode {
        WrappingMode::Repeat => Wrap::Repeat,
        WrappingMode::MirroredRepeat => Wrap::Mirror,
        WrappingMode::ClampToEdge => Wrap::Clamp,
    }
}
