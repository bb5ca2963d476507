//! A window as the display of a headset: both eyes side by side, each bent
//! against its lens.

use thiserror::Error;

use super::{EyeImages, Gpu, LensPass, Viewport};

/// Why a window shows nothing.
#[derive(Debug, Error)]
pub enum ScreenError {
    /// The system lets nobody draw into it.
    #[error("cannot draw into the window: {0}")]
    Window(#[from] wgpu::CreateSurfaceError),
    /// The GPU does not.
    #[error("the GPU cannot draw into this window")]
    Unsupported,
    /// It is there no longer.
    #[error("the window's surface was lost")]
    Lost,
}

/// What is drawn into a window.
#[derive(Debug)]
pub struct Screen {
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
}

impl Screen {
    /// Takes a window's surface, of `size` pixels, to be shown by `present_mode`.
    ///
    /// # Errors
    /// When the GPU cannot draw into it.
    pub fn new(
        surface: wgpu::Surface<'static>,
        gpu: &Gpu,
        size: [u32; 2],
        present_mode: wgpu::PresentMode,
    ) -> Result<Self, ScreenError> {
        let [width, height] = within(size, &gpu.device);
        let mut config = surface
            .get_default_config(&gpu.adapter, width, height)
            .ok_or(ScreenError::Unsupported)?;
        let formats = surface.get_capabilities(&gpu.adapter).formats;
        // The colours are encoded for a display already.
        if let Some(plain) = formats.iter().find(|format| !format.is_srgb()) {
            config.format = *plain;
        }
        config.present_mode = present_mode;
        surface.configure(&gpu.device, &config);
        Ok(Self { surface, config })
    }

    /// Of the eyes' pictures, whose colours the window takes as they are.
    #[must_use]
    pub fn eye_format(&self) -> wgpu::TextureFormat {
        if self.config.format.is_srgb() {
            wgpu::TextureFormat::Rgba8UnormSrgb
        } else {
            wgpu::TextureFormat::Rgba8Unorm
        }
    }

    /// Bends `eyes` into this window.
    #[must_use]
    pub fn lens_pass(
        &self,
        device: &wgpu::Device,
        eyes: &EyeImages,
        lenses: [super::EyeLens; 2],
    ) -> LensPass {
        LensPass::new(device, eyes, self.config.format, lenses)
    }

    /// The window has another size now.
    pub fn resize(&mut self, device: &wgpu::Device, size: [u32; 2]) {
        [self.config.width, self.config.height] = within(size, device);
        self.surface.configure(device, &self.config);
    }

    /// What is shown next, once there is something to draw into; none while the
    /// window is hidden.
    ///
    /// # Errors
    /// The window is gone.
    pub fn next(&self, device: &wgpu::Device) -> Result<Option<wgpu::SurfaceTexture>, ScreenError> {
        use wgpu::CurrentSurfaceTexture::{Lost, Outdated, Suboptimal, Success, Validation};
        match self.surface.get_current_texture() {
            Success(picture) | Suboptimal(picture) => Ok(Some(picture)),
            Outdated | Validation => {
                self.surface.configure(device, &self.config);
                Ok(None)
            }
            Lost => Err(ScreenError::Lost),
            _ => Ok(None),
        }
    }

    /// Draws both eyes into `picture`.
    pub fn draw(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        lens: &LensPass,
        picture: &wgpu::SurfaceTexture,
    ) {
        let size = picture.texture.size();
        let view = picture
            .texture
            .create_view(&wgpu::TextureViewDescriptor::default());
        lens.draw(encoder, &view, Viewport::halves([size.width, size.height]));
    }
}

/// A size that a device draws, with a pixel for each eye at least.
fn within([width, height]: [u32; 2], device: &wgpu::Device) -> [u32; 2] {
    let limit = device.limits().max_texture_dimension_2d;
    [width.clamp(2, limit), height.clamp(1, limit)]
}
