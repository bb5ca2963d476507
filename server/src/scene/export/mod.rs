//! A scene as a binary glTF file that other programs read.
//!
//! One node for what stands still and one for every moving object, one
//! primitive a material, pictures as PNG, lights as KHR_lights_punctual, the
//! spawn as a camera at eye height. What glTF has no words for (the sky, the
//! sun's size) goes into the scene's `extras`, which the loader reads back.

mod bin;
mod look;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, HashMap};
use std::io::{self, Write};

use glam::{Quat, Vec2, Vec3, Vec4};
use serde_json::{Value, json};
use shadecast_protocol::ObjectId;

use super::gltf_load::extras::{Extras, Own, Sky};
use super::spawn::EYE_HEIGHT;
use super::{Light, RigidObject, Scene, Triangle};
use bin::Bin;

/// Writes `scene` as GLB.
///
/// # Errors
/// Those of `out`; and a scene whose buffers exceed the 4 GiB of a GLB file.
pub fn write_glb(scene: &Scene, out: &mut dyn Write) -> io::Result<()> {
    let mut bin = Bin::default();
    let (images, textures, samplers, materials) = look::look(scene, &mut bin)?;
    let mut nodes = Vec::new();
    let mut meshes = Vec::new();
    for (number, object) in std::iter::once(None)
        .chain(scene.objects.iter().map(Some))
        .enumerate()
    {
        let primitives = primitives(scene, ObjectId(number as u16), &mut bin);
        let mut node = object.map_or(json!({ "name": scene.name }), rest);
        if !primitives.is_empty() {
            node["mesh"] = json!(meshes.len());
            meshes.push(json!({ "primitives": primitives }));
        }
        nodes.push(node);
    }
    let animation = animation(&scene.objects, &mut bin);
    for (index, light) in scene.lights.iter().enumerate() {
        nodes.push(light_node(index, light));
    }
    if let Some(spawn) = scene.spawn {
        nodes.push(json!({
            "name": "spawn",
            "camera": 0,
            "translation": (spawn.position + Vec3::Y * EYE_HEIGHT).to_array(),
            "rotation": spawn.orientation.to_array(),
        }));
    }
    let mut root = json!({
        "asset": { "version": "2.0", "generator": "shadecast" },
        "scene": 0,
        "scenes": [{
            "name": scene.name,
            "nodes": (0..nodes.len()).collect::<Vec<_>>(),
            "extras": extras(scene),
        }],
        "nodes": nodes,
        "meshes": meshes,
        "materials": materials,
        "textures": textures,
        "samplers": samplers,
        "images": images,
        "accessors": bin.accessors,
        "bufferViews": bin.views,
        "buffers": [{ "byteLength": bin.bytes.len() }],
        "extensions": { "KHR_lights_punctual": {
            "lights": scene.lights.iter().map(light).collect::<Vec<_>>(),
        }},
        "extensionsUsed": [
            "KHR_lights_punctual",
            "KHR_materials_emissive_strength",
            "KHR_materials_ior",
            "KHR_texture_transform",
        ],
    });
    if scene.lights.is_empty() {
        root["extensions"] = json!({});
    }
    if let Some(animation) = animation {
        root["animations"] = json!([animation]);
    }
    if scene.spawn.is_some() {
        root["cameras"] = json!([{
            "type": "perspective",
            "perspective": { "yfov": 1.2, "znear": 0.05 },
        }]);
    }
    drop_empty(&mut root);
    write_chunks(&root.to_string(), bin.bytes, out)
}

/// glTF allows no empty lists and no empty objects at its root.
fn drop_empty(root: &mut Value) {
    if let Some(object) = root.as_object_mut() {
        object.retain(|_, value| {
            let empty_list = value.as_array().is_some_and(Vec::is_empty);
            let empty_object = value.as_object().is_some_and(serde_json::Map::is_empty);
            !empty_list && !empty_object
        });
    }
}

fn write_chunks(json: &str, mut bin: Vec<u8>, out: &mut dyn Write) -> io::Result<()> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    bin.resize(bin.len().next_multiple_of(4), 0);
    let length = |bytes: usize| {
        let too_large = |_| io::Error::other("the scene is too large for a GLB file");
        u32::try_from(bytes)
            .map(u32::to_le_bytes)
            .map_err(too_large)
    };
    out.write_all(b"glTF\x02\0\0\0")?;
    out.write_all(&length(12 + 8 + json.len() + 8 + bin.len())?)?;
    out.write_all(&length(json.len())?)?;
    out.write_all(b"JSON")?;
    out.write_all(&json)?;
    out.write_all(&length(bin.len())?)?;
    out.write_all(b"BIN\0")?;
    out.write_all(&bin)
}

/// One primitive for every material of an object's triangles.
fn primitives(scene: &Scene, object: ObjectId, bin: &mut Bin) -> Vec<Value> {
    let mut by_material: BTreeMap<u32, Vec<&Triangle>> = BTreeMap::new();
    for triangle in scene.triangles.iter().filter(|t| t.object == object) {
        by_material
            .entry(triangle.material)
            .or_default()
            .push(triangle);
    }
    by_material
        .into_iter()
        .map(|(material, triangles)| primitive(scene, material, &triangles, bin))
        .collect()
}

fn primitive(scene: &Scene, material: u32, triangles: &[&Triangle], bin: &mut Bin) -> Value {
    let mut vertices: Vec<(u32, u32)> = Vec::new();
    let mut known = HashMap::new();
    let mut indices = Vec::with_capacity(3 * triangles.len());
    for triangle in triangles {
        for pair in triangle.positions.into_iter().zip(triangle.corners) {
            indices.push(*known.entry(pair).or_insert_with(|| {
                vertices.push(pair);
                vertices.len() as u32 - 1
            }));
        }
    }
    let corners = || {
        vertices
            .iter()
            .map(|&(_, corner)| &scene.corners[corner as usize])
    };
    let positions: Vec<[f32; 3]> = vertices
        .iter()
        .map(|&(position, _)| scene.positions[position as usize].to_array())
        .collect();
    let normals: Vec<[f32; 3]> = corners().map(|corner| corner.normal.to_array()).collect();
    let mut attributes = json!({
        "POSITION": bin.positions(&positions),
        "NORMAL": bin.vectors(&normals),
    });
    for set in 0..2 {
        if corners().any(|corner| corner.uv[set] != Vec2::ZERO) {
            let uvs: Vec<[f32; 2]> = corners().map(|corner| corner.uv[set].to_array()).collect();
            attributes[format!("TEXCOORD_{set}")] = json!(bin.vectors(&uvs));
        }
    }
    if corners().all(|corner| corner.tangent != Vec4::ZERO) {
        let tangents: Vec<[f32; 4]> = corners().map(|c| c.tangent.to_array()).collect();
        attributes["TANGENT"] = json!(bin.vectors(&tangents));
    }
    if corners().any(|corner| corner.color != Vec4::ONE) {
        let colors: Vec<[f32; 4]> = corners().map(|corner| corner.color.to_array()).collect();
        attributes["COLOR_0"] = json!(bin.vectors(&colors));
    }
    json!({ "attributes": attributes, "indices": bin.indices(&indices), "material": material })
}

/// The node of a moving object, at time zero.
fn rest(object: &RigidObject) -> Value {
    let pose = object.world_from_object(std::time::Duration::ZERO);
    json!({
        "name": object.name,
        "translation": pose.position.to_array(),
        "rotation": pose.orientation.to_array(),
    })
}

/// The motion of all objects; node `n` is object `n`.
fn animation(objects: &[RigidObject], bin: &mut Bin) -> Option<Value> {
    let mut samplers = Vec::new();
    let mut channels = Vec::new();
    for (index, object) in objects.iter().enumerate() {
        if object.keys.is_empty() {
            continue;
        }
        let times: Vec<f32> = object.keys.iter().map(|key| key.0.as_secs_f32()).collect();
        let positions: Vec<[f32; 3]> = object
            .keys
            .iter()
            .map(|key| key.1.position.to_array())
            .collect();
        let orientations: Vec<[f32; 4]> = object
            .keys
            .iter()
            .map(|key| key.1.orientation.to_array())
            .collect();
        let times = bin.times(&times);
        for (path, values) in [
            ("translation", bin.values(&positions)),
            ("rotation", bin.values(&orientations)),
        ] {
            let target = json!({ "node": index + 1, "path": path });
            channels.push(json!({ "sampler": samplers.len(), "target": target }));
            samplers.push(json!({ "input": times, "output": values, "interpolation": "LINEAR" }));
        }
    }
    (!channels.is_empty()).then(|| json!({ "samplers": samplers, "channels": channels }))
}

/// Colour with a largest component of one, and the intensity that it scales.
fn color_and_intensity(radiant: Vec3) -> (Vec3, f32) {
    let intensity = radiant.max_element();
    if intensity > 0.0 {
        (radiant / intensity, intensity)
    } else {
        (Vec3::ONE, 0.0)
    }
}

fn light(light: &Light) -> Value {
    let (kind, radiant, range) = match *light {
        Light::Point {
            intensity, range, ..
        } => ("point", intensity, range),
        Light::Spot {
            intensity, range, ..
        } => ("spot", intensity, range),
        Light::Directional { irradiance, .. } => ("directional", irradiance, f32::INFINITY),
    };
    let (color, intensity) = color_and_intensity(radiant);
    let mut json = json!({ "type": kind, "color": color.to_array(), "intensity": intensity });
    if range.is_finite() {
        json["range"] = json!(range);
    }
    if let Light::Spot { inner, outer, .. } = *light {
        json["spot"] = json!({ "innerConeAngle": inner, "outerConeAngle": outer });
    }
    json
}

fn light_node(index: usize, light: &Light) -> Value {
    let (position, direction) = match *light {
        Light::Point { position, .. } => (position, Vec3::NEG_Z),
        Light::Spot {
            position,
            direction,
            ..
        } => (position, direction),
        Light::Directional { direction, .. } => (Vec3::ZERO, direction),
    };
    json!({
        "translation": position.to_array(),
        "rotation": Quat::from_rotation_arc(Vec3::NEG_Z, direction).to_array(),
        "extensions": { "KHR_lights_punctual": { "light": index } },
    })
}

fn extras(scene: &Scene) -> Extras {
    let sun_angular_radius = scene.lights.iter().find_map(|light| match light {
        Light::Directional { angular_radius, .. } => Some(*angular_radius),
        Light::Point { .. } | Light::Spot { .. } => None,
    });
    Extras {
        shadecast: Own {
            sky: (!scene.sky.is_black()).then(|| Sky {
                zenith: scene.sky.zenith.to_array(),
                horizon: scene.sky.horizon.to_array(),
                ground: scene.sky.ground.to_array(),
            }),
            sun_angular_radius: sun_angular_radius.unwrap_or_default(),
        },
    }
}
