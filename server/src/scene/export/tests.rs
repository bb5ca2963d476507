use crate::scene::{Light, Scene, courtyard, load, write_glb};

fn written_and_loaded(scene: &Scene) -> Scene {
    let mut bytes = Vec::new();
    write_glb(scene, &mut bytes).unwrap();
    let path = std::env::temp_dir().join(format!("shadecast-export-{}.glb", std::process::id()));
    std::fs::write(&path, bytes).unwrap();
    let loaded = load(&path);
    std::fs::remove_file(&path).unwrap();
    loaded.unwrap()
}

/// Material, object, and the bits of positions and texture coordinates.
type Key = (u32, u16, [[u32; 3]; 3], [[u32; 2]; 3]);

/// All triangles, in an order of their own.
fn triangles(scene: &Scene) -> Vec<Key> {
    let mut triangles: Vec<_> = scene
        .triangles
        .iter()
        .map(|t| {
            let positions = t
                .positions
                .map(|i| scene.positions[i as usize].to_array().map(f32::to_bits));
            let uvs = t.corners.map(|i| {
                (scene.corners[i as usize].uv[0] + 0.0)
                    .to_array()
                    .map(f32::to_bits)
            });
            (t.material, t.object.0, positions, uvs)
        })
        .collect();
    triangles.sort_unstable();
    triangles
}

#[test]
fn a_scene_survives_the_round_trip() {
    let scene = courtyard(10_000);
    let loaded = written_and_loaded(&scene);
    assert_eq!(triangles(&loaded), triangles(&scene));
    assert_eq!(loaded.images, scene.images);
    assert_eq!(loaded.sky, scene.sky);
    assert!(
        loaded.notes.warnings.is_empty(),
        "{:?}",
        loaded.notes.warnings
    );
    assert!(loaded.notes.extensions_ignored.is_empty());

    assert_eq!(loaded.materials.len(), scene.materials.len());
    for (a, b) in loaded.materials.iter().zip(&scene.materials) {
        assert_eq!(a.name, b.name);
        assert_eq!(a.base_color, b.base_color);
        assert_eq!(a.alpha, b.alpha);
        assert_eq!(
            (a.metallic, a.roughness, a.ior),
            (b.metallic, b.roughness, b.ior)
        );
        assert!(a.emissive.abs_diff_eq(b.emissive, 1e-5));
        match (&a.base_color_texture, &b.base_color_texture) {
            (Some(a), Some(b)) => {
                assert!(a.transform.abs_diff_eq(b.transform, 1e-6));
                assert_eq!((a.image, a.wrap, a.linear), (b.image, b.wrap, b.linear));
            }
            (a, b) => assert_eq!(a, b),
        }
    }
    assert_eq!(loaded.lights.len(), scene.lights.len());
    for (a, b) in loaded.lights.iter().zip(&scene.lights) {
        match (a, b) {
            (
                Light::Directional {
                    direction: a,
                    irradiance: c,
                    angular_radius: e,
                },
                Light::Directional {
                    direction: b,
                    irradiance: d,
                    angular_radius: f,
                },
            ) => assert!(a.abs_diff_eq(*b, 1e-5) && c.abs_diff_eq(*d, 1e-5) && e == f),
            (a, b) => assert_eq!(a, b),
        }
    }
    assert_eq!(loaded.objects.len(), 1);
    assert_eq!(loaded.objects[0].name, scene.objects[0].name);
    for (a, b) in loaded.objects[0].keys.iter().zip(&scene.objects[0].keys) {
        assert_eq!(a.0, b.0);
        assert!(a.1.position.abs_diff_eq(b.1.position, 1e-5));
        assert!(a.1.orientation.dot(b.1.orientation).abs() > 0.999_999);
    }
    let (a, b) = (loaded.spawn.unwrap(), scene.spawn.unwrap());
    assert!(a.position.abs_diff_eq(b.position, 1e-5));
    assert!(a.orientation.dot(b.orientation).abs() > 0.999_999);
}

#[test]
fn a_written_file_is_aligned_and_says_its_length() {
    let mut bytes = Vec::new();
    write_glb(&courtyard(10_000), &mut bytes).unwrap();
    let length = u32::from_le_bytes(bytes[8..12].try_into().unwrap());
    assert_eq!(length as usize, bytes.len());
    assert_eq!(bytes.len() % 4, 0);
}
