//! One session with the runtime, from the headset's device to its loss or exit.
//!
//! A turn of it is a display frame, in the order that OpenXR wants: wait, begin,
//! acquire, locate, draw, release, end. The eyes are located after everything
//! that does not depend on them (uploads, waiting for an image), right before
//! the commands are recorded that carry their matrices.

mod layers;
mod open;

use std::time::Duration;

use ::openxr as xr;
use glam::Vec2;
use shadecast_protocol::{ClientTime, EyeView, Hand};
use xr::sys;

use super::error::refused;
use super::hands::Hands;
use super::lifecycle::{LifeCycle, Step};
use super::moment::display_at;
use super::offers::Offers;
use super::space::{EyeLocation, locate_eyes, pose_from_xr, velocity_from_xr};
use super::swapchain::Swapchain;
use super::{Ending, HeadsetError, walk};
use crate::render::vulkan::VulkanGpu;
use crate::render::{EyeCamera, EyeImages, Gpu, Renderer};
use crate::worn::{Frame, Held, since};
use crate::{Drawn, HeadView, Input};

/// Everything that is lost with the session.
// Dropped from top to bottom: what draws, the runtime's pictures, the session,
// the device, the runtime's instance.
pub(super) struct RuntimeSession {
    renderer: Renderer,
    color: Swapchain,
    depth: Option<Swapchain>,
    hands: Hands,
    base: xr::Space,
    head: xr::Space,
    waiter: xr::FrameWaiter,
    stream: xr::FrameStream<xr::Vulkan>,
    session: xr::Session<xr::Vulkan>,
    vulkan: VulkanGpu,
    instance: xr::Instance,
    offers: Offers,
    life: LifeCycle,
    events: Box<xr::EventDataBuffer>,
    /// Whether the renderer has the frame and the sky that are held.
    is_current: bool,
}

/// What the runtime made of a turn.
pub(super) enum SessionTurn {
    Idle,
    Frame(Frame),
    Ended(Ending),
}

impl RuntimeSession {
    pub(super) fn vulkan(&self) -> &VulkanGpu {
        &self.vulkan
    }

    pub(super) fn offers(&self) -> Offers {
        self.offers
    }

    pub(super) fn eye_size(&self) -> [u32; 2] {
        self.color.size
    }

    /// Depth has the size that is drawn, which is more than the pictures' where
    /// they are antialiased: the compositor takes any.
    pub(super) fn description(&self) -> String {
        let [width, height] = self.color.size;
        let gpu = &self.vulkan.gpu;
        let depth = self.depth.as_ref().map_or(String::new(), |depth| {
            let [width, height] = depth.size;
            format!(", depth of {width}x{height}")
        });
        format!(
            "2x{width}x{height}{depth}, {}, {}, {}",
            gpu.adapter.get_info().name,
            gpu.stereo.name(),
            self.offers
        )
    }

    pub(super) fn life(&self) -> &LifeCycle {
        &self.life
    }

    /// Asks the runtime to end the session; it answers with its states.
    pub(super) fn request_exit(&self) -> Result<(), HeadsetError> {
        match self.session.request_exit() {
            // Not begun: nothing is shown that must be ended first.
            Err(sys::Result::ERROR_SESSION_NOT_RUNNING) | Ok(()) => Ok(()),
            Err(result) => Err(refused("does not let the session end")(result)),
        }
    }

    /// One display frame, or none while the runtime wants none. `now` reads the
    /// client's clock.
    pub(super) fn turn(
        &mut self,
        held: &mut Held,
        now: &dyn Fn() -> ClientTime,
        tell: &mut dyn FnMut(Input),
    ) -> Result<SessionTurn, HeadsetError> {
        if let Some(ending) = self.hear()? {
            return Ok(SessionTurn::Ended(ending));
        }
        if !self.life.is_running() {
            return Ok(SessionTurn::Idle);
        }
        let state = self.waiter.wait().map_err(refused("times no frame"))?;
        let began = now();
        let runtime_now = if self.offers.clock {
            self.instance.now().ok()
        } else {
            None
        };
        let time = state.predicted_display_time;
        let period = state.predicted_display_period;
        let mut frame = Frame::begin(
            began,
            display_at(began, runtime_now, time, period),
            Duration::from_nanos(period.as_nanos().max(0) as u64),
        );
        self.stream.begin().map_err(refused("begins no frame"))?;
        let drawn = if state.should_render {
            self.draw(held, time, &mut frame, now, tell)
        } else {
            Ok(None)
        };
        match drawn {
            Ok(eyes) => self.end(time, eyes.as_ref())?,
            Err(error) => {
                // A frame that was begun is ended; what went wrong first is told.
                let _ = self.end(time, None);
                return Err(error);
            }
        }
        Ok(SessionTurn::Frame(frame))
    }

    /// Takes what the runtime has to say.
    fn hear(&mut self) -> Result<Option<Ending>, HeadsetError> {
        loop {
            let event = self
                .instance
                .poll_event(&mut self.events)
                .map_err(refused("tells no events"))?;
            let state = match event {
                None => return Ok(None),
                Some(xr::Event::SessionStateChanged(event)) => event.state(),
                Some(xr::Event::InstanceLossPending(_)) => return Ok(Some(Ending::Lost)),
                Some(xr::Event::ReferenceSpaceChangePending(_)) => {
                    // The space is the same, and poses in it are told as they will be.
                    tracing::info!("the play space was centred anew");
                    continue;
                }
                Some(xr::Event::DisplayRefreshRateChangedFB(event)) => {
                    let [from, to] = [
                        event.from_display_refresh_rate(),
                        event.to_display_refresh_rate(),
                    ];
                    tracing::info!("the display changed from {from} to {to} Hz");
                    continue;
                }
                Some(_) => continue,
            };
            tracing::info!("the session is {state:?}");
            match self.life.enter(state) {
                Step::Stay => {}
                Step::Begin => {
                    self.session
                        .begin(xr::ViewConfigurationType::PRIMARY_STEREO)
                        .map_err(refused("does not begin the session"))?;
                }
                Step::End => {
                    self.session
                        .end()
                        .map_err(refused("does not end the session"))?;
                }
                Step::Leave(ending) => return Ok(Some(ending)),
            }
        }
    }

    /// Draws into the next image. None where the runtime does not know where
    /// the eyes are: there is nothing to show then.
    fn draw(
        &mut self,
        held: &mut Held,
        time: xr::Time,
        frame: &mut Frame,
        now: &dyn Fn() -> ClientTime,
        tell: &mut dyn FnMut(Input),
    ) -> Result<Option<[EyeLocation; 2]>, HeadsetError> {
        held.bring_up_to_date(&mut self.renderer, &mut self.is_current, frame, now);
        let stick = if self.life.is_focused() {
            self.hands.sync(&self.session)?;
            self.hands.stick(&self.session)
        } else {
            Vec2::ZERO
        };
        let target = self.color.acquire()?;
        let depth = match &mut self.depth {
            Some(depth) => Some(depth.acquire()?),
            None => None,
        };
        let eyes = locate_eyes(&self.session, time, &self.base)
            .map_err(refused("does not tell where the eyes are"))?;
        let mut submitted_at = frame.began;
        if let Some(eyes) = &eyes {
            let cameras = eyes.each_ref().map(|eye| EyeCamera {
                world_from_eye: held.world_from_play.then(eye.base_from_eye),
                fov: eye.fov,
            });
            let motion = held.seconds_of_motion(frame.display_at);
            self.renderer.place_notice(cameras);
            let began = now();
            submit(
                &self.vulkan.gpu,
                &self.renderer,
                cameras,
                motion,
                target,
                depth,
            );
            submitted_at = now();
            frame.drawing = since(began, submitted_at);
            frame.drawn = true;
        }
        self.color.release()?;
        if let Some(depth) = &mut self.depth {
            depth.release()?;
        }
        if let Some(eyes) = &eyes {
            self.report(held, eyes, stick, time, (frame, submitted_at), tell)?;
        }
        Ok(eyes)
    }

    /// Tells the server where the head and the hands are, and moves the play
    /// space on for the next frame.
    fn report(
        &mut self,
        held: &mut Held,
        eyes: &[EyeLocation; 2],
        stick: Vec2,
        time: xr::Time,
        (frame, now): (&Frame, ClientTime),
        tell: &mut dyn FnMut(Input),
    ) -> Result<(), HeadsetError> {
        let (location, velocity) = self
            .head
            .relate(&self.base, time)
            .map_err(refused("does not tell where the head is"))?;
        let Some(base_from_head) = pose_from_xr(location.pose) else {
            return Ok(());
        };
        let world_from_base = held.world_from_play;
        let world_from_head = world_from_base.then(base_from_head);
        let walks = walk::velocity(world_from_head, stick);
        let flags = velocity.velocity_flags;
        let linear = velocity_from_xr(
            flags.contains(xr::SpaceVelocityFlags::LINEAR_VALID),
            velocity.linear_velocity,
        );
        let angular = velocity_from_xr(
            flags.contains(xr::SpaceVelocityFlags::ANGULAR_VALID),
            velocity.angular_velocity,
        );
        let head_from_base = base_from_head.inverse();
        let hands = if self.life.is_focused() {
            self.hands.locate(&self.session, &self.base, time)
        } else {
            [None; 2]
        };
        tell(Input::View(HeadView {
            // Of the head, here and now, and not when the runtime woke us: the
            // server measures the network by it.
            sampled_at: now,
            display_at: frame.display_at.max(now),
            world_from_head,
            linear_velocity: world_from_base.orientation * linear + walks,
            angular_velocity: world_from_base.orientation * angular,
            eyes: eyes.each_ref().map(|eye| EyeView {
                head_from_eye: head_from_base.then(eye.base_from_eye),
                fov: eye.fov,
            }),
            // `eye_size` saw to it that they fit.
            eye_resolution: self.color.size.map(|side| side as u16),
            hands: hands.map(|hand| {
                hand.map(|hand| Hand {
                    world_from_aim: world_from_base.then(hand.world_from_aim),
                    ..hand
                })
            }),
        }));
        if frame.fresh
            && let Some(shown) = &held.shown
        {
            tell(Input::Drawn(Drawn::new(
                shown,
                frame.began,
                frame.display_at,
            )));
        }
        held.world_from_play.position += walks * frame.period.as_secs_f32();
        Ok(())
    }
}

impl Drop for RuntimeSession {
    fn drop(&mut self) {
        // The runtime's images go next, and the GPU may still be drawing.
        let _ = self
            .vulkan
            .gpu
            .device
            .poll(wgpu::PollType::wait_indefinitely());
    }
}

fn submit(
    gpu: &Gpu,
    renderer: &Renderer,
    cameras: [EyeCamera; 2],
    seconds_of_motion: f32,
    target: &EyeImages,
    depth: Option<&EyeImages>,
) {
    let mut encoder = gpu
        .device
        .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    renderer.draw_with_depth(&mut encoder, cameras, seconds_of_motion, target, depth);
    gpu.queue.submit([encoder.finish()]);
}
