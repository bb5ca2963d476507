//! Materials, textures, samplers and pictures.

use std::io::{self, Cursor};

use glam::{Mat2, Vec2};
use image::{ExtendedColorType, ImageFormat};
use serde_json::{Value, json};

use super::bin::Bin;
use super::color_and_intensity;
use crate::scene::{Alpha, Image, Material, Scene, TextureRef, Wrap};

/// The four lists `images`, `textures`, `samplers` and `materials`.
type Lists = (Vec<Value>, Vec<Value>, Vec<Value>, Vec<Value>);

pub(super) fn look(scene: &Scene, bin: &mut Bin) -> io::Result<Lists> {
    let images: io::Result<Vec<Value>> = scene
        .images
        .iter()
        .map(|image| picture(image, bin))
        .collect();
    let mut shelf = Shelf::default();
    let materials = scene.materials.iter().map(|m| shelf.material(m)).collect();
    Ok((images?, shelf.textures, shelf.samplers, materials))
}

fn picture(image: &Image, bin: &mut Bin) -> io::Result<Value> {
    let mut png = Cursor::new(Vec::new());
    image::write_buffer_with_format(
        &mut png,
        &image.rgba,
        image.width,
        image.height,
        ExtendedColorType::Rgba8,
        ImageFormat::Png,
    )
    .map_err(io::Error::other)?;
    let view = bin.view(png.get_ref());
    Ok(json!({ "name": image.name, "bufferView": view, "mimeType": "image/png" }))
}

#[derive(Default)]
struct Shelf {
    textures: Vec<Value>,
    samplers: Vec<Value>,
}

impl Shelf {
    fn material(&mut self, material: &Material) -> Value {
        let (emissive, strength) = color_and_intensity(material.emissive);
        let emits = strength > 0.0;
        let mut json = json!({
            "name": material.name,
            "pbrMetallicRoughness": {
                "baseColorFactor": material.base_color.to_array(),
                "metallicFactor": material.metallic,
                "roughnessFactor": material.roughness,
            },
            "emissiveFactor": if emits { emissive.to_array() } else { [0.0; 3] },
            "doubleSided": material.double_sided,
            "extensions": { "KHR_materials_ior": { "ior": material.ior } },
        });
        if emits {
            json["extensions"]["KHR_materials_emissive_strength"] =
                json!({ "emissiveStrength": strength });
        }
        match material.alpha {
            Alpha::Opaque => {}
            Alpha::Mask { cutoff } => {
                json["alphaMode"] = json!("MASK");
                json["alphaCutoff"] = json!(cutoff);
            }
            Alpha::Blend => json["alphaMode"] = json!("BLEND"),
        }
        let pbr = &mut json["pbrMetallicRoughness"];
        self.slot(pbr, "baseColorTexture", &material.base_color_texture);
        let metallic_roughness = &material.metallic_roughness_texture;
        self.slot(pbr, "metallicRoughnessTexture", metallic_roughness);
        self.slot(&mut json, "normalTexture", &material.normal_texture);
        self.slot(&mut json, "occlusionTexture", &material.occlusion_texture);
        self.slot(&mut json, "emissiveTexture", &material.emissive_texture);
        if material.normal_texture.is_some() {
            json["normalTexture"]["scale"] = json!(material.normal_scale);
        }
        json
    }

    fn slot(&mut self, owner: &mut Value, name: &str, texture: &Option<TextureRef>) {
        let Some(texture) = texture else {
            return;
        };
        let sampler = sampler(texture);
        let sampler = index_of(&mut self.samplers, sampler);
        let source = json!({ "source": texture.image, "sampler": sampler });
        let index = index_of(&mut self.textures, source);
        let mut info = json!({ "index": index, "texCoord": texture.uv_set });
        if texture.transform != glam::Affine2::IDENTITY {
            info["extensions"] = json!({ "KHR_texture_transform": transform(texture) });
        }
        owner[name] = info;
    }
}

/// The index of `value` in `list`, which it joins if it is new.
fn index_of(list: &mut Vec<Value>, value: Value) -> usize {
    list.iter()
        .position(|known| *known == value)
        .unwrap_or_else(|| {
            list.push(value);
            list.len() - 1
        })
}

fn sampler(texture: &TextureRef) -> Value {
    let wrap = |wrap: Wrap| match wrap {
        Wrap::Repeat => 10_497,
        Wrap::Mirror => 33_648,
        Wrap::Clamp => 33_071,
    };
    // LINEAR with LINEAR_MIPMAP_LINEAR, or NEAREST twice.
    let [magnified, minified] = if texture.linear {
        [9729, 9987]
    } else {
        [9728, 9728]
    };
    json!({
        "magFilter": magnified,
        "minFilter": minified,
        "wrapS": wrap(texture.wrap[0]),
        "wrapT": wrap(texture.wrap[1]),
    })
}

/// Takes the transform apart into what glTF can say: no shear.
fn transform(texture: &TextureRef) -> Value {
    let matrix = texture.transform.matrix2;
    let rotation = -matrix.x_axis.to_angle();
    let scale: Mat2 = Mat2::from_angle(rotation) * matrix;
    json!({
        "offset": texture.transform.translation.to_array(),
        "rotation": rotation,
        "scale": Vec2::new(scale.x_axis.x, scale.y_axis.y).to_array(),
    })
}
