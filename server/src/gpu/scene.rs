//! The scene as the kernels read it: trees, triangles, materials, texels and lamps.

use std::time::Duration;

use glam::{Mat3, Vec3, Vec3A, Vec4};
use obvhs::{BvhBuildParams, cwbvh::builder::build_cwbvh_from_tris};
use shadecast_protocol::{ObjectId, Pose};
use shadecast_shaders::light::{
    Globals, Instance, LightRecord, Material as MaterialRecord, NO_TEXTURE, TextureRecord,
    rows_of_affine,
};
use wgpu::ShaderStages;

use super::{Binding, Gpu, GpuError, bind, layout};
use crate::scene::{Alpha, Image, Light, Scene, TextureRef, Wrap};

/// Radiance times area below which an emissive triangle is no lamp.
const FAINTEST_LAMP: f32 = 1e-9;
/// Where the object begins in a triangle's last word, above its material.
const OBJECT_SHIFT: u32 = 20;
/// Share of what white paper in the open reflects below which a lamp's
/// contribution is too faint to always be worth a shadow ray.
const FAINT_SHARE: f32 = 0.01;
/// Largest share of the largest binding that texels may take; images are
/// halved until they fit.
const TEXEL_SHARE: f64 = 0.9;

/// The scene's buffers and their one bind group.
#[derive(Debug)]
pub struct GpuScene {
    pub(crate) layout: wgpu::BindGroupLayout,
    pub(crate) group: wgpu::BindGroup,
    /// What the kernels leave out, as override constants.
    pub(crate) constants: Vec<(&'static str, f64)>,
    globals: Globals,
    globals_buffer: wgpu::Buffer,
    instances: Vec<Instance>,
    instance_buffer: wgpu::Buffer,
    /// Bytes on the GPU.
    pub bytes: u64,
    /// Times that images were halved to fit.
    pub texture_halvings: u32,
}

impl GpuScene {
    /// Builds the trees and uploads everything. `progress` is told the share done.
    ///
    /// # Errors
    /// When a list is larger than the device binds.
    pub fn new(
        gpu: &Gpu,
        scene: &Scene,
        bounces: u32,
        progress: &mut dyn FnMut(f32),
    ) -> Result<Self, GpuError> {
        let trees = Trees::build(scene, progress);
        let limit = gpu.device.limits().max_storage_buffer_binding_size;
        let texels = Texels::pack(scene, (limit as f64 * TEXEL_SHARE / 4.0) as usize);
        let materials = material_records(scene, &texels);
        let (lights, light_weight, sun) = light_records(scene, &materials);

        let corners: Vec<[[f32; 4]; 3]> = scene
            .corners
            .iter()
            .map(|corner| {
                let color = corner.color.clamp(Vec4::ZERO, Vec4::ONE) * 255.0 + 0.5;
                let packed = u32::from_le_bytes(color.to_array().map(|c| c as u8));
                [
                    corner.normal.extend(f32::from_bits(packed)).to_array(),
                    corner.tangent.to_array(),
                    [
                        corner.uv[0].x,
                        corner.uv[0].y,
                        corner.uv[1].x,
                        corner.uv[1].y,
                    ],
                ]
            })
            .collect();
        let triangles: Vec<[u32; 4]> = scene
            .triangles
            .iter()
            .map(|t| {
                let last = t.material | u32::from(t.object.0) << OBJECT_SHIFT;
                [t.corners[0], t.corners[1], t.corners[2], last]
            })
            .collect();
        let vertices: Vec<[u32; 3]> = scene.triangles.iter().map(|t| t.positions).collect();

        let any =
            |wanted: &dyn Fn(&crate::scene::Material) -> bool| scene.materials.iter().any(wanted);
        let constants = [
            ("HAS_SUN", sun.is_some()),
            ("HAS_LIGHTS", !lights.is_empty()),
            ("HAS_SKY", !scene.sky.is_black()),
            ("HAS_MASKS", any(&|m| matches!(m.alpha, Alpha::Mask { .. }))),
            ("HAS_TEXTURES", !scene.images.is_empty()),
            ("HAS_NORMAL_MAPS", any(&|m| m.normal_texture.is_some())),
            ("HAS_MOVERS", !scene.objects.is_empty()),
        ]
        .map(|(name, used)| (name, f64::from(u8::from(used))))
        .to_vec();

        let mut globals = Globals {
            sky_zenith: scene.sky.zenith.to_array(),
            sky_horizon: scene.sky.horizon.to_array(),
            sky_ground: scene.sky.ground.to_array(),
            light_count: lights.len() as u32,
            light_weight,
            instance_count: trees.instances.len() as u32,
            bounces,
            ..Default::default()
        };
        if let Some(sun) = sun {
            globals.sun_direction = (-sun.direction).to_array();
            globals.sun_cos = sun.angular_radius.cos();
            globals.sun_irradiance = sun.irradiance.to_array();
        }
        let open_sky = luminance(scene.sky.zenith + scene.sky.horizon) * 0.5;
        let sunlit = luminance(Vec3::from(globals.sun_irradiance)) / std::f32::consts::PI;
        globals.faint = FAINT_SHARE * (open_sky + sunlit);
        let globals_buffer = gpu.uniform("globals", size_of::<Globals>());
        gpu.queue
            .write_buffer(&globals_buffer, 0, bytemuck::bytes_of(&globals));
        let instance_buffer = gpu.storage("instances", bytemuck::cast_slice(&trees.instances))?;
        let lists = [
            gpu.storage("BVH nodes", bytemuck::cast_slice(&trees.nodes))?,
            gpu.storage("BVH triangles", bytemuck::cast_slice(&trees.triangles))?,
            gpu.storage("triangles", bytemuck::cast_slice(&triangles))?,
            gpu.storage("corners", bytemuck::cast_slice(&corners))?,
            gpu.storage("materials", bytemuck::cast_slice(&materials))?,
            gpu.storage("texels", bytemuck::cast_slice(&texels.texels))?,
            gpu.storage("lights", bytemuck::cast_slice(&lights))?,
            instance_buffer.clone(),
            gpu.storage("positions", bytemuck::cast_slice(&scene.positions))?,
            gpu.storage("vertices", bytemuck::cast_slice(&vertices))?,
        ];
        let mut bindings = vec![Binding::Uniform];
        bindings.extend([Binding::Read; 10]);
        let layout = layout(
            gpu,
            ShaderStages::COMPUTE | ShaderStages::VERTEX | ShaderStages::FRAGMENT,
            &bindings,
        );
        let mut buffers = vec![&globals_buffer];
        buffers.extend(&lists);
        let group = bind(gpu, &layout, &buffers);
        let bytes = buffers.iter().map(|buffer| buffer.size()).sum();
        Ok(Self {
            layout,
            group,
            constants,
            globals,
            globals_buffer,
            instances: trees.instances,
            instance_buffer,
            bytes,
            texture_halvings: texels.halvings,
        })
    }

    /// Sets how many indirect bounces the paths make from now on.
    pub fn set_bounces(&mut self, gpu: &Gpu, bounces: u32) {
        self.globals.bounces = bounces;
        gpu.queue
            .write_buffer(&self.globals_buffer, 0, bytemuck::bytes_of(&self.globals));
    }

    /// Indirect bounces of the paths.
    pub(crate) fn bounces(&self) -> u32 {
        self.globals.bounces
    }

    /// Moves the objects; `poses[n]` is `world_from_object` of `ObjectId(n + 1)`.
    pub fn set_poses(&mut self, gpu: &Gpu, poses: &[Pose]) {
        if poses.is_empty() {
            return;
        }
        for (instance, pose) in self.instances.iter_mut().skip(1).zip(poses) {
            (instance.world_from_object, instance.object_from_world) = transforms(*pose);
        }
        gpu.queue.write_buffer(
            &self.instance_buffer,
            0,
            bytemuck::cast_slice(&self.instances),
        );
    }
}

type Rows = [[f32; 4]; 3];

fn transforms(pose: Pose) -> (Rows, Rows) {
    let inverse = pose.inverse();
    (
        rows_of_affine(Mat3::from_quat(pose.orientation), pose.position),
        rows_of_affine(Mat3::from_quat(inverse.orientation), inverse.position),
    )
}

/// One tree for the world and one for each moving object, end to end.
struct Trees {
    nodes: Vec<obvhs::cwbvh::node::CwBvhNode>,
    /// Corner and two edges, in tree order; the scene's triangle and its flags
    /// in the fourth components.
    triangles: Vec<[[f32; 4]; 3]>,
    instances: Vec<Instance>,
}

impl Trees {
    fn build(scene: &Scene, progress: &mut dyn FnMut(f32)) -> Self {
        let mut trees = Self {
            nodes: Vec::new(),
            triangles: Vec::new(),
            instances: Vec::new(),
        };
        for object in 0..=scene.objects.len() {
            progress(object as f32 / (scene.objects.len() + 1) as f32);
            trees.add(scene, ObjectId(object as u16));
        }
        progress(1.0);
        trees
    }

    fn add(&mut self, scene: &Scene, object: ObjectId) {
        let members: Vec<u32> = (0..)
            .zip(&scene.triangles)
            .filter(|(_, triangle)| triangle.object == object)
            .map(|(index, _)| index)
            .collect();
        let corners_of = |triangle: u32| {
            scene.triangles[triangle as usize]
                .positions
                .map(|p| scene.positions[p as usize])
        };
        let shapes: Vec<_> = members
            .iter()
            .map(|&triangle| {
                let [v0, v1, v2] = corners_of(triangle).map(Vec3A::from);
                obvhs::triangle::Triangle { v0, v1, v2 }
            })
            .collect();
        let (world_from_object, object_from_world) = transforms(Pose::IDENTITY);
        let mut instance = Instance {
            world_from_object,
            object_from_world,
            root_node: NO_TEXTURE,
            first_triangle: self.triangles.len() as u32,
            padding: [0; 2],
        };
        if !shapes.is_empty() {
            instance.root_node = self.nodes.len() as u32;
            let tree = build_cwbvh_from_tris(
                &shapes,
                BvhBuildParams::very_slow_build(),
                &mut Duration::default(),
            );
            self.nodes.extend(tree.nodes);
            self.triangles
                .extend(tree.primitive_indices.iter().map(|&local| {
                    let triangle = members[local as usize];
                    let material =
                        &scene.materials[scene.triangles[triangle as usize].material as usize];
                    let flags = u32::from(matches!(material.alpha, Alpha::Mask { .. }))
                        | u32::from(material.double_sided) << 1;
                    let [a, b, c] = corners_of(triangle);
                    [
                        a.extend(f32::from_bits(triangle)).to_array(),
                        (b - a).extend(f32::from_bits(flags)).to_array(),
                        (c - a).extend(0.0).to_array(),
                    ]
                }));
        }
        self.instances.push(instance);
    }
}

/// All images with their mip levels, one after the other.
struct Texels {
    texels: Vec<u32>,
    /// Offset, size and levels of each image as (linear, sRGB) data.
    places: Vec<[Option<Place>; 2]>,
    halvings: u32,
}

#[derive(Clone, Copy)]
struct Place {
    offset: u32,
    width: u32,
    height: u32,
    levels: u32,
}

impl Texels {
    fn pack(scene: &Scene, most: usize) -> Self {
        let mut uses = vec![[false; 2]; scene.images.len()];
        for material in &scene.materials {
            for (slot, texture) in slots(material).iter().enumerate() {
                if let Some(texture) = texture {
                    uses[texture.image as usize][usize::from(is_srgb(slot))] = true;
                }
            }
        }
        let texel_count = |halvings: u32| -> usize {
            let side = |s: u32| ((s >> halvings).max(1)) as usize;
            (scene.images.iter().zip(&uses))
                .map(|(image, used)| {
                    let copies = used.iter().filter(|u| **u).count();
                    copies * side(image.width) * side(image.height) * 4 / 3 + 64
                })
                .sum()
        };
        let halvings = (0..16).find(|&h| texel_count(h) <= most).unwrap_or(16);
        let mut packed = Self {
            texels: Vec::new(),
            places: Vec::new(),
            halvings,
        };
        for (image, used) in scene.images.iter().zip(uses) {
            let places = [false, true]
                .map(|srgb| used[usize::from(srgb)].then(|| packed.add(image, srgb, halvings)));
            packed.places.push(places);
        }
        packed
    }

    fn add(&mut self, image: &Image, srgb: bool, halvings: u32) -> Place {
        let roots: [u8; 256] =
            std::array::from_fn(|byte| (linear_from_srgb(byte as u8).sqrt() * 255.0 + 0.5) as u8);
        let (mut width, mut height) = (image.width, image.height);
        let mut level: Vec<u32> = image
            .rgba
            .chunks_exact(4)
            .map(|c| {
                let rgb = [c[0], c[1], c[2]]
                    .map(|byte| if srgb { roots[usize::from(byte)] } else { byte });
                u32::from_le_bytes([rgb[0], rgb[1], rgb[2], c[3]])
            })
            .collect();
        for _ in 0..halvings {
            (level, width, height) = halved(&level, width, height, srgb);
        }
        let place = Place {
            offset: self.texels.len() as u32,
            width,
            height,
            levels: 1,
        };
        let mut levels = 1;
        self.texels.extend(&level);
        while width > 1 || height > 1 {
            (level, width, height) = halved(&level, width, height, srgb);
            self.texels.extend(&level);
            levels += 1;
        }
        Place { levels, ..place }
    }
}

fn linear_from_srgb(byte: u8) -> f32 {
    let c = f32::from(byte) / 255.0;
    if c <= 0.040_45 {
        c / 12.92
    } else {
        ((c + 0.055) / 1.055).powf(2.4)
    }
}

/// The next mip level: the mean of two by two texels, in linear light.
fn halved(texels: &[u32], width: u32, height: u32, srgb: bool) -> (Vec<u32>, u32, u32) {
    let (w, h) = ((width / 2).max(1), (height / 2).max(1));
    // Colours are square roots of linear light.
    let decode = |byte: u8| {
        let c = f32::from(byte) / 255.0;
        if srgb { c * c } else { c }
    };
    let encode = |c: f32| ((if srgb { c.sqrt() } else { c }) * 255.0 + 0.5) as u8;
    let mut out = Vec::with_capacity((w * h) as usize);
    for y in 0..h {
        for x in 0..w {
            let mut sum = [0.0; 4];
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let (sx, sy) = ((2 * x + dx).min(width - 1), (2 * y + dy).min(height - 1));
                let bytes = texels[(sy * width + sx) as usize].to_le_bytes();
                for (channel, byte) in bytes.into_iter().enumerate() {
                    sum[channel] += if channel == 3 {
                        f32::from(byte) / 255.0
                    } else {
                        decode(byte)
                    };
                }
            }
            let alpha = (sum[3] * 0.25 * 255.0 + 0.5) as u8;
            out.push(u32::from_le_bytes([
                encode(sum[0] * 0.25),
                encode(sum[1] * 0.25),
                encode(sum[2] * 0.25),
                alpha,
            ]));
        }
    }
    (out, w, h)
}

/// The slots in the order of the record.
fn slots(material: &crate::scene::Material) -> [Option<TextureRef>; 4] {
    [
        material.base_color_texture,
        material.metallic_roughness_texture,
        material.normal_texture,
        material.emissive_texture,
    ]
}

fn is_srgb(slot: usize) -> bool {
    slot == 0 || slot == 3
}

fn material_records(scene: &Scene, texels: &Texels) -> Vec<MaterialRecord> {
    let wrap = |wrap: Wrap| match wrap {
        Wrap::Repeat => 0,
        Wrap::Mirror => 1,
        Wrap::Clamp => 2,
    };
    let record = |slot: usize, texture: Option<TextureRef>| {
        let srgb = is_srgb(slot);
        let place = texture.and_then(|t| texels.places[t.image as usize][usize::from(srgb)]);
        let (Some(texture), Some(place)) = (texture, place) else {
            return TextureRecord::NONE;
        };
        TextureRecord {
            offset: place.offset,
            size: place.width | place.height << 16,
            flags: wrap(texture.wrap[0])
                | wrap(texture.wrap[1]) << 2
                | u32::from(texture.linear) << 4
                | u32::from(texture.uv_set == 1) << 5
                | u32::from(srgb) << 6,
            levels: place.levels,
            matrix: texture.transform.matrix2.to_cols_array(),
            translation: texture.transform.translation.to_array(),
            padding: [0.0; 2],
        }
    };
    scene
        .materials
        .iter()
        .map(|material| {
            let textures = slots(material);
            let mean = material.emissive_texture.map_or(Vec3::ONE, |texture| {
                mean_color(&scene.images[texture.image as usize])
            });
            let reflectance = ((material.ior - 1.0) / (material.ior + 1.0)).powi(2);
            MaterialRecord {
                base_color: material.base_color.to_array(),
                emissive: material.emissive.to_array(),
                metallic: material.metallic,
                roughness: material.roughness,
                normal_scale: material.normal_scale,
                alpha_cutoff: match material.alpha {
                    Alpha::Mask { cutoff } => cutoff,
                    Alpha::Opaque | Alpha::Blend => -1.0,
                },
                f0: reflectance,
                double_sided: u32::from(material.double_sided),
                emission_weight: luminance(material.emissive * mean),
                padding: [0.0; 2],
                textures: std::array::from_fn(|slot| record(slot, textures[slot])),
            }
        })
        .collect()
}

fn luminance(c: Vec3) -> f32 {
    c.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// Mean of an sRGB image in linear light.
fn mean_color(image: &Image) -> Vec3 {
    let mut sum = Vec3::ZERO;
    for texel in image.rgba.chunks_exact(4) {
        sum += Vec3::from([texel[0], texel[1], texel[2]].map(linear_from_srgb));
    }
    sum / (image.rgba.len() / 4).max(1) as f32
}

struct Sun {
    direction: Vec3,
    irradiance: Vec3,
    angular_radius: f32,
}

/// The lamps with their probabilities, the sum of their weights, and the
/// strongest directional light, which is none of them.
fn light_records(
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
