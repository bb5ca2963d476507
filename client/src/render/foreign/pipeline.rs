//! How the pass samples pictures of one kind.

use std::sync::Arc;

use ash::vk;

use super::pass::Pass;
use super::ring::RING;
use super::{ConvertError, RawDevice, SourceSampler};

/// Bytes of what the fragment shader is told: 1 / size of the buffer.
const PUSHED_BYTES: u32 = 8;

/// What pictures of one kind are drawn with. The sampler is part of it: one that
/// converts YCbCr must be known when the pipeline is built.
#[derive(Debug)]
pub(super) struct Pipeline {
    device: Arc<RawDevice>,
    sampler: Arc<SourceSampler>,
    set_layout: vk::DescriptorSetLayout,
    pub(super) layout: vk::PipelineLayout,
    pub(super) pipeline: vk::Pipeline,
    pool: vk::DescriptorPool,
    /// One for each place in the ring.
    pub(super) sets: Vec<vk::DescriptorSet>,
}

impl Pass {
    pub(super) fn pipeline(&self, sampler: &Arc<SourceSampler>) -> Result<Pipeline, ConvertError> {
        let mut this = Pipeline {
            device: Arc::clone(&self.device),
            sampler: Arc::clone(sampler),
            set_layout: vk::DescriptorSetLayout::null(),
            layout: vk::PipelineLayout::null(),
            pipeline: vk::Pipeline::null(),
            pool: vk::DescriptorPool::null(),
            sets: Vec::new(),
        };
        let failed = ConvertError::when("build the conversion pipeline");
        let raw = self.device.raw();
        let samplers = [sampler.raw()];
        let bindings = [vk::DescriptorSetLayoutBinding::default()
            .binding(0)
            .descriptor_type(vk::DescriptorType::COMBINED_IMAGE_SAMPLER)
            .descriptor_count(1)
            .stage_flags(vk::ShaderStageFlags::FRAGMENT)
            .immutable_samplers(&samplers)];
        let pushed = [vk::PushConstantRange {
            stage_flags: vk::ShaderStageFlags::FRAGMENT,
            offset: 0,
            size: PUSHED_BYTES,
        }];
        // A converting sampler may take as many descriptors as it has planes.
        let pool_sizes = [vk::DescriptorPoolSize {
            ty: vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
            descriptor_count: 3 * RING as u32,
        }];
        // SAFETY: the infos are valid and of one device; `drop` destroys what was
        // made.
        unsafe {
            let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
            this.set_layout = raw
                .create_descriptor_set_layout(&info, None)
                .map_err(&failed)?;
            let set_layouts = [this.set_layout; RING];
            let info = vk::PipelineLayoutCreateInfo::default()
                .set_layouts(&set_layouts[..1])
                .push_constant_ranges(&pushed);
            this.layout = raw.create_pipeline_layout(&info, None).map_err(&failed)?;
            this.pipeline = self.graphics_pipeline(this.layout)?;
            let info = vk::DescriptorPoolCreateInfo::default()
                .max_sets(RING as u32)
                .pool_sizes(&pool_sizes);
            this.pool = raw.create_descriptor_pool(&info, None).map_err(&failed)?;
            let info = vk::DescriptorSetAllocateInfo::default()
                .descriptor_pool(this.pool)
                .set_layouts(&set_layouts);
            this.sets = raw.allocate_descriptor_sets(&info).map_err(&failed)?;
        }
        Ok(this)
    }

    /// # Safety
    /// The layout is of this device.
    unsafe fn graphics_pipeline(
        &self,
        layout: vk::PipelineLayout,
    ) -> Result<vk::Pipeline, ConvertError> {
        let stage = |stage, module| {
            vk::PipelineShaderStageCreateInfo::default()
                .stage(stage)
                .module(module)
                .name(c"main")
        };
        let [vertex, fragment] = self.shaders;
        let stages = [
            stage(vk::ShaderStageFlags::VERTEX, vertex),
            stage(vk::ShaderStageFlags::FRAGMENT, fragment),
        ];
        let no_vertices = vk::PipelineVertexInputStateCreateInfo::default();
        let triangles = vk::PipelineInputAssemblyStateCreateInfo::default()
            .topology(vk::PrimitiveTopology::TRIANGLE_LIST);
        let viewport = vk::PipelineViewportStateCreateInfo::default()
            .viewport_count(1)
            .scissor_count(1);
        let fill = vk::PipelineRasterizationStateCreateInfo::default()
            .polygon_mode(vk::PolygonMode::FILL)
            .line_width(1.0);
        let one_sample = vk::PipelineMultisampleStateCreateInfo::default()
            .rasterization_samples(vk::SampleCountFlags::TYPE_1);
        let opaque = [vk::PipelineColorBlendAttachmentState::default()
            .color_write_mask(vk::ColorComponentFlags::RGBA)];
        let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&opaque);
        let dynamic = vk::PipelineDynamicStateCreateInfo::default()
            .dynamic_states(&[vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR]);
        let info = vk::GraphicsPipelineCreateInfo::default()
            .stages(&stages)
            .vertex_input_state(&no_vertices)
            .input_assembly_state(&triangles)
            .viewport_state(&viewport)
            .rasterization_state(&fill)
            .multisample_state(&one_sample)
            .color_blend_state(&blend)
            .dynamic_state(&dynamic)
            .layout(layout)
            .render_pass(self.render_pass);
        // SAFETY: the layout has what the shaders use, by the caller's word of
        // this device; the pass has one colour attachment.
        unsafe {
            self.device
                .raw()
                .create_graphics_pipelines(vk::PipelineCache::null(), &[info], None)
        }
        .map(|pipelines| pipelines[0])
        .map_err(|(_, error)| ConvertError::when("build the conversion pipeline")(error))
    }
}

impl Pipeline {
    pub(super) fn is_for(&self, sampler: &Arc<SourceSampler>) -> bool {
        Arc::ptr_eq(&self.sampler, sampler)
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        let raw = self.device.raw();
        // SAFETY: ours; the GPU is done with them (`Converter::prepare`).
        unsafe {
            raw.destroy_descriptor_pool(self.pool, None);
            raw.destroy_pipeline(self.pipeline, None);
            raw.destroy_pipeline_layout(self.layout, None);
            raw.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}
