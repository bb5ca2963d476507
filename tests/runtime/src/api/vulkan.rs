//! XR_KHR_vulkan_enable2: the application's Vulkan objects, created here.

use ash::vk::{self, Handle as _};
use openxr_sys as sys;
use sys::Result as R;
use sys::platform::{VkDevice, VkInstance, VkPhysicalDevice, VkResult};

use super::instance::known;
use super::{api, input, output, place};
use crate::images::{Vulkan, raw};

api! {
    fn graphics_requirements(
        world,
        instance: sys::Instance,
        system: sys::SystemId,
        requirements: *mut sys::GraphicsRequirementsVulkanKHR,
    ) {
        let oldest = world.script.headset.oldest_vulkan;
        world.instance(instance)?.requirements_asked = true;
        known(system)?;
        // SAFETY: the arguments are those of the function.
        let out = unsafe { output(requirements, sys::GraphicsRequirementsVulkanKHR::TYPE) }?;
        out.min_api_version_supported = oldest;
        out.max_api_version_supported = sys::Version::new(1, 99, 0);
        Ok(R::SUCCESS)
    }

    fn create_vulkan_instance(
        world,
        instance: sys::Instance,
        info: *const sys::VulkanInstanceCreateInfoKHR,
        vulkan_instance: *mut VkInstance,
        result: *mut VkResult,
    ) {
        let instance = world.instance(instance)?;
        // SAFETY: the arguments are those of the function.
        let info = unsafe { input(info, sys::VulkanInstanceCreateInfoKHR::TYPE) }?;
        known(info.system_id)?;
        if !instance.requirements_asked {
            return Err(R::ERROR_GRAPHICS_REQUIREMENTS_CALL_MISSING);
        }
        let load = info.pfn_get_instance_proc_addr.ok_or(R::ERROR_VALIDATION_FAILURE)?;
        let description = info.vulkan_create_info.cast::<vk::InstanceCreateInfo<'_>>();
        // SAFETY: both are what the application's Vulkan takes.
        let created = unsafe { Vulkan::create(load, description) }?;
        let (handle, code) = match created {
            Ok(vulkan) => {
                let handle = vulkan.instance.handle().as_raw();
                instance.vulkan = Some(vulkan);
                (handle, 0)
            }
            Err(result) => (0, result.as_raw()),
        };
        // SAFETY: the arguments are those of the function.
        unsafe {
            *place(vulkan_instance)? = handle as VkInstance;
            *place(result)? = code;
        }
        Ok(R::SUCCESS)
    }

    fn graphics_device(
        world,
        instance: sys::Instance,
        info: *const sys::VulkanGraphicsDeviceGetInfoKHR,
        physical: *mut VkPhysicalDevice,
    ) {
        let instance = world.instance(instance)?;
        // SAFETY: the arguments are those of the function.
        let info = unsafe { input(info, sys::VulkanGraphicsDeviceGetInfoKHR::TYPE) }?;
        let vulkan = instance.vulkan.as_ref().ok_or(R::ERROR_VALIDATION_FAILURE)?;
        if vulkan.instance.handle().as_raw() != info.vulkan_instance as u64 {
            return Err(R::ERROR_VALIDATION_FAILURE);
        }
        // SAFETY: the arguments are those of the function.
        *unsafe { place(physical) }? = raw(vulkan.physical) as VkPhysicalDevice;
        Ok(R::SUCCESS)
    }

    fn create_vulkan_device(
        world,
        instance: sys::Instance,
        info: *const sys::VulkanDeviceCreateInfoKHR,
        device: *mut VkDevice,
        result: *mut VkResult,
    ) {
        let refusal = vk::Result::from_raw(world.script.headset.vulkan_device);
        let instance = world.instance(instance)?;
        // SAFETY: the arguments are those of the function.
        let info = unsafe { input(info, sys::VulkanDeviceCreateInfoKHR::TYPE) }?;
        let vulkan = instance.vulkan.as_mut().ok_or(R::ERROR_VALIDATION_FAILURE)?;
        if raw(vulkan.physical) != info.vulkan_physical_device as u64 {
            return Err(R::ERROR_VALIDATION_FAILURE);
        }
        let description = info.vulkan_create_info.cast::<vk::DeviceCreateInfo<'_>>();
        if description.is_null() {
            return Err(R::ERROR_VALIDATION_FAILURE);
        }
        let created = match refusal {
            // SAFETY: the description is one for this very device.
            vk::Result::SUCCESS => unsafe {
                vulkan.instance.create_device(vulkan.physical, &*description, None)
            },
            refusal => Err(refusal),
        };
        let (handle, code) = match created {
            Ok(device) => {
                vulkan.device = Some(device.handle());
                (device.handle().as_raw(), 0)
            }
            Err(result) => (0, result.as_raw()),
        };
        // SAFETY: the arguments are those of the function.
        unsafe {
            *place(device)? = handle as VkDevice;
            *place(result)? = code;
        }
        Ok(R::SUCCESS)
    }
}
