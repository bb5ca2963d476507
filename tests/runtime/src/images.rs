//! Images on the application's device, and their way back to memory.

use ash::vk::{self, Handle};
use openxr_sys as sys;
use sys::Result as R;
use sys::platform::VkGetInstanceProcAddr;

use crate::log::Image;

/// The instance that the runtime created for the application.
pub(crate) struct Vulkan {
    pub(crate) instance: ash::Instance,
    pub(crate) physical: vk::PhysicalDevice,
    pub(crate) device: Option<vk::Device>,
}

/// The application's device, during a session.
pub(crate) struct Gpu {
    pub(crate) device: ash::Device,
    queue: vk::Queue,
    pool: vk::CommandPool,
    memory: vk::PhysicalDeviceMemoryProperties,
}

/// An image of a swapchain.
pub(crate) struct Picture {
    pub(crate) image: vk::Image,
    memory: vk::DeviceMemory,
    /// Of the work that was submitted until it was released.
    fence: vk::Fence,
    pub(crate) in_flight: bool,
}

/// A refusal of Vulkan is a failure of the runtime.
fn failed(_: vk::Result) -> R {
    R::ERROR_RUNTIME_FAILURE
}

impl Vulkan {
    /// # Safety
    /// The function and the description are those of `xrCreateVulkanInstanceKHR`.
    pub(crate) unsafe fn create(
        load: VkGetInstanceProcAddr,
        info: *const vk::InstanceCreateInfo<'_>,
    ) -> Result<Result<Self, vk::Result>, R> {
        // SAFETY: both are `PFN_vkGetInstanceProcAddr`.
        let get_instance_proc_addr = unsafe {
            std::mem::transmute::<VkGetInstanceProcAddr, vk::PFN_vkGetInstanceProcAddr>(load)
        };
        let functions = ash::StaticFn {
            get_instance_proc_addr,
        };
        // SAFETY: the function loads Vulkan's, as the caller says.
        let entry = unsafe { ash::Entry::from_static_fn(functions) };
        // SAFETY: the description is whole, as the caller says.
        let instance = match unsafe { entry.create_instance(&*info, None) } {
            Ok(instance) => instance,
            Err(result) => return Ok(Err(result)),
        };
        // SAFETY: the instance was just created.
        let devices = unsafe { instance.enumerate_physical_devices() }.map_err(failed)?;
        let physical = devices.first().copied();
        Ok(Ok(Self {
            instance,
            physical: physical.ok_or(R::ERROR_RUNTIME_FAILURE)?,
            device: None,
        }))
    }
}

impl Gpu {
    /// # Safety
    /// The device is one of the instance, with a queue of this family, and lives
    /// longer than the session.
    pub(crate) unsafe fn new(
        vulkan: &Vulkan,
        device: vk::Device,
        family: u32,
        index: u32,
    ) -> Result<Self, R> {
        // SAFETY: all handles are valid, as the caller says.
        unsafe {
            let device = ash::Device::load(vulkan.instance.fp_v1_0(), device);
            let pool = vk::CommandPoolCreateInfo::default()
                .queue_family_index(family)
                .flags(vk::CommandPoolCreateFlags::TRANSIENT);
            Ok(Self {
                queue: device.get_device_queue(family, index),
                pool: device.create_command_pool(&pool, None).map_err(failed)?,
                memory: vulkan
                    .instance
                    .get_physical_device_memory_properties(vulkan.physical),
                device,
            })
        }
    }

    fn allocate(
        &self,
        needs: vk::MemoryRequirements,
        flags: vk::MemoryPropertyFlags,
    ) -> Result<vk::DeviceMemory, R> {
        let fits = |(index, kind): &(usize, &vk::MemoryType)| {
            needs.memory_type_bits >> index & 1 == 1 && kind.property_flags.contains(flags)
        };
        let kinds = self.memory.memory_types_as_slice().iter().enumerate();
        let (index, _) = { kinds }.find(fits).ok_or(R::ERROR_OUT_OF_MEMORY)?;
        let info = vk::MemoryAllocateInfo::default()
            .allocation_size(needs.size)
            .memory_type_index(index as u32);
        // SAFETY: the device is valid while the session is.
        unsafe { self.device.allocate_memory(&info, None) }.map_err(failed)
    }

    /// An image of a swapchain, in the layout in which it is drawn into.
    pub(crate) fn picture(&self, info: &sys::SwapchainCreateInfo) -> Result<Picture, R> {
        let is_depth = is_depth(info.format);
        let mut usage = vk::ImageUsageFlags::TRANSFER_SRC
            | if is_depth {
                vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT
            } else {
                vk::ImageUsageFlags::COLOR_ATTACHMENT
            };
        if info.usage_flags.contains(sys::SwapchainUsageFlags::SAMPLED) {
            usage |= vk::ImageUsageFlags::SAMPLED;
        }
        let description = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(vk::Format::from_raw(info.format as i32))
            .extent(vk::Extent3D {
                width: info.width,
                height: info.height,
                depth: 1,
            })
            .mip_levels(info.mip_count)
            .array_layers(info.array_size)
            .samples(vk::SampleCountFlags::TYPE_1)
            .usage(usage);
        // SAFETY: the device is valid while the session is; what is created here
        // belongs together.
        unsafe {
            let image = self
                .device
                .create_image(&description, None)
                .map_err(failed)?;
            let needs = self.device.get_image_memory_requirements(image);
            let memory = self.allocate(needs, vk::MemoryPropertyFlags::DEVICE_LOCAL)?;
            self.device
                .bind_image_memory(image, memory, 0)
                .map_err(failed)?;
            let fence = vk::FenceCreateInfo::default();
            let picture = Picture {
                image,
                memory,
                fence: self.device.create_fence(&fence, None).map_err(failed)?,
                in_flight: false,
            };
            let drawn = attachment_layout(is_depth);
            self.once(|commands| {
                self.transition(
                    commands,
                    image,
                    is_depth,
                    [vk::ImageLayout::UNDEFINED, drawn],
                );
            })?;
            Ok(picture)
        }
    }

    /// Marks the end of the work on a picture.
    pub(crate) fn release(&self, picture: &mut Picture) -> Result<(), R> {
        // SAFETY: the fence is this picture's and not in use.
        unsafe { self.device.queue_submit(self.queue, &[], picture.fence) }.map_err(failed)?;
        picture.in_flight = true;
        Ok(())
    }

    /// Waits until the work on a picture has ended, as a compositor's reading
    /// of it does.
    pub(crate) fn wait(&self, picture: &mut Picture) -> Result<(), R> {
        if !std::mem::take(&mut picture.in_flight) {
            return Ok(());
        }
        // SAFETY: the fence was submitted by `release`.
        unsafe {
            let fences = [picture.fence];
            self.device
                .wait_for_fences(&fences, true, u64::MAX)
                .map_err(failed)?;
            self.device.reset_fences(&fences).map_err(failed)
        }
    }

    /// A layer of a picture of four bytes a pixel.
    pub(crate) fn read(
        &self,
        picture: &Picture,
        format: i64,
        [width, height]: [u32; 2],
        layer: u32,
    ) -> Result<Image, R> {
        let is_depth = is_depth(format);
        let bytes = u64::from(width) * u64::from(height) * 4;
        let description = vk::BufferCreateInfo::default()
            .size(bytes)
            .usage(vk::BufferUsageFlags::TRANSFER_DST);
        // SAFETY: the device is valid while the session is; the buffer and its
        // memory live until the end of this function, when the copy is done.
        unsafe {
            let buffer = self
                .device
                .create_buffer(&description, None)
                .map_err(failed)?;
            let needs = self.device.get_buffer_memory_requirements(buffer);
            let flags =
                vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
            let memory = self.allocate(needs, flags)?;
            self.device
                .bind_buffer_memory(buffer, memory, 0)
                .map_err(failed)?;
            let drawn = attachment_layout(is_depth);
            let source = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
            self.once(|commands| {
                self.transition(commands, picture.image, is_depth, [drawn, source]);
                let part = vk::ImageSubresourceLayers {
                    aspect_mask: aspect(is_depth),
                    mip_level: 0,
                    base_array_layer: layer,
                    layer_count: 1,
                };
                let copy = vk::BufferImageCopy::default()
                    .image_subresource(part)
                    .image_extent(vk::Extent3D {
                        width,
                        height,
                        depth: 1,
                    });
                self.device.cmd_copy_image_to_buffer(
                    commands,
                    picture.image,
                    source,
                    buffer,
                    &[copy],
                );
                self.transition(commands, picture.image, is_depth, [source, drawn]);
            })?;
            let mapped = self
                .device
                .map_memory(memory, 0, bytes, vk::MemoryMapFlags::empty())
                .map_err(failed)?;
            let copied = std::slice::from_raw_parts(mapped.cast::<u8>(), bytes as usize).to_vec();
            self.device.destroy_buffer(buffer, None);
            self.device.free_memory(memory, None);
            Ok(Image {
                width,
                height,
                bytes: copied,
            })
        }
    }

    pub(crate) fn destroy(&self, pictures: Vec<Picture>) {
        // SAFETY: an application destroys a swapchain when it no longer draws
        // into it, and the queue has ended what it did.
        unsafe {
            let _ = self.device.queue_wait_idle(self.queue);
            for picture in pictures {
                self.device.destroy_fence(picture.fence, None);
                self.device.destroy_image(picture.image, None);
                self.device.free_memory(picture.memory, None);
            }
        }
    }

    /// Submits commands and waits for their end.
    unsafe fn once(&self, record: impl FnOnce(vk::CommandBuffer)) -> Result<(), R> {
        let allocation = vk::CommandBufferAllocateInfo::default()
            .command_pool(self.pool)
            .command_buffer_count(1);
        // SAFETY: the pool is used by this thread alone, and the buffer until the
        // queue is idle.
        unsafe {
            let buffers = self
                .device
                .allocate_command_buffers(&allocation)
                .map_err(failed)?;
            let begin = vk::CommandBufferBeginInfo::default();
            self.device
                .begin_command_buffer(buffers[0], &begin)
                .map_err(failed)?;
            record(buffers[0]);
            self.device.end_command_buffer(buffers[0]).map_err(failed)?;
            let submit = vk::SubmitInfo::default().command_buffers(&buffers);
            self.device
                .queue_submit(self.queue, &[submit], vk::Fence::null())
                .map_err(failed)?;
            self.device.queue_wait_idle(self.queue).map_err(failed)?;
            self.device.free_command_buffers(self.pool, &buffers);
        }
        Ok(())
    }

    unsafe fn transition(
        &self,
        commands: vk::CommandBuffer,
        image: vk::Image,
        is_depth: bool,
        [from, to]: [vk::ImageLayout; 2],
    ) {
        let everything = vk::AccessFlags::MEMORY_READ | vk::AccessFlags::MEMORY_WRITE;
        let barrier = vk::ImageMemoryBarrier::default()
            .image(image)
            .old_layout(from)
            .new_layout(to)
            .src_access_mask(everything)
            .dst_access_mask(everything)
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .subresource_range(vk::ImageSubresourceRange {
                aspect_mask: aspect(is_depth),
                base_mip_level: 0,
                level_count: vk::REMAINING_MIP_LEVELS,
                base_array_layer: 0,
                layer_count: vk::REMAINING_ARRAY_LAYERS,
            });
        // SAFETY: the command buffer is being recorded, the image is ours.
        unsafe {
            self.device.cmd_pipeline_barrier(
                commands,
                vk::PipelineStageFlags::ALL_COMMANDS,
                vk::PipelineStageFlags::ALL_COMMANDS,
                vk::DependencyFlags::empty(),
                &[],
                &[],
                &[barrier],
            );
        }
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        // SAFETY: the application keeps the device until the session is destroyed.
        unsafe {
            let _ = self.device.queue_wait_idle(self.queue);
            self.device.destroy_command_pool(self.pool, None);
        }
    }
}

pub(crate) fn is_depth(format: i64) -> bool {
    format == i64::from(vk::Format::D32_SFLOAT.as_raw())
}

fn attachment_layout(is_depth: bool) -> vk::ImageLayout {
    if is_depth {
        vk::ImageLayout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL
    } else {
        vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL
    }
}

fn aspect(is_depth: bool) -> vk::ImageAspectFlags {
    if is_depth {
        vk::ImageAspectFlags::DEPTH
    } else {
        vk::ImageAspectFlags::COLOR
    }
}

pub(crate) fn raw<H: Handle>(handle: H) -> u64 {
    handle.as_raw()
}
