//! The Vulkan half of showing pictures of a platform's decoder, with images that
//! a software driver has.
//!
//! What is not here is the platform, which makes the image. The pass is the same;
//! the sampler converts YCbCr where the driver can, as in `nv12`.

#[cfg(not(target_vendor = "apple"))]
mod nv12;

use std::any::Any;
use std::sync::{Arc, Mutex};

use ash::vk;
use glam::Vec3;
use shadecast_protocol::Pose;
use wgpu::hal::api::Vulkan;

use super::pass::{FRAGMENT, VERTEX};
use super::{ConvertError, ImageParts, ImageSource, RawDevice, SourceImage, SourceSampler};
use crate::render::atlas::extent;
use crate::render::tests::{Bench, Geometry, assert_close, at, picture};
use crate::render::{Readback, UploadError};
use crate::{DecodedPicture, ForeignPicture};

/// A picture of this platform: a texture of wgpu that nothing else uses, and a
/// count of those that their decoder waits for.
#[derive(Debug)]
struct Lent {
    texture: wgpu::Texture,
    lent: Arc<Mutex<u32>>,
}

impl Drop for Lent {
    fn drop(&mut self) {
        *self.lent.lock().unwrap() -= 1;
    }
}

#[derive(Debug)]
struct Platform {
    device: Arc<RawDevice>,
    sampler: Arc<SourceSampler>,
    lent: Arc<Mutex<u32>>,
}

impl Platform {
    /// Makes the bench's renderer take pictures of this platform.
    fn of(bench: &mut Bench) -> Self {
        let device = RawDevice::of(&bench.gpu.device).unwrap();
        let this = Self {
            sampler: sampler(&device),
            device,
            lent: Arc::default(),
        };
        let images = Images(Arc::clone(&this.sampler));
        bench.renderer.set_image_source(Box::new(images)).unwrap();
        this
    }

    /// A picture of `size` in a buffer that may be larger, with colours by column
    /// and row; the rest of the buffer is white.
    fn lend(
        &self,
        queue: &wgpu::Queue,
        buffer: [u32; 2],
        size: [u32; 2],
        color: impl Fn(u32, u32) -> [u8; 3],
    ) -> DecodedPicture {
        let texture = self.device.wgpu().create_texture(&wgpu::TextureDescriptor {
            label: Some("foreign"),
            size: extent(buffer),
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8Unorm,
            usage: wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        let texels: Vec<u8> = (0..buffer[1])
            .flat_map(|y| (0..buffer[0]).map(move |x| (x, y)))
            .flat_map(|(x, y)| {
                let inside = x < size[0] && y < size[1];
                let [r, g, b] = if inside { color(x, y) } else { [255; 3] };
                // The source's alpha is not that of the atlas.
                [r, g, b, 0]
            })
            .collect();
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(buffer[0] * 4),
            rows_per_image: None,
        };
        queue.write_texture(texture.as_image_copy(), &texels, layout, texture.size());
        let mut encoder = self.device.encoder();
        encoder.transition_resources(
            std::iter::empty(),
            std::iter::once(wgpu::wgt::TextureTransition {
                texture: &texture,
                selector: None,
                state: wgpu::wgt::TextureUses::RESOURCE,
            }),
        );
        queue.submit([encoder.finish()]);
        *self.lent.lock().unwrap() += 1;
        DecodedPicture::Foreign(ForeignPicture {
            size,
            image: Arc::new(Lent {
                texture,
                lent: Arc::clone(&self.lent),
            }),
        })
    }

    fn lent(&self) -> u32 {
        *self.lent.lock().unwrap()
    }
}

fn sampler(device: &Arc<RawDevice>) -> Arc<SourceSampler> {
    let info = vk::SamplerCreateInfo::default();
    // SAFETY: the info is valid, and the sampler goes to its owner.
    unsafe {
        let sampler = device.raw().create_sampler(&info, None).unwrap();
        SourceSampler::new(device, sampler, vk::SamplerYcbcrConversion::null())
    }
}

#[derive(Debug)]
struct Images(Arc<SourceSampler>);

impl ImageSource for Images {
    fn image(
        &mut self,
        picture: &(dyn Any + Send + Sync),
    ) -> Result<Arc<SourceImage>, ConvertError> {
        let lent = picture
            .downcast_ref::<Lent>()
            .ok_or_else(|| ConvertError::Picture("of another platform".into()))?;
        let size = lent.texture.size();
        let device = self.0.device();
        // SAFETY: the texture keeps the image alive as long as it is lent.
        unsafe {
            let image = lent.texture.as_hal::<Vulkan>().unwrap().raw_handle();
            let view = vk::ImageViewCreateInfo::default()
                .image(image)
                .view_type(vk::ImageViewType::TYPE_2D)
                .format(vk::Format::R8G8B8A8_UNORM)
                .subresource_range(super::image::COLOR);
            let parts = ImageParts {
                image,
                memory: vk::DeviceMemory::null(),
                view: device.raw().create_image_view(&view, None).unwrap(),
                size: [size.width, size.height],
                owner: vk::QUEUE_FAMILY_IGNORED,
            };
            Ok(SourceImage::new(parts, &self.0))
        }
    }
}

/// Tells rows from columns and every texel from its neighbours.
fn gradient(x: u32, y: u32) -> [u8; 3] {
    [
        (x * 16) as u8,
        (y * 16) as u8,
        ((x * 7 + y * 3) % 256) as u8,
    ]
}

fn bench_with(
    platform_picture: impl FnOnce(&Platform, &Bench) -> DecodedPicture,
) -> (Bench, Platform) {
    let mut bench = Bench::new(crate::render::Stereo::TwoPass);
    let platform = Platform::of(&mut bench);
    let picture = platform_picture(&platform, &bench);
    show(&mut bench, picture).expect("a sound frame");
    (bench, platform)
}

fn show(bench: &mut Bench, shown: DecodedPicture) -> Result<(), UploadError> {
    let mut frame = Geometry::default()
        .whole_quad(Vec3::new(0.0, 0.0, -1.0), 1.0)
        .frame(picture(16, |_, _| [0; 3]));
    frame.picture = shown;
    bench.renderer.upload(&frame)
}

fn atlas(bench: &Bench) -> crate::render::Pixels {
    let mut encoder = bench.encoder();
    let texture = bench.renderer.atlas().unwrap();
    let copy = Readback::record(&bench.gpu.device, &mut encoder, texture, 0);
    bench.gpu.queue.submit([encoder.finish()]);
    copy.take(&bench.gpu.device).unwrap()
}

#[track_caller]
fn assert_shows(bench: &Bench, size: [u32; 2], color: impl Fn(u32, u32) -> [u8; 3]) {
    let atlas = atlas(bench);
    assert_eq!([atlas.width, atlas.height], size);
    for (index, texel) in atlas.rgba.chunks_exact(4).enumerate() {
        let (x, y) = (index as u32 % size[0], index as u32 / size[0]);
        assert_eq!(texel[..3], color(x, y), "({x}, {y})");
        assert_eq!(texel[3], 255);
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_picture_arrives_texel_by_texel() {
    let (bench, _platform) =
        bench_with(|platform, bench| platform.lend(&bench.gpu.queue, [16, 16], [16, 16], gradient));
    assert_shows(&bench, [16, 16], gradient);
    // Reading back left it in another state, from which drawing goes on.
    let middle = bench.look(Pose::IDENTITY).at(32, 32);
    assert_close(middle, gradient(8, 8), 16);
    assert_ne!(middle, [0; 3]);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn what_lies_beside_the_picture_in_its_buffer_is_cut_off() {
    let (bench, _platform) =
        bench_with(|platform, bench| platform.lend(&bench.gpu.queue, [64, 32], [16, 14], gradient));
    assert_shows(&bench, [16, 14], gradient);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn pictures_follow_each_other_and_go_back_to_their_decoder() {
    let (mut bench, platform) =
        bench_with(|platform, bench| platform.lend(&bench.gpu.queue, [16, 16], [16, 16], gradient));
    for step in 0..20_u8 {
        let color = |x: u32, y: u32| [step * 10, x as u8, y as u8];
        let picture = platform.lend(&bench.gpu.queue, [16, 16], [16, 16], color);
        show(&mut bench, picture).unwrap();
        if step % 3 == 0 {
            assert_shows(&bench, [16, 16], color);
        }
        let seen = bench.look(at(Vec3::new(0.0, 0.0, -0.5))).at(32, 32);
        assert_close(seen, [step * 10, 8, 8], 1);
        assert!(platform.lent() <= 4, "{} are kept", platform.lent());
    }
    drop(bench);
    assert_eq!(platform.lent(), 0);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn sizes_samplers_and_kinds_of_pictures_may_change() {
    let (mut bench, platform) =
        bench_with(|platform, bench| platform.lend(&bench.gpu.queue, [16, 16], [16, 16], gradient));
    let smaller = platform.lend(&bench.gpu.queue, [8, 8], [8, 8], gradient);
    show(&mut bench, smaller).unwrap();
    assert_shows(&bench, [8, 8], gradient);

    // In memory, and back.
    let [white, grey] = [[235, 128, 128], [126, 128, 128]];
    show(&mut bench, picture(16, |_, _| white).into()).unwrap();
    assert_shows(&bench, [16, 16], |_, _| [255; 3]);
    let larger = platform.lend(&bench.gpu.queue, [32, 16], [32, 16], gradient);
    show(&mut bench, larger).unwrap();
    assert_shows(&bench, [32, 16], gradient);
    show(&mut bench, picture(16, |_, _| grey).into()).unwrap();
    assert_shows(&bench, [16, 16], |_, _| [128; 3]);

    // Another sampler is another pipeline.
    let images = Images(sampler(&platform.device));
    bench.renderer.set_image_source(Box::new(images)).unwrap();
    let other = platform.lend(&bench.gpu.queue, [16, 16], [16, 16], gradient);
    show(&mut bench, other).unwrap();
    assert_shows(&bench, [16, 16], gradient);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn what_cannot_be_converted_is_refused_and_the_last_one_stays() {
    let mut bench = Bench::new(crate::render::Stereo::TwoPass);
    let stranger = DecodedPicture::Foreign(ForeignPicture {
        size: [16, 16],
        image: Arc::new("no picture"),
    });
    let refused = show(&mut bench, stranger.clone());
    assert_eq!(refused, Err(UploadError::NoConverter));

    let platform = Platform::of(&mut bench);
    let good = platform.lend(&bench.gpu.queue, [16, 16], [16, 16], gradient);
    show(&mut bench, good).unwrap();
    let refused = show(&mut bench, stranger).unwrap_err();
    assert_eq!(refused.to_string(), "of another platform");
    for size in [[0, 0], [17, 16], [16, 18]] {
        let cut = platform.lend(&bench.gpu.queue, [16, 16], size, gradient);
        assert!(matches!(
            show(&mut bench, cut),
            Err(UploadError::Convert(ConvertError::Picture(_)))
        ));
    }
    assert_shows(&bench, [16, 16], gradient);
}

#[test]
fn the_binaries_are_of_the_sources() {
    for (binary, source) in [
        (VERTEX, include_str!("convert.vert")),
        (FRAGMENT, include_str!("convert.frag")),
    ] {
        let holds = binary
            .windows(source.len())
            .any(|window| window == source.as_bytes());
        assert!(holds, "run compile.sh");
    }
}
