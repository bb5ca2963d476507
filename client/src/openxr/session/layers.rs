//! What a frame ends with: the pictures of both eyes, and their depth.

use ::openxr as xr;
use xr::sys;

use super::RuntimeSession;
use crate::openxr::HeadsetError;
use crate::openxr::error::refused;
use crate::openxr::space::EyeLocation;
use crate::openxr::swapchain::Swapchain;
use crate::render::NEAR;

impl RuntimeSession {
    /// Ends the frame that was begun: with both eyes where they were drawn, or
    /// with nothing.
    pub(super) fn end(
        &mut self,
        time: xr::Time,
        eyes: Option<&[EyeLocation; 2]>,
    ) -> Result<(), HeadsetError> {
        let ended = match eyes {
            None => self.stream.end(time, xr::EnvironmentBlendMode::OPAQUE, &[]),
            Some(eyes) => {
                let near_and_far =
                    |depth: &Swapchain, eye: u32| sys::CompositionLayerDepthInfoKHR {
                        ty: sys::CompositionLayerDepthInfoKHR::TYPE,
                        next: std::ptr::null(),
                        sub_image: *depth.part(eye).as_raw(),
                        min_depth: 0.0,
                        max_depth: 1.0,
                        // Reversed: depth 0 is infinitely far, depth 1 is near.
                        near_z: f32::INFINITY,
                        far_z: NEAR,
                    };
                let depths = self
                    .depth
                    .as_ref()
                    .map(|depth| [near_and_far(depth, 0), near_and_far(depth, 1)]);
                let view = |eye: usize| {
                    let (pose, fov) = eyes[eye].raw;
                    let mut raw = xr::CompositionLayerProjectionView::new()
                        .pose(pose)
                        .fov(fov)
                        .sub_image(self.color.part(eye as u32))
                        .into_raw();
                    if let Some(depths) = &depths {
                        raw.next = std::ptr::from_ref(&depths[eye]).cast();
                    }
                    // SAFETY: the swapchains and `depths` outlive the call below.
                    unsafe { xr::CompositionLayerProjectionView::from_raw(raw) }
                };
                let views = [view(0), view(1)];
                let layer = xr::CompositionLayerProjection::new()
                    .space(&self.base)
                    .views(&views);
                let mode = xr::EnvironmentBlendMode::OPAQUE;
                self.stream.end(time, mode, &[&layer])
            }
        };
        ended.map_err(refused("does not take a frame"))
    }
}
