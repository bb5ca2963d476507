//! Every fault of a file is one sentence, never a panic.

use serde_json::{Value, json};

use super::{glb, load_bytes, png, sentence, triangle, with, with_image};
use crate::scene::{LoadError, load};

#[test]
fn missing_files_are_named() {
    let error = sentence(load(std::path::Path::new("/nowhere/at/all.glb")));
    assert!(
        error.starts_with("cannot read /nowhere/at/all.glb"),
        "{error}"
    );
    let error = sentence(with(|json, _| {
        json["buffers"][0]["uri"] = json!("gone.bin")
    }));
    assert!(error.contains("gone.bin"), "{error}");
    let error = sentence(with(|json, _| {
        json["buffers"][0]["uri"] = json!("../secret")
    }));
    assert!(error.contains("does not lie beside the file"), "{error}");
}

#[test]
fn a_file_cut_off_anywhere_is_refused() {
    let (json, bin) = triangle();
    let whole = glb(&json, &bin);
    for length in 0..whole.len() {
        assert!(load_bytes(&whole[..length]).is_err(), "{length} bytes");
    }
}

#[test]
fn garbage_is_refused() {
    assert!(sentence(load_bytes(b"garbage")).contains("its JSON does not parse"));
    assert!(sentence(load_bytes(b"{}")).contains("version"));
    assert!(sentence(load_bytes(b"[1]")).contains("version"));
}

#[test]
fn nodes_must_form_a_tree() {
    let cyclic = with(|json, _| json["nodes"] = json!([{ "mesh": 0, "children": [0] }]));
    assert!(matches!(cyclic, Err(LoadError::Cycle { node: 0 })));
    let shared = with(|json, _| {
        json["nodes"] = json!([{ "children": [1, 2] }, { "children": [2] }, { "mesh": 0 }]);
    });
    assert!(matches!(shared, Err(LoadError::Cycle { node: 2 })));
}

#[test]
fn a_deep_tree_does_not_exhaust_the_stack() {
    let scene = with(|json, _| {
        let mut nodes: Vec<Value> = (1..50_000).map(|i| json!({ "children": [i] })).collect();
        nodes.push(json!({ "mesh": 0 }));
        json["nodes"] = json!(nodes);
    });
    assert_eq!(scene.unwrap().triangles.len(), 1);
}

#[test]
fn lying_sizes_are_refused() {
    let error = sentence(with(|json, _| json["accessors"][0]["count"] = json!(4)));
    assert_eq!(error, "bufferViews[0]: is too short for 4 elements");
    let error = sentence(with(|json, _| {
        json["bufferViews"][0]["byteLength"] = json!(1000)
    }));
    assert_eq!(error, "bufferViews[0]: reaches beyond its buffer");
    let error = sentence(with(|json, _| {
        json["buffers"][0]["byteLength"] = json!(1000)
    }));
    assert_eq!(error, "buffers[0]: holds 44 bytes of 1000");
    let error = sentence(with(|json, _| {
        json["accessors"][0]["count"] = json!(4_000_000_000_u32);
        json["accessors"][0]
            .as_object_mut()
            .unwrap()
            .remove("bufferView");
    }));
    assert!(error.contains("exceeds the limit"), "{error}");
    let error = sentence(with(|json, _| {
        json["bufferViews"][0]["byteOffset"] = json!(u64::MAX);
    }));
    assert!(error.contains("reaches beyond its buffer"), "{error}");
}

#[test]
fn indices_must_be_in_range() {
    let error = sentence(with(|_, bin| bin[40] = 7));
    assert_eq!(
        error,
        "meshes[0].primitives[0]: index 7 is out of range of 3 vertices"
    );
    for (pointer, value) in [
        ("/nodes/0/mesh", 9),
        ("/meshes/0/primitives/0/indices", 9),
        ("/accessors/0/bufferView", 9),
        ("/bufferViews/0/buffer", 9),
        ("/scene", 9),
    ] {
        let error = sentence(with(|json, _| {
            *json.pointer_mut(pointer).unwrap() = json!(value)
        }));
        assert!(error.contains("index out of bounds"), "{pointer}: {error}");
    }
    let error = sentence(with(|json, _| {
        json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(9);
    }));
    assert_eq!(error, "meshes[0]: its accessor 9 does not exist");
    let error = sentence(with(|json, _| {
        json["animations"] = json!([{
            "samplers": [{ "input": 0, "output": 0 }],
            "channels": [{ "sampler": 0, "target": { "node": 9, "path": "translation" } }],
        }]);
    }));
    assert_eq!(error, "animations[0]: its target is out of range");
}

#[test]
fn numbers_must_be_finite() {
    let error = sentence(with(|_, bin| {
        bin[12..16].copy_from_slice(&f32::NAN.to_le_bytes())
    }));
    assert_eq!(error, "accessors[0]: element 1 is not finite");
    let error = sentence(with(|json, _| {
        json["nodes"][0]["translation"] = json!([1e38, 1e39, 0])
    }));
    assert!(!error.is_empty());
    // Finite alone, but not one after the other.
    let error = sentence(with(|json, _| {
        json["nodes"] =
            json!([{ "scale": [1e30, 1, 1], "children": [1] }, { "translation": [1e30, 0, 0] }]);
    }));
    assert_eq!(error, "nodes[1]: its transform is not finite");
}

#[test]
fn materials_must_not_make_light_nor_take_it() {
    let with_material = |material: Value| {
        with(move |json, _| {
            json["materials"] = json!([material]);
            json["meshes"][0]["primitives"][0]["material"] = json!(0);
        })
    };
    for wrong in [
        json!({ "emissiveFactor": [0, -1, 0] }),
        json!({ "extensions": { "KHR_materials_ior": { "ior": -1 } } }),
    ] {
        let error = sentence(with_material(wrong));
        assert!(error.starts_with("materials[0]: its emission"), "{error}");
    }
    let white = json!({ "pbrMetallicRoughness": { "baseColorFactor": [10, 0.5, -1, 1] } });
    let scene = with_material(white).unwrap();
    assert_eq!(
        scene.materials[0].base_color.to_array(),
        [1.0, 0.5, 0.0, 1.0]
    );
    assert!(scene.notes.warnings[0].starts_with("materials[0] has a base colour beyond"));
}

#[test]
fn there_must_be_triangles() {
    let none = with(|json, _| json["nodes"] = json!([{}]));
    assert!(matches!(none, Err(LoadError::NoTriangles)));
    let flat = with(|json, _| json["nodes"][0]["scale"] = json!([1, 0, 1]));
    assert!(matches!(flat, Err(LoadError::NoTriangles)));
    let points = with(|json, _| json["meshes"][0]["primitives"][0]["mode"] = json!(0));
    assert!(matches!(points, Err(LoadError::NoTriangles)));
}

#[test]
fn an_image_must_decode() {
    let error = sentence(with_image(b"not a picture"));
    assert!(error.starts_with("images[0] does not decode"), "{error}");
    let cut = &png()[..40];
    assert!(sentence(with_image(cut)).starts_with("images[0] does not decode"));
    let mut huge = png();
    huge[16..20].copy_from_slice(&100_000_u32.to_be_bytes());
    assert!(sentence(with_image(&huge)).starts_with("images[0] does not decode"));
}

#[test]
fn extensions_are_known_listed_or_refused() {
    let error = sentence(with(|json, _| {
        json["extensionsRequired"] = json!(["KHR_mesh_quantization", "KHR_draco_mesh_compression"]);
    }));
    assert_eq!(
        error,
        "the file requires unsupported extensions: KHR_draco_mesh_compression"
    );
    let scene = with(|json, _| {
        json["extensionsUsed"] = json!(["KHR_materials_clearcoat", "KHR_mesh_quantization"]);
        json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    })
    .unwrap();
    assert_eq!(scene.notes.extensions_used, ["KHR_mesh_quantization"]);
    assert_eq!(scene.notes.extensions_ignored, ["KHR_materials_clearcoat"]);
}
