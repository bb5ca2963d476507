//! Vulkan objects created by the runtime (XR_KHR_vulkan_enable2): it adds the
//! extensions that it needs, and knows on which GPU its headset is.

use ::openxr as xr;
use ash::vk::{self, Handle};

use crate::render::vulkan::{VkHost, VulkanError};

/// A runtime that creates Vulkan objects.
pub(super) struct XrHost<'a> {
    pub(super) instance: &'a xr::Instance,
    pub(super) system: xr::SystemId,
}

// SAFETY: the runtime creates the objects from the very descriptions, as
// XR_KHR_vulkan_enable2 obliges it to.
unsafe impl VkHost for XrHost<'_> {
    fn create_instance(
        &mut self,
        entry: &ash::Entry,
        info: &vk::InstanceCreateInfo<'_>,
    ) -> Result<vk::Instance, VulkanError> {
        // SAFETY: the graphics requirements were asked for; the description is whole.
        let created = unsafe {
            self.instance.create_vulkan_instance(
                self.system,
                loader(entry),
                std::ptr::from_ref(info).cast(),
            )
        };
        let raw = of_runtime(created, "gave no Vulkan instance")?;
        Ok(vk::Instance::from_raw(raw as u64))
    }

    fn physical_device(
        &mut self,
        instance: &ash::Instance,
    ) -> Result<vk::PhysicalDevice, VulkanError> {
        let raw = instance.handle().as_raw() as xr::sys::platform::VkInstance;
        // SAFETY: the instance is the one that the runtime created.
        let device = unsafe { self.instance.vulkan_graphics_device(self.system, raw) };
        let device = device.map_err(|result| refused("names no GPU", result))?;
        Ok(vk::PhysicalDevice::from_raw(device as u64))
    }

    fn create_device(
        &mut self,
        entry: &ash::Entry,
        _: &ash::Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> Result<vk::Device, VulkanError> {
        // SAFETY: the physical device is the one that the runtime named; the
        // description is whole.
        let created = unsafe {
            self.instance.create_vulkan_device(
                self.system,
                loader(entry),
                physical.as_raw() as xr::sys::platform::VkPhysicalDevice,
                std::ptr::from_ref(info).cast(),
            )
        };
        let raw = of_runtime(created, "gave no Vulkan device")?;
        Ok(vk::Device::from_raw(raw as u64))
    }
}

fn loader(entry: &ash::Entry) -> xr::sys::platform::VkGetInstanceProcAddr {
    let load = entry.static_fn().get_instance_proc_addr;
    // SAFETY: both are `PFN_vkGetInstanceProcAddr`; they differ in whether the
    // returned pointer and the handle are spelt as pointers.
    unsafe { std::mem::transmute(load) }
}

/// Of two answers, the runtime's and Vulkan's.
fn of_runtime<T>(
    created: xr::Result<Result<T, i32>>,
    what: &'static str,
) -> Result<T, VulkanError> {
    match created {
        Ok(Ok(handle)) => Ok(handle),
        Ok(Err(result)) => Err(VulkanError::Refused {
            what,
            result: vk::Result::from_raw(result),
        }),
        Err(result) => Err(refused(what, result)),
    }
}

fn refused(what: &str, result: xr::sys::Result) -> VulkanError {
    VulkanError::Host(format!("the OpenXR runtime {what}: {result}"))
}
