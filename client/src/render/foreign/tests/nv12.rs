//! A picture as hardware decoders leave it, luma in one plane and chroma in the
//! other, through the very sampler of the headset, beside the same picture in memory.
//!
//! Of software drivers Mesa 25's samples YCbCr and 22's does not. There nothing
//! can be held against anything, and the test says so.

use std::any::Any;
use std::sync::Arc;

use ash::vk;
use wgpu::hal::api::Vulkan;

use super::{atlas, show};
use crate::render::foreign::{
    ConvertError, ImageParts, ImageSource, PictureKind, RawDevice, SourceImage, SourceSampler,
};
use crate::render::tests::{Bench, picture};
use crate::render::vulkan::{DirectHost, Extras, VulkanGpu};
use crate::{DecodedPicture, ForeignPicture, YuvPicture};

const SIDE: u32 = 16;
/// Of the buffer, which is larger than the picture in it.
const BUFFER: [u32; 2] = [32, 24];

/// Makes an image of a picture, anew each time.
#[derive(Debug)]
struct Nv12 {
    device: Arc<RawDevice>,
    queue: wgpu::Queue,
    sampler: Arc<SourceSampler>,
    /// Whose the image is between conversions.
    owner: u32,
}

impl Nv12 {
    fn new(bench: &Bench, owner: u32, chroma: [vk::ChromaLocation; 2]) -> Self {
        let device = RawDevice::of(&bench.gpu.device).unwrap();
        let kind = PictureKind {
            format: vk::Format::G8_B8R8_2PLANE_420_UNORM,
            external_format: 0,
            components: [vk::ComponentSwizzle::IDENTITY; 4],
            chroma,
        };
        Self {
            sampler: SourceSampler::bt709(&device, kind).unwrap(),
            device,
            queue: bench.gpu.queue.clone(),
            owner,
        }
    }

    /// An image of two planes, filled and ready to be sampled.
    ///
    /// # Safety
    /// The parts are of `device` and given away by it.
    unsafe fn make(&self, bytes: &[u8]) -> Result<ImageParts, vk::Result> {
        let raw = self.device.raw();
        let [width, height] = BUFFER;
        let extent = |divisor| vk::Extent3D {
            width: width / divisor,
            height: height / divisor,
            depth: 1,
        };
        let format = vk::Format::G8_B8R8_2PLANE_420_UNORM;
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(format)
            .extent(extent(1))
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .usage(vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST);
        let buffer = vk::BufferCreateInfo::default()
            .size(bytes.len() as u64)
            .usage(vk::BufferUsageFlags::TRANSFER_SRC);
        // SAFETY: the infos are valid; the queue is idle before what is temporary goes.
        unsafe {
            let image = raw.create_image(&info, None)?;
            let memory = self.allocate(
                raw.get_image_memory_requirements(image),
                vk::MemoryPropertyFlags::DEVICE_LOCAL,
            )?;
            raw.bind_image_memory(image, memory, 0)?;
            let staging = raw.create_buffer(&buffer, None)?;
            let staged = self.allocate(
                raw.get_buffer_memory_requirements(staging),
                vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT,
            )?;
            raw.bind_buffer_memory(staging, staged, 0)?;
            let mapped = raw.map_memory(staged, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty())?;
            std::ptr::copy_nonoverlapping(bytes.as_ptr(), mapped.cast(), bytes.len());

            let plane = |aspect, offset, divisor| {
                vk::BufferImageCopy::default()
                    .buffer_offset(offset)
                    .image_subresource(
                        vk::ImageSubresourceLayers::default()
                            .aspect_mask(aspect)
                            .layer_count(1),
                    )
                    .image_extent(extent(divisor))
            };
            let planes = [
                plane(vk::ImageAspectFlags::PLANE_0, 0, 1),
                plane(vk::ImageAspectFlags::PLANE_1, u64::from(width * height), 2),
            ];
            self.once(|commands| {
                let to = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
                self.transition(commands, image, [vk::ImageLayout::UNDEFINED, to]);
                raw.cmd_copy_buffer_to_image(commands, staging, image, to, &planes);
                let ready = vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL;
                self.transition(commands, image, [to, ready]);
            })?;
            raw.destroy_buffer(staging, None);
            raw.free_memory(staged, None);

            let mut conversion =
                vk::SamplerYcbcrConversionInfo::default().conversion(self.sampler.conversion());
            let view = vk::ImageViewCreateInfo::default()
                .image(image)
                .view_type(vk::ImageViewType::TYPE_2D)
                .format(format)
                .subresource_range(crate::render::foreign::image::COLOR)
                .push_next(&mut conversion);
            Ok(ImageParts {
                image,
                memory,
                view: raw.create_image_view(&view, None)?,
                size: BUFFER,
                owner: self.owner,
            })
        }
    }

    unsafe fn allocate(
        &self,
        needs: vk::MemoryRequirements,
        flags: vk::MemoryPropertyFlags,
    ) -> Result<vk::DeviceMemory, vk::Result> {
        // SAFETY: both are of one device.
        unsafe {
            let kinds = { self.device.instance() }
                .get_physical_device_memory_properties(self.device.physical());
            let fits = |(index, kind): &(usize, &vk::MemoryType)| {
                needs.memory_type_bits >> index & 1 == 1 && kind.property_flags.contains(flags)
            };
            let mut kinds = kinds.memory_types_as_slice().iter().enumerate();
            let (index, _) = kinds.find(fits).expect("memory of this kind");
            let info = vk::MemoryAllocateInfo::default()
                .allocation_size(needs.size)
                .memory_type_index(index as u32);
            self.device.raw().allocate_memory(&info, None)
        }
    }

    /// Submits commands and waits for their end.
    unsafe fn once(&self, record: impl FnOnce(vk::CommandBuffer)) -> Result<(), vk::Result> {
        let raw = self.device.raw();
        let pool =
            vk::CommandPoolCreateInfo::default().queue_family_index(self.device.queue_family());
        // SAFETY: nothing else submits meanwhile, and the queue is idle at the end.
        unsafe {
            let pool = raw.create_command_pool(&pool, None)?;
            let allocation = vk::CommandBufferAllocateInfo::default()
                .command_pool(pool)
                .command_buffer_count(1);
            let buffers = raw.allocate_command_buffers(&allocation)?;
            raw.begin_command_buffer(buffers[0], &vk::CommandBufferBeginInfo::default())?;
            record(buffers[0]);
            raw.end_command_buffer(buffers[0])?;
            let queue = self.queue.as_hal::<Vulkan>().expect("Vulkan").as_raw();
            let submit = vk::SubmitInfo::default().command_buffers(&buffers);
            raw.queue_submit(queue, &[submit], vk::Fence::null())?;
            raw.queue_wait_idle(queue)?;
            raw.destroy_command_pool(pool, None);
        }
        Ok(())
    }

    unsafe fn transition(
        &self,
        commands: vk::CommandBuffer,
        image: vk::Image,
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
            .subresource_range(crate::render::foreign::image::COLOR);
        let stages = vk::PipelineStageFlags::ALL_COMMANDS;
        let none = vk::DependencyFlags::empty();
        // SAFETY: the buffer is being recorded, the image is ours.
        unsafe {
            let raw = self.device.raw();
            raw.cmd_pipeline_barrier(commands, stages, stages, none, &[], &[], &[barrier]);
        }
    }
}

impl ImageSource for Nv12 {
    fn image(
        &mut self,
        picture: &(dyn Any + Send + Sync),
    ) -> Result<Arc<SourceImage>, ConvertError> {
        let bytes: &Vec<u8> = picture.downcast_ref().expect("a picture of this test");
        // SAFETY: what is made is given away.
        unsafe {
            let parts = self.make(bytes).map_err(ConvertError::when("make it"))?;
            Ok(SourceImage::new(parts, &self.sampler))
        }
    }
}

/// Both planes of a buffer, in whose corner the picture lies.
fn planes_of(picture: &YuvPicture) -> Vec<u8> {
    let [width, height] = BUFFER.map(|side| side as usize);
    let mut bytes = vec![200; width * height * 3 / 2];
    let side = SIDE as usize;
    for (row, luma) in picture.y.chunks(side).enumerate() {
        bytes[row * width..][..side].copy_from_slice(luma);
    }
    let (_, chroma) = bytes.split_at_mut(width * height);
    let half = side / 2;
    for (index, (blue, red)) in picture.u.iter().zip(&picture.v).enumerate() {
        let first = index / half * width + index % half * 2;
        chroma[first..first + 2].copy_from_slice(&[*blue, *red]);
    }
    bytes
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn two_planes_become_what_the_same_picture_in_memory_becomes() {
    let extras = Extras {
        ycbcr: true,
        ..Extras::default()
    };
    let vulkan = VulkanGpu::open(&mut DirectHost, &extras).expect("a device");
    if !vulkan.ycbcr {
        let name = vulkan.gpu.adapter.get_info().driver_info;
        println!("left out: {name} does not sample YCbCr");
        return;
    }
    // Blacker than black and whiter than white among them, and every chroma sample
    // another one than its neighbours.
    let shown = picture(SIDE, |x, y| {
        let [x, y] = [x as u8, y as u8];
        [5 + 31 * x, 16 + 29 * y + x, 240 - 23 * x - 5 * y]
    });
    let mut bench = Bench::on_device(vulkan.gpu);
    show(&mut bench, shown.clone().into()).unwrap();
    let in_memory = atlas(&bench);
    let (even, middle) = (
        vk::ChromaLocation::COSITED_EVEN,
        vk::ChromaLocation::MIDPOINT,
    );
    for (owner, chroma) in [
        (vk::QUEUE_FAMILY_IGNORED, [middle, middle]),
        (vk::QUEUE_FAMILY_EXTERNAL, [middle, middle]),
        (vk::QUEUE_FAMILY_IGNORED, [even, middle]),
        (vk::QUEUE_FAMILY_IGNORED, [even, even]),
    ] {
        let images = Nv12::new(&bench, owner, chroma);
        bench.renderer.set_image_source(Box::new(images)).unwrap();
        let foreign = DecodedPicture::Foreign(ForeignPicture {
            size: [SIDE; 2],
            image: Arc::new(planes_of(&shown)),
        });
        show(&mut bench, foreign).unwrap();
        let converted = atlas(&bench);
        assert_eq!([converted.width, converted.height], [SIDE; 2]);
        for (index, (found, expected)) in converted.rgba.iter().zip(&in_memory.rgba).enumerate() {
            // Rounded by the sampler instead of by the shader.
            assert!(
                found.abs_diff(*expected) <= 1,
                "chroma {chroma:?}, byte {index}: {found} is not {expected}"
            );
        }
    }
}
