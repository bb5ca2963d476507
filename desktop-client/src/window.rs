//! The mock headset in a window: both eyes side by side, mouse and keyboard for
//! a head.

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow};
use shadecast_client::Clock;
use shadecast_client::render::{EyeLens, Gpu, LensPass, LensProfile, Screen};
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
    let lenses = args.lenses()?.unwrap_or(LensProfile::IDENTITY.eyes(1.0));
    let events = EventLoop::new().map_err(|_| {
        anyhow!("there is no display to open a window on: run it on a desktop, or without --window")
    })?;
    let mut app = App {
        args,
        clock: Clock::start(),
        lenses,
        open: None,
        outcome: Ok(()),
    };
    events.run_app(&mut app).context("the window was lost")?;
    app.outcome
}

struct App<'a> {
    args: &'a Args,
    clock: Clock,
    lenses: [EyeLens; 2],
    open: Option<Open>,
    outcome: Result<()>,
}

/// A window and what is drawn in it.
struct Open {
    // Before the window, which it draws into.
    screen: Screen,
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
            match Open::new(self.args, self.clock, self.lenses, events) {
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
    fn new(
        args: &Args,
        clock: Clock,
        lenses: [EyeLens; 2],
        events: &ActiveEventLoop,
    ) -> Result<Self> {
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
        let size = window.inner_size();
        // Without waiting for the monitor: the display's clock is our own.
        let present_mode = wgpu::PresentMode::AutoNoVsync;
        let screen = Screen::new(surface, &gpu, [size.width, size.height], present_mode)?;
        let drawing = Drawing::new(gpu, args.eye_size, screen.eye_format());
        Ok(Self {
            lens: screen.lens_pass(&drawing.gpu().device, drawing.eyes(), lenses),
            headset: Headset::start(args, clock, drawing)?,
            screen,
            window,
            display: DisplayClock::new(clock.now(), args.display_rate()),
            pilot: Pilot::new(),
            holds_mouse: false,
            last: clock.now(),
        })
    }

    /// False when the run is over.
    fn turn(&mut self, clock: Clock, limit: Option<f64>) -> Result<bool> {
        let now = clock.now();
        let display_at = self.display.begin(now);
        let elapsed = now.0.saturating_sub(self.last.0) as f32 * 1e-9;
        self.last = now;
        let head = self.pilot.step(elapsed);
        // Where it is hidden, the session goes on.
        let picture = self.screen.next(&self.headset.drawing.gpu().device)?;
        let (screen, lens) = (&self.screen, &self.lens);
        let turn = self.headset.turn(display_at, head, |encoder| {
            if let Some(picture) = &picture {
                screen.draw(encoder, lens, picture);
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
        if size.width >= 2 && size.height >= 1 {
            let device = &self.headset.drawing.gpu().device;
            self.screen.resize(device, [size.width, size.height]);
        }
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
