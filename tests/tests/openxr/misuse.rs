//! The simulated runtime shows no mercy: what breaks a rule earns the error
//! code of the specification. Otherwise the other tests would prove little.

use ash::vk::{self, Handle};
use shadecast_client::openxr::api::{self as xr, Vulkan, sys};
use shadecast_client::render::vulkan::{Extras, VkHost, VulkanError, VulkanGpu};
use shadecast_simulated_runtime::{Runtime, Script};
use sys::Result as R;

/// Creates what the runtime wants, as the client does.
struct Host<'a>(&'a xr::Instance, xr::SystemId);

fn gave<T>(created: xr::Result<Result<T, i32>>) -> Result<T, VulkanError> {
    let created = created.map_err(|result| VulkanError::Host(result.to_string()))?;
    created.map_err(|result| VulkanError::Host(result.to_string()))
}

fn loader(entry: &ash::Entry) -> sys::platform::VkGetInstanceProcAddr {
    // SAFETY: both are `PFN_vkGetInstanceProcAddr`.
    unsafe { std::mem::transmute(entry.static_fn().get_instance_proc_addr) }
}

// SAFETY: the runtime creates the objects from the very descriptions.
unsafe impl VkHost for Host<'_> {
    fn create_instance(
        &mut self,
        entry: &ash::Entry,
        info: &vk::InstanceCreateInfo<'_>,
    ) -> Result<vk::Instance, VulkanError> {
        let info = std::ptr::from_ref(info).cast();
        // SAFETY: the description is whole.
        let created = unsafe { self.0.create_vulkan_instance(self.1, loader(entry), info) };
        Ok(vk::Instance::from_raw(gave(created)? as u64))
    }

    fn physical_device(&mut self, it: &ash::Instance) -> Result<vk::PhysicalDevice, VulkanError> {
        let instance = it.handle().as_raw() as sys::platform::VkInstance;
        // SAFETY: the instance is the runtime's.
        let device = unsafe { self.0.vulkan_graphics_device(self.1, instance) };
        Ok(vk::PhysicalDevice::from_raw(gave(device.map(Ok))? as u64))
    }

    fn create_device(
        &mut self,
        entry: &ash::Entry,
        _: &ash::Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> Result<vk::Device, VulkanError> {
        let physical = physical.as_raw() as sys::platform::VkPhysicalDevice;
        let info = std::ptr::from_ref(info).cast();
        // SAFETY: the description is whole and for this device.
        let created = unsafe {
            self.0
                .create_vulkan_device(self.1, loader(entry), physical, info)
        };
        Ok(vk::Device::from_raw(gave(created)? as u64))
    }
}

#[track_caller]
fn earns<T>(call: xr::Result<T>, error: R) {
    assert_eq!(call.err(), Some(error));
}

fn instance(runtime: &Runtime) -> (xr::Instance, xr::SystemId) {
    // SAFETY: the simulation answers as OpenXR says.
    let entry = unsafe { xr::Entry::from_get_instance_proc_addr(runtime.entry(), &()) };
    let mut extensions = xr::ExtensionSet::default();
    extensions.khr_vulkan_enable2 = true;
    let application = xr::ApplicationInfo {
        application_name: "misuse",
        api_version: xr::Version::new(1, 0, 0),
        ..xr::ApplicationInfo::default()
    };
    let instance = entry
        .expect("its functions")
        .create_instance(&application, &extensions, &[], &())
        .expect("an instance");
    let system = instance.system(xr::FormFactor::HEAD_MOUNTED_DISPLAY);
    (instance, system.expect("a headset"))
}

#[test]
fn instances_and_systems_are_asked_for_rightly_or_not_at_all() {
    let runtime = Runtime::new(Script::default());
    let (instance, system) = instance(&runtime);
    earns(
        instance.system(xr::FormFactor::HANDHELD_DISPLAY),
        R::ERROR_FORM_FACTOR_UNSUPPORTED,
    );
    let mono = xr::ViewConfigurationType::PRIMARY_MONO;
    earns(
        instance.enumerate_view_configuration_views(system, mono),
        R::ERROR_VIEW_CONFIGURATION_TYPE_UNSUPPORTED,
    );
    earns(
        instance.system_properties(xr::SystemId::from_raw(7)),
        R::ERROR_SYSTEM_INVALID,
    );
    earns(
        instance.string_to_path("no/slash"),
        R::ERROR_PATH_FORMAT_INVALID,
    );
    earns(
        instance.path_to_string(xr::Path::from_raw(99)),
        R::ERROR_PATH_INVALID,
    );
    let nothing = xr::vulkan::SessionCreateInfo {
        instance: std::ptr::null(),
        physical_device: std::ptr::null(),
        device: std::ptr::null(),
        queue_family_index: 0,
        queue_index: 0,
    };
    // SAFETY: nothing is read of what is not there.
    let session = unsafe { instance.create_session::<Vulkan>(system, &nothing) };
    earns(
        session.map(drop),
        R::ERROR_GRAPHICS_REQUIREMENTS_CALL_MISSING,
    );
    assert_eq!(runtime.log().broken_rules().len(), 6);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn frames_images_and_layers_keep_their_order_and_their_bounds() {
    let runtime = Runtime::new(Script::default());
    let (instance, system) = instance(&runtime);
    instance
        .graphics_requirements::<Vulkan>(system)
        .expect("requirements");
    let gpu = VulkanGpu::open(&mut Host(&instance, system), &Extras::default()).expect("a device");
    let binding = xr::vulkan::SessionCreateInfo {
        instance: gpu.instance.as_raw() as _,
        physical_device: gpu.physical.as_raw() as _,
        device: gpu.device.as_raw() as _,
        queue_family_index: gpu.queue_family,
        queue_index: 0,
    };
    // SAFETY: the device outlives the session.
    let session = unsafe { instance.create_session::<Vulkan>(system, &binding) };
    let (session, mut waiter, mut stream) = session.expect("a session");
    let stereo = xr::ViewConfigurationType::PRIMARY_STEREO;

    earns(waiter.wait(), R::ERROR_SESSION_NOT_RUNNING);
    earns(session.end(), R::ERROR_SESSION_NOT_RUNNING);
    earns(session.request_exit(), R::ERROR_SESSION_NOT_RUNNING);
    session.begin(stereo).expect("it is ready");
    earns(session.begin(stereo), R::ERROR_SESSION_RUNNING);
    earns(session.end(), R::ERROR_SESSION_NOT_STOPPING);

    let base = session
        .create_reference_space(xr::ReferenceSpaceType::STAGE, xr::Posef::IDENTITY)
        .expect("a floor");
    earns(
        session.create_reference_space(xr::ReferenceSpaceType::STAGE, xr::Posef::default()),
        R::ERROR_POSE_INVALID,
    );
    let never = xr::Time::from_nanos(0);
    earns(
        session.locate_views(stereo, never, &base),
        R::ERROR_TIME_INVALID,
    );
    let set = instance.create_action_set("set", "Set", 0).expect("a set");
    earns(
        session.sync_actions(&[xr::ActiveActionSet::new(&set)]),
        R::ERROR_ACTIONSET_NOT_ATTACHED,
    );
    session.attach_action_sets(&[&set]).expect("once");
    earns(
        session.attach_action_sets(&[&set]),
        R::ERROR_ACTIONSETS_ALREADY_ATTACHED,
    );

    let mut description = xr::SwapchainCreateInfo {
        create_flags: xr::SwapchainCreateFlags::EMPTY,
        usage_flags: xr::SwapchainUsageFlags::COLOR_ATTACHMENT,
        format: 43,
        sample_count: 1,
        width: 32,
        height: 16,
        face_count: 1,
        array_size: 2,
        mip_count: 1,
    };
    let mut swapchain = session
        .create_swapchain(&description)
        .expect("it is offered");
    description.format = 44;
    earns(
        session.create_swapchain(&description),
        R::ERROR_SWAPCHAIN_FORMAT_UNSUPPORTED,
    );
    earns(
        swapchain.wait_image(xr::Duration::INFINITE),
        R::ERROR_CALL_ORDER_INVALID,
    );
    for _ in 0..3 {
        swapchain.acquire_image().expect("there are three");
    }
    earns(swapchain.acquire_image(), R::ERROR_CALL_ORDER_INVALID);

    let opaque = xr::EnvironmentBlendMode::OPAQUE;
    earns(stream.begin(), R::ERROR_CALL_ORDER_INVALID);
    let time = waiter.wait().expect("it runs").predicted_display_time;
    earns(stream.end(time, opaque, &[]), R::ERROR_CALL_ORDER_INVALID);
    stream.begin().expect("it was waited for");
    earns(stream.end(never, opaque, &[]), R::ERROR_TIME_INVALID);
    let additive = xr::EnvironmentBlendMode::ADDITIVE;
    earns(
        stream.end(time, additive, &[]),
        R::ERROR_ENVIRONMENT_BLEND_MODE_UNSUPPORTED,
    );

    // A layer whose every part can be wrong.
    let mut end = |swapchain: &xr::Swapchain<Vulkan>, array: u32, width: i32, pose: xr::Posef| {
        let part = || {
            xr::SwapchainSubImage::new()
                .swapchain(swapchain)
                .image_array_index(array)
                .image_rect(xr::Rect2Di {
                    offset: xr::Offset2Di { x: 1, y: 0 },
                    extent: xr::Extent2Di { width, height: 16 },
                })
        };
        let view = || {
            xr::CompositionLayerProjectionView::new()
                .pose(pose)
                .sub_image(part())
        };
        let views = [view(), view()];
        let layer = xr::CompositionLayerProjection::new()
            .space(&base)
            .views(&views);
        stream.end(time, opaque, &[&layer])
    };
    let straight = xr::Posef::IDENTITY;
    earns(end(&swapchain, 0, 31, straight), R::ERROR_LAYER_INVALID);
    swapchain
        .wait_image(xr::Duration::INFINITE)
        .expect("it was acquired");
    swapchain.release_image().expect("it was waited for");
    earns(
        end(&swapchain, 0, 32, straight),
        R::ERROR_SWAPCHAIN_RECT_INVALID,
    );
    earns(
        end(&swapchain, 2, 31, straight),
        R::ERROR_VALIDATION_FAILURE,
    );
    earns(
        end(&swapchain, 0, 31, xr::Posef::default()),
        R::ERROR_POSE_INVALID,
    );
    // The frame has stayed begun through all of it.
    end(&swapchain, 1, 31, straight).expect("nothing is wrong with it");
    assert_eq!(runtime.log().frames.len(), 1);
    gpu.gpu
        .device
        .poll(wgpu::PollType::wait_indefinitely())
        .expect("the device answers");
    drop((swapchain, set, base, waiter, stream, session));
    drop(gpu);
}
