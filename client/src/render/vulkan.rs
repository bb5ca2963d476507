//! The renderer's device, made by hand on Vulkan.
//!
//! wgpu opens a device by itself where nothing else has a say ([`Gpu::open`]).
//! An OpenXR runtime wants to create instance and device itself, and pictures
//! in AHardwareBuffers need extensions that wgpu does not know. Both are a
//! [`VkHost`] here: what is asked for is the same, who creates it differs.

use std::ffi::CStr;

use ash::vk;
use thiserror::Error;
use wgpu::hal::vulkan as hal;

use super::gpu::demands;
use super::{Gpu, Stereo};

/// Who creates the Vulkan objects.
///
/// # Safety
/// What is returned is what the create info describes, and is valid; the
/// physical device is one of the instance, the device one of the physical
/// device. The handles are given away: the device, and then the instance, are
/// destroyed by the [`Gpu`] that is made of them.
pub unsafe trait VkHost {
    /// Creates an instance of this description, and no less.
    ///
    /// # Errors
    /// When there is none; says why.
    fn create_instance(
        &mut self,
        entry: &ash::Entry,
        info: &vk::InstanceCreateInfo<'_>,
    ) -> Result<vk::Instance, VulkanError>;

    /// Names the device to draw with.
    ///
    /// # Errors
    /// When there is none; says why.
    fn physical_device(
        &mut self,
        instance: &ash::Instance,
    ) -> Result<vk::PhysicalDevice, VulkanError>;

    /// Creates a device of this description, and no less.
    ///
    /// # Errors
    /// When there is none; says why.
    fn create_device(
        &mut self,
        entry: &ash::Entry,
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> Result<vk::Device, VulkanError>;
}

/// What a device should be able to do besides drawing.
#[derive(Clone, Debug, Default)]
pub struct Extras {
    /// Device extensions, each of which is enabled where it is supported.
    pub extensions: Vec<&'static CStr>,
    /// Sampling of YCbCr pictures, where it is supported.
    pub ycbcr: bool,
}

/// Why there is no device.
#[derive(Debug, Error)]
pub enum VulkanError {
    /// There is no Vulkan on this machine.
    #[error("Vulkan is missing: install a Vulkan driver, for example mesa-vulkan-drivers ({0})")]
    NoLoader(#[from] ash::LoadingError),
    /// There is no GPU.
    #[error("no GPU driver was found: install a Vulkan driver, for example mesa-vulkan-drivers")]
    NoPhysicalDevice,
    /// Vulkan refused something.
    #[error("the GPU driver {what}: {result}")]
    Refused {
        /// What it did not do.
        what: &'static str,
        /// In its own words.
        result: vk::Result,
    },
    /// The driver is too old, or lacks something that drawing needs.
    #[error("the GPU driver lacks {0}")]
    Lacks(&'static str),
    /// The host refused; in its own words.
    #[error("{0}")]
    Host(String),
    /// The renderer's layer over Vulkan refused.
    #[error("the GPU cannot be used: {0}")]
    Unusable(String),
}

/// A [`Gpu`] with the handles that are below it.
#[derive(Debug)]
pub struct VulkanGpu {
    /// What to draw with.
    pub gpu: Gpu,
    /// Lets windows be drawn into.
    pub api: wgpu::Instance,
    /// The instance. Valid for as long as any part of `gpu`.
    pub instance: vk::Instance,
    /// As `instance`.
    pub physical: vk::PhysicalDevice,
    /// As `instance`.
    pub device: vk::Device,
    /// The family of the queue; the queue is its first.
    pub queue_family: u32,
    /// Of the extra extensions, those that are enabled.
    pub extensions: Vec<&'static CStr>,
    /// Whether YCbCr pictures can be sampled.
    pub ycbcr: bool,
}

/// wgpu uses the first family, which on all drivers that are known can draw.
const QUEUE_FAMILY: u32 = 0;

/// The instance asks for this version wherever the loader knows it: wgpu-hal
/// goes by the version of the device, and a device of 1.3 under an instance
/// that asked for less lacks functions that it calls.
const API_VERSION: u32 = vk::API_VERSION_1_3;

impl VulkanGpu {
    /// Opens the device of `host`, with those of the `extras` that it has.
    ///
    /// # Errors
    /// When there is no Vulkan, no device, or one that cannot draw for two eyes.
    pub fn open(host: &mut impl VkHost, extras: &Extras) -> Result<Self, VulkanError> {
        Self::open_with(host, extras, None)
    }

    /// As [`open`](Self::open), to draw in this mode; without one, in what the
    /// device does rightly.
    ///
    /// # Errors
    /// As [`open`](Self::open); when the device cannot draw in this mode.
    pub fn open_with(
        host: &mut impl VkHost,
        extras: &Extras,
        stereo: Option<Stereo>,
    ) -> Result<Self, VulkanError> {
        // SAFETY: the Vulkan loader of the system is what it says.
        let entry = unsafe { ash::Entry::load() }?;
        let flags = wgpu::InstanceFlags::empty();
        let (instance, instance_raw) = open_instance(&entry, host, flags)?;
        let physical = host.physical_device(instance.shared_instance().raw_instance())?;
        let exposed = instance
            .expose_adapter(physical)
            .ok_or(VulkanError::Lacks("what drawing needs at the least"))?;
        let stereo = stereo.unwrap_or_else(|| {
            Stereo::of_device(
                exposed.features,
                &exposed.capabilities.limits,
                exposed.info.device_type,
            )
        });
        let demands = demands(stereo, &exposed.capabilities.limits);
        if let Some(lacking) = lacking(exposed.features, demands.required_features) {
            return Err(VulkanError::Lacks(lacking));
        }
        let adapter = &exposed.adapter;
        let mut names = adapter.required_device_extensions(demands.required_features);
        let capabilities = adapter.physical_device_capabilities();
        let supported = |name: &&'static CStr| capabilities.supports_extension(name);
        let extensions: Vec<_> = extras
            .extensions
            .iter()
            .copied()
            .filter(supported)
            .collect();
        names.extend(&extensions);
        names.sort_unstable();
        names.dedup();

        let raw_instance = instance.shared_instance().raw_instance();
        let ycbcr = extras.ycbcr && samples_ycbcr(raw_instance, physical);
        let device_raw = {
            let mut features = adapter.physical_device_features(&names, demands.required_features);
            let pointers: Vec<_> = names.iter().map(|name| name.as_ptr()).collect();
            let priorities = [1.0];
            let queues = [vk::DeviceQueueCreateInfo::default()
                .queue_family_index(QUEUE_FAMILY)
                .queue_priorities(&priorities)];
            let info = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_extension_names(&pointers);
            let mut conversion = vk::PhysicalDeviceSamplerYcbcrConversionFeatures::default()
                .sampler_ycbcr_conversion(true);
            let mut info = features.add_to_device_create(info);
            if ycbcr {
                info = info.push_next(&mut conversion);
            }
            host.create_device(&entry, raw_instance, physical, &info)?
        };
        // SAFETY: the host says that the device is valid and of this instance.
        let raw_device = unsafe { ash::Device::load(raw_instance.fp_v1_0(), device_raw) };
        // SAFETY: the device was made by `exposed.adapter`'s own description of
        // extensions and features, with one queue of this family, and is given away.
        let open = unsafe {
            adapter.device_from_raw(
                raw_device,
                None,
                &names,
                demands.required_features,
                &demands.required_limits,
                &demands.memory_hints,
                QUEUE_FAMILY,
                0,
            )
        }
        .map_err(|error| VulkanError::Unusable(error.to_string()))?;
        // SAFETY: the adapter is one of the instance, the device one of the
        // adapter, opened with this description.
        let (api, adapter, opened) = unsafe {
            let api = wgpu::Instance::from_hal::<hal::Api>(instance);
            let adapter = api.create_adapter_from_hal(exposed);
            let opened = adapter.create_device_from_hal(open, &demands);
            (api, adapter, opened)
        };
        let (device, queue) = opened.map_err(|error| VulkanError::Unusable(error.to_string()))?;
        Ok(Self {
            gpu: Gpu {
                adapter,
                device,
                queue,
                stereo,
            },
            api,
            instance: instance_raw,
            physical,
            device: device_raw,
            queue_family: QUEUE_FAMILY,
            extensions,
            ycbcr,
        })
    }
}

/// What drawing needs and the device does not have, in words.
fn lacking(has: wgpu::Features, needed: wgpu::Features) -> Option<&'static str> {
    let names = [
        (wgpu::Features::IMMEDIATES, "push constants"),
        (
            wgpu::Features::MULTIVIEW,
            "multiview, in which it was asked to draw",
        ),
    ];
    let lacks = |feature| needed.contains(feature) && !has.contains(feature);
    names
        .into_iter()
        .find_map(|(feature, name)| lacks(feature).then_some(name))
}

fn open_instance(
    entry: &ash::Entry,
    host: &mut impl VkHost,
    flags: wgpu::InstanceFlags,
) -> Result<(hal::Instance, vk::Instance), VulkanError> {
    // SAFETY: the entry is loaded.
    let version = unsafe { entry.try_enumerate_instance_version() }
        .map_err(refused("does not tell its version"))?
        .unwrap_or(vk::API_VERSION_1_0);
    if version < vk::API_VERSION_1_1 {
        return Err(VulkanError::Lacks("Vulkan 1.1"));
    }
    let mut names = hal::Instance::desired_extensions(entry, version, flags)
        .map_err(|error| VulkanError::Unusable(error.to_string()))?;
    names.sort_unstable();
    names.dedup();
    let pointers: Vec<_> = names.iter().map(|name| name.as_ptr()).collect();
    let application = vk::ApplicationInfo::default()
        .application_name(c"shadecast")
        .api_version(API_VERSION);
    let info = vk::InstanceCreateInfo::default()
        .application_info(&application)
        .enabled_extension_names(&pointers);
    let instance_raw = host.create_instance(entry, &info)?;
    // SAFETY: the host says that the instance is valid.
    let raw = unsafe { ash::Instance::load(entry.static_fn(), instance_raw) };
    // SAFETY: the instance is of this entry, has these extensions, and is given away.
    let instance = unsafe {
        hal::Instance::from_raw(
            entry.clone(),
            raw,
            version,
            0,
            None,
            names,
            flags,
            wgpu::MemoryBudgetThresholds::default(),
            false,
            None,
        )
    }
    .map_err(|error| VulkanError::Unusable(error.to_string()))?;
    Ok((instance, instance_raw))
}

fn samples_ycbcr(instance: &ash::Instance, physical: vk::PhysicalDevice) -> bool {
    let mut conversion = vk::PhysicalDeviceSamplerYcbcrConversionFeatures::default();
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut conversion);
    // SAFETY: the physical device is one of the instance, which is of 1.1 at least.
    unsafe { instance.get_physical_device_features2(physical, &mut features) };
    conversion.sampler_ycbcr_conversion == vk::TRUE
}

/// Names what Vulkan did not do.
pub(crate) fn refused(what: &'static str) -> impl Fn(vk::Result) -> VulkanError {
    move |result| VulkanError::Refused { what, result }
}

/// Creates everything itself, on the first GPU; where there is none, on a
/// software driver.
#[derive(Clone, Copy, Debug, Default)]
pub struct DirectHost;

// SAFETY: the objects are created by Vulkan from the very descriptions.
unsafe impl VkHost for DirectHost {
    fn create_instance(
        &mut self,
        entry: &ash::Entry,
        info: &vk::InstanceCreateInfo<'_>,
    ) -> Result<vk::Instance, VulkanError> {
        // SAFETY: the description is whole.
        let instance = unsafe { entry.create_instance(info, None) };
        Ok(instance.map_err(refused("gave no instance"))?.handle())
    }

    fn physical_device(
        &mut self,
        instance: &ash::Instance,
    ) -> Result<vk::PhysicalDevice, VulkanError> {
        // SAFETY: the instance is valid.
        let all = unsafe { instance.enumerate_physical_devices() }
            .map_err(refused("lists no devices"))?;
        let slowness = |device: &vk::PhysicalDevice| {
            // SAFETY: the device is one of the instance.
            let properties = unsafe { instance.get_physical_device_properties(*device) };
            match properties.device_type {
                vk::PhysicalDeviceType::DISCRETE_GPU => 0,
                vk::PhysicalDeviceType::INTEGRATED_GPU => 1,
                vk::PhysicalDeviceType::VIRTUAL_GPU => 2,
                _ => 3,
            }
        };
        let fastest = all.into_iter().min_by_key(slowness);
        fastest.ok_or(VulkanError::NoPhysicalDevice)
    }

    fn create_device(
        &mut self,
        _: &ash::Entry,
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> Result<vk::Device, VulkanError> {
        // SAFETY: the device is one of the instance, the description is whole.
        let device = unsafe { instance.create_device(physical, info, None) };
        Ok(device.map_err(refused("gave no device"))?.handle())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_without_multiview_draws_in_two_passes_or_says_so() {
        let limits = wgpu::Limits {
            max_multiview_view_count: 2,
            ..wgpu::Limits::default()
        };
        let kind = wgpu::DeviceType::IntegratedGpu;
        let all = wgpu::Features::IMMEDIATES | wgpu::Features::MULTIVIEW;
        let without = wgpu::Features::IMMEDIATES;
        assert_eq!(Stereo::of_device(all, &limits, kind), Stereo::Multiview);
        assert_eq!(Stereo::of_device(without, &limits, kind), Stereo::TwoPass);
        let one_view = wgpu::Limits::default();
        assert_eq!(Stereo::of_device(all, &one_view, kind), Stereo::TwoPass);

        let needed = |stereo| demands(stereo, &limits).required_features;
        assert_eq!(lacking(without, needed(Stereo::TwoPass)), None);
        assert_eq!(lacking(all, needed(Stereo::Multiview)), None);
        let said = |has, stereo| {
            let name = lacking(has, needed(stereo)).expect("it lacks something");
            VulkanError::Lacks(name).to_string()
        };
        assert_eq!(
            said(without, Stereo::Multiview),
            "the GPU driver lacks multiview, in which it was asked to draw"
        );
        assert_eq!(
            said(wgpu::Features::empty(), Stereo::TwoPass),
            "the GPU driver lacks push constants"
        );
    }
}
