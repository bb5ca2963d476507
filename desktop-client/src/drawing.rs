//! The GPU's side of a display frame: both eyes, then the lens.

use anyhow::{Context, Result};
use shadecast_client::ClientFrame;
use shadecast_client::render::{
    EyeCamera, EyeImages, EyeLens, Gpu, LensPass, Pixels, Readback, Renderer, RendererConfig,
    Viewport,
};
use shadecast_protocol::Sky;

/// Draws for one display.
#[derive(Debug)]
pub(crate) struct Drawing {
    gpu: Gpu,
    renderer: Renderer,
    eyes: EyeImages,
    eye_format: wgpu::TextureFormat,
}

impl Drawing {
    /// Eyes of `eye_size` pixels.
    pub(crate) fn new(gpu: Gpu, eye_size: u16, eye_format: wgpu::TextureFormat) -> Self {
        let eye_size = [u32::from(eye_size); 2];
        let config = RendererConfig {
            eye_size,
            eye_format,
            stereo: gpu.stereo,
            antialias: true,
        };
        Self {
            renderer: Renderer::new(&gpu.device, &gpu.queue, config),
            eyes: EyeImages::new(&gpu.device, eye_size, eye_format),
            eye_format,
            gpu,
        }
    }

    pub(crate) fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    pub(crate) fn set_sky(&mut self, sky: &Sky) {
        self.renderer.set_sky(Some(sky));
    }

    pub(crate) fn upload(&mut self, frame: &ClientFrame) -> Result<()> {
        Ok(self.renderer.upload(frame)?)
    }

    /// The pictures that are drawn into.
    pub(crate) fn eyes(&self) -> &EyeImages {
        &self.eyes
    }

    /// Draws both eyes, lets `finish` add what follows, and waits for the GPU.
    pub(crate) fn draw(
        &self,
        cameras: [EyeCamera; 2],
        seconds_of_motion: f32,
        finish: impl FnOnce(&mut wgpu::CommandEncoder),
    ) -> Result<()> {
        let mut encoder = self.encoder();
        self.renderer
            .draw(&mut encoder, cameras, seconds_of_motion, &self.eyes);
        finish(&mut encoder);
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu
            .device
            .poll(wgpu::PollType::wait_indefinitely())
            .context("the GPU stopped answering")?;
        Ok(())
    }

    /// One eye as it was drawn last, before the lens.
    pub(crate) fn eye(&self, eye: usize) -> Result<Pixels> {
        self.read(self.eyes.texture(), eye as u32)
    }

    /// One eye as it would look from elsewhere, or at another time.
    pub(crate) fn eye_from(
        &self,
        cameras: [EyeCamera; 2],
        seconds_of_motion: f32,
        eye: usize,
    ) -> Result<Pixels> {
        let size = self.eyes.texture().size();
        let elsewhere =
            EyeImages::new(&self.gpu.device, [size.width, size.height], self.eye_format);
        let mut encoder = self.encoder();
        self.renderer
            .draw(&mut encoder, cameras, seconds_of_motion, &elsewhere);
        self.gpu.queue.submit([encoder.finish()]);
        self.read(elsewhere.texture(), eye as u32)
    }

    /// The decoded atlas; none before the first frame.
    pub(crate) fn atlas(&self) -> Result<Option<Pixels>> {
        self.renderer
            .atlas()
            .map(|atlas| self.read(atlas, 0))
            .transpose()
    }

    /// A layer of an RGBA8 texture.
    pub(crate) fn read(&self, texture: &wgpu::Texture, layer: u32) -> Result<Pixels> {
        let mut encoder = self.encoder();
        let copy = Readback::record(&self.gpu.device, &mut encoder, texture, layer);
        self.gpu.queue.submit([encoder.finish()]);
        Ok(copy.take(&self.gpu.device)?)
    }

    fn encoder(&self) -> wgpu::CommandEncoder {
        self.gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }
}

/// The picture of a headset's display, where there is no display: both eyes,
/// bent, side by side.
#[derive(Debug)]
pub(crate) struct Panel {
    lens: LensPass,
    texture: wgpu::Texture,
    view: wgpu::TextureView,
}

impl Panel {
    pub(crate) fn new(drawing: &Drawing, lenses: [EyeLens; 2]) -> Self {
        let eye = drawing.eyes.texture().size();
        let texture = drawing.gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("panel"),
            size: wgpu::Extent3d {
                width: eye.width * 2,
                height: eye.height,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: drawing.eye_format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        Self {
            lens: LensPass::new(
                &drawing.gpu.device,
                &drawing.eyes,
                drawing.eye_format,
                lenses,
            ),
            view: texture.create_view(&wgpu::TextureViewDescriptor::default()),
            texture,
        }
    }

    pub(crate) fn draw(&self, encoder: &mut wgpu::CommandEncoder) {
        let halves = Viewport::halves([self.texture.width(), self.texture.height()]);
        self.lens.draw(encoder, &self.view, halves);
    }

    pub(crate) fn texture(&self) -> &wgpu::Texture {
        &self.texture
    }
}
