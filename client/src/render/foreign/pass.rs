//! The pass that draws a picture of the platform into a texture, in plain
//! Vulkan.

use std::io::Cursor;
use std::sync::Arc;

use ash::vk;
use wgpu::hal::api::Vulkan;

use super::pipeline::Pipeline;
use super::ring::{FORMAT, Ring, Target};
use super::{ConvertError, RawDevice, SourceImage};

pub(super) const VERTEX: &[u8] = include_bytes!("convert.vert.spv");
pub(super) const FRAGMENT: &[u8] = include_bytes!("convert.frag.spv");

/// What is the same for all pictures.
#[derive(Debug)]
pub(super) struct Pass {
    pub(super) device: Arc<RawDevice>,
    pub(super) render_pass: vk::RenderPass,
    pub(super) shaders: [vk::ShaderModule; 2],
}

impl Pass {
    pub(super) fn new(device: &Arc<RawDevice>) -> Result<Self, ConvertError> {
        let mut this = Self {
            device: Arc::clone(device),
            render_pass: vk::RenderPass::null(),
            shaders: [vk::ShaderModule::null(); 2],
        };
        let attachments = [vk::AttachmentDescription::default()
            .format(FORMAT)
            .samples(vk::SampleCountFlags::TYPE_1)
            // Every texel is written.
            .load_op(vk::AttachmentLoadOp::DONT_CARE)
            .store_op(vk::AttachmentStoreOp::STORE)
            .initial_layout(vk::ImageLayout::UNDEFINED)
            .final_layout(vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL)];
        let colors = [vk::AttachmentReference {
            attachment: 0,
            layout: vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
        }];
        let subpasses = [vk::SubpassDescription::default()
            .pipeline_bind_point(vk::PipelineBindPoint::GRAPHICS)
            .color_attachments(&colors)];
        // Drawing that samples the texture ends before this writes it, and that
        // which comes later begins after. The same stages of both ends order the
        // source's barriers.
        let (sampling, writing) = (
            vk::PipelineStageFlags::FRAGMENT_SHADER,
            vk::PipelineStageFlags::COLOR_ATTACHMENT_OUTPUT,
        );
        let dependencies = [
            vk::SubpassDependency::default()
                .src_subpass(vk::SUBPASS_EXTERNAL)
                .dst_subpass(0)
                .src_stage_mask(sampling)
                .dst_stage_mask(writing)
                .src_access_mask(vk::AccessFlags::SHADER_READ)
                .dst_access_mask(vk::AccessFlags::COLOR_ATTACHMENT_WRITE),
            vk::SubpassDependency::default()
                .src_subpass(0)
                .dst_subpass(vk::SUBPASS_EXTERNAL)
                .src_stage_mask(writing)
                .dst_stage_mask(sampling)
                .src_access_mask(vk::AccessFlags::COLOR_ATTACHMENT_WRITE)
                .dst_access_mask(vk::AccessFlags::SHADER_READ),
        ];
        let info = vk::RenderPassCreateInfo::default()
            .attachments(&attachments)
            .subpasses(&subpasses)
            .dependencies(&dependencies);
        // SAFETY: the infos are valid; `drop` destroys what was made.
        unsafe {
            this.render_pass = device
                .raw()
                .create_render_pass(&info, None)
                .map_err(ConvertError::when("make the conversion pass"))?;
            for (shader, bytes) in this.shaders.iter_mut().zip([VERTEX, FRAGMENT]) {
                *shader = shader_module(device.raw(), bytes)?;
            }
        }
        Ok(this)
    }

    pub(super) fn ring(
        &self,
        device: &Arc<RawDevice>,
        queue: &wgpu::Queue,
        size: [u32; 2],
    ) -> Result<Ring, ConvertError> {
        Ring::new(device, queue, self.render_pass, size)
    }

    /// Records the conversion of `image` into `target`.
    ///
    /// # Safety
    /// Nothing else is recorded into the encoder. The GPU is done with what this
    /// place in the ring was used for before, and everything here lives until it
    /// is done with this.
    pub(super) unsafe fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        pipeline: &Pipeline,
        slot: usize,
        image: &SourceImage,
        target: &Target,
    ) -> Result<(), ConvertError> {
        let raw = self.device.raw();
        let set = pipeline.sets[slot];
        let images = [vk::DescriptorImageInfo::default()
            .image_view(image.view())
            .image_layout(vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL)];
        let writes = [vk::WriteDescriptorSet::default()
            .dst_set(set)
            .dst_binding(0)
            .descriptor_type(vk::DescriptorType::COMBINED_IMAGE_SAMPLER)
            .image_info(&images)];
        let texel = image.size().map(|side| 1.0 / side as f32);
        let area = vk::Rect2D {
            offset: vk::Offset2D::default(),
            extent: target.extent(),
        };
        let viewport = vk::Viewport {
            width: area.extent.width as f32,
            height: area.extent.height as f32,
            max_depth: 1.0,
            ..vk::Viewport::default()
        };
        let begin = vk::RenderPassBeginInfo::default()
            .render_pass(self.render_pass)
            .framebuffer(target.framebuffer())
            .render_area(area);
        let barrier = |before, after, barrier: Option<vk::ImageMemoryBarrier<'_>>, commands| {
            if let Some(barrier) = barrier {
                // SAFETY: as below.
                unsafe {
                    raw.cmd_pipeline_barrier(
                        commands,
                        before,
                        after,
                        vk::DependencyFlags::empty(),
                        &[],
                        &[],
                        &[barrier],
                    );
                }
            }
        };
        let sampling = vk::PipelineStageFlags::FRAGMENT_SHADER;
        // SAFETY: the handles are alive and of one device by the caller's word;
        // the set is not in use by the GPU; wgpu begins and ends the buffer.
        unsafe {
            raw.update_descriptor_sets(&writes, &[]);
            encoder.as_hal_mut::<Vulkan, _, _>(|hal| {
                let commands = hal.ok_or(ConvertError::NotVulkan)?.raw_handle();
                let top = vk::PipelineStageFlags::TOP_OF_PIPE;
                barrier(top, sampling, image.acquire(), commands);
                raw.cmd_begin_render_pass(commands, &begin, vk::SubpassContents::INLINE);
                raw.cmd_bind_pipeline(commands, vk::PipelineBindPoint::GRAPHICS, pipeline.pipeline);
                raw.cmd_set_viewport(commands, 0, &[viewport]);
                raw.cmd_set_scissor(commands, 0, &[area]);
                raw.cmd_bind_descriptor_sets(
                    commands,
                    vk::PipelineBindPoint::GRAPHICS,
                    pipeline.layout,
                    0,
                    &[set],
                    &[],
                );
                raw.cmd_push_constants(
                    commands,
                    pipeline.layout,
                    vk::ShaderStageFlags::FRAGMENT,
                    0,
                    bytemuck::bytes_of(&texel),
                );
                raw.cmd_draw(commands, 3, 1, 0, 0);
                raw.cmd_end_render_pass(commands);
                let bottom = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
                barrier(sampling, bottom, image.release(), commands);
                Ok(())
            })
        }
    }
}

/// # Safety
/// The bytes are valid SPIR-V.
unsafe fn shader_module(
    device: &ash::Device,
    bytes: &[u8],
) -> Result<vk::ShaderModule, ConvertError> {
    let failed = |_| ConvertError::Picture("the conversion shader is damaged".into());
    let words = ash::util::read_spv(&mut Cursor::new(bytes)).map_err(failed)?;
    let info = vk::ShaderModuleCreateInfo::default().code(&words);
    // SAFETY: by the caller's word.
    unsafe { device.create_shader_module(&info, None) }
        .map_err(ConvertError::when("load the conversion shader"))
}

impl Drop for Pass {
    fn drop(&mut self) {
        let raw = self.device.raw();
        // SAFETY: ours; the GPU is done with them (`Converter::drop`).
        unsafe {
            raw.destroy_render_pass(self.render_pass, None);
            for shader in self.shaders {
                raw.destroy_shader_module(shader, None);
            }
        }
    }
}
