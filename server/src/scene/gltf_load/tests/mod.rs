//! Small files built in memory.

mod bad_input;
mod meaning;

use std::f32::consts::FRAC_PI_2;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use serde_json::{Value, json};

use super::{LoadError, load};
use crate::scene::Scene;

/// A file that is gone when the test is over.
struct TempFile(PathBuf);

impl TempFile {
    fn new(bytes: &[u8]) -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let name = format!("shadecast-load-{}-{number}.glb", std::process::id());
        let path = std::env::temp_dir().join(name);
        std::fs::write(&path, bytes).unwrap();
        Self(path)
    }
}

impl Drop for TempFile {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

fn glb(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend(((28 + json.len() + bin.len()) as u32).to_le_bytes());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(&json);
    bytes.extend((bin.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(bin);
    bytes
}

fn load_bytes(bytes: &[u8]) -> Result<Scene, LoadError> {
    load(&TempFile::new(bytes).0)
}

fn floats(values: &[f32]) -> Vec<u8> {
    values
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .collect()
}

/// One triangle in the plane z = 0, its positions three floats each, then
/// three u16 indices; and its buffer.
fn triangle() -> (Value, Vec<u8>) {
    let mut bin = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    bin.extend([0, 0, 1, 0, 2, 0, 0, 0]);
    let json = json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "buffers": [{ "byteLength": 44 }],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": 36 },
            { "buffer": 0, "byteOffset": 36, "byteLength": 6 },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" },
            { "bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR" },
        ],
    });
    (json, bin)
}

fn with(change: impl FnOnce(&mut Value, &mut Vec<u8>)) -> Result<Scene, LoadError> {
    let (mut json, mut bin) = triangle();
    change(&mut json, &mut bin);
    load_bytes(&glb(&json, &bin))
}

fn sentence(result: Result<Scene, LoadError>) -> String {
    result.expect_err("it should not load").to_string()
}

/// Appends `bytes` with a view and an accessor; returns the accessor's index.
fn add(json: &mut Value, bin: &mut Vec<u8>, bytes: &[u8], accessor: Value) -> usize {
    let view = json["bufferViews"].as_array().unwrap().len();
    let offset = bin.len();
    bin.extend(bytes);
    bin.resize(bin.len().next_multiple_of(4), 0);
    json["buffers"][0]["byteLength"] = json!(bin.len());
    let views = json["bufferViews"].as_array_mut().unwrap();
    views.push(json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }));
    let mut accessor = accessor;
    accessor["bufferView"] = json!(view);
    let accessors = json["accessors"].as_array_mut().unwrap();
    accessors.push(accessor);
    accessors.len() - 1
}

fn with_image(image: &[u8]) -> Result<Scene, LoadError> {
    with(|json, bin| {
        add(
            json,
            bin,
            image,
            json!({ "componentType": 5121, "count": 1, "type": "SCALAR" }),
        );
        json["accessors"].as_array_mut().unwrap().pop();
        json["images"] = json!([{ "bufferView": 2, "mimeType": "image/png" }]);
        json["samplers"] = json!([{ "wrapS": 33648, "wrapT": 33071, "magFilter": 9728 }]);
        json["textures"] = json!([{ "source": 0, "sampler": 0 }]);
        json["materials"] = json!([{
            "alphaMode": "MASK",
            "alphaCutoff": 0.25,
            "pbrMetallicRoughness": { "baseColorTexture": { "index": 0, "texCoord": 1,
                "extensions": { "KHR_texture_transform": {
                    "offset": [0.5, 0.25], "rotation": FRAC_PI_2, "scale": [2, 3],
                } } } },
        }]);
        json["meshes"][0]["primitives"][0]["material"] = json!(0);
    })
}

fn png() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let kind = image::ExtendedColorType::Rgba8;
    let format = image::ImageFormat::Png;
    image::write_buffer_with_format(&mut bytes, &[1, 2, 3, 4], 1, 1, kind, format).unwrap();
    bytes.into_inner()
}
