//! Swapchains: acquired, waited for, released, in this order.

use std::collections::VecDeque;

use ash::vk::Handle as _;
use openxr_sys as sys;
use sys::Result as R;

use super::{api, input, list, place};
use crate::world::{Swapchain, World};

/// Images of a swapchain.
const IMAGES: usize = 3;

api! {
    fn swapchain_formats(
        world,
        session: sys::Session,
        capacity: u32,
        count: *mut u32,
        formats: *mut i64,
    ) {
        world.session(session)?;
        let all = &world.script.headset.formats;
        // SAFETY: the arguments are those of the function.
        unsafe { list(all, capacity, count, formats, |out, format| *out = *format) }
    }

    fn create_swapchain(
        world,
        session: sys::Session,
        info: *const sys::SwapchainCreateInfo,
        swapchain: *mut sys::Swapchain,
    ) {
        // SAFETY: the arguments are those of the function.
        let info = unsafe { input(info, sys::SwapchainCreateInfo::TYPE) }?;
        if !world.script.headset.formats.contains(&info.format) {
            return Err(R::ERROR_SWAPCHAIN_FORMAT_UNSUPPORTED);
        }
        if info.width == 0 || info.height == 0 || info.width > 8192 || info.height > 8192 {
            return Err(R::ERROR_SIZE_INSUFFICIENT);
        }
        if info.face_count != 1 || info.sample_count != 1 || info.array_size == 0 {
            return Err(R::ERROR_FEATURE_UNSUPPORTED);
        }
        let session = world.session(session)?;
        let pictures = (0..IMAGES)
            .map(|_| session.gpu.picture(info))
            .collect::<Result<Vec<_>, R>>()?;
        let handle = world.handle();
        world.log.swapchains.push((info.format, info.width, info.height));
        world.swapchains.insert(handle, Swapchain {
            format: info.format,
            size: [info.width, info.height],
            layers: info.array_size,
            pictures,
            acquired: VecDeque::new(),
            waited: false,
            released: None,
            next: 0,
        });
        // SAFETY: the arguments are those of the function.
        *unsafe { place(swapchain) }? = sys::Swapchain::from_raw(handle);
        Ok(R::SUCCESS)
    }

    fn destroy_swapchain(world, swapchain: sys::Swapchain) {
        if destroy(world, swapchain) {
            Ok(R::SUCCESS)
        } else {
            Err(R::ERROR_HANDLE_INVALID)
        }
    }

    fn swapchain_images(
        world,
        swapchain: sys::Swapchain,
        capacity: u32,
        count: *mut u32,
        images: *mut sys::SwapchainImageBaseHeader,
    ) {
        let swapchain = world.swapchains.get(&swapchain).ok_or(R::ERROR_HANDLE_INVALID)?;
        let images = images.cast::<sys::SwapchainImageVulkanKHR>();
        // SAFETY: the arguments are those of the function.
        unsafe {
            list(&swapchain.pictures, capacity, count, images, |out, picture| {
                out.image = picture.image.as_raw();
            })
        }
    }

    fn acquire_image(
        world,
        swapchain: sys::Swapchain,
        _info: *const sys::SwapchainImageAcquireInfo,
        index: *mut u32,
    ) {
        world.any_session()?;
        let swapchain = world.swapchains.get_mut(&swapchain).ok_or(R::ERROR_HANDLE_INVALID)?;
        if swapchain.acquired.len() == IMAGES {
            return Err(R::ERROR_CALL_ORDER_INVALID);
        }
        let next = swapchain.next;
        swapchain.next = (next + 1) % IMAGES as u32;
        swapchain.acquired.push_back(next);
        // SAFETY: the arguments are those of the function.
        *unsafe { place(index) }? = next;
        Ok(R::SUCCESS)
    }

    fn wait_image(
        world,
        swapchain: sys::Swapchain,
        info: *const sys::SwapchainImageWaitInfo,
    ) {
        // SAFETY: the arguments are those of the function.
        unsafe { input(info, sys::SwapchainImageWaitInfo::TYPE) }?;
        world.any_session()?;
        let World { session, swapchains, .. } = world;
        let swapchain = swapchains.get_mut(&swapchain).ok_or(R::ERROR_HANDLE_INVALID)?;
        let (Some(first), false) = (swapchain.acquired.front(), swapchain.waited) else {
            return Err(R::ERROR_CALL_ORDER_INVALID);
        };
        let session = session.as_ref().ok_or(R::ERROR_HANDLE_INVALID)?;
        session.gpu.wait(&mut swapchain.pictures[*first as usize])?;
        swapchain.waited = true;
        Ok(R::SUCCESS)
    }

    fn release_image(
        world,
        swapchain: sys::Swapchain,
        _info: *const sys::SwapchainImageReleaseInfo,
    ) {
        world.any_session()?;
        let World { session, swapchains, .. } = world;
        let swapchain = swapchains.get_mut(&swapchain).ok_or(R::ERROR_HANDLE_INVALID)?;
        if !std::mem::take(&mut swapchain.waited) {
            return Err(R::ERROR_CALL_ORDER_INVALID);
        }
        let index = swapchain.acquired.pop_front().ok_or(R::ERROR_CALL_ORDER_INVALID)?;
        let session = session.as_ref().ok_or(R::ERROR_HANDLE_INVALID)?;
        session.gpu.release(&mut swapchain.pictures[index as usize])?;
        swapchain.released = Some(index);
        Ok(R::SUCCESS)
    }
}

pub(super) fn destroy(world: &mut World, swapchain: u64) -> bool {
    let Some(swapchain) = world.swapchains.remove(&swapchain) else {
        return false;
    };
    if let Some(session) = &world.session {
        session.gpu.destroy(swapchain.pictures);
    }
    true
}
