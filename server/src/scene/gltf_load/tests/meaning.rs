//! What a file says is what the scene holds.

use glam::{Vec2, Vec3, vec2, vec3};
use serde_json::json;

use super::{add, floats, load_bytes, png, triangle, with, with_image};
use crate::scene::{Alpha, Light, Scene, SkyModel, Wrap};

fn face_normal(scene: &Scene) -> Vec3 {
    let [a, b, c] = scene.triangles[0]
        .positions
        .map(|i| scene.positions[i as usize]);
    (b - a).cross(c - a).normalize()
}

#[test]
fn a_bare_triangle_gets_a_flat_normal_a_material_and_light() {
    let scene = with(|_, _| {}).unwrap();
    assert_eq!(scene.triangles.len(), 1);
    assert_eq!(scene.positions, [Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert!(scene.corners.iter().all(|corner| corner.normal == Vec3::Z));
    assert_eq!(scene.materials.len(), 1);
    assert_eq!(scene.sky, SkyModel::constant(Vec3::ONE));
    assert_eq!(scene.notes.warnings.len(), 1);
}

#[test]
fn a_data_uri_is_a_buffer() {
    let (mut json, bin) = triangle();
    let digits = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::from("data:application/octet-stream;base64,");
    let mut padded = bin;
    padded.resize(padded.len().next_multiple_of(3), 0);
    for [a, b, c] in padded.as_chunks::<3>().0 {
        let bits = u32::from_be_bytes([0, *a, *b, *c]);
        text.extend([18, 12, 6, 0].map(|shift| char::from(digits[(bits >> shift) as usize & 63])));
    }
    json["buffers"][0]["uri"] = json!(text);
    let scene = load_bytes(json.to_string().as_bytes()).unwrap();
    assert_eq!(scene.positions, [Vec3::ZERO, Vec3::X, Vec3::Y]);
}

#[test]
fn textures_keep_their_wrap_modes_and_transform() {
    let scene = with_image(&png()).unwrap();
    assert_eq!(scene.images[0].rgba, [1, 2, 3, 4]);
    let material = &scene.materials[0];
    assert_eq!(material.alpha, Alpha::Mask { cutoff: 0.25 });
    let texture = material.base_color_texture.unwrap();
    assert_eq!(texture.wrap, [Wrap::Mirror, Wrap::Clamp]);
    assert!(!texture.linear);
    assert_eq!(texture.uv_set, 1);
    // Scaled, then turned counter-clockwise as seen with v running down.
    let moved = |uv: Vec2| texture.transform.transform_point2(uv);
    assert!(moved(Vec2::ZERO).abs_diff_eq(vec2(0.5, 0.25), 1e-6));
    assert!(moved(Vec2::X).abs_diff_eq(vec2(0.5, 0.25 - 2.0), 1e-6));
    assert!(moved(Vec2::Y).abs_diff_eq(vec2(0.5 + 3.0, 0.25), 1e-6));
}

#[test]
fn mirroring_keeps_the_front_in_front() {
    let scene = with(|json, _| json["nodes"][0]["scale"] = json!([-1, 1, 1])).unwrap();
    assert_eq!(face_normal(&scene), Vec3::Z);
}

#[test]
fn given_normals_survive_uneven_and_mirroring_scale() {
    for scale in [
        vec3(2.0, 3.0, 4.0),
        vec3(-1.0, 1.0, 1.0),
        vec3(-2.0, -2.0, -2.0),
    ] {
        let scene = with(|json, bin| {
            let normals = floats(&[0.0, 0.0, 1.0].repeat(3));
            let accessor = json!({ "componentType": 5126, "count": 3, "type": "VEC3" });
            let index = add(json, bin, &normals, accessor);
            json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(index);
            json["nodes"][0]["scale"] = json!(scale.to_array());
        })
        .unwrap();
        for corner in &scene.corners {
            assert!(
                corner.normal.abs_diff_eq(face_normal(&scene), 1e-6),
                "{scale}"
            );
        }
    }
}

#[test]
fn quantised_positions_and_coordinates_are_read() {
    let scene = with(|json, bin| {
        let positions = [0_i16, 0, 0, 0, 100, 0, 0, 0, 0, -100, 0, 0].map(i16::to_le_bytes);
        let accessor = json!({ "componentType": 5122, "count": 3, "type": "VEC3" });
        let index = add(json, bin, positions.as_flattened(), accessor);
        let views = json["bufferViews"].as_array().unwrap().len();
        json["bufferViews"][views - 1]["byteStride"] = json!(8);
        let attributes = &mut json["meshes"][0]["primitives"][0]["attributes"];
        attributes["POSITION"] = json!(index);
        let uvs = [0_u8, 255, 255, 0, 51, 102];
        let accessor = json!({
            "componentType": 5121, "count": 3, "type": "VEC2", "normalized": true,
        });
        let index = add(json, bin, &uvs, accessor);
        json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(index);
        json["nodes"][0]["scale"] = json!([0.01, 0.01, 0.01]);
    })
    .unwrap();
    assert!(scene.positions[1].abs_diff_eq(Vec3::X, 1e-6));
    assert!(scene.positions[2].abs_diff_eq(-Vec3::Y, 1e-6));
    let uvs: Vec<Vec2> = scene.corners.iter().map(|corner| corner.uv[0]).collect();
    assert_eq!(uvs[0], Vec2::Y);
    assert_eq!(uvs[1], Vec2::X);
    assert!(uvs[2].abs_diff_eq(vec2(0.2, 0.4), 1e-6));
}

#[test]
fn strips_turn_every_other_triangle() {
    let scene = with(|json, bin| {
        let positions = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]);
        let accessor = json!({ "componentType": 5126, "count": 4, "type": "VEC3" });
        let index = add(json, bin, &positions, accessor);
        json["meshes"][0]["primitives"] =
            json!([{ "attributes": { "POSITION": index }, "mode": 5 }]);
    })
    .unwrap();
    assert_eq!(scene.triangles.len(), 2);
    assert_eq!(scene.positions.len(), 4);
    assert!(scene.corners.iter().all(|corner| corner.normal == Vec3::Z));
}

#[test]
fn a_far_scene_comes_home_by_whole_metres() {
    let scene = with(|json, _| {
        json["nodes"][0]["translation"] = json!([500_000.25, 0, 0]);
        json["nodes"].as_array_mut().unwrap().push(json!({
            "translation": [500_000, 2, 0],
            "extensions": { "KHR_lights_punctual": { "light": 0 } },
        }));
        json["scenes"][0]["nodes"] = json!([0, 1]);
        json["extensions"] =
            json!({ "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": 2 }] } });
    })
    .unwrap();
    assert!(
        scene
            .positions
            .iter()
            .all(|position| position.length() < 3.0)
    );
    assert_eq!((scene.positions[0].x - 0.25).fract(), 0.0);
    assert!(scene.notes.warnings[0].contains("far from the origin"));
    let Light::Point {
        position,
        intensity,
        ..
    } = scene.lights[0]
    else {
        panic!("a point light");
    };
    assert!(position.length() < 3.0);
    assert_eq!(intensity, Vec3::splat(2.0));
    assert!(scene.sky.is_black());
}

#[test]
fn an_animated_node_becomes_an_object_with_its_scale_baked_in() {
    let scene = with(|json, bin| {
        let scalar = json!({ "componentType": 5126, "count": 2, "type": "SCALAR" });
        let times = add(json, bin, &floats(&[0.0, 2.0]), scalar);
        let vector = json!({ "componentType": 5126, "count": 2, "type": "VEC3" });
        let path = add(json, bin, &floats(&[1.0, 0.0, 0.0, 3.0, 0.0, 0.0]), vector);
        json["nodes"] = json!([
            { "children": [1], "translation": [0, 5, 0] },
            { "children": [2], "translation": [1, 0, 0], "scale": [2, 2, 2], "name": "cart" },
            { "mesh": 0, "translation": [0, 0, 1] },
        ]);
        json["animations"] = json!([{
            "samplers": [{ "input": times, "output": path }],
            "channels": [{ "sampler": 0, "target": { "node": 1, "path": "translation" } }],
        }]);
    })
    .unwrap();
    assert_eq!(scene.triangles[0].object.0, 1);
    assert_eq!(scene.objects[0].name, "cart");
    assert_eq!(scene.positions[0], vec3(0.0, 0.0, 2.0));
    assert_eq!(scene.positions[1], vec3(2.0, 0.0, 2.0));
    let at = |seconds| {
        let time = std::time::Duration::from_secs_f32(seconds);
        scene.objects[0].world_from_object(time).position
    };
    assert_eq!(scene.objects[0].keys.len(), 2);
    assert!(at(0.0).abs_diff_eq(vec3(1.0, 5.0, 0.0), 1e-6));
    assert!(at(1.0).abs_diff_eq(vec3(2.0, 5.0, 0.0), 1e-6));
}

#[test]
fn a_camera_is_where_the_viewer_stands() {
    let scene = with(|json, _| {
        json["cameras"] = json!([{
            "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 },
        }]);
        let half = std::f32::consts::FRAC_1_SQRT_2;
        json["nodes"].as_array_mut().unwrap().push(json!({
            "camera": 0, "translation": [1, 1.6, 2], "rotation": [0, half, 0, half],
        }));
        json["scenes"][0]["nodes"] = json!([0, 1]);
    })
    .unwrap();
    let spawn = scene.spawn.unwrap();
    assert!(spawn.position.abs_diff_eq(vec3(1.0, 0.0, 2.0), 1e-6));
    assert!((spawn.orientation * Vec3::NEG_Z).abs_diff_eq(Vec3::NEG_X, 1e-6));
}
