//! The mock headset in a window: both eyes side by side, mouse and keyboard for
//! a head.

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow};
use shadecast_client::Clock;
use shadecast_client::render::{Gpu, LensPass, LensProfile, Viewport};
use shadecast_protocol::ClientTime;
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::{DeviceEvent, DeviceId, ElementState, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::keyboard::{KeyCode, PhysicalKey};
use winit::window::{CursorGrabMode, Window, WindowId};

use crate::args::Args;
use crate::clock::DisplayClock;
use crate::drawing::Drawing;
use crate::headset::Headset;
use crate::pilot::Pilot;

/// Runs until the window is closed.
pub(crate) fn run(args: &Args) -> Result<()> {
    let lens = args.lens()?.unwrap_or(LensProfile::IDENTITY);
    let events = EventLoop::new().map_err(|_| {
        anyhow!("there is no display to open a window on: run it on a desktop, or without --window")
    })?;
    let mut app = App {
        args,
        clock: Clock::start(),
        lens,
        open: None,
        outcome: Ok(()),
    };
    events.run_app(&mut app).context("the window was lost")?;
    app.outcome
}

struct App<'a> {
    args: &'a Args,
    clock: Clock,
    lens: LensProfile,
    open: Option<Open>,
    outcome: Result<()>,
}

/// A window and what is drawn in it.
struct Open {
    // Before the window, which it draws into.
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    window: Arc<Window>,
    headset: Headset,
    lens: LensPass,
    display: DisplayClock,
    pilot: Pilot,
    /// The mouse turns the head from the first click on.
    holds_mouse: bool,
    last: ClientTime,
}

impl ApplicationHandler for App<'_> {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.open.is_none() {
            match Open::new(self.args, self.clock, self.lens, events) {
                Ok(open) => self.open = Some(open),
                Err(error) => self.end(events, Err(error)),
            }
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(open) = &mut self.open else { return };
        match event {
            WindowEvent::CloseRequested => events.exit(),
            WindowEvent::Resized(size) => open.resize(size),
            WindowEvent::MouseInput {
                state: ElementState::Pressed,
                ..
            } => open.hold_mouse(),
            WindowEvent::KeyboardInput { event, .. } => match event.physical_key {
                PhysicalKey::Code(KeyCode::Escape) => events.exit(),
                PhysicalKey::Code(key) => open.pilot.key(key, event.state.is_pressed()),
                PhysicalKey::Unidentified(_) => {}
            },
            _ => {}
        }
    }

    fn device_event(&mut self, _: &ActiveEventLoop, _: DeviceId, event: DeviceEvent) {
        if let (Some(open), DeviceEvent::MouseMotion { delta }) = (&mut self.open, event)
            && open.holds_mouse
        {
            open.pilot.look(delta);
        }
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        let Some(open) = &mut self.open else { return };
        if self.clock.now() >= open.display.next_tick() {
            match open.turn(self.clock, self.args.seconds) {
                Ok(true) => {}
                Ok(false) => events.exit(),
                Err(error) => return self.end(events, Err(error)),
            }
        }
        let wait = open
            .display
            .next_tick()
            .0
            .saturating_sub(self.clock.now().0);
        let next = Instant::now() + Duration::from_nanos(wait);
        events.set_control_flow(ControlFlow::WaitUntil(next));
    }
}

impl App<'_> {
    fn end(&mut self, events: &ActiveEventLoop, outcome: Result<()>) {
        self.outcome = outcome;
        events.exit();
    }
}

impl Open {
    fn new(args: &Args, clock: Clock, lens: LensProfile, events: &ActiveEventLoop) -> Result<Self> {
        let eye = u32::from(args.eye_size);
        let attributes = Window::default_attributes()
            .with_title("shadecast")
            .with_inner_size(PhysicalSize::new(eye * 2, eye));
        let window = Arc::new(
            events
                .create_window(attributes)
                .context("cannot open a window")?,
        );
        let display = Box::new(events.owned_display_handle());
        let instance =
            wgpu::Instance::new(wgpu::InstanceDescriptor::new_with_display_handle(display));
        let surface = instance
            .create_surface(Arc::clone(&window))
            .context("cannot draw into the window")?;
        let gpu = Gpu::open(&instance, Some(&surface))?;
        let config = configuration(&surface, &gpu, window.inner_size())?;
        surface.configure(&gpu.device, &config);
        let eye_format = if config.format.is_srgb() {
            wgpu::TextureFormat::Rgba8UnormSrgb
        } else {
            wgpu::TextureFormat::Rgba8Unorm
        };
        let drawing = Drawing::new(gpu, args.eye_size, eye_format);
        Ok(Self {
            lens: drawing.lens_pass(config.format, lens),
            headset: Headset::start(args, clock, drawing)?,
            surface,
            config,
            window,
            display: DisplayClock::new(clock.now(), args.display_rate()),
            pilot: Pilot::new(),
            holds_mouse: false,
            last: clock.now(),
        })
    }

    /// False when the run is over.
    fn turn(&mut self, clock: Clock, limit: Option<f64>) -> Result<bool> {
        use wgpu::CurrentSurfaceTexture::{Lost, Outdated, Suboptimal, Success, Validation};
        let now = clock.now();
        let display_at = self.display.begin(now);
        let elapsed = now.0.saturating_sub(self.last.0) as f32 * 1e-9;
        self.last = now;
        let head = self.pilot.step(elapsed);
        let picture = match self.surface.get_current_texture() {
            Success(picture) | Suboptimal(picture) => Some(picture),
            Outdated | Validation => {
                self.configure();
                None
            }
            Lost => return Err(anyhow!("the window's surface was lost")),
            // Hidden: the session goes on.
            _ => None,
        };
        let (lens, halves) = (
            &self.lens,
            Viewport::halves([self.config.width, self.config.height]),
        );
        let turn = self.headset.turn(display_at, head, |encoder| {
            if let Some(picture) = &picture {
                let view = picture
                    .texture
                    .create_view(&wgpu::TextureViewDescriptor::default());
                lens.draw(encoder, &view, halves);
            }
        })?;
        if let Some(picture) = picture {
            self.window.pre_present_notify();
            picture.present();
        }
        let over = match (limit, self.headset.measured.first_picture) {
            (Some(limit), Some(first)) => {
                clock.now().0.saturating_sub(first.0) as f64 * 1e-9 >= limit
            }
            _ => false,
        };
        Ok(!turn.interrupted && !over)
    }

    fn resize(&mut self, size: PhysicalSize<u32>) {
        let limit = self.headset.drawing.gpu().device.limits();
        let limit = limit.max_texture_dimension_2d;
        if size.width >= 2 && size.height >= 1 {
            self.config.width = size.width.min(limit);
            self.config.height = size.height.min(limit);
            self.configure();
        }
    }

    fn configure(&self) {
        let device = &self.headset.drawing.gpu().device;
        self.surface.configure(device, &self.config);
    }

    /// Not every window system does either; looking around then ends at the
    /// window's edge.
    fn hold_mouse(&mut self) {
        self.holds_mouse = true;
        let _ = self
            .window
            .set_cursor_grab(CursorGrabMode::Locked)
            .or_else(|_| self.window.set_cursor_grab(CursorGrabMode::Confined));
        self.window.set_cursor_visible(false);
    }
}

/// Without waiting for the monitor: the display's clock is our own.
fn configuration(
    surface: &wgpu::Surface<'_>,
    gpu: &Gpu,
    size: PhysicalSize<u32>,
) -> Result<wgpu::SurfaceConfiguration> {
    let limit = gpu.device.limits().max_texture_dimension_2d;
    let mut config = surface
        .get_default_config(
            &gpu.adapter,
            size.width.clamp(2, limit),
            size.height.clamp(1, limit),
        )
        .context("the GPU cannot draw into this window")?;
    let formats = surface.get_capabilities(&gpu.adapter).formats;
    // The colours are encoded for a display already.
    if let Some(plain) = formats.iter().find(|format| !format.is_srgb()) {
        config.format = *plain;
    }
    config.present_mode = wgpu::PresentMode::AutoNoVsync;
    Ok(config)
}
