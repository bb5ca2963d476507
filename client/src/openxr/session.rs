//! One session with the runtime, from the headset's device to its loss or exit.
//!
//! A turn of it is a display frame, in the order that OpenXR wants: wait, begin,
//! acquire, locate, draw, release, end. The eyes are located after everything
//! that does not depend on them (uploads, waiting for an image), right before
//! the commands are recorded that carry their matrices.

use std::time::Duration;

use ::openxr as xr;
use ash::vk::Handle;
use glam::Vec2;
use shadecast_protocol::{ClientTime, EyeView, Hand};
use xr::sys;

use super::error::refused;
use super::hands::Hands;
use super::held::Held;
use super::host::XrHost;
use super::lifecycle::{LifeCycle, Step};
use super::moment::display_at;
use super::offers::Offers;
use super::space::{EyeLocation, locate_eyes, pose_from_xr, velocity_from_xr};
use super::swapchain::Swapchain;
use super::{Ending, Frame, HeadsetConfig, HeadsetError, walk};
use crate::render::vulkan::VulkanGpu;
use crate::render::{EyeCamera, EyeImages, Gpu, NEAR, Renderer, RendererConfig};
use crate::{Drawn, HeadView, Input};

/// What the renderer is written for.
const VULKAN: xr::Version = xr::Version::new(1, 3, 0);
/// Least and most pixels of an eye's picture, each way: those of a view report.
const EYE_SIDES: std::ops::RangeInclusive<u32> = 16..=8192;
/// Height of a standing person's eyes, metres, where the runtime knows no floor.
const EYE_HEIGHT: f32 = 1.6;

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
    pub(super) fn open(
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
        let mut offers = Offers::of(&extensions);
        let instance = create_instance(entry, platform, offers)?;
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
        let vulkan = VulkanGpu::open(&mut host, &config.extras)?;
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

    pub(super) fn vulkan(&self) -> &VulkanGpu {
        &self.vulkan
    }

    pub(super) fn offers(&self) -> Offers {
        self.offers
    }

    pub(super) fn eye_size(&self) -> [u32; 2] {
        self.color.size
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
        let mut frame = Frame {
            began,
            display_at: display_at(began, runtime_now, time, period),
            period: Duration::from_nanos(period.as_nanos().max(0) as u64),
            uploading: Duration::ZERO,
            drawing: Duration::ZERO,
            drawn: false,
            fresh: false,
        };
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
        self.bring_up_to_date(held, frame, now);
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
            let motion = held
                .shown
                .as_ref()
                .map_or(0.0, |shown| shown.seconds_of_motion(frame.display_at));
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

    /// Gives the renderer what has come since the last frame; all of what is
    /// held, if the session is new.
    fn bring_up_to_date(
        &mut self,
        held: &mut Held,
        frame: &mut Frame,
        now: &dyn Fn() -> ClientTime,
    ) {
        let newest = held.take_newest(frame.began);
        let has_newest = newest.is_some();
        let lacking = || held.shown.clone().filter(|_| !self.is_current);
        if let Some(world) = newest.or_else(lacking) {
            let began = now();
            match self.renderer.upload(&world) {
                Ok(()) => {
                    held.shown = Some(world);
                    frame.fresh = has_newest;
                }
                Err(error) => tracing::warn!("a frame is not shown: {error}"),
            }
            frame.uploading = since(began, now());
        }
        if std::mem::take(&mut held.sky_is_new) || !self.is_current {
            self.renderer.set_sky(held.sky.as_ref());
        }
        self.is_current = true;
        self.renderer.set_notice(held.notice(frame.began));
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

    /// Ends the frame that was begun: with both eyes where they were drawn, or
    /// with nothing.
    fn end(&mut self, time: xr::Time, eyes: Option<&[EyeLocation; 2]>) -> Result<(), HeadsetError> {
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

fn create_instance(
    entry: &xr::Entry,
    platform: &impl xr::PlatformInfo,
    offers: Offers,
) -> Result<xr::Instance, HeadsetError> {
    let application = xr::ApplicationInfo {
        application_name: "shadecast",
        application_version: 0,
        engine_name: "shadecast",
        engine_version: 0,
        // Loaders and runtimes of 1.0 refuse 1.1, and nothing of it is needed.
        api_version: xr::Version::new(1, 0, 0),
    };
    entry
        .create_instance(&application, &offers.enable(), &[], platform)
        .map_err(|result| match result {
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

fn since(began: ClientTime, now: ClientTime) -> Duration {
    Duration::from_nanos(now.0.saturating_sub(began.0))
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
