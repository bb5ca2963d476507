//! The pipelines that draw into the eyes, each built when a frame first needs
//! it: objects that move and masks cost nothing where a scene has neither.

use std::num::NonZeroU32;

use crate::DrawVertex;

use super::Stereo;

/// Reversed Z, so 32-bit floats are precise from the nose to the horizon.
pub(super) const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// A matrix for each eye: what Vulkan guarantees room for.
pub(super) const IMMEDIATE_BYTES: u32 = 128;

pub(super) const TWO_PASS_SOURCE: &str = concat!(
    include_str!("patches.wgsl"),
    include_str!("sky.wgsl"),
    include_str!("notice.wgsl"),
    include_str!("two_pass.wgsl")
);
pub(super) const MULTIVIEW_SOURCE: &str = concat!(
    include_str!("patches.wgsl"),
    include_str!("sky.wgsl"),
    include_str!("notice.wgsl"),
    include_str!("multiview.wgsl")
);

impl Stereo {
    /// Layers that a pass of this mode draws into.
    pub(super) fn mask(self) -> Option<NonZeroU32> {
        match self {
            Self::Multiview => NonZeroU32::new(0b11),
            Self::TwoPass => None,
        }
    }
}

/// Layouts of what the shaders read.
#[derive(Debug)]
pub(super) struct Layouts {
    /// Group 0: the picture and its sampler.
    pub(super) atlas: wgpu::BindGroupLayout,
    /// Group 1: `world_from_object`.
    pub(super) objects: wgpu::BindGroupLayout,
    /// Group 2: coverage.
    pub(super) mask: wgpu::BindGroupLayout,
    /// Group 0 of the sky: its picture and its sampler.
    pub(super) sky: wgpu::BindGroupLayout,
    /// Group 0 of the notice: its picture and its sampler.
    #[cfg(feature = "notice")]
    pub(super) notice: wgpu::BindGroupLayout,
}

impl Layouts {
    pub(super) fn new(device: &wgpu::Device) -> Self {
        let group = |label, entries: &[wgpu::BindGroupLayoutEntry]| {
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(label),
                entries,
            })
        };
        let storage = wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility: wgpu::ShaderStages::VERTEX,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only: true },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        Self {
            atlas: group("atlas", &[texture(0), sampler(1)]),
            objects: group("objects", &[storage]),
            mask: group("mask", &[texture(0)]),
            sky: group("sky", &[texture(2), sampler(3)]),
            #[cfg(feature = "notice")]
            notice: group("notice", &[texture(4), sampler(5)]),
        }
    }
}

fn texture(binding: u32) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
        ty: wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: true },
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        },
        count: None,
    }
}

fn sampler(binding: u32) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::FRAGMENT,
        ty: wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
        count: None,
    }
}

/// What a frame's patches need of a pipeline.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Needs {
    /// Objects that move.
    pub(super) objects: bool,
    /// Masks.
    pub(super) mask: bool,
    /// Texels unevenly spaced on their triangles.
    pub(super) foreshortened: bool,
}

/// Builds pipelines and keeps those that have been needed.
#[derive(Debug)]
pub(super) struct Pipelines {
    module: wgpu::ShaderModule,
    layouts: Layouts,
    eye_format: wgpu::TextureFormat,
    multiview_mask: Option<NonZeroU32>,
    patches: Vec<(Needs, wgpu::RenderPipeline)>,
}

impl Pipelines {
    pub(super) fn new(
        device: &wgpu::Device,
        eye_format: wgpu::TextureFormat,
        stereo: Stereo,
    ) -> Self {
        let source = match stereo {
            Stereo::Multiview => MULTIVIEW_SOURCE,
            Stereo::TwoPass => TWO_PASS_SOURCE,
        };
        Self {
            module: device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some("eyes"),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            }),
            layouts: Layouts::new(device),
            eye_format,
            multiview_mask: stereo.mask(),
            patches: Vec::new(),
        }
    }

    pub(super) fn layouts(&self) -> &Layouts {
        &self.layouts
    }

    /// Builds what `needs` asks for, unless it has been built.
    pub(super) fn prepare(&mut self, device: &wgpu::Device, needs: Needs) {
        if self.patches(needs).is_none() {
            let pipeline = self.build_patches(device, needs);
            self.patches.push((needs, pipeline));
        }
    }

    /// The pipeline for `needs`, if it has been prepared.
    pub(super) fn patches(&self, needs: Needs) -> Option<&wgpu::RenderPipeline> {
        self.patches
            .iter()
            .find_map(|(built, pipeline)| (*built == needs).then_some(pipeline))
    }

    fn build_patches(&self, device: &wgpu::Device, needs: Needs) -> wgpu::RenderPipeline {
        let objects = needs.objects.then_some(&self.layouts.objects);
        let mask = needs.mask.then_some(&self.layouts.mask);
        self.build(
            device,
            &Parts {
                label: "patches",
                groups: &[Some(&self.layouts.atlas), objects, mask],
                vertex: if needs.objects {
                    "vertex_moving"
                } else {
                    "vertex_still"
                },
                buffers: &[wgpu::VertexBufferLayout {
                    array_stride: size_of::<DrawVertex>() as u64,
                    step_mode: wgpu::VertexStepMode::Vertex,
                    attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Uint32, 2 => Float32x3],
                }],
                fragment: if needs.mask { "masked" } else { "opaque" },
                constants: &[("FORESHORTENED", f64::from(u8::from(needs.foreshortened)))],
                topology: wgpu::PrimitiveTopology::TriangleList,
                cull: Some(wgpu::Face::Back),
                blend: None,
                depth_write: true,
                depth_compare: wgpu::CompareFunction::Greater,
            },
        )
    }

    pub(super) fn build_sky(&self, device: &wgpu::Device) -> wgpu::RenderPipeline {
        self.build(
            device,
            &Parts {
                label: "sky",
                groups: &[Some(&self.layouts.sky)],
                vertex: "vertex_sky",
                buffers: &[],
                fragment: "sky",
                constants: &[],
                topology: wgpu::PrimitiveTopology::TriangleList,
                cull: None,
                blend: None,
                depth_write: false,
                // Its own depth is zero, as is that of nothing.
                depth_compare: wgpu::CompareFunction::GreaterEqual,
            },
        )
    }

    #[cfg(feature = "notice")]
    pub(super) fn build_notice(&self, device: &wgpu::Device) -> wgpu::RenderPipeline {
        self.build(
            device,
            &Parts {
                label: "notice",
                groups: &[Some(&self.layouts.notice)],
                vertex: "vertex_notice",
                buffers: &[],
                fragment: "notice",
                constants: &[],
                topology: wgpu::PrimitiveTopology::TriangleStrip,
                cull: None,
                blend: Some(wgpu::BlendState::ALPHA_BLENDING),
                depth_write: false,
                depth_compare: wgpu::CompareFunction::Always,
            },
        )
    }

    fn build(&self, device: &wgpu::Device, parts: &Parts<'_>) -> wgpu::RenderPipeline {
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(parts.label),
            bind_group_layouts: parts.groups,
            immediate_size: IMMEDIATE_BYTES,
        });
        device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(parts.label),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: &self.module,
                entry_point: Some(parts.vertex),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: parts.buffers,
            },
            fragment: Some(wgpu::FragmentState {
                module: &self.module,
                entry_point: Some(parts.fragment),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: parts.constants,
                    ..wgpu::PipelineCompilationOptions::default()
                },
                targets: &[Some(wgpu::ColorTargetState {
                    blend: parts.blend,
                    ..self.eye_format.into()
                })],
            }),
            primitive: wgpu::PrimitiveState {
                topology: parts.topology,
                front_face: wgpu::FrontFace::Ccw,
                cull_mode: parts.cull,
                ..wgpu::PrimitiveState::default()
            },
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH_FORMAT,
                depth_write_enabled: Some(parts.depth_write),
                depth_compare: Some(parts.depth_compare),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState::default(),
            multiview_mask: self.multiview_mask,
            cache: None,
        })
    }
}

/// In what the pipelines differ.
struct Parts<'a> {
    label: &'a str,
    groups: &'a [Option<&'a wgpu::BindGroupLayout>],
    vertex: &'a str,
    buffers: &'a [wgpu::VertexBufferLayout<'a>],
    fragment: &'a str,
    /// Overrides of the fragment stage.
    constants: &'a [(&'a str, f64)],
    topology: wgpu::PrimitiveTopology,
    cull: Option<wgpu::Face>,
    blend: Option<wgpu::BlendState>,
    depth_write: bool,
    depth_compare: wgpu::CompareFunction,
}
