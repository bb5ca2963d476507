//! Everything that shines.

use glam::Vec3;
use shadecast_shaders::light::LightRecord;

use super::{light_tree::Emitter, luminance, materials::mean_emissions};
use crate::scene::{Light, Scene};

/// Radiance times area below which an emissive triangle is no lamp.
const FAINTEST_LAMP: f32 = 1e-9;

pub(super) struct Sun {
    pub(super) direction: Vec3,
    pub(super) irradiance: Vec3,
    pub(super) angular_radius: f32,
}

/// The lamps, those that are triangles last and in the scene's order.
pub(super) struct Lamps {
    pub(super) lights: Vec<LightRecord>,
    pub(super) emitters: Vec<Emitter>,
    /// How many are no triangles.
    pub(super) punctual_count: u32,
    /// The strongest directional light, which is none of the lamps.
    pub(super) sun: Option<Sun>,
}

impl Lamps {
    pub(super) fn of(scene: &Scene) -> Self {
        let mut lamps = Self {
            lights: Vec::new(),
            emitters: Vec::new(),
            punctual_count: 0,
            sun: None,
        };
        let strongest = (scene.lights.iter().enumerate())
            .filter_map(|(index, light)| match light {
                Light::Directional { irradiance, .. } => Some((index, luminance(*irradiance))),
                _ => None,
            })
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(index, _)| index);
        for (index, light) in scene.lights.iter().enumerate() {
            match *light {
                Light::Directional {
                    direction,
                    irradiance,
                    angular_radius,
                } if Some(index) == strongest => {
                    lamps.sun = Some(Sun {
                        direction,
                        irradiance,
                        angular_radius,
                    });
                }
                _ => lamps.add_punctual(light),
            }
        }
        lamps.punctual_count = lamps.lights.len() as u32;
        lamps.add_triangles(scene);
        lamps
    }

    fn add_punctual(&mut self, light: &Light) {
        let all_around = Emitter {
            instance: 0,
            centre: Vec3::ZERO,
            radius: 0.0,
            axis: Vec3::Y,
            cos_spread: -1.0,
            power: 0.0,
        };
        let (record, emitter) = match *light {
            Light::Directional {
                direction,
                irradiance,
                ..
            } => (
                LightRecord {
                    kind: 3,
                    direction: direction.to_array(),
                    intensity: irradiance.to_array(),
                    ..Default::default()
                },
                Emitter {
                    radius: -1.0,
                    power: luminance(irradiance),
                    ..all_around
                },
            ),
            Light::Point {
                position,
                intensity,
                range,
            } => (
                LightRecord {
                    kind: 1,
                    position: position.to_array(),
                    intensity: intensity.to_array(),
                    range: range.min(1e18),
                    ..Default::default()
                },
                Emitter {
                    centre: position,
                    power: luminance(intensity),
                    ..all_around
                },
            ),
            Light::Spot {
                position,
                direction,
                intensity,
                range,
                inner,
                outer,
            } => (
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
                Emitter {
                    centre: position,
                    axis: direction,
                    // No light falls beyond the cone; as normals, within a right angle of
                    // which light is sent, its directions may be few.
                    cos_spread: 1.0,
                    power: luminance(intensity),
                    ..all_around
                },
            ),
        };
        if emitter.power > 0.0 {
            self.lights.push(record);
            self.emitters.push(emitter);
        }
    }

    fn add_triangles(&mut self, scene: &Scene) {
        let emissions = mean_emissions(scene);
        for (index, triangle) in scene.triangles.iter().enumerate() {
            let emission = emissions[triangle.material as usize];
            if emission <= 0.0 {
                continue;
            }
            let [a, b, c] = triangle.positions.map(|p| scene.positions[p as usize]);
            let doubled = (b - a).cross(c - a);
            let area = doubled.length() * 0.5;
            if emission * area <= FAINTEST_LAMP {
                continue;
            }
            let centre = (a + b + c) / 3.0;
            let instance = u32::from(triangle.object.0);
            let double_sided = scene.materials[triangle.material as usize].double_sided;
            self.lights.push(LightRecord {
                kind: 0,
                triangle: index as u32,
                instance,
                area,
                ..Default::default()
            });
            self.emitters.push(Emitter {
                instance,
                centre,
                radius: [a, b, c]
                    .map(|p| p.distance(centre))
                    .into_iter()
                    .fold(0.0, f32::max),
                axis: doubled.normalize_or_zero(),
                cos_spread: if double_sided { -1.0 } else { 1.0 },
                power: emission * area,
            });
        }
    }
}
