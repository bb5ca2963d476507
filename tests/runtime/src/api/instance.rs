//! Instances, systems and paths.

use std::ffi::c_char;

use openxr_sys as sys;
use sys::{Handle, Result as R};

use super::{api, input, list, output, place, text, write_text};
use crate::Headset;
use crate::world::{Instance, enter_current};

/// The one headset.
const SYSTEM: u64 = 1;
/// Largest side of a picture, pixels.
const LARGEST: u32 = 8192;

pub(super) unsafe extern "system" fn enumerate_extensions(
    layer: *const c_char,
    capacity: u32,
    count: *mut u32,
    properties: *mut sys::ExtensionProperties,
) -> sys::Result {
    enter_current("xrEnumerateInstanceExtensionProperties", |world| {
        if !layer.is_null() {
            return Err(R::ERROR_API_LAYER_NOT_PRESENT);
        }
        let names = &world.script.headset.extensions;
        let write = |out: &mut sys::ExtensionProperties, name: &&str| {
            write_text(&mut out.extension_name, &format!("XR_{name}"));
            out.extension_version = 1;
        };
        // SAFETY: the arguments are those of the function.
        unsafe { list(names, capacity, count, properties, write) }
    })
}

pub(super) unsafe extern "system" fn enumerate_layers(
    _: u32,
    count: *mut u32,
    _: *mut sys::ApiLayerProperties,
) -> sys::Result {
    // SAFETY: null or writable.
    match unsafe { count.as_mut() } {
        Some(count) => {
            *count = 0;
            R::SUCCESS
        }
        None => R::ERROR_VALIDATION_FAILURE,
    }
}

pub(super) unsafe extern "system" fn create_instance(
    info: *const sys::InstanceCreateInfo,
    instance: *mut sys::Instance,
) -> sys::Result {
    enter_current("xrCreateInstance", |world| {
        // SAFETY: the arguments are those of the function.
        let info = unsafe { input(info, sys::InstanceCreateInfo::TYPE) }?;
        let api = info.application_info.api_version;
        if api.major() != 1 || !world.script.headset.speaks_1_0 {
            return Err(R::ERROR_API_VERSION_UNSUPPORTED);
        }
        if info.application_info.application_name[0] == 0 {
            return Err(R::ERROR_NAME_INVALID);
        }
        if world.instance.is_some() {
            return Err(R::ERROR_LIMIT_REACHED);
        }
        let mut extensions = Vec::new();
        for index in 0..info.enabled_extension_count as usize {
            // SAFETY: there are as many as the struct says.
            let name = unsafe { text(*info.enabled_extension_names.add(index)) }?;
            let short = name.strip_prefix("XR_").unwrap_or(name);
            let Headset {
                extensions: offered,
                refuses,
                ..
            } = &world.script.headset;
            if !offered.contains(&short) || refuses.contains(&short) {
                return Err(R::ERROR_EXTENSION_NOT_PRESENT);
            }
            extensions.push(short.to_owned());
        }
        world.log.extensions = extensions;
        let handle = world.handle();
        world.instance = Some(Instance {
            handle,
            requirements_asked: false,
            vulkan: None,
            lost: false,
        });
        // SAFETY: the arguments are those of the function.
        *unsafe { place(instance) }? = sys::Instance::from_raw(handle);
        Ok(R::SUCCESS)
    })
}

api! {
    fn destroy_instance(world, instance: sys::Instance) {
        if world.instance.take_if(|it| it.handle == instance).is_none() {
            return Err(R::ERROR_HANDLE_INVALID);
        }
        world.session = None;
        world.swapchains.clear();
        world.spaces.clear();
        world.sets.clear();
        world.actions.clear();
        world.events.clear();
        if let Some(path) = &world.script.log_to {
            let _ = std::fs::write(path, format!("{:#?}\n", world.log));
        }
        Ok(R::SUCCESS)
    }

    fn instance_properties(
        world,
        instance: sys::Instance,
        properties: *mut sys::InstanceProperties,
    ) {
        world.instance(instance)?;
        // SAFETY: the arguments are those of the function.
        let out = unsafe { output(properties, sys::InstanceProperties::TYPE) }?;
        out.runtime_version = sys::Version::new(0, 1, 0);
        write_text(&mut out.runtime_name, "shadecast simulation");
        Ok(R::SUCCESS)
    }

    fn get_system(
        world,
        instance: sys::Instance,
        info: *const sys::SystemGetInfo,
        system: *mut sys::SystemId,
    ) {
        world.instance(instance)?;
        // SAFETY: the arguments are those of the function.
        let info = unsafe { input(info, sys::SystemGetInfo::TYPE) }?;
        if info.form_factor != sys::FormFactor::HEAD_MOUNTED_DISPLAY {
            return Err(R::ERROR_FORM_FACTOR_UNSUPPORTED);
        }
        if !world.script.headset.connected || world.clock.now() < world.away_until {
            return Err(R::ERROR_FORM_FACTOR_UNAVAILABLE);
        }
        // SAFETY: the arguments are those of the function.
        *unsafe { place(system) }? = sys::SystemId::from_raw(SYSTEM);
        Ok(R::SUCCESS)
    }

    fn system_properties(
        world,
        instance: sys::Instance,
        system: sys::SystemId,
        properties: *mut sys::SystemProperties,
    ) {
        world.instance(instance)?;
        known(system)?;
        // SAFETY: the arguments are those of the function.
        let out = unsafe { output(properties, sys::SystemProperties::TYPE) }?;
        out.system_id = system;
        out.vendor_id = 0;
        write_text(&mut out.system_name, "simulated headset");
        out.graphics_properties = sys::SystemGraphicsProperties {
            max_swapchain_image_height: LARGEST,
            max_swapchain_image_width: LARGEST,
            max_layer_count: 16,
        };
        out.tracking_properties = sys::SystemTrackingProperties {
            orientation_tracking: sys::TRUE,
            position_tracking: sys::TRUE,
        };
        Ok(R::SUCCESS)
    }

    fn view_configurations(
        world,
        instance: sys::Instance,
        system: sys::SystemId,
        capacity: u32,
        count: *mut u32,
        kinds: *mut sys::ViewConfigurationType,
    ) {
        world.instance(instance)?;
        known(system)?;
        let stereo = [sys::ViewConfigurationType::PRIMARY_STEREO];
        // SAFETY: the arguments are those of the function.
        unsafe { list(&stereo, capacity, count, kinds, |out, kind| *out = *kind) }
    }

    fn view_configuration_properties(
        world,
        instance: sys::Instance,
        system: sys::SystemId,
        kind: sys::ViewConfigurationType,
        properties: *mut sys::ViewConfigurationProperties,
    ) {
        world.instance(instance)?;
        known(system)?;
        stereo(kind)?;
        // SAFETY: the arguments are those of the function.
        let out = unsafe { output(properties, sys::ViewConfigurationProperties::TYPE) }?;
        out.view_configuration_type = kind;
        out.fov_mutable = sys::FALSE;
        Ok(R::SUCCESS)
    }

    fn view_configuration_views(
        world,
        instance: sys::Instance,
        system: sys::SystemId,
        kind: sys::ViewConfigurationType,
        capacity: u32,
        count: *mut u32,
        views: *mut sys::ViewConfigurationView,
    ) {
        world.instance(instance)?;
        known(system)?;
        stereo(kind)?;
        let eyes = world.script.headset.eyes.clone();
        let all = vec![eyes.size; eyes.count as usize];
        // SAFETY: the arguments are those of the function.
        unsafe { list_views(&all, capacity, count, views) }
    }

    fn blend_modes(
        world,
        instance: sys::Instance,
        system: sys::SystemId,
        kind: sys::ViewConfigurationType,
        capacity: u32,
        count: *mut u32,
        modes: *mut sys::EnvironmentBlendMode,
    ) {
        world.instance(instance)?;
        known(system)?;
        stereo(kind)?;
        let opaque = [sys::EnvironmentBlendMode::OPAQUE];
        // SAFETY: the arguments are those of the function.
        unsafe { list(&opaque, capacity, count, modes, |out, mode| *out = *mode) }
    }

    fn string_to_path(
        world,
        instance: sys::Instance,
        string: *const c_char,
        path: *mut sys::Path,
    ) {
        world.instance(instance)?;
        // SAFETY: the arguments are those of the function.
        let string = unsafe { text(string) }?;
        let fits = |byte: u8| {
            byte.is_ascii_lowercase() || byte.is_ascii_digit() || b"-_./".contains(&byte)
        };
        if !string.starts_with('/') || string.ends_with('/') || !string.bytes().all(fits) {
            return Err(R::ERROR_PATH_FORMAT_INVALID);
        }
        let known = world.paths.iter().position(|known| known == string);
        let index = known.unwrap_or_else(|| {
            world.paths.push(string.to_owned());
            world.paths.len() - 1
        });
        // SAFETY: the arguments are those of the function.
        *unsafe { place(path) }? = sys::Path::from_raw(index as u64 + 1);
        Ok(R::SUCCESS)
    }

    fn path_to_string(
        world,
        instance: sys::Instance,
        path: sys::Path,
        capacity: u32,
        count: *mut u32,
        buffer: *mut c_char,
    ) {
        world.instance(instance)?;
        let mut bytes = world.path(path)?.as_bytes().to_vec();
        bytes.push(0);
        let write = |out: &mut c_char, byte: &u8| *out = *byte as c_char;
        // SAFETY: the arguments are those of the function.
        unsafe { list(&bytes, capacity, count, buffer, write) }
    }

    fn result_to_string(
        world,
        instance: sys::Instance,
        result: sys::Result,
        buffer: *mut c_char,
    ) {
        world.instance(instance)?;
        // SAFETY: the function's buffer is of this size.
        let out = unsafe {
            std::slice::from_raw_parts_mut(buffer, sys::MAX_RESULT_STRING_SIZE)
        };
        write_text(out, &format!("{result:?}"));
        Ok(R::SUCCESS)
    }
}

pub(super) fn known(system: sys::SystemId) -> Result<(), R> {
    if system.into_raw() == SYSTEM {
        Ok(())
    } else {
        Err(R::ERROR_SYSTEM_INVALID)
    }
}

pub(super) fn stereo(kind: sys::ViewConfigurationType) -> Result<(), R> {
    if kind == sys::ViewConfigurationType::PRIMARY_STEREO {
        Ok(())
    } else {
        Err(R::ERROR_VIEW_CONFIGURATION_TYPE_UNSUPPORTED)
    }
}

unsafe fn list_views(
    sizes: &[[u32; 2]],
    capacity: u32,
    count: *mut u32,
    views: *mut sys::ViewConfigurationView,
) -> Result<R, R> {
    let write = |out: &mut sys::ViewConfigurationView, [width, height]: &[u32; 2]| {
        out.recommended_image_rect_width = *width;
        out.recommended_image_rect_height = *height;
        out.max_image_rect_width = LARGEST;
        out.max_image_rect_height = LARGEST;
        out.recommended_swapchain_sample_count = 1;
        out.max_swapchain_sample_count = 4;
    };
    // SAFETY: as the caller says.
    unsafe { list(sizes, capacity, count, views, write) }
}
