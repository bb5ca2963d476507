//! KHR_lights_punctual.

use glam::{DVec3, Vec3};
use gltf::khr_lights_punctual::Kind;

use super::LoadError;
use super::nodes::Instance;
use crate::scene::{Light, Scene};

/// Adds the light of a node, if it has one. It stays where it is at rest.
pub(super) fn add(
    instance: &Instance<'_>,
    sun_angular_radius: f32,
    scene: &mut Scene,
) -> Result<(), LoadError> {
    let Some(light) = instance.node.light() else {
        return Ok(());
    };
    let position = instance.world_from_node.w_axis.truncate().as_vec3();
    let direction = instance
        .world_from_node
        .transform_vector3(DVec3::NEG_Z)
        .as_vec3()
        .normalize_or(Vec3::NEG_Z);
    let intensity = Vec3::from_array(light.color()) * light.intensity();
    let range = light.range().unwrap_or(f32::INFINITY);
    let angles = match light.kind() {
        Kind::Spot {
            inner_cone_angle,
            outer_cone_angle,
        } => [inner_cone_angle, outer_cone_angle],
        Kind::Directional | Kind::Point => [0.0; 2],
    };
    let sane = intensity.is_finite()
        && intensity.min_element() >= 0.0
        && range > 0.0
        && angles
            .iter()
            .all(|angle| (0.0..=std::f32::consts::FRAC_PI_2 + 1e-3).contains(angle));
    if !sane {
        let place = format!("extensions.KHR_lights_punctual.lights[{}]", light.index());
        return Err(LoadError::invalid(
            place,
            "a number is not finite or out of range",
        ));
    }
    scene.lights.push(match light.kind() {
        Kind::Point => Light::Point {
            position,
            intensity,
            range,
        },
        Kind::Directional => Light::Directional {
            direction,
            irradiance: intensity,
            angular_radius: sun_angular_radius,
        },
        Kind::Spot { .. } => Light::Spot {
            position,
            direction,
            intensity,
            range,
            inner: angles[0],
            outer: angles[1],
        },
    });
    Ok(())
}
