//! The way to a session: runtime, headset, device, swapchains, spaces, actions.

use ::openxr as xr;
use ash::vk::Handle;
use xr::sys;

use super::RuntimeSession;
use crate::openxr::error::refused;
use crate::openxr::hands::Hands;
use crate::openxr::host::XrHost;
use crate::openxr::lifecycle::LifeCycle;
use crate::openxr::swapchain::Swapchain;
use crate::openxr::{HeadsetConfig, HeadsetError, Offers};
use crate::render::vulkan::VulkanGpu;
use crate::render::{Renderer, RendererConfig};

/// What the renderer is written for.
const VULKAN: xr::Version = xr::Version::new(1, 3, 0);
/// Least and most pixels of an eye's picture, each way: those of a view report.
const EYE_SIDES: std::ops::RangeInclusive<u32> = 16..=8192;
/// Height of a standing person's eyes, metres, where the runtime knows no floor.
const EYE_HEIGHT: f32 = 1.6;

impl RuntimeSession {
    /// A session that has not begun.
    pub(in crate::openxr) fn open(
        entry: &xr::Entry,
        platform: &impl xr::PlatformInfo,
        config: &mut HeadsetConfig,
    ) -> Result<Self, HeadsetError> {
        let extensions = entry
            .enumerate_extensions()
            .map_err(HeadsetError::NoRuntime)?;
        if !extensions.khr_vulkan_enable2 {
            return Err(HeadsetError::NoVulkan);
        }
        let (instance, mut offers) = create_instance(entry, platform, Offers::of(&extensions))?;
        let system = instance
            .system(xr::FormFactor::HEAD_MOUNTED_DISPLAY)
            .map_err(HeadsetError::NoHeadset)?;
        let eye_size = eye_size(&instance, system)?;
        let requirements = instance
            .graphics_requirements::<xr::Vulkan>(system)
            .map_err(refused("does not tell which Vulkan it needs"))?;
        if requirements.min_api_version_supported > VULKAN {
            return Err(HeadsetError::VulkanVersion(
                requirements.min_api_version_supported,
            ));
        }
        let mut host = XrHost {
            instance: &instance,
            system,
        };
        let vulkan = VulkanGpu::open_with(&mut host, &config.extras, config.stereo)?;
        let binding = xr::vulkan::SessionCreateInfo {
            instance: vulkan.instance.as_raw() as _,
            physical_device: vulkan.physical.as_raw() as _,
            device: vulkan.device.as_raw() as _,
            queue_family_index: vulkan.queue_family,
            queue_index: 0,
        };
        // SAFETY: instance and device are those that the runtime created; they
        // are dropped after the session.
        let (session, waiter, stream) =
            unsafe { instance.create_session::<xr::Vulkan>(system, &binding) }
                .map_err(refused("gave no session"))?;

        let color = Swapchain::color(&session, &vulkan.gpu.device, eye_size)?;
        let renderer_config = RendererConfig {
            eye_size,
            eye_format: color.format,
            stereo: vulkan.gpu.stereo,
            antialias: config.antialias,
        };
        let depth = if offers.depth {
            let size = renderer_config.drawn_size();
            Swapchain::depth(&session, &vulkan.gpu.device, size)?
        } else {
            None
        };
        offers.depth = depth.is_some();
        let mut renderer = Renderer::new(&vulkan.gpu.device, &vulkan.gpu.queue, renderer_config);
        if let Some(hook) = &mut config.on_device {
            hook(&vulkan, &mut renderer);
        }
        let space = |kind, pose| {
            session
                .create_reference_space(kind, pose)
                .map_err(refused("has no space to stand in"))
        };
        let (kind, offset) = play_space(&session, offers)?;
        let base = space(kind, offset)?;
        let head = space(xr::ReferenceSpaceType::VIEW, xr::Posef::IDENTITY)?;
        if let Some(rate) = config.display_rate.filter(|_| offers.display_rate) {
            ask_for_rate(&session, rate);
        }
        Ok(Self {
            hands: Hands::new(&session)?,
            renderer,
            color,
            depth,
            base,
            head,
            waiter,
            stream,
            session,
            vulkan,
            instance,
            offers,
            life: LifeCycle::default(),
            events: Box::new(xr::EventDataBuffer::new()),
            is_current: false,
        })
    }
}

fn create_instance(
    entry: &xr::Entry,
    platform: &impl xr::PlatformInfo,
    offers: Offers,
) -> Result<(xr::Instance, Offers), HeadsetError> {
    let application = xr::ApplicationInfo {
        application_name: "shadecast",
        application_version: 0,
        engine_name: "shadecast",
        engine_version: 0,
        // Loaders and runtimes of 1.0 refuse 1.1, and nothing of it is needed.
        api_version: xr::Version::new(1, 0, 0),
    };
    let create = |offers: Offers| {
        let created = entry.create_instance(&application, &offers.enable(), &[], platform);
        created.map(|instance| (instance, offers))
    };
    let created = match create(offers) {
        Err(sys::Result::ERROR_EXTENSION_NOT_PRESENT) => {
            tracing::warn!("the OpenXR runtime refuses an extension that it offers");
            create(Offers::default())
        }
        created => created,
    };
    created.map_err(|result| match result {
        sys::Result::ERROR_API_VERSION_UNSUPPORTED => HeadsetError::ApiVersion,
        sys::Result::ERROR_RUNTIME_UNAVAILABLE
        | sys::Result::ERROR_RUNTIME_FAILURE
        | sys::Result::ERROR_FILE_ACCESS_ERROR
        | sys::Result::ERROR_FILE_CONTENTS_INVALID => HeadsetError::NoRuntime(result),
        _ => refused("gave no instance")(result),
    })
}

/// Pixels of the two eyes' pictures, which are layers of one.
fn eye_size(instance: &xr::Instance, system: xr::SystemId) -> Result<[u32; 2], HeadsetError> {
    let stereo = xr::ViewConfigurationType::PRIMARY_STEREO;
    let views = instance
        .enumerate_view_configuration_views(system, stereo)
        .map_err(refused("has no headset for two eyes"))?;
    let [left, right] = views[..] else {
        return Err(HeadsetError::Views(views.len()));
    };
    let largest = |of: fn(&xr::ViewConfigurationView) -> u32| of(&left).max(of(&right));
    let size = [
        largest(|view| view.recommended_image_rect_width),
        largest(|view| view.recommended_image_rect_height),
    ];
    if size.iter().all(|side| EYE_SIDES.contains(side)) {
        Ok(size)
    } else {
        Err(HeadsetError::Size(size[0], size[1]))
    }
}

/// Where the user stands: on the floor, centred anew when the user asks for it
/// if the runtime can, or at an assumed height above where there would be one.
fn play_space(
    session: &xr::Session<xr::Vulkan>,
    offers: Offers,
) -> Result<(xr::ReferenceSpaceType, xr::Posef), HeadsetError> {
    let kinds = session
        .enumerate_reference_spaces()
        .map_err(refused("has no space to stand in"))?;
    let with_floor = [
        (offers.local_floor, xr::ReferenceSpaceType::LOCAL_FLOOR_EXT),
        (true, xr::ReferenceSpaceType::STAGE),
    ];
    for (offered, kind) in with_floor {
        if offered && kinds.contains(&kind) {
            return Ok((kind, xr::Posef::IDENTITY));
        }
    }
    let mut floor = xr::Posef::IDENTITY;
    floor.position.y = -EYE_HEIGHT;
    Ok((xr::ReferenceSpaceType::LOCAL, floor))
}

/// Asks for the offered rate that is the nearest. A runtime that refuses keeps
/// its own, which every frame is told anew.
fn ask_for_rate(session: &xr::Session<xr::Vulkan>, wanted: f32) {
    let distance = |rate: &f32| (rate - wanted).abs();
    let asked = session.enumerate_display_refresh_rates().and_then(|rates| {
        let nearest = rates
            .into_iter()
            .min_by(|one, other| distance(one).total_cmp(&distance(other)));
        nearest.map_or(Ok(()), |rate| session.request_display_refresh_rate(rate))
    });
    if let Err(error) = asked {
        tracing::warn!("the display keeps its rate: {error}");
    }
}
