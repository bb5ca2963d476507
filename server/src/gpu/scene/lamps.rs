//! Everything that shines, as a list to choose from by power.

use glam::Vec3;
use shadecast_shaders::light::{LightRecord, Material as MaterialRecord};

use super::luminance;
use crate::scene::{Light, Scene};

/// Radiance times area below which an emissive triangle is no lamp.
const FAINTEST_LAMP: f32 = 1e-9;

pub(super) struct Sun {
    pub(super) direction: Vec3,
    pub(super) irradiance: Vec3,
    pub(super) angular_radius: f32,
}

/// The lamps with their probabilities, the sum of their weights, and the
/// strongest directional light, which is none of them.
pub(super) fn light_records(
    scene: &Scene,
    materials: &[MaterialRecord],
) -> (Vec<LightRecord>, f32, Option<Sun>) {
    let strongest = (scene.lights.iter().enumerate())
        .filter_map(|(index, light)| match light {
            Light::Directional { irradiance, .. } => Some((index, luminance(*irradiance))),
            _ => None,
        })
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(index, _)| index);
    let mut sun = None;
    let mut weighted: Vec<(f32, LightRecord)> = Vec::new();
    for (index, light) in scene.lights.iter().enumerate() {
        match *light {
            Light::Directional {
                direction,
                irradiance,
                angular_radius,
            } => {
                if Some(index) == strongest {
                    sun = Some(Sun {
                        direction,
                        irradiance,
                        angular_radius,
                    });
                } else {
                    weighted.push((
                        luminance(irradiance),
                        LightRecord {
                            kind: 3,
                            direction: direction.to_array(),
                            intensity: irradiance.to_array(),
                            ..Default::default()
                        },
                    ));
                }
            }
            Light::Point {
                position,
                intensity,
                range,
            } => {
                weighted.push((
                    luminance(intensity) * 4.0,
                    LightRecord {
                        kind: 1,
                        position: position.to_array(),
                        intensity: intensity.to_array(),
                        range: range.min(1e18),
                        ..Default::default()
                    },
                ));
            }
            Light::Spot {
                position,
                direction,
                intensity,
                range,
                inner,
                outer,
            } => {
                weighted.push((
                    luminance(intensity) * 2.0,
                    LightRecord {
                        kind: 2,
                        position: position.to_array(),
                        direction: direction.to_array(),
                        intensity: intensity.to_array(),
                        range: range.min(1e18),
                        cos_inner: inner.cos(),
                        cos_outer: outer.cos(),
                        ..Default::default()
                    },
                ));
            }
        }
    }
    for (index, triangle) in scene.triangles.iter().enumerate() {
        let weight = materials[triangle.material as usize].emission_weight;
        let [a, b, c] = triangle.positions.map(|p| scene.positions[p as usize]);
        let area = (b - a).cross(c - a).length() * 0.5;
        if weight * area > FAINTEST_LAMP {
            weighted.push((
                weight * area,
                LightRecord {
                    kind: 0,
                    triangle: index as u32,
                    instance: u32::from(triangle.object.0),
                    area,
                    ..Default::default()
                },
            ));
        }
    }
    let total: f64 = weighted.iter().map(|(weight, _)| f64::from(*weight)).sum();
    let mut sum = 0.0;
    let lights = weighted
        .into_iter()
        .map(|(weight, record)| {
            sum += f64::from(weight);
            LightRecord {
                probability: (f64::from(weight) / total) as f32,
                cumulative: (sum / total) as f32,
                ..record
            }
        })
        .collect();
    (lights, total as f32, sun)
}
