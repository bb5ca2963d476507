//! The scene as the kernels read it: trees, triangles, materials, texels and lamps.

mod environment;
mod lamps;
mod light_tree;
mod materials;
mod texels;
mod trees;

use glam::{Vec3, Vec4};
use shadecast_protocol::Pose;
use shadecast_shaders::light::{Globals, Instance};
use wgpu::ShaderStages;

use self::{
    environment::Environment,
    lamps::Lamps,
    light_tree::LightTree,
    materials::material_records,
    texels::Texels,
    trees::{Trees, transforms},
};
use super::{Binding, Gpu, GpuError, bind, layout};
use crate::scene::{Scene, SceneFacts};

/// Where the object begins in a triangle's last word, above its material.
const OBJECT_SHIFT: u32 = 20;
/// Share of what white paper in the open reflects below which a lamp's
/// contribution is too faint to always be worth a shadow ray.
const FAINT_SHARE: f32 = 0.01;
/// Largest share of the largest binding that texels may take; images are
/// halved until they fit.
const TEXEL_SHARE: f64 = 0.9;

/// How light is found. Whatever is switched off, the light is the same but for its
/// noise: that is how `shadecast-eval` tells what each part is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Integrator {
    /// Indirect bounces; 0 is emission and direct light only.
    pub bounces: u32,
    /// Lamps are chosen by what they can send, and not all alike.
    pub light_selection: bool,
    /// Light and BSDF samples share what both find.
    pub multiple_importance: bool,
    /// Points of Sobol's sequence instead of random numbers.
    pub low_discrepancy: bool,
    /// Texels that few samples have lit are smoothed.
    pub smoothing: bool,
    /// What the scene does not use is compiled away.
    pub specialised: bool,
}

impl Integrator {
    /// Everything switched on.
    #[must_use]
    pub fn with_bounces(bounces: u32) -> Self {
        Self {
            bounces,
            light_selection: true,
            multiple_importance: true,
            low_discrepancy: true,
            smoothing: true,
            specialised: true,
        }
    }
}

/// The scene's buffers and their one bind group.
#[derive(Debug)]
pub struct GpuScene {
    /// First group of every kernel that reads the scene.
    pub layout: wgpu::BindGroupLayout,
    /// The same, bound.
    pub group: wgpu::BindGroup,
    /// What the kernels leave out, as override constants.
    pub constants: Vec<(&'static str, f64)>,
    globals: Globals,
    globals_buffer: wgpu::Buffer,
    instances: Vec<Instance>,
    instance_buffer: wgpu::Buffer,
    light_tree: LightTree,
    light_nodes: wgpu::Buffer,
    /// Paths send rays beyond their last vertex, for lamps in narrow lobes.
    pub(crate) looks_for_lamps: bool,
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
        integrator: Integrator,
        progress: &mut dyn FnMut(f32),
    ) -> Result<Self, GpuError> {
        let trees = Trees::build(scene, progress);
        let limit = gpu.device.limits().max_storage_buffer_binding_size;
        let texels = Texels::pack(scene, (limit as f64 * TEXEL_SHARE / 4.0) as usize);
        let materials = material_records(scene, &texels);
        let Lamps {
            mut lights,
            emitters,
            punctual_count,
            sun,
        } = Lamps::of(scene);
        let (light_tree, trails) = LightTree::build(emitters);
        for (light, trail) in lights.iter_mut().zip(trails) {
            light.trail = trail;
        }

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

        let environment = (scene.environment.as_ref())
            .map(|map| Environment::of(map, limit))
            .unwrap_or_default();
        let facts = SceneFacts::of(scene);
        let used = [
            ("HAS_SUN", sun.is_some()),
            ("HAS_LIGHTS", !lights.is_empty()),
            ("HAS_SKY", facts.sky),
            ("HAS_ENVIRONMENT", scene.environment.is_some()),
            ("HAS_MASKS", facts.alpha_mask || facts.alpha_blend),
            ("HAS_TEXTURES", facts.textures),
            ("HAS_NORMAL_MAPS", facts.normal_maps),
            ("HAS_MOVERS", facts.moving_objects > 0),
            ("HAS_NARROW_LOBES", facts.lamps_in_narrow_lobes()),
        ];
        let switched = [
            ("LIGHT_SELECTION", integrator.light_selection),
            ("MULTIPLE_IMPORTANCE", integrator.multiple_importance),
            ("LOW_DISCREPANCY", integrator.low_discrepancy),
            ("SMOOTHING", integrator.smoothing),
        ];
        let used = used.map(|(name, used)| (name, used || !integrator.specialised));
        let constants = used
            .into_iter()
            .chain(switched)
            .map(|(name, on)| (name, f64::from(u8::from(on))))
            .collect();

        let mut globals = Globals {
            sky_zenith: scene.sky.zenith.to_array(),
            sky_horizon: scene.sky.horizon.to_array(),
            sky_ground: scene.sky.ground.to_array(),
            light_count: lights.len() as u32,
            punctual_count,
            instance_count: trees.instances.len() as u32,
            bounces: integrator.bounces,
            environment_cell: environment.cell,
            environment_size: environment.size,
            ..Default::default()
        };
        if let Some(sun) = sun {
            globals.sun_direction = (-sun.direction).to_array();
            globals.sun_cos = sun.angular_radius.cos();
            globals.sun_irradiance = sun.irradiance.to_array();
        }
        let open_sky = match &scene.environment {
            Some(map) => luminance(map.mean()),
            None => luminance(scene.sky.zenith + scene.sky.horizon) * 0.5,
        };
        let sunlit = luminance(Vec3::from(globals.sun_irradiance)) / std::f32::consts::PI;
        globals.faint = FAINT_SHARE * (open_sky + sunlit);
        let globals_buffer = gpu.uniform("globals", size_of::<Globals>());
        gpu.queue
            .write_buffer(&globals_buffer, 0, bytemuck::bytes_of(&globals));
        let instance_buffer = gpu.storage("instances", bytemuck::cast_slice(&trees.instances))?;
        let light_nodes = gpu.storage("light nodes", bytemuck::cast_slice(&light_tree.nodes))?;
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
            light_nodes.clone(),
            gpu.storage("environment", bytemuck::cast_slice(&environment.radiance))?,
            gpu.storage(
                "environment cells",
                bytemuck::cast_slice(&environment.cells),
            )?,
        ];
        let mut bindings = vec![Binding::Uniform];
        bindings.extend([Binding::Read; 13]);
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
            light_tree,
            light_nodes,
            looks_for_lamps: facts.lamps_in_narrow_lobes() || !integrator.specialised,
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
        if self.light_tree.moves() {
            self.light_tree.refit(poses);
            let nodes = bytemuck::cast_slice(&self.light_tree.nodes);
            gpu.queue.write_buffer(&self.light_nodes, 0, nodes);
        }
    }
}

fn luminance(c: Vec3) -> f32 {
    c.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}
