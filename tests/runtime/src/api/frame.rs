//! Frames: waited for, begun, ended, in this order and no other.

use openxr_sys as sys;
use sys::{Result as R, SessionState};

use super::session::{change_rate, stop};
use super::{api, input, output};
use crate::images::is_depth;
use crate::log::{DepthPart, Layer, Submitted, ViewPart};
use crate::script::Fault;
use crate::world::{Event, Then, World};
use crate::{ClockKind, pose};

/// The application is woken this many display intervals before its light.
const AHEAD: i64 = 2;
/// Most layers of a frame.
const LAYERS: u32 = 16;

api! {
    fn wait_frame(
        world,
        session: sys::Session,
        info: *const sys::FrameWaitInfo,
        state: *mut sys::FrameState,
    ) {
        if !info.is_null() {
            // SAFETY: the arguments are those of the function.
            unsafe { input(info, sys::FrameWaitInfo::TYPE) }?;
        }
        // SAFETY: the arguments are those of the function.
        let out = unsafe { output(state, sys::FrameState::TYPE) }?;
        let current = world.session(session)?;
        if !current.running {
            return Err(R::ERROR_SESSION_NOT_RUNNING);
        }
        if current.state == SessionState::LOSS_PENDING {
            current.lost = true;
            return Err(R::ERROR_SESSION_LOST);
        }
        if current.waited.is_some() {
            // It would block until another thread begins the frame.
            return Err(R::ERROR_CALL_ORDER_INVALID);
        }
        let frame = world.frame;
        world.frame += 1;
        world.log.waited += 1;
        suffer(world, frame);
        let period = world.period();
        let now = world.clock.now();
        let current = world.session(session)?;
        // The next picture of the display that there is still time for.
        let first = now + AHEAD * period;
        let late = (now + period - current.last_shown).max(0) / period.max(1);
        let next = current.last_shown + period * late.max(1);
        let shown = if current.last_shown == 0 { first } else { next };
        current.last_shown = shown;
        let visible = matches!(current.state, SessionState::VISIBLE | SessionState::FOCUSED);
        let hidden = current.hidden > 0;
        current.hidden = current.hidden.saturating_sub(1);
        let should_render = visible && !hidden;
        current.waited = Some((shown, should_render));
        world.clock.wait_until(shown - AHEAD * period);
        out.predicted_display_time = sys::Time::from_nanos(shown);
        out.predicted_display_period = sys::Duration::from_nanos(period);
        out.should_render = should_render.into();
        Ok(R::SUCCESS)
    }

    fn begin_frame(world, session: sys::Session, info: *const sys::FrameBeginInfo) {
        if !info.is_null() {
            // SAFETY: the arguments are those of the function.
            unsafe { input(info, sys::FrameBeginInfo::TYPE) }?;
        }
        let session = world.session(session)?;
        if !session.running {
            return Err(R::ERROR_SESSION_NOT_RUNNING);
        }
        let waited = session.waited.take().ok_or(R::ERROR_CALL_ORDER_INVALID)?;
        let discarded = session.begun.replace(waited).is_some();
        Ok(if discarded { R::FRAME_DISCARDED } else { R::SUCCESS })
    }

    fn end_frame(world, session: sys::Session, info: *const sys::FrameEndInfo) {
        // SAFETY: the arguments are those of the function.
        let info = unsafe { input(info, sys::FrameEndInfo::TYPE) }?;
        let current = world.session(session)?;
        if !current.running {
            return Err(R::ERROR_SESSION_NOT_RUNNING);
        }
        let (_, should_render) = current.begun.ok_or(R::ERROR_CALL_ORDER_INVALID)?;
        // A frame that is refused stays begun.
        if let Some(refusal) = current.refuse.take() {
            return Err(refusal);
        }
        let display_time = info.display_time.as_nanos();
        if display_time <= 0 {
            return Err(R::ERROR_TIME_INVALID);
        }
        if info.environment_blend_mode != sys::EnvironmentBlendMode::OPAQUE {
            return Err(R::ERROR_ENVIRONMENT_BLEND_MODE_UNSUPPORTED);
        }
        if info.layer_count > LAYERS {
            return Err(R::ERROR_LAYER_LIMIT_EXCEEDED);
        }
        let frame = world.frame - 1;
        let mut layers = Vec::new();
        for index in 0..info.layer_count as usize {
            // SAFETY: there are as many as the struct says.
            let header = unsafe { *info.layers.add(index) };
            layers.push(take_layer(world, header.cast(), frame)?);
        }
        let late = world.script.clock == ClockKind::System
            && world.clock.now() > display_time - world.period() / 4;
        world.log.late += u64::from(late);
        world.log.frames.push(Submitted {
            frame,
            display_time,
            should_render,
            layers,
        });
        let current = world.session(session)?;
        current.begun = None;
        let next = match current.state {
            SessionState::READY => SessionState::SYNCHRONIZED,
            SessionState::SYNCHRONIZED => SessionState::VISIBLE,
            SessionState::VISIBLE => SessionState::FOCUSED,
            _ => return Ok(R::SUCCESS),
        };
        world.announce(next);
        Ok(R::SUCCESS)
    }
}

/// What the script has for this frame.
fn suffer(world: &mut World, frame: u64) {
    let due = |(at, _): &&(u64, Fault)| *at == frame;
    let faults: Vec<Fault> = { world.script.faults.iter() }
        .filter(due)
        .map(|(_, fault)| *fault)
        .collect();
    let now = world.clock.now();
    let period = world.period();
    for fault in faults {
        let away = |ms: i64| now + ms * 1_000_000;
        let Some(session) = &mut world.session else {
            return;
        };
        match fault {
            Fault::Hide(frames) => session.hidden = frames,
            Fault::Skip(frames) => session.last_shown += i64::from(frames) * period,
            Fault::Blind(frames) => session.blind = frames,
            Fault::Untracked(frames) => session.untracked = frames,
            Fault::RefuseFrame(result) => session.refuse = Some(result),
            Fault::TakeOff(ms) => stop(world, Then::Ready(away(ms))),
            Fault::Exit => stop(world, Then::Exit),
            Fault::LoseSession(ms) => {
                world.away_until = away(ms);
                // It works until the application asks for the next frame.
                world.announce(SessionState::LOSS_PENDING);
            }
            Fault::LoseInstance(ms) => {
                session.lost = true;
                world.away_until = away(ms);
                world.events.push_back(Event::InstanceLost(now));
                if let Some(instance) = &mut world.instance {
                    instance.lost = true;
                }
            }
            Fault::Rate(rate) => change_rate(world, rate),
            Fault::Recentre(centre) => {
                let at = session.last_shown + 2 * period;
                world.next_centre = Some((at, pose::then(world.centre, centre)));
                world.events.push_back(Event::Recentred(at, centre));
            }
        }
    }
    if let Some(session) = &mut world.session {
        session.blind = session.blind.saturating_sub(1);
        session.untracked = session.untracked.saturating_sub(1);
    }
}

fn take_layer(
    world: &mut World,
    layer: *const sys::CompositionLayerProjection,
    frame: u64,
) -> Result<Layer, R> {
    // SAFETY: a layer, or null.
    let layer = unsafe { input(layer, sys::CompositionLayerProjection::TYPE) }
        .map_err(|_| R::ERROR_LAYER_INVALID)?;
    let space = sys::Handle::into_raw(layer.space);
    if !world.spaces.contains_key(&space) {
        return Err(R::ERROR_HANDLE_INVALID);
    }
    if layer.view_count != 2 || layer.views.is_null() {
        return Err(R::ERROR_VALIDATION_FAILURE);
    }
    let keep = world.script.keep.contains(&frame);
    let mut parts = Vec::new();
    let (mut colors, mut depths) = (Vec::new(), Vec::new());
    for eye in 0..2 {
        // SAFETY: there are two, as the layer says.
        let view = unsafe {
            input(
                layer.views.add(eye),
                sys::CompositionLayerProjectionView::TYPE,
            )
        }?;
        if !pose::is_valid(&view.pose) {
            return Err(R::ERROR_POSE_INVALID);
        }
        let depth = view.next.cast::<sys::CompositionLayerDepthInfoKHR>();
        // SAFETY: a struct in the chain, or null.
        let depth = unsafe { input(depth, sys::CompositionLayerDepthInfoKHR::TYPE) }.ok();
        check_part(world, &view.sub_image, false)?;
        if let Some(depth) = depth {
            if !world
                .log
                .extensions
                .iter()
                .any(|name| name == "KHR_composition_layer_depth")
            {
                return Err(R::ERROR_VALIDATION_FAILURE);
            }
            check_part(world, &depth.sub_image, true)?;
            let range = depth.min_depth..depth.max_depth;
            if !(0.0..=1.0).contains(&range.start) || range.end > 1.0 || range.is_empty() {
                return Err(R::ERROR_VALIDATION_FAILURE);
            }
            if depth.near_z == depth.far_z || depth.near_z < 0.0 || depth.far_z < 0.0 {
                return Err(R::ERROR_VALIDATION_FAILURE);
            }
        }
        if keep {
            colors.push(read(world, &view.sub_image)?);
            if let Some(depth) = depth {
                depths.push(read(world, &depth.sub_image)?);
            }
        }
        parts.push(ViewPart {
            pose: view.pose,
            fov: view.fov,
            array_index: view.sub_image.image_array_index,
            size: size(&view.sub_image),
            depth: depth.map(|depth| DepthPart {
                near_z: depth.near_z,
                far_z: depth.far_z,
                range: [depth.min_depth, depth.max_depth],
                size: size(&depth.sub_image),
            }),
        });
    }
    if let Ok(images) = colors.try_into() {
        world.log.images.push((frame, images));
    }
    if let Ok(images) = depths.try_into() {
        world.log.depths.push((frame, images));
    }
    Ok(Layer {
        views: [parts[0], parts[1]],
    })
}

/// A part of a swapchain that has been drawn into.
fn check_part(world: &World, part: &sys::SwapchainSubImage, wants_depth: bool) -> Result<(), R> {
    let swapchain = sys::Handle::into_raw(part.swapchain);
    let swapchain = world
        .swapchains
        .get(&swapchain)
        .ok_or(R::ERROR_HANDLE_INVALID)?;
    if swapchain.released.is_none() || is_depth(swapchain.format) != wants_depth {
        return Err(R::ERROR_LAYER_INVALID);
    }
    let (offset, extent) = (part.image_rect.offset, part.image_rect.extent);
    let fits = |at: i32, length: i32, side: u32| {
        at >= 0 && length > 0 && i64::from(at) + i64::from(length) <= i64::from(side)
    };
    let [width, height] = swapchain.size;
    if !fits(offset.x, extent.width, width) || !fits(offset.y, extent.height, height) {
        return Err(R::ERROR_SWAPCHAIN_RECT_INVALID);
    }
    if part.image_array_index >= swapchain.layers {
        return Err(R::ERROR_VALIDATION_FAILURE);
    }
    Ok(())
}

fn size(part: &sys::SwapchainSubImage) -> [i32; 2] {
    [part.image_rect.extent.width, part.image_rect.extent.height]
}

fn read(world: &World, part: &sys::SwapchainSubImage) -> Result<crate::Image, R> {
    let swapchain = &world.swapchains[&sys::Handle::into_raw(part.swapchain)];
    let session = world.session.as_ref().ok_or(R::ERROR_HANDLE_INVALID)?;
    let index = swapchain.released.ok_or(R::ERROR_LAYER_INVALID)? as usize;
    session.gpu.read(
        &swapchain.pictures[index],
        swapchain.format,
        swapchain.size,
        part.image_array_index,
    )
}
