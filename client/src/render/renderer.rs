//! One turn of drawing: upload what is new, draw both eyes.

use glam::Mat4;
use shadecast_protocol::Sky;
use thiserror::Error;

use crate::{ClientFrame, DecodedPicture, MaskAtlas, YuvPicture};

use super::atlas::Atlas;
use super::mesh::Mesh;
#[cfg(feature = "notice")]
use super::notice::NoticePass;
use super::pipelines::{DEPTH_FORMAT, Needs, Pipelines};
use super::shrink::Shrink;
use super::sky::SkyPass;
use super::{EyeCamera, EyeImages, Stereo};

/// What never changes while a renderer lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RendererConfig {
    /// Width and height of one eye's picture, pixels.
    pub eye_size: [u32; 2],
    /// What the eyes are drawn into.
    pub eye_format: wgpu::TextureFormat,
    /// How both are drawn.
    pub stereo: Stereo,
    /// Draw four samples a pixel and show their mean.
    pub antialias: bool,
}

impl RendererConfig {
    /// Width and height that one eye is drawn at, pixels, before it is shrunk to
    /// its size; depth is of this size.
    #[must_use]
    pub fn drawn_size(self) -> [u32; 2] {
        let scale = if self.antialias { 2 } else { 1 };
        self.eye_size.map(|side| side * scale)
    }
}

/// Why a frame cannot be drawn on this device. The frame before it stays.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum UploadError {
    /// A plane does not have as many bytes as its size says, or no bytes at all.
    #[error("the {plane} of a {width}x{height} picture has {bytes} bytes")]
    Plane {
        /// Which.
        plane: &'static str,
        /// Of the picture, texels.
        width: u32,
        /// Of the picture, texels.
        height: u32,
        /// What there is.
        bytes: usize,
    },
    /// The picture is larger than the device's textures.
    #[error("an atlas of {width}x{height} texels is too large for the GPU (at most {limit})")]
    Atlas {
        /// Texels.
        width: u32,
        /// Texels.
        height: u32,
        /// Largest side, texels.
        limit: u32,
    },
    /// The geometry is larger than the device's buffers.
    #[error("geometry of {bytes} bytes is too large for the GPU (at most {limit})")]
    Geometry {
        /// Of the largest list.
        bytes: u64,
        /// Largest buffer.
        limit: u64,
    },
    /// The picture is one of the platform's decoder, and nothing here knows how
    /// to reach those.
    #[error("a picture of the platform's decoder, which this renderer cannot reach")]
    NoConverter,
    /// A picture of the platform's decoder did not become RGBA.
    #[cfg(feature = "vulkan")]
    #[error(transparent)]
    Convert(#[from] super::foreign::ConvertError),
}

/// Draws frames into the eyes of a headset.
#[derive(Debug)]
pub struct Renderer {
    device: wgpu::Device,
    queue: wgpu::Queue,
    config: RendererConfig,
    pipelines: Pipelines,
    atlas: Atlas,
    mesh: Mesh,
    objects: Option<wgpu::BindGroup>,
    sky: Option<SkyPass>,
    #[cfg(feature = "notice")]
    notice: Option<NoticePass>,
    depth: wgpu::TextureView,
    shrink: Option<Shrink>,
}

impl Renderer {
    /// A renderer that draws nothing yet.
    #[must_use]
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, config: RendererConfig) -> Self {
        Self {
            device: device.clone(),
            queue: queue.clone(),
            config,
            pipelines: Pipelines::new(device, config.eye_format, config.stereo),
            atlas: Atlas::new(device, config.eye_format),
            mesh: Mesh::new(),
            objects: None,
            sky: None,
            #[cfg(feature = "notice")]
            notice: None,
            depth: depth(device, config),
            shrink: config
                .antialias
                .then(|| Shrink::new(device, config.eye_size, config.eye_format)),
        }
    }

    /// Replaces what is seen where no geometry is; without a sky that is black.
    pub fn set_sky(&mut self, sky: Option<&Sky>) {
        self.sky = sky.and_then(|sky| {
            SkyPass::new(
                &self.device,
                &self.queue,
                &self.pipelines,
                self.config.eye_format,
                sky,
            )
        });
    }

    /// From now on pictures of the platform's decoder are reached through
    /// `images`.
    ///
    /// # Errors
    /// The device is not one of Vulkan, or has no room.
    #[cfg(feature = "vulkan")]
    pub fn set_image_source(
        &mut self,
        images: Box<dyn super::foreign::ImageSource>,
    ) -> Result<(), super::foreign::ConvertError> {
        let converter = super::foreign::Converter::new(&self.device, images)?;
        self.atlas.foreign = Some(converter);
        Ok(())
    }

    /// Shows a text on a panel in the world, or takes it away. The panel keeps
    /// its place while only its text changes.
    #[cfg(feature = "notice")]
    pub fn set_notice(&mut self, text: Option<&str>) {
        if self.notice.as_ref().map(NoticePass::text) == text {
            return;
        }
        let before = self.notice.take();
        self.notice = text.map(|text| {
            NoticePass::new(
                &self.device,
                &self.queue,
                &self.pipelines,
                self.config.eye_format,
                text,
                before.as_ref(),
            )
        });
    }

    /// Hangs a panel that is new ahead of these eyes.
    #[cfg(feature = "notice")]
    pub fn place_notice(&mut self, cameras: [EyeCamera; 2]) {
        if let Some(notice) = &mut self.notice {
            notice.place(cameras);
        }
    }

    /// Switches to another frame, whole.
    ///
    /// # Errors
    /// When the device cannot hold it; nothing has changed then.
    pub fn upload(&mut self, frame: &ClientFrame) -> Result<(), UploadError> {
        check(frame, &self.device.limits())?;
        let (device, queue) = (&self.device, &self.queue);
        self.atlas
            .upload(device, queue, self.pipelines.layouts(), frame)?;
        if self.mesh.upload(device, queue, frame) {
            self.objects = self.mesh.transforms().map(|buffer| {
                device.create_bind_group(&wgpu::BindGroupDescriptor {
                    label: Some("objects"),
                    layout: &self.pipelines.layouts().objects,
                    entries: &[wgpu::BindGroupEntry {
                        binding: 0,
                        resource: buffer.as_entire_binding(),
                    }],
                })
            });
        }
        for needs in self.needs() {
            self.pipelines.prepare(device, needs);
        }
        Ok(())
    }

    /// Draws the left and the right eye into the layers of `target`, which has
    /// the size and format of the configuration. Objects are where they are
    /// `seconds_of_motion` after the moment of the frame's motions, in whatever
    /// is submitted before the next call.
    pub fn draw(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        cameras: [EyeCamera; 2],
        seconds_of_motion: f32,
        target: &EyeImages,
    ) {
        self.draw_with_depth(encoder, cameras, seconds_of_motion, target, None);
    }

    /// As [`draw`](Self::draw), and keeps the depth: reversed, infinite, of
    /// [`RendererConfig::drawn_size`], `Depth32Float`.
    pub fn draw_with_depth(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        cameras: [EyeCamera; 2],
        seconds_of_motion: f32,
        target: &EyeImages,
        depth: Option<&EyeImages>,
    ) {
        self.mesh.move_objects(&self.queue, seconds_of_motion);
        match &self.shrink {
            Some(shrink) => {
                self.draw_eyes(encoder, cameras, shrink.large(), depth);
                shrink.draw(encoder, target);
            }
            None => self.draw_eyes(encoder, cameras, target, depth),
        }
    }

    fn draw_eyes(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        cameras: [EyeCamera; 2],
        target: &EyeImages,
        depth: Option<&EyeImages>,
    ) {
        match self.config.stereo {
            Stereo::Multiview => {
                self.draw_pass(
                    encoder,
                    cameras,
                    target.array(),
                    depth.map(EyeImages::array),
                );
            }
            Stereo::TwoPass => {
                for (eye, camera) in cameras.into_iter().enumerate() {
                    let depth = depth.map(|depth| &depth.layers()[eye]);
                    self.draw_pass(encoder, [camera; 2], &target.layers()[eye], depth);
                }
            }
        }
    }

    fn draw_pass(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        cameras: [EyeCamera; 2],
        color: &wgpu::TextureView,
        kept_depth: Option<&wgpu::TextureView>,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("eyes"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: color,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                    store: wgpu::StoreOp::Store,
                },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: kept_depth.unwrap_or(&self.depth),
                depth_ops: Some(wgpu::Operations {
                    // Reversed Z: zero is infinitely far.
                    load: wgpu::LoadOp::Clear(0.0),
                    store: match kept_depth {
                        Some(_) => wgpu::StoreOp::Store,
                        None => wgpu::StoreOp::Discard,
                    },
                }),
                stencil_ops: None,
            }),
            multiview_mask: self.config.stereo.mask(),
            ..wgpu::RenderPassDescriptor::default()
        });
        self.draw_patches(&mut pass, cameras.map(EyeCamera::clip_from_world));
        if let Some(sky) = &self.sky {
            let rays = cameras.map(EyeCamera::world_ray_from_ndc);
            sky.draw(&mut pass, bytemuck::bytes_of(&rays));
        }
        #[cfg(feature = "notice")]
        if let Some(notice) = &self.notice {
            notice.draw(&mut pass, cameras.map(EyeCamera::clip_from_world));
        }
    }

    /// What has no mask first, so that the GPU can test depth before it shades.
    fn draw_patches(&self, pass: &mut wgpu::RenderPass<'_>, clip_from_world: [Mat4; 2]) {
        let Some(atlas) = self.atlas.group() else {
            return;
        };
        for needs in self.needs() {
            let Some(pipeline) = self.pipelines.patches(needs) else {
                continue;
            };
            pass.set_pipeline(pipeline);
            pass.set_immediates(0, bytemuck::bytes_of(&clip_from_world));
            pass.set_bind_group(0, atlas, &[]);
            if needs.objects {
                pass.set_bind_group(1, self.objects.as_ref(), &[]);
            }
            if needs.mask {
                pass.set_bind_group(2, self.atlas.mask_group(), &[]);
            }
            self.mesh.draw(pass, self.mesh.range(needs.mask));
        }
    }

    /// Of the draw calls that the frame takes: at most two.
    fn needs(&self) -> impl Iterator<Item = Needs> + use<> {
        let objects = self.mesh.moves();
        let foreshortened = self.mesh.is_foreshortened();
        let has_masks = self.atlas.mask_group().is_some();
        let needed = [false, true].map(|mask| {
            let drawn = !self.mesh.range(mask).is_empty() && (has_masks || !mask);
            drawn.then_some(Needs {
                objects,
                mask,
                foreshortened,
            })
        });
        needed.into_iter().flatten()
    }

    /// The atlas as it was decoded, RGBA8, to be read back; none before the
    /// first frame.
    #[must_use]
    pub fn atlas(&self) -> Option<&wgpu::Texture> {
        self.atlas.texture()
    }
}

fn check(frame: &ClientFrame, limits: &wgpu::Limits) -> Result<(), UploadError> {
    let [width, height] = frame.picture.size();
    let limit = limits.max_texture_dimension_2d;
    if width > limit || height > limit {
        return Err(UploadError::Atlas {
            width,
            height,
            limit,
        });
    }
    if let DecodedPicture::Planes(picture) = &frame.picture {
        check_planes(picture)?;
    }
    if let Some(MaskAtlas {
        width: w,
        height: h,
        coverage,
    }) = frame.masks.as_deref()
        && (coverage.len() != width as usize * height as usize || [*w, *h] != [width, height])
    {
        return Err(UploadError::Plane {
            plane: "mask",
            width,
            height,
            bytes: coverage.len(),
        });
    }
    let bytes = Mesh::largest_buffer(frame);
    let limit = limits.max_buffer_size;
    if bytes > limit {
        return Err(UploadError::Geometry { bytes, limit });
    }
    Ok(())
}

fn check_planes(picture: &YuvPicture) -> Result<(), UploadError> {
    let YuvPicture {
        width,
        height,
        y,
        u,
        v,
    } = picture;
    let (width, height) = (*width, *height);
    let quarter = (width / 2) as usize * (height / 2) as usize;
    for (plane, bytes, expected) in [
        ("luma", y.len(), quarter * 4),
        ("blue chroma", u.len(), quarter),
        ("red chroma", v.len(), quarter),
    ] {
        if bytes != expected || bytes == 0 || width % 2 == 1 || height % 2 == 1 {
            return Err(UploadError::Plane {
                plane,
                width,
                height,
                bytes,
            });
        }
    }
    Ok(())
}

/// One depth layer an eye for multiview, and one shared by both passes
/// otherwise: the left eye is done with it when the right one begins.
fn depth(device: &wgpu::Device, config: RendererConfig) -> wgpu::TextureView {
    let layers = match config.stereo {
        Stereo::Multiview => 2,
        Stereo::TwoPass => 1,
    };
    let [width, height] = config.drawn_size();
    device
        .create_texture(&wgpu::TextureDescriptor {
            label: Some("depth"),
            size: wgpu::Extent3d {
                width,
                height,
                depth_or_array_layers: layers,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: DEPTH_FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TRANSIENT,
            view_formats: &[],
        })
        .create_view(&wgpu::TextureViewDescriptor::default())
}
