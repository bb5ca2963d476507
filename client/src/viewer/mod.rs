//! A phone in a viewer: lenses before a screen, and nothing that composes.
//!
//! Where a headset's runtime draws the eyes' pictures onto its display, a phone does
//! so itself: the lens pass is on. Only the head's orientation is known
//! ([`HeadTracker`]); lenses and screen are a few lengths ([`Optics`]). The window
//! comes and goes with the life of the app, and the world that is held outlives it.

mod tracker;

use std::io::ErrorKind;
use std::path::Path;
use std::time::Duration;

use shadecast_protocol::ClientTime;
use thiserror::Error;
use wgpu::rwh::{DisplayHandle, HandleError, HasDisplayHandle, HasWindowHandle, WindowHandle};

pub use tracker::HeadTracker;

use crate::render::vulkan::{DirectHost, Extras, VulkanError, VulkanGpu};
use crate::render::{
    EyeCamera, EyeImages, Eyes, FrameReceiver, LensPass, Optics, OpticsError, PhoneScreen,
    Renderer, RendererConfig, Screen, ScreenError,
};
use crate::worn::{Display, Frame, Held, OnDevice, Turn, since};
use crate::{Drawn, HeadView, Input};

/// Frames from the moment at which there is a picture to draw into to its light: one
/// to draw, one to be scanned out.
const FRAMES_AHEAD: u32 = 2;

/// Why a viewer shows nothing.
#[derive(Debug, Error)]
pub enum ViewerError {
    /// No device.
    #[error(transparent)]
    Gpu(#[from] VulkanError),
    /// No window.
    #[error(transparent)]
    Screen(#[from] ScreenError),
    /// Lenses and screen do not belong together.
    #[error(transparent)]
    Optics(#[from] OpticsError),
    /// A file that tells of no viewer.
    #[error("{0}: {1}")]
    File(String, String),
}

/// Reads a viewer from a file, JSON with the names of the fields of [`Optics`];
/// Cardboard, where there is none.
///
/// # Errors
/// When it is something else, or no viewer that can be worn; names the file.
pub fn read_optics(path: &Path) -> Result<Optics, ViewerError> {
    let named = |why: String| ViewerError::File(path.display().to_string(), why);
    let text = match std::fs::read_to_string(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Optics::CARDBOARD),
        text => text.map_err(|error| named(error.to_string()))?,
    };
    let optics: Optics = serde_json::from_str(&text).map_err(|error| named(error.to_string()))?;
    optics.checked().map_err(|error| named(error.to_string()))
}

/// Tells the tracker what the sensors have read; the second is the client's time.
pub type Sensors = Box<dyn FnMut(&mut HeadTracker, ClientTime)>;

/// What a viewer is opened with.
pub struct ViewerConfig {
    /// The lenses.
    pub optics: Optics,
    /// What is behind them.
    pub screen: PhoneScreen,
    /// Draw four samples a pixel and show their mean.
    pub antialias: bool,
    /// What the device should be able to do besides drawing.
    pub extras: Extras,
    /// For what else is done on the device.
    pub on_device: Option<OnDevice>,
    /// What tells how the head is turned.
    pub sensors: Sensors,
}

/// A phone in a viewer, and the world that is shown on it.
pub struct Viewer {
    // Before the device.
    shown: Option<Shown>,
    vulkan: VulkanGpu,
    held: Held,
    tracker: HeadTracker,
    config: ViewerConfig,
    leaves: bool,
}

/// What is lost with the window.
struct Shown {
    renderer: Renderer,
    eyes: Eyes,
    pictures: EyeImages,
    lens: LensPass,
    screen: Screen,
    /// Whether the renderer has the frame and the sky that are held.
    is_current: bool,
}

impl Viewer {
    /// Opens the device; pictures are drawn once there is a window. What it shows
    /// comes from `frames`.
    ///
    /// # Errors
    /// When there is no device that can draw, or the viewer is none that can be worn.
    pub fn open(config: ViewerConfig, frames: FrameReceiver) -> Result<Self, ViewerError> {
        config.optics.checked()?;
        Ok(Self {
            shown: None,
            vulkan: VulkanGpu::open(&mut DirectHost, &config.extras)?,
            held: Held::new(frames),
            tracker: HeadTracker::new(config.screen.quarters),
            config,
            leaves: false,
        })
    }

    /// A window of `size` pixels to draw into; the one before is not touched again.
    /// One that does not fit behind the lenses stays black, and the log says so: while
    /// a phone is turned, its window may be upright for a moment.
    ///
    /// # Errors
    /// When it cannot be drawn into.
    pub fn set_window(
        &mut self,
        window: impl HasWindowHandle + Send + Sync + 'static,
        size: [u32; 2],
    ) -> Result<(), ViewerError> {
        self.drop_window();
        let eyes = match self.config.optics.eyes(size, self.config.screen) {
            Ok(eyes) => eyes,
            Err(error) => {
                tracing::warn!("{error}");
                return Ok(());
            }
        };
        let gpu = &self.vulkan.gpu;
        let surface = self.vulkan.api.create_surface(Window(window));
        let surface = surface.map_err(ScreenError::from)?;
        let screen = Screen::new(surface, gpu, size, wgpu::PresentMode::Fifo)?;
        let eye_format = screen.eye_format();
        let pictures = EyeImages::new(&gpu.device, eyes.size, eye_format);
        let config = RendererConfig {
            eye_size: eyes.size,
            eye_format,
            stereo: gpu.stereo,
            antialias: self.config.antialias,
        };
        let mut renderer = Renderer::new(&gpu.device, &gpu.queue, config);
        if let Some(on_device) = &mut self.config.on_device {
            on_device(&self.vulkan, &mut renderer);
        }
        let [width, height] = eyes.size;
        tracing::info!(
            "viewer: 2x{width}x{height}, {}, {}",
            gpu.adapter.get_info().name,
            gpu.stereo.name(),
        );
        self.shown = Some(Shown {
            renderer,
            lens: screen.lens_pass(&gpu.device, &pictures, eyes.lenses),
            eyes,
            pictures,
            screen,
            is_current: false,
        });
        Ok(())
    }

    /// The window goes away. It is not touched once this returns.
    pub fn drop_window(&mut self) {
        if self.shown.take().is_some() {
            // The GPU may still be drawing.
            let device = &self.vulkan.gpu.device;
            let _ = device.poll(wgpu::PollType::wait_indefinitely());
        }
    }

    /// Ahead is now where the head looks.
    pub fn recentre(&mut self) {
        self.tracker.recentre();
    }
}

/// A window of Android, which has one display.
struct Window<W>(W);

impl<W: HasWindowHandle> HasWindowHandle for Window<W> {
    fn window_handle(&self) -> Result<WindowHandle<'_>, HandleError> {
        self.0.window_handle()
    }
}

impl<W> HasDisplayHandle for Window<W> {
    fn display_handle(&self) -> Result<DisplayHandle<'_>, HandleError> {
        Ok(DisplayHandle::android())
    }
}

impl Display for Viewer {
    type Error = ViewerError;

    fn held(&self) -> &Held {
        &self.held
    }

    fn held_mut(&mut self) -> &mut Held {
        &mut self.held
    }

    fn turn(
        &mut self,
        now: &dyn Fn() -> ClientTime,
        tell: &mut dyn FnMut(Input),
    ) -> Result<Turn, ViewerError> {
        if self.leaves {
            return Ok(Turn::Exit);
        }
        let Some(shown) = &mut self.shown else {
            return Ok(Turn::Idle);
        };
        let gpu = &self.vulkan.gpu;
        // Waits until the display is done with a picture.
        let picture = match shown.screen.next(&gpu.device) {
            Ok(Some(picture)) => picture,
            Ok(None) => return Ok(Turn::Idle),
            Err(error) => {
                tracing::warn!("{error}");
                self.drop_window();
                return Ok(Turn::Lost);
            }
        };
        let began = now();
        let period = period(self.config.screen.rate);
        let light = (period * FRAMES_AHEAD).as_nanos() as u64;
        let display_at = ClientTime(began.0.saturating_add(light));
        let mut frame = Frame::begin(began, display_at, period);
        self.held
            .bring_up_to_date(&mut shown.renderer, &mut shown.is_current, &mut frame, now);

        // As late as can be, right before the matrices are recorded.
        let sampled_at = now();
        (self.config.sensors)(&mut self.tracker, sampled_at);
        let head = self
            .tracker
            .at(display_at)
            .seen_from(self.held.world_from_play);
        let cameras = EyeCamera::pair(head.pose, &shown.eyes.views);
        shown.renderer.place_notice(cameras);
        let motion = self.held.seconds_of_motion(display_at);
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        shown
            .renderer
            .draw(&mut encoder, cameras, motion, &shown.pictures);
        shown.screen.draw(&mut encoder, &shown.lens, &picture);
        gpu.queue.submit([encoder.finish()]);
        picture.present();
        frame.drawing = since(sampled_at, now());
        frame.drawn = true;

        tell(Input::View(HeadView {
            sampled_at,
            display_at: display_at.max(sampled_at),
            world_from_head: head.pose,
            linear_velocity: head.linear_velocity,
            angular_velocity: head.angular_velocity,
            eyes: shown.eyes.views,
            // `Optics::eyes` saw to it that they fit.
            eye_resolution: shown.eyes.size.map(|side| side as u16),
            hands: [None; 2],
        }));
        if frame.fresh
            && let Some(shown) = &self.held.shown
        {
            tell(Input::Drawn(Drawn::new(shown, began, display_at)));
        }
        Ok(Turn::Frame(frame))
    }

    fn is_shown(&self) -> bool {
        self.shown.is_some()
    }

    fn request_exit(&mut self) -> Result<(), ViewerError> {
        self.leaves = true;
        Ok(())
    }

    fn largest_texture(&self) -> Option<u32> {
        Some(self.vulkan.gpu.device.limits().max_texture_dimension_2d)
    }
}

/// Between two pictures of a screen; a usual one's, where the rate is none.
fn period(rate: f32) -> Duration {
    let is_rate = (1.0..=1000.0).contains(&rate);
    Duration::from_secs_f32(1.0 / if is_rate { rate } else { 60.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_tells_of_another_viewer_or_what_is_wrong_with_it() {
        let path = std::env::temp_dir().join(format!("viewer-{}.json", std::process::id()));
        let read = || read_optics(&path).map_err(|error| error.to_string());
        assert_eq!(read(), Ok(Optics::CARDBOARD), "there is none");
        let mut wide = Optics::CARDBOARD;
        wide.half_fov = 45.0;
        std::fs::write(&path, serde_json::to_string(&wide).unwrap()).unwrap();
        assert_eq!(read(), Ok(wide));
        wide.half_fov = 95.0;
        for text in [serde_json::to_string(&wide).unwrap(), "{}".into()] {
            std::fs::write(&path, &text).unwrap();
            let error = read().unwrap_err();
            assert!(error.contains(".json: "), "{text}: {error}");
            assert!(
                error.contains("half_fov") || error.contains("missing"),
                "{error}"
            );
        }
        std::fs::write(&path, [0xff; 4]).unwrap();
        assert!(read().unwrap_err().contains(".json: "), "no text");
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn a_screen_without_a_rate_has_a_usual_one() {
        assert_eq!(period(100.0), Duration::from_millis(10));
        for none in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e-30] {
            assert_eq!(period(none), period(60.0), "{none}");
        }
    }
}
