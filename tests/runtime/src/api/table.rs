//! Which name is which function.

use std::ffi::c_char;

use openxr_sys as sys;
use sys::pfn::VoidFunction;
use sys::{Handle as _, Result as R};

use super::{actions, events, frame, instance, session, space, swapchain, text, vulkan};

/// What an application gets that asks for a function which the runtime knows
/// and does not do: haptics and names for people.
unsafe extern "system" fn unsupported() -> R {
    R::ERROR_FUNCTION_UNSUPPORTED
}

/// Functions that need no instance.
const GLOBAL: [&str; 3] = [
    "xrCreateInstance",
    "xrEnumerateInstanceExtensionProperties",
    "xrEnumerateApiLayerProperties",
];

pub(crate) unsafe extern "system" fn get_instance_proc_addr(
    instance: sys::Instance,
    name: *const c_char,
    function: *mut Option<VoidFunction>,
) -> R {
    // SAFETY: the arguments are those of the function.
    let (Ok(name), Some(out)) = (unsafe { text(name) }, unsafe { function.as_mut() }) else {
        return R::ERROR_VALIDATION_FAILURE;
    };
    *out = None;
    if instance == sys::Instance::NULL && !GLOBAL.contains(&name) {
        return R::ERROR_HANDLE_INVALID;
    }
    *out = find(name);
    if out.is_some() {
        R::SUCCESS
    } else {
        R::ERROR_FUNCTION_UNSUPPORTED
    }
}

fn find(name: &str) -> Option<VoidFunction> {
    macro_rules! functions {
        ($($known:literal => $function:expr, $kind:ident;)*) => {
            match name {
                $($known => {
                    let function: sys::pfn::$kind = $function;
                    // SAFETY: whoever asks for this name calls it as this type.
                    Some(unsafe { std::mem::transmute::<sys::pfn::$kind, VoidFunction>(function) })
                })*
                "xrApplyHapticFeedback" | "xrStopHapticFeedback" | "xrGetActionStateFloat"
                | "xrEnumerateBoundSourcesForAction" | "xrGetInputSourceLocalizedName"
                | "xrStructureTypeToString" => {
                    // SAFETY: with the C convention, arguments that are not read do no harm.
                    Some(unsafe {
                        std::mem::transmute::<unsafe extern "system" fn() -> R, VoidFunction>(
                            unsupported,
                        )
                    })
                }
                _ => None,
            }
        };
    }
    functions! {
        "xrGetInstanceProcAddr" => get_instance_proc_addr, GetInstanceProcAddr;
        "xrEnumerateInstanceExtensionProperties" => instance::enumerate_extensions, EnumerateInstanceExtensionProperties;
        "xrEnumerateApiLayerProperties" => instance::enumerate_layers, EnumerateApiLayerProperties;
        "xrCreateInstance" => instance::create_instance, CreateInstance;
        "xrDestroyInstance" => instance::destroy_instance, DestroyInstance;
        "xrGetInstanceProperties" => instance::instance_properties, GetInstanceProperties;
        "xrResultToString" => instance::result_to_string, ResultToString;
        "xrStringToPath" => instance::string_to_path, StringToPath;
        "xrPathToString" => instance::path_to_string, PathToString;
        "xrGetSystem" => instance::get_system, GetSystem;
        "xrGetSystemProperties" => instance::system_properties, GetSystemProperties;
        "xrEnumerateViewConfigurations" => instance::view_configurations, EnumerateViewConfigurations;
        "xrGetViewConfigurationProperties" => instance::view_configuration_properties, GetViewConfigurationProperties;
        "xrEnumerateViewConfigurationViews" => instance::view_configuration_views, EnumerateViewConfigurationViews;
        "xrEnumerateEnvironmentBlendModes" => instance::blend_modes, EnumerateEnvironmentBlendModes;
        "xrGetVulkanGraphicsRequirements2KHR" => vulkan::graphics_requirements, GetVulkanGraphicsRequirements2KHR;
        "xrCreateVulkanInstanceKHR" => vulkan::create_vulkan_instance, CreateVulkanInstanceKHR;
        "xrGetVulkanGraphicsDevice2KHR" => vulkan::graphics_device, GetVulkanGraphicsDevice2KHR;
        "xrCreateVulkanDeviceKHR" => vulkan::create_vulkan_device, CreateVulkanDeviceKHR;
        "xrCreateSession" => session::create_session, CreateSession;
        "xrDestroySession" => session::destroy_session, DestroySession;
        "xrBeginSession" => session::begin_session, BeginSession;
        "xrEndSession" => session::end_session, EndSession;
        "xrRequestExitSession" => session::request_exit, RequestExitSession;
        "xrEnumerateDisplayRefreshRatesFB" => session::display_rates, EnumerateDisplayRefreshRatesFB;
        "xrGetDisplayRefreshRateFB" => session::display_rate, GetDisplayRefreshRateFB;
        "xrRequestDisplayRefreshRateFB" => session::request_display_rate, RequestDisplayRefreshRateFB;
        "xrEnumerateSwapchainFormats" => swapchain::swapchain_formats, EnumerateSwapchainFormats;
        "xrCreateSwapchain" => swapchain::create_swapchain, CreateSwapchain;
        "xrDestroySwapchain" => swapchain::destroy_swapchain, DestroySwapchain;
        "xrEnumerateSwapchainImages" => swapchain::swapchain_images, EnumerateSwapchainImages;
        "xrAcquireSwapchainImage" => swapchain::acquire_image, AcquireSwapchainImage;
        "xrWaitSwapchainImage" => swapchain::wait_image, WaitSwapchainImage;
        "xrReleaseSwapchainImage" => swapchain::release_image, ReleaseSwapchainImage;
        "xrEnumerateReferenceSpaces" => space::reference_spaces, EnumerateReferenceSpaces;
        "xrCreateReferenceSpace" => space::create_reference_space, CreateReferenceSpace;
        "xrGetReferenceSpaceBoundsRect" => space::bounds_rect, GetReferenceSpaceBoundsRect;
        "xrCreateActionSpace" => space::create_action_space, CreateActionSpace;
        "xrDestroySpace" => space::destroy_space, DestroySpace;
        "xrLocateSpace" => space::locate_space, LocateSpace;
        "xrLocateViews" => space::locate_views, LocateViews;
        "xrWaitFrame" => frame::wait_frame, WaitFrame;
        "xrBeginFrame" => frame::begin_frame, BeginFrame;
        "xrEndFrame" => frame::end_frame, EndFrame;
        "xrPollEvent" => events::poll_event, PollEvent;
        "xrConvertTimespecTimeToTimeKHR" => events::time_from_timespec, ConvertTimespecTimeToTimeKHR;
        "xrConvertTimeToTimespecTimeKHR" => events::timespec_from_time, ConvertTimeToTimespecTimeKHR;
        "xrCreateActionSet" => actions::create_action_set, CreateActionSet;
        "xrDestroyActionSet" => actions::destroy_action_set, DestroyActionSet;
        "xrCreateAction" => actions::create_action, CreateAction;
        "xrDestroyAction" => actions::destroy_action, DestroyAction;
        "xrSuggestInteractionProfileBindings" => actions::suggest_bindings, SuggestInteractionProfileBindings;
        "xrAttachSessionActionSets" => actions::attach_sets, AttachSessionActionSets;
        "xrGetCurrentInteractionProfile" => actions::current_profile, GetCurrentInteractionProfile;
        "xrSyncActions" => actions::sync_actions, SyncActions;
        "xrGetActionStateBoolean" => actions::state_boolean, GetActionStateBoolean;
        "xrGetActionStateVector2f" => actions::state_vector, GetActionStateVector2f;
        "xrGetActionStatePose" => actions::state_pose, GetActionStatePose;
    }
}
