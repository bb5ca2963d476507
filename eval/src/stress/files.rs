//! Files with numbers that are none: each is refused by a sentence that names the
//! thing, or loads as something that does no harm.

use std::{
    env, fs, process,
    sync::atomic::{AtomicU32, Ordering},
};

use anyhow::Result;
use serde_json::{Value, json};
use shadecast_server::scene::{self, LoadError, Scene};

use super::{
    Case, Effort,
    property::Property,
    scenes::{View, picture},
};

pub(super) const CASES: &[Case] = &[
    Case {
        name: "files_with_wrong_numbers",
        what: "glTF files with NaN, infinity or what overflows to it, each in one place",
        measure: wrong_numbers,
    },
    Case {
        name: "file_that_creates_light",
        what: "a glTF file whose base colour is ten times white, in an even sky",
        measure: creates_light,
    },
];

type Change = fn(&mut Value, &mut Vec<f32>);

/// What is wrong, what the error must name, and how the file gets it.
const WRONG: &[(&str, &str, Change)] = &[
    (
        "a vertex that is no number",
        "accessors[0]: element 1",
        |_, bin| bin[4] = f32::NAN,
    ),
    ("an infinite vertex", "accessors[0]: element 0", |_, bin| {
        bin[0] = f32::INFINITY
    }),
    ("a normal that is no number", "accessors[1]", |_, bin| {
        bin[9] = f32::NAN
    }),
    (
        "an infinite texture coordinate",
        "accessors[2]",
        |_, bin| bin[18] = f32::INFINITY,
    ),
    (
        "a vertex colour that is no number",
        "accessors[3]",
        |_, bin| bin[24] = f32::NAN,
    ),
    ("an animation to nowhere", "accessors[5]", |json, bin| {
        bin[35] = f32::NAN;
        json["animations"] = json!([{
            "samplers": [{ "input": 4, "output": 5 }],
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": "translation" } }],
        }]);
    }),
    ("an animation at no time", "accessors[4]", |json, bin| {
        bin[33] = f32::INFINITY;
        json["animations"] = json!([{
            "samplers": [{ "input": 4, "output": 5 }],
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": "translation" } }],
        }]);
    }),
    ("an infinite place", "nodes[0]", |json, _| {
        json["nodes"][0]["translation"] = json!([1e39, 0, 0]);
    }),
    ("a lamp whose place overflows", "nodes[2]", |json, _| {
        json["nodes"][1]["scale"] = json!([1e30, 1e30, 1e30]);
        json["nodes"][2]["translation"] = json!([1e30, 0, 0]);
    }),
    ("a camera whose place overflows", "nodes[2]", |json, _| {
        json["cameras"] = json!([{ "type": "perspective",
            "perspective": { "yfov": 1, "znear": 0.1 } }]);
        json["nodes"][1]["scale"] = json!([1e30, 1e30, 1e30]);
        json["nodes"][2] = json!({ "camera": 0, "translation": [1e30, 0, 0] });
    }),
    ("a vertex whose place overflows", "vertex", |json, bin| {
        bin[0] = 1e30;
        json["nodes"][0]["scale"] = json!([1e30, 1, 1]);
    }),
    ("an infinite lamp", "lights[0]", |json, _| {
        json["extensions"]["KHR_lights_punctual"]["lights"][0]["intensity"] = json!(1e39);
    }),
    (
        "a lamp whose colour times intensity overflows",
        "lights[0]",
        |json, _| {
            let lamp = &mut json["extensions"]["KHR_lights_punctual"]["lights"][0];
            lamp["intensity"] = json!(1e30);
            lamp["color"] = json!([1e30, 1, 1]);
        },
    ),
    ("a lamp of negative colour", "lights[0]", |json, _| {
        json["extensions"]["KHR_lights_punctual"]["lights"][0]["color"] = json!([-1, 1, 1]);
    }),
    ("an infinite base colour", "materials[0]", |json, _| {
        json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([1e39, 1, 1, 1]);
    }),
    ("an infinite roughness", "materials[0]", |json, _| {
        json["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] = json!(1e39);
    }),
    (
        "an emission that overflows by its strength",
        "materials[0]",
        |json, _| {
            json["materials"][0]["emissiveFactor"] = json!([1, 1, 1]);
            json["materials"][0]["extensions"] =
                json!({ "KHR_materials_emissive_strength": { "emissiveStrength": 1e39 } });
        },
    ),
    ("a negative emission", "materials[0]", |json, _| {
        json["materials"][0]["emissiveFactor"] = json!([-1, 1, 1]);
    }),
    ("a refractive index of -1", "materials[0]", |json, _| {
        json["materials"][0]["extensions"] = json!({ "KHR_materials_ior": { "ior": -1 } });
    }),
    ("an infinite sky", "the sky", |json, _| {
        json["scenes"][0]["extras"] = json!({ "shadecast": { "sky":
            { "zenith": [1e39, 1, 1], "horizon": [1, 1, 1], "ground": [1, 1, 1] } } });
    }),
];

fn wrong_numbers(_: Effort) -> Result<Vec<Property>> {
    load(&glb(|_, _| ()))?;
    Ok(WRONG
        .iter()
        .map(|(what, name, change)| {
            let named = match load(&glb(change)) {
                Ok(_) => false,
                Err(error) => error.to_string().contains(name),
            };
            let what = format!("{what} is refused as {name} (1 is yes)");
            Property::at_least(what, f64::from(u8::from(named)), 1.0)
        })
        .collect())
}

fn creates_light(effort: Effort) -> Result<Vec<Property>> {
    let scene = load(&glb(|json, bin| {
        json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([10, 10, 10, 1]);
        json["scenes"][0]["extras"] = json!({ "shadecast": { "sky":
            { "zenith": [1, 1, 1], "horizon": [1, 1, 1], "ground": [1, 1, 1] } } });
        json["scenes"][0]["nodes"] = json!([0]);
        bin[24..33].fill(1.0);
    }))?;
    let view = View::new(glam::vec3(0.25, 0.25, 1.0), glam::Vec3::NEG_Z, 0.1);
    let found = picture(&scene, view, 2, effort.samples(64), effort.seed)?;
    let what = "mean radiance over the sky's";
    Ok(vec![Property::at_most(what, found.mean(), 1.01)])
}

fn load(bytes: &[u8]) -> Result<Scene, LoadError> {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    let path = env::temp_dir().join(format!("shadecast-stress-{}-{number}.glb", process::id()));
    let written = fs::write(&path, bytes).map_err(|source| LoadError::Read {
        path: path.clone(),
        source,
    });
    let loaded = written.and_then(|()| scene::load(&path));
    // It lies among temporary files: nothing is lost where it stays.
    let _ = fs::remove_file(&path);
    loaded
}

/// A triangle with all that a vertex may have, beside a node with a lamp in it.
fn glb(change: impl Fn(&mut Value, &mut Vec<f32>)) -> Vec<u8> {
    // Positions, normals, coordinates, colours; then times and places of an animation.
    let mut bin: Vec<f32> = [
        &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0][..],
        &[0.0, 0.0, 1.0].repeat(3),
        &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0],
        &[0.5; 9],
        &[0.0, 1.0],
        &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
    ]
    .concat();
    let floats = [9, 9, 6, 9, 2, 6];
    let mut offset = 0;
    let views: Vec<Value> = floats
        .iter()
        .map(|count| {
            let view = json!({ "buffer": 0, "byteOffset": offset, "byteLength": count * 4 });
            offset += count * 4;
            view
        })
        .collect();
    let accessor = |view: usize, count: u32, kind: &str| {
        let mut accessor =
            json!({ "bufferView": view, "componentType": 5126, "count": count, "type": kind });
        if view == 4 {
            (accessor["min"], accessor["max"]) = (json!([0]), json!([1]));
        }
        accessor
    };
    let mut json = json!({
        "asset": { "version": "2.0" },
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": { "KHR_lights_punctual": {
            "lights": [{ "type": "point", "intensity": 10, "color": [1, 1, 1] }],
        } },
        "scene": 0,
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": [
            { "mesh": 0 },
            { "children": [2] },
            { "translation": [0, 0, 1], "extensions": { "KHR_lights_punctual": { "light": 0 } } },
        ],
        "materials": [{ "pbrMetallicRoughness": { "metallicFactor": 0 } }],
        "meshes": [{ "primitives": [{ "material": 0, "attributes":
            { "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "COLOR_0": 3 } }] }],
        "buffers": [{ "byteLength": offset }],
        "bufferViews": views,
        "accessors": [
            accessor(0, 3, "VEC3"), accessor(1, 3, "VEC3"), accessor(2, 3, "VEC2"),
            accessor(3, 3, "VEC3"), accessor(4, 2, "SCALAR"), accessor(5, 2, "VEC3"),
        ],
    });
    change(&mut json, &mut bin);
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let chunk = |kind: &[u8; 4], content: &[u8]| {
        [&(content.len() as u32).to_le_bytes()[..], kind, content].concat()
    };
    let chunks = [
        chunk(b"JSON", &text),
        chunk(b"BIN\0", bytemuck::cast_slice(&bin)),
    ]
    .concat();
    let length = 12 + chunks.len() as u32;
    [&b"glTF\x02\0\0\0"[..], &length.to_le_bytes(), &chunks].concat()
}
