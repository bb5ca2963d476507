//! The Vulkan device that wgpu draws with, as it is.

use std::fmt;
use std::sync::Arc;

use ash::vk;
use wgpu::hal::api::Vulkan;

use super::ConvertError;

/// The Vulkan device below a device of wgpu, which it keeps alive.
pub struct RawDevice {
    raw: ash::Device,
    instance: ash::Instance,
    physical: vk::PhysicalDevice,
    queue_family: u32,
    wgpu: wgpu::Device,
}

impl RawDevice {
    /// The device below `device`.
    ///
    /// # Errors
    /// It is not one of Vulkan.
    pub fn of(device: &wgpu::Device) -> Result<Arc<Self>, ConvertError> {
        // SAFETY: nothing of it is destroyed, and `wgpu` keeps it alive.
        let hal = unsafe { device.as_hal::<Vulkan>() }.ok_or(ConvertError::NotVulkan)?;
        Ok(Arc::new(Self {
            raw: hal.raw_device().clone(),
            instance: hal.shared_instance().raw_instance().clone(),
            physical: hal.raw_physical_device(),
            queue_family: hal.queue_family_index(),
            wgpu: device.clone(),
        }))
    }

    /// The device; nothing that wgpu owns may be destroyed with it.
    #[must_use]
    pub fn raw(&self) -> &ash::Device {
        &self.raw
    }

    /// The instance of the device.
    #[must_use]
    pub fn instance(&self) -> &ash::Instance {
        &self.instance
    }

    /// What the device was made of.
    #[must_use]
    pub fn physical(&self) -> vk::PhysicalDevice {
        self.physical
    }

    pub(super) fn queue_family(&self) -> u32 {
        self.queue_family
    }

    pub(super) fn wgpu(&self) -> &wgpu::Device {
        &self.wgpu
    }

    pub(super) fn encoder(&self) -> wgpu::CommandEncoder {
        self.wgpu
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    /// Returns when the GPU is done with it, or lost.
    pub(super) fn wait_for(&self, submission: wgpu::SubmissionIndex) {
        let wait = wgpu::PollType::Wait {
            submission_index: Some(submission),
            timeout: None,
        };
        if let Err(error) = self.wgpu.poll(wait) {
            tracing::warn!("the GPU stopped answering: {error}");
        }
    }
}

impl fmt::Debug for RawDevice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("RawDevice")
            .field(&self.raw.handle())
            .finish()
    }
}
