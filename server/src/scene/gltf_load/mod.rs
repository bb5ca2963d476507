//! A glTF 2.0 or GLB file becomes a [`Scene`].
//!
//! The `gltf` crate parses the JSON and checks that indices stay in range;
//! bytes are read here, with every offset checked first, because a file may
//! lie about its lengths. The node tree is composed in `f64` and flattened:
//! what stands still ends up in world space, what an animation moves rigidly
//! in the space of its own object.

mod accessor;
mod animation;
mod container;
mod error;
pub(in crate::scene) mod extras;
mod images;
mod lights;
mod materials;
mod mesh;
mod nodes;
#[cfg(test)]
mod tests;
mod weld;

use std::path::Path;

use glam::{DVec3, Vec3};

use super::tangents::complete_tangents;
use super::{Light, Scene, SkyModel};
use accessor::Data;
use container::Container;
pub use error::LoadError;

/// Most triangles of a scene.
const MAX_TRIANGLES: usize = 16 << 20;
/// A scene whose middle is further than this from the origin is moved, for
/// `f32` then resolves no better than a tenth of a millimetre.
const FAR_AWAY: f64 = 1000.0;

/// Loads a glTF or GLB file.
///
/// # Errors
/// Every fault of the file is a [`LoadError`]; what can be left out without
/// changing the scene's meaning becomes a warning in [`Scene::notes`].
pub fn load(path: &Path) -> Result<Scene, LoadError> {
    let container = Container::open(path)?;
    let document = &container.document;
    let data = Data {
        buffers: &container.buffers,
    };
    let mut scene = Scene {
        name: path
            .file_stem()
            .map(|stem| stem.to_string_lossy().into_owned())
            .unwrap_or_default(),
        ..Scene::default()
    };
    scene.notes.extensions_used = container.extensions_used.clone();
    scene.notes.extensions_ignored = container.extensions_ignored.clone();

    let motions = animation::Motions::read(document, &data, &mut scene)?;
    let instances = nodes::flatten(document, &motions, &mut scene)?;
    materials::read(&container, &data, &mut scene)?;
    let mut soup = mesh::Soup::default();
    for instance in &instances {
        soup.add(instance, document, &data, &mut scene)?;
    }
    let extras = extras::Extras::of(document);
    for instance in &instances {
        lights::add(instance, extras.sun_angular_radius(), &mut scene)?;
        nodes::stand_at_camera(instance, &mut scene);
    }
    let offset = whole_metres_to_middle(&soup);
    weld::weld(soup, offset, &mut scene)?;
    move_all(&mut scene, -offset.as_vec3());
    scene.sky = extras.sky()?;
    light_if_dark(&mut scene);
    complete_tangents(&mut scene);
    Ok(scene)
}

/// The offset to subtract from all positions: zero unless the scene is far away.
fn whole_metres_to_middle(soup: &mesh::Soup) -> DVec3 {
    let (low, high) = soup.bounds();
    let middle = 0.5 * (low + high);
    if middle.is_finite() && middle.length() > FAR_AWAY {
        middle.round()
    } else {
        DVec3::ZERO
    }
}

/// Moves everything but the triangles, which weld has moved already in `f64`.
fn move_all(scene: &mut Scene, by: Vec3) {
    if by == Vec3::ZERO {
        return;
    }
    scene.notes.warnings.push(format!(
        "the scene was far from the origin and is moved by ({}, {}, {}) m",
        by.x, by.y, by.z
    ));
    for (_, pose) in scene.objects.iter_mut().flat_map(|object| &mut object.keys) {
        pose.position += by;
    }
    for light in &mut scene.lights {
        match light {
            Light::Point { position, .. } | Light::Spot { position, .. } => *position += by,
            Light::Directional { .. } => {}
        }
    }
    if let Some(spawn) = &mut scene.spawn {
        spawn.position += by;
    }
}

/// A file without any light would be black.
fn light_if_dark(scene: &mut Scene) {
    let emits = |triangle: &super::Triangle| {
        scene.materials[triangle.material as usize].emissive != Vec3::ZERO
    };
    if scene.lights.is_empty() && scene.sky.is_black() && !scene.triangles.iter().any(emits) {
        scene.sky = SkyModel::constant(Vec3::ONE);
        scene
            .notes
            .warnings
            .push("the file has no light: an even white sky lights it".to_owned());
    }
}
