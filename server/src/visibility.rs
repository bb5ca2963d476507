//! Which patches may be seen until the next update takes effect.
//!
//! From each viewpoint of a prediction a picture of patch ids is drawn; a compute
//! pass counts the pixels of each patch. The union over all viewpoints is the
//! potentially visible set. What is too small to meet a pixel's centre in every
//! picture is met sooner or later, since each picture's pixels lie elsewhere, and
//! from then on it is in the set for a few updates, whatever they find ([`Recent`]).
//!
//! Source: SAS 2018, section 3.1 and figure 5.

mod recent;

use std::time::Duration;

use glam::{Mat4, Vec2, vec2};
use shadecast_protocol::Pose;
use shadecast_shaders::visibility::{IDS_SOURCE, MARK_SOURCE, seen_words};
use wgpu::ShaderStages;

use crate::{
    gpu::{Binding, Gpu, GpuError, GpuScene, bind, layout},
    patches::{DrawRange, PatchedScene},
    prediction::Viewpoint,
};

pub use recent::Recent;

/// Most pictures of a frame: two of each of eight heads.
const MOST_PICTURES: usize = 2 * 8;
/// Sides of the target are rounded up to these, pixels: pictures that are a little
/// larger than the last ones need no new one.
const TARGET_STEP: u32 = 64;

/// The pass that finds the potentially visible set.
#[derive(Debug)]
pub struct Visibility {
    pipelines: Vec<(wgpu::RenderPipeline, DrawRange)>,
    mark: wgpu::ComputePipeline,
    mark_layout: wgpu::BindGroupLayout,
    group: wgpu::BindGroup,
    matrices: wgpu::Buffer,
    most_matrices: usize,
    counts: wgpu::Buffer,
    target: Option<Target>,
    /// Pictures drawn so far.
    pictures: u32,
}

#[derive(Debug)]
struct Target {
    size: (u32, u32),
    ids: wgpu::TextureView,
    depth: wgpu::TextureView,
    mark_group: wgpu::BindGroup,
}

impl Visibility {
    /// Prepares to draw `scene`.
    ///
    /// # Errors
    /// When a list is larger than the device binds.
    pub fn new(gpu: &Gpu, gpu_scene: &GpuScene, scene: &PatchedScene) -> Result<Self, GpuError> {
        let own_layout = layout(gpu, ShaderStages::VERTEX, &[Binding::Read, Binding::Read]);
        let mut patch_of_triangle = vec![0_u32; scene.scene.triangles.len()];
        for (id, patch) in (0..).zip(&scene.patches) {
            for k in 0..patch.shape.triangles().len() {
                patch_of_triangle[patch.first_triangle as usize + k] = id;
            }
        }
        let most_matrices = MOST_PICTURES * (scene.scene.objects.len() + 1);
        let matrices = gpu.scratch("view matrices", (most_matrices * size_of::<Mat4>()) as u64)?;
        let patch_of_triangle = gpu.storage(
            "patch of triangle",
            bytemuck::cast_slice(&patch_of_triangle),
        )?;
        let group = bind(gpu, &own_layout, &[&patch_of_triangle, &matrices]);

        let module = gpu
            .device
            .create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some("patch ids"),
                source: wgpu::ShaderSource::Wgsl(IDS_SOURCE.into()),
            });
        let pipeline_layout = gpu
            .device
            .create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("patch ids"),
                bind_group_layouts: &[Some(&gpu_scene.layout), Some(&own_layout)],
                immediate_size: 0,
            });
        let pipelines = scene
            .ranges
            .iter()
            .map(|range| {
                let options = wgpu::PipelineCompilationOptions {
                    constants: &gpu_scene.constants,
                    ..Default::default()
                };
                let pipeline = gpu
                    .device
                    .create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                        label: Some("patch ids"),
                        layout: Some(&pipeline_layout),
                        vertex: wgpu::VertexState {
                            module: &module,
                            entry_point: Some("id_vertex"),
                            compilation_options: options.clone(),
                            buffers: &[],
                        },
                        primitive: wgpu::PrimitiveState {
                            cull_mode: (!range.double_sided).then_some(wgpu::Face::Back),
                            ..Default::default()
                        },
                        depth_stencil: Some(wgpu::DepthStencilState {
                            format: wgpu::TextureFormat::Depth32Float,
                            depth_write_enabled: Some(true),
                            depth_compare: Some(wgpu::CompareFunction::Greater),
                            stencil: wgpu::StencilState::default(),
                            bias: wgpu::DepthBiasState::default(),
                        }),
                        multisample: wgpu::MultisampleState::default(),
                        fragment: Some(wgpu::FragmentState {
                            module: &module,
                            entry_point: Some(if range.masked {
                                "id_fragment_masked"
                            } else {
                                "id_fragment"
                            }),
                            compilation_options: options,
                            targets: &[Some(wgpu::TextureFormat::R32Uint.into())],
                        }),
                        multiview_mask: None,
                        cache: None,
                    });
                (pipeline, *range)
            })
            .collect();
        let mark_layout = layout(gpu, ShaderStages::COMPUTE, &[Binding::Ids, Binding::Write]);
        let mark = gpu.compute_pipeline(
            MARK_SOURCE,
            "mark",
            &[&mark_layout],
            &[("PATCHES", scene.patches.len() as f64)],
        );
        let words = seen_words(scene.patches.len().max(1) as u32);
        Ok(Self {
            pipelines,
            mark,
            mark_layout,
            group,
            matrices,
            most_matrices,
            counts: gpu.scratch("pixels of patch", u64::from(words) * 4)?,
            target: None,
            pictures: 0,
        })
    }

    /// Pixels of all id pictures of a frame that each patch covers: none where it
    /// is not in the potentially visible set.
    #[must_use]
    pub fn pixels(&self) -> &wgpu::Buffer {
        &self.counts
    }

    /// Records the finding of what is seen from any of the first 16 `viewpoints`.
    ///
    /// `objects_after` tells `world_from_object` of all objects, `ObjectId(1)` first,
    /// so long after the beginning of the frame.
    pub fn record(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        gpu_scene: &GpuScene,
        viewpoints: &[Viewpoint],
        objects_after: impl Fn(Duration) -> Vec<Pose>,
    ) {
        encoder.clear_buffer(&self.counts, 0, None);
        let viewpoints = &viewpoints[..viewpoints.len().min(MOST_PICTURES)];
        let largest = viewpoints.iter().map(|viewpoint| viewpoint.size);
        let Some(size) = largest.reduce(|a, b| [a[0].max(b[0]), a[1].max(b[1])]) else {
            return;
        };
        let [width, height] = size.map(|side| side.next_multiple_of(TARGET_STEP));
        self.ensure_target(gpu, (width, height));
        let Some(target) = &self.target else {
            return;
        };
        let mut matrices: Vec<Mat4> = Vec::new();
        for (viewpoint, picture) in viewpoints.iter().zip(self.pictures..) {
            let pixels = vec2(viewpoint.size[0] as f32, viewpoint.size[1] as f32);
            let offset = offset_of(picture) * 2.0 / pixels;
            let view = Mat4::from_translation(offset.extend(0.0)) * viewpoint.clip_from_world();
            matrices.push(view);
            let poses = objects_after(viewpoint.after);
            matrices.extend(poses.iter().map(|pose| view * pose.matrix()));
        }
        matrices.truncate(self.most_matrices);
        self.pictures = self.pictures.wrapping_add(viewpoints.len() as u32);
        gpu.queue
            .write_buffer(&self.matrices, 0, bytemuck::cast_slice(&matrices));

        let of_each = matrices.len() / viewpoints.len();
        for (viewpoint, first_matrix) in viewpoints.iter().zip((0..).step_by(of_each)) {
            let [width, height] = viewpoint.size;
            self.record_ids(encoder, target, gpu_scene, viewpoint.size, first_matrix);
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.mark);
            pass.set_bind_group(0, &target.mark_group, &[]);
            pass.dispatch_workgroups(width.div_ceil(32), height.div_ceil(8), 1);
        }
    }

    fn record_ids(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        target: &Target,
        gpu_scene: &GpuScene,
        size: [u32; 2],
        first_matrix: u32,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("patch ids"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &target.ids,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                    store: wgpu::StoreOp::Store,
                },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &target.depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Discard,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        // A smaller picture lies in a corner of the target; the rest stays clear.
        let [width, height] = size.map(|side| side as f32);
        pass.set_viewport(0.0, 0.0, width, height, 0.0, 1.0);
        pass.set_bind_group(0, &gpu_scene.group, &[]);
        pass.set_bind_group(1, &self.group, &[]);
        for (pipeline, range) in &self.pipelines {
            pass.set_pipeline(pipeline);
            let matrix = first_matrix + u32::from(range.object.0);
            let first = range.first_triangle * 3;
            pass.draw(first..first + range.triangle_count * 3, matrix..matrix + 1);
        }
    }

    fn ensure_target(&mut self, gpu: &Gpu, size: (u32, u32)) {
        if (self.target.as_ref()).is_some_and(|target| target.size == size) {
            return;
        }
        let texture = |format, usage| {
            gpu.device
                .create_texture(&wgpu::TextureDescriptor {
                    label: Some("patch ids"),
                    size: wgpu::Extent3d {
                        width: size.0,
                        height: size.1,
                        depth_or_array_layers: 1,
                    },
                    mip_level_count: 1,
                    sample_count: 1,
                    dimension: wgpu::TextureDimension::D2,
                    format,
                    usage,
                    view_formats: &[],
                })
                .create_view(&wgpu::TextureViewDescriptor::default())
        };
        let attachment = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let ids = texture(
            wgpu::TextureFormat::R32Uint,
            attachment | wgpu::TextureUsages::TEXTURE_BINDING,
        );
        let mark_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("mark"),
            layout: &self.mark_layout,
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 0,
                    resource: wgpu::BindingResource::TextureView(&ids),
                },
                wgpu::BindGroupEntry {
                    binding: 1,
                    resource: self.counts.as_entire_binding(),
                },
            ],
        });
        let depth = texture(wgpu::TextureFormat::Depth32Float, attachment);
        self.target = Some(Target {
            size,
            ids,
            depth,
            mark_group,
        });
    }
}

/// By how much of a pixel a picture's pixels lie aside: evenly over a pixel, and
/// any few in a row are far apart. Source: Roberts, "The Unreasonable Effectiveness
/// of Quasirandom Sequences", 2018 (R2).
fn offset_of(picture: u32) -> Vec2 {
    // Fractions of 2^32, so that wrapping is exact however many pictures there were.
    const STEPS: [u32; 2] = [0xc13f_a9a9, 0x91e1_0da5];
    let [x, y] = STEPS.map(|step| (picture.wrapping_mul(step) >> 8) as f32 / (1 << 24) as f32);
    vec2(x, y) - 0.5
}
