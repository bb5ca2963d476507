//! A device that can draw for two eyes, and how it draws them.

use thiserror::Error;

use super::pipelines::IMMEDIATE_BYTES;

/// How both eyes are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stereo {
    /// One pass into both layers of the target.
    Multiview,
    /// One pass for each layer, where multiview is missing or wrong.
    TwoPass,
}

impl Stereo {
    /// The name in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Multiview => "multiview",
            Self::TwoPass => "two_pass",
        }
    }

    /// What an adapter does rightly. Software drivers draw in two passes:
    /// Mesa's lavapipe puts triangles that are clipped into the wrong layer.
    #[must_use]
    pub fn of(adapter: &wgpu::Adapter) -> Self {
        Self::of_device(
            adapter.features(),
            &adapter.limits(),
            adapter.get_info().device_type,
        )
    }

    /// The same of an adapter that wgpu does not hold yet.
    pub(super) fn of_device(
        features: wgpu::Features,
        limits: &wgpu::Limits,
        device_type: wgpu::DeviceType,
    ) -> Self {
        let can =
            features.contains(wgpu::Features::MULTIVIEW) && limits.max_multiview_view_count >= EYES;
        if can && device_type != wgpu::DeviceType::Cpu {
            Self::Multiview
        } else {
            Self::TwoPass
        }
    }
}

/// Views of a multiview pass.
const EYES: u32 = 2;

/// Why there is no device to draw with.
#[derive(Debug, Error)]
pub enum GpuError {
    /// No driver, or none that can show pictures on the surface.
    #[error(
        "no GPU driver was found: install a Vulkan driver, for example mesa-vulkan-drivers ({0})"
    )]
    NoAdapter(#[from] wgpu::RequestAdapterError),
    /// The driver is there, and cannot do what the renderer needs.
    #[error("the GPU driver gave no device: {0}")]
    NoDevice(#[from] wgpu::RequestDeviceError),
}

/// An open device.
#[derive(Debug)]
pub struct Gpu {
    /// What the driver says of itself.
    pub adapter: wgpu::Adapter,
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// How it should draw both eyes.
    pub stereo: Stereo,
}

impl Gpu {
    /// Opens the fastest adapter, for `surface` if there is one.
    ///
    /// # Errors
    /// When there is no adapter, or it cannot give a device.
    pub fn open(
        instance: &wgpu::Instance,
        surface: Option<&wgpu::Surface<'_>>,
    ) -> Result<Self, GpuError> {
        let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            force_fallback_adapter: false,
            compatible_surface: surface,
        }))?;
        let stereo = Stereo::of(&adapter);
        Self::with_stereo(adapter, stereo)
    }

    /// Opens `adapter` to draw with the given mode.
    ///
    /// # Errors
    /// When the adapter cannot give a device.
    pub fn with_stereo(adapter: wgpu::Adapter, stereo: Stereo) -> Result<Self, GpuError> {
        let demands = demands(stereo, &adapter.limits());
        let (device, queue) = pollster::block_on(adapter.request_device(&demands))?;
        Ok(Self {
            adapter,
            device,
            queue,
            stereo,
        })
    }
}

/// What the renderer asks of a device, whoever makes it. `limits` are those of
/// the adapter.
pub(super) fn demands(stereo: Stereo, limits: &wgpu::Limits) -> wgpu::DeviceDescriptor<'static> {
    let mut required_limits = wgpu::Limits {
        max_immediate_size: IMMEDIATE_BYTES,
        max_buffer_size: limits.max_buffer_size,
        max_storage_buffer_binding_size: limits.max_storage_buffer_binding_size,
        ..wgpu::Limits::default()
    };
    let mut required_features = wgpu::Features::IMMEDIATES;
    if stereo == Stereo::Multiview {
        required_features |= wgpu::Features::MULTIVIEW;
        required_limits.max_multiview_view_count = EYES;
    }
    wgpu::DeviceDescriptor {
        label: Some("shadecast client"),
        required_features,
        required_limits,
        ..wgpu::DeviceDescriptor::default()
    }
}
