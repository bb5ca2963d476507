//! Sessions: their device, their states and the rate of their display.

use ash::vk::{self, Handle as _};
use openxr_sys as sys;
use sys::{Result as R, SessionState};

use super::instance::{known, stereo};
use super::{api, input, list, place};
use crate::images::{Gpu, raw};
use crate::world::{Event, Session, Then, World};

/// What the display can be asked for, pictures a second.
const RATES: [f32; 3] = [72.0, 90.0, 120.0];

api! {
    fn create_session(
        world,
        instance: sys::Instance,
        info: *const sys::SessionCreateInfo,
        session: *mut sys::Session,
    ) {
        // SAFETY: the arguments are those of the function.
        let info = unsafe { input(info, sys::SessionCreateInfo::TYPE) }?;
        known(info.system_id)?;
        if world.session.is_some() {
            return Err(R::ERROR_LIMIT_REACHED);
        }
        let instance = world.instance(instance)?;
        if !instance.requirements_asked {
            return Err(R::ERROR_GRAPHICS_REQUIREMENTS_CALL_MISSING);
        }
        let binding = info.next.cast::<sys::GraphicsBindingVulkanKHR>();
        // SAFETY: a struct in the chain, or null.
        let binding = unsafe { input(binding, sys::GraphicsBindingVulkanKHR::TYPE) }
            .map_err(|_| R::ERROR_GRAPHICS_DEVICE_INVALID)?;
        let vulkan = instance.vulkan.as_ref().ok_or(R::ERROR_GRAPHICS_DEVICE_INVALID)?;
        let device = vulkan.device.ok_or(R::ERROR_GRAPHICS_DEVICE_INVALID)?;
        let same = vulkan.instance.handle().as_raw() == binding.instance as u64
            && raw(vulkan.physical) == binding.physical_device as u64
            && raw(device) == binding.device as u64;
        if !same {
            return Err(R::ERROR_GRAPHICS_DEVICE_INVALID);
        }
        let (family, index) = (binding.queue_family_index, binding.queue_index);
        // SAFETY: the device is the one that was created here.
        let gpu = unsafe { Gpu::new(vulkan, vk::Device::from_raw(raw(device)), family, index) }?;
        let handle = world.handle();
        world.session = Some(Session {
            handle,
            gpu,
            state: SessionState::UNKNOWN,
            running: false,
            lost: false,
            attached: None,
            waited: None,
            begun: None,
            last_shown: 0,
            hidden: 0,
            blind: 0,
            untracked: 0,
            refuse: None,
            then: Then::Stay,
        });
        world.log.sessions += 1;
        world.announce(SessionState::IDLE);
        world.announce(SessionState::READY);
        // SAFETY: the arguments are those of the function.
        *unsafe { place(session) }? = sys::Session::from_raw(handle);
        Ok(R::SUCCESS)
    }

    fn destroy_session(world, session: sys::Session) {
        if !world.swapchains.is_empty() {
            // An application that leaves its swapchains to their session.
            let names: Vec<_> = world.swapchains.keys().copied().collect();
            for name in names {
                super::swapchain::destroy(world, name);
            }
        }
        if world.session.take_if(|it| it.handle == session).is_none() {
            return Err(R::ERROR_HANDLE_INVALID);
        }
        world.spaces.clear();
        Ok(R::SUCCESS)
    }

    fn begin_session(world, session: sys::Session, info: *const sys::SessionBeginInfo) {
        let session = world.session(session)?;
        // SAFETY: the arguments are those of the function.
        let info = unsafe { input(info, sys::SessionBeginInfo::TYPE) }?;
        if session.running {
            return Err(R::ERROR_SESSION_RUNNING);
        }
        if session.state != SessionState::READY {
            return Err(R::ERROR_SESSION_NOT_READY);
        }
        stereo(info.primary_view_configuration_type)?;
        session.running = true;
        Ok(R::SUCCESS)
    }

    fn end_session(world, session: sys::Session) {
        let session = world.session(session)?;
        if !session.running {
            return Err(R::ERROR_SESSION_NOT_RUNNING);
        }
        if session.state != SessionState::STOPPING {
            return Err(R::ERROR_SESSION_NOT_STOPPING);
        }
        session.running = false;
        session.waited = None;
        session.begun = None;
        let then = session.then;
        world.announce(SessionState::IDLE);
        if then == Then::Exit {
            world.announce(SessionState::EXITING);
        }
        Ok(R::SUCCESS)
    }

    fn request_exit(world, session: sys::Session) {
        if !world.session(session)?.running {
            return Err(R::ERROR_SESSION_NOT_RUNNING);
        }
        stop(world, Then::Exit);
        Ok(R::SUCCESS)
    }

    fn display_rates(
        world,
        session: sys::Session,
        capacity: u32,
        count: *mut u32,
        rates: *mut f32,
    ) {
        world.session(session)?;
        // SAFETY: the arguments are those of the function.
        unsafe { list(&RATES, capacity, count, rates, |out, rate| *out = *rate) }
    }

    fn display_rate(world, session: sys::Session, rate: *mut f32) {
        world.session(session)?;
        // SAFETY: the arguments are those of the function.
        *unsafe { place(rate) }? = world.rate;
        Ok(R::SUCCESS)
    }

    fn request_display_rate(world, session: sys::Session, rate: f32) {
        world.session(session)?;
        if !RATES.contains(&rate) {
            return Err(R::ERROR_DISPLAY_REFRESH_RATE_UNSUPPORTED_FB);
        }
        world.log.rates.push(rate);
        change_rate(world, rate);
        Ok(R::SUCCESS)
    }
}

pub(super) fn change_rate(world: &mut World, rate: f32) {
    if rate != world.rate {
        world.events.push_back(Event::Rate(world.rate, rate));
        world.rate = rate;
    }
}

/// The application is no longer shown; `then` follows when it has ended its session.
pub(super) fn stop(world: &mut World, then: Then) {
    if let Some(session) = &mut world.session {
        session.then = then;
    }
    for state in [
        SessionState::VISIBLE,
        SessionState::SYNCHRONIZED,
        SessionState::STOPPING,
    ] {
        world.announce(state);
    }
}
