//! What a client shows of an atlas, before tone curve and video; see `view.wgsl`.

use std::cell::OnceCell;

use anyhow::Result;
use bytemuck::{Pod, Zeroable};
use glam::{Mat3, Vec3};
use shadecast_protocol::{Epoch, PatchShape, Pose, Slot, Update};
use shadecast_server::{
    Pipeline,
    kernels::{Binding, bind, layout, workgroups},
    patches::PatchedScene,
    still::Still,
};
use shadecast_shaders::light::{ADVANCE_SOURCE, TRIANGLE_SOURCE, rows_of_affine};
use wgpu::ShaderStages;

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct ViewParameters {
    world_from_eye: [[f32; 4]; 3],
    tangents: [f32; 4],
    size: [u32; 2],
    atlas_width: u32,
    padding: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Home {
    position: u32,
    layout_bits: u32,
    first_triangle: u32,
    corners: [u32; 3],
    weights: [u32; 2],
}

const NOWHERE: u32 = u32::MAX;
/// In `Home::layout_bits`: a triangle's slot.
const TRIANGLE: u32 = 1 << 15;

/// The slots of an atlas as its updates tell of them, and the kernel that looks
/// at the scene through them.
#[derive(Debug)]
pub(super) struct AtlasView {
    atlas_width: u32,
    epoch: Epoch,
    homes: Vec<Home>,
    homes_buffer: wgpu::Buffer,
    patches: wgpu::Buffer,
    parameters: wgpu::Buffer,
    layout: wgpu::BindGroupLayout,
    nothing: wgpu::BindGroup,
    empty: wgpu::BindGroupLayout,
    source: String,
    /// Compiled when first looked with.
    kernels: [OnceCell<wgpu::ComputePipeline>; 3],
}

/// What is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Look {
    /// What a client shows of the atlas: radiance.
    Atlas,
    /// What it would show in even light without an atlas: see `even.wgsl`.
    Even,
    /// What texel coordinates do from pixel to pixel: see `density.wgsl`.
    Density,
}

impl Look {
    fn kernel(self) -> &'static str {
        match self {
            Self::Atlas => "see_atlas",
            Self::Even => "see_even",
            Self::Density => "see_density",
        }
    }
}

impl AtlasView {
    pub(super) fn new(pipeline: &Pipeline, atlas_width: u16) -> Result<Self> {
        let (gpu, _) = pipeline.gpu();
        let PatchedScene { scene, patches, .. } = pipeline.scene();
        let mut patch_of = vec![0_u32; scene.triangles.len()];
        let mut homes = Vec::with_capacity(patches.len());
        for (index, patch) in (0..).zip(patches) {
            let first = patch.first_triangle as usize;
            patch_of[first..first + patch.shape.triangles().len()].fill(index);
            homes.push(Home {
                position: NOWHERE,
                layout_bits: 0,
                first_triangle: patch.first_triangle,
                ..Home::zeroed()
            });
        }
        let nothing = layout(gpu, ShaderStages::COMPUTE, &[]);
        let own = layout(
            gpu,
            ShaderStages::COMPUTE,
            &[
                Binding::Uniform,
                Binding::Read,
                Binding::Read,
                Binding::Read,
                Binding::Write,
            ],
        );
        let source = [
            ADVANCE_SOURCE,
            TRIANGLE_SOURCE,
            include_str!("view.wgsl"),
            include_str!("even.wgsl"),
            include_str!("density.wgsl"),
        ]
        .concat();
        Ok(Self {
            atlas_width: u32::from(atlas_width),
            epoch: Epoch(0),
            homes_buffer: gpu.storage("homes", bytemuck::cast_slice(&homes))?,
            homes,
            patches: gpu.storage("patches", bytemuck::cast_slice(&patch_of))?,
            parameters: gpu.uniform("view", size_of::<ViewParameters>()),
            source,
            kernels: Default::default(),
            nothing: bind(gpu, &nothing, &[]),
            empty: nothing,
            layout: own,
        })
    }

    /// Takes in what an update says of slots.
    pub(super) fn update(&mut self, pipeline: &Pipeline, update: &Update) {
        let patches = &pipeline.scene().patches;
        if update.epoch != self.epoch {
            self.epoch = update.epoch;
            self.homes
                .iter_mut()
                .for_each(|home| home.position = NOWHERE);
        }
        for patch in &update.removals {
            self.homes[patch.0 as usize].position = NOWHERE;
        }
        for placement in &update.placements {
            let shape = match patches[placement.patch.0 as usize].shape {
                PatchShape::Solo => 0,
                PatchShape::Pair => 1,
                PatchShape::Triple => 2,
            };
            let home = &mut self.homes[placement.patch.0 as usize];
            let packed = |[x, y]: [u16; 2]| u32::from(x) | u32::from(y) << 16;
            match placement.slot {
                Slot::Block(block) => {
                    let level = block.level.landscape();
                    home.position = packed([block.x, block.y]);
                    home.layout_bits = u32::from(level.width)
                        | u32::from(level.height) << 4
                        | shape << 8
                        | u32::from(block.level.is_turned()) << 14;
                }
                Slot::Triangle(slot) => {
                    home.position = packed(slot.corners[0]);
                    home.layout_bits = TRIANGLE;
                    home.corners = slot.corners.map(packed);
                    home.weights = [
                        packed([slot.weights[0], slot.weights[1]]),
                        slot.weights[2].into(),
                    ];
                }
            }
        }
    }

    /// The picture of a pinhole camera.
    pub(super) fn see(
        &self,
        pipeline: &Pipeline,
        view: (Pose, [f32; 4]),
        size: [u32; 2],
    ) -> Result<Still> {
        Ok(Still {
            width: size[0],
            height: size[1],
            radiance: (self.look(pipeline, Look::Atlas, view, size)?.into_iter())
                .map(|[r, g, b, _]| Vec3::new(r, g, b))
                .collect(),
        })
    }

    /// Four numbers a pixel of a pinhole camera.
    pub(super) fn look(
        &self,
        pipeline: &Pipeline,
        look: Look,
        (pose, tangents): (Pose, [f32; 4]),
        size: [u32; 2],
    ) -> Result<Vec<[f32; 4]>> {
        let (gpu, gpu_scene) = pipeline.gpu();
        let kernel = self.kernels[look as usize].get_or_init(|| {
            let layouts = [&gpu_scene.layout, &self.empty, &self.layout];
            gpu.compute_pipeline(&self.source, look.kernel(), &layouts, &gpu_scene.constants)
        });
        let parameters = ViewParameters {
            world_from_eye: rows_of_affine(Mat3::from_quat(pose.orientation), pose.position),
            tangents,
            size,
            atlas_width: self.atlas_width,
            padding: 0,
        };
        gpu.queue
            .write_buffer(&self.parameters, 0, bytemuck::bytes_of(&parameters));
        gpu.queue
            .write_buffer(&self.homes_buffer, 0, bytemuck::cast_slice(&self.homes));
        let pixels = size[0] * size[1];
        let bytes = u64::from(pixels) * 16;
        let seen = gpu.scratch("seen", bytes)?;
        let buffers = [
            &self.parameters,
            &self.homes_buffer,
            &self.patches,
            pipeline.shown(),
            &seen,
        ];
        let group = bind(gpu, &self.layout, &buffers);
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(kernel);
            pass.set_bind_group(0, &gpu_scene.group, &[]);
            pass.set_bind_group(1, &self.nothing, &[]);
            pass.set_bind_group(2, &group, &[]);
            let (x, y) = workgroups(pixels, 64);
            pass.dispatch_workgroups(x, y, 1);
        }
        gpu.queue.submit([encoder.finish()]);
        Ok(gpu.read(&seen, 0..bytes)?)
    }
}
