//! What the simulated headset is like and what happens to it.

use openxr_sys as sys;
use sys::{Fovf, Posef, Vector2f, Vector3f};

use crate::pose;

/// Where the head is in the play space, `seconds` after the runtime's time zero:
/// floor level, facing -Z.
pub type HeadTrace = Box<dyn Fn(f64) -> Posef + Send>;

/// A headset and its day.
pub struct Script {
    /// What there is.
    pub headset: Headset,
    /// What the display and its clock do.
    pub clock: ClockKind,
    /// Of the display, pictures a second.
    pub rate: f32,
    /// Where the head is.
    pub head: HeadTrace,
    /// What the left and the right hand hold.
    pub controllers: [Option<Controller>; 2],
    /// What goes wrong, and in which frame (they count from zero over all
    /// sessions).
    pub faults: Vec<(u64, Fault)>,
    /// Frames whose pictures are read back.
    pub keep: Vec<u64>,
    /// Where the log is written when the instance is destroyed.
    pub log_to: Option<std::path::PathBuf>,
}

/// What does not change while a runtime runs.
#[derive(Clone, Debug)]
pub struct Headset {
    /// Extensions that the runtime offers, without `XR_`.
    pub extensions: Vec<&'static str>,
    /// Extensions that it offers and then refuses to an instance, without `XR_`.
    pub refuses: Vec<&'static str>,
    /// What Vulkan answers when a device is created; 0 where it gives one.
    pub vulkan_device: i32,
    /// The oldest Vulkan that the runtime takes.
    pub oldest_vulkan: sys::Version,
    /// Whether the runtime is of OpenXR 1.0.
    pub speaks_1_0: bool,
    /// Pictures for the eyes.
    pub eyes: Eyes,
    /// Vulkan formats of swapchains, best first.
    pub formats: Vec<i64>,
    /// Whether a headset is connected.
    pub connected: bool,
}

/// The display's pictures.
#[derive(Clone, Debug)]
pub struct Eyes {
    /// How many.
    pub count: u32,
    /// Pixels of each.
    pub size: [u32; 2],
    /// From the middle of the head, metres.
    pub offset: f32,
    /// Left and right.
    pub fov: [Fovf; 2],
}

/// How time passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClockKind {
    /// As fast as the application draws.
    Virtual,
    /// As for everybody.
    System,
}

/// A controller that lies still.
#[derive(Clone, Copy, Debug)]
pub struct Controller {
    /// In the play space.
    pub aim: Posef,
    /// Whether the button is held.
    pub pressed: bool,
    /// Right and ahead.
    pub stick: Vector2f,
}

/// What goes wrong.
#[derive(Clone, Copy, Debug)]
pub enum Fault {
    /// For so many frames nothing is to be drawn.
    Hide(u32),
    /// So many display intervals pass without a frame.
    Skip(u32),
    /// For so many frames the runtime does not know where the head is.
    Blind(u32),
    /// For so many frames the position is believed and not tracked.
    Untracked(u32),
    /// The headset is taken off for so many milliseconds.
    TakeOff(i64),
    /// The session is lost, and the headset is away for so many milliseconds.
    LoseSession(i64),
    /// The instance is lost, and so is everything.
    LoseInstance(i64),
    /// The display changes its rate, pictures a second.
    Rate(f32),
    /// The user asks for the play space to begin here, in the old one.
    Recentre(Posef),
    /// The next end of a frame is refused.
    RefuseFrame(sys::Result),
    /// The user leaves the application.
    Exit,
}

impl Default for Headset {
    fn default() -> Self {
        let fov = |left: f32, right: f32| Fovf {
            angle_left: left,
            angle_right: right,
            angle_up: 0.75,
            angle_down: -0.85,
        };
        Self {
            extensions: vec![
                "KHR_vulkan_enable2",
                "KHR_composition_layer_depth",
                "FB_display_refresh_rate",
                "EXT_local_floor",
            ],
            refuses: Vec::new(),
            vulkan_device: 0,
            oldest_vulkan: sys::Version::new(1, 0, 0),
            speaks_1_0: true,
            eyes: Eyes {
                count: 2,
                size: [256; 2],
                offset: 0.032,
                // Eyes see further outwards than towards the nose.
                fov: [fov(-0.9, 0.7), fov(-0.7, 0.9)],
            },
            // R8G8B8A8_SRGB, B8G8R8A8_SRGB, R8G8B8A8_UNORM, D32_SFLOAT.
            formats: vec![43, 50, 37, 126],
            connected: true,
        }
    }
}

impl Default for Script {
    fn default() -> Self {
        Self {
            headset: Headset::default(),
            clock: ClockKind::Virtual,
            rate: 90.0,
            head: Box::new(look_around),
            controllers: [None; 2],
            faults: Vec::new(),
            keep: Vec::new(),
            log_to: None,
        }
    }
}

impl Script {
    /// For a runtime that a loader found: the system's clock, `SHADECAST_SIM_FRAMES`
    /// frames until the user leaves, and a log in the file `SHADECAST_SIM_LOG`.
    #[must_use]
    pub fn from_environment() -> Self {
        let mut script = Self {
            clock: ClockKind::System,
            log_to: std::env::var_os("SHADECAST_SIM_LOG").map(Into::into),
            ..Self::default()
        };
        script.headset.extensions.push("KHR_convert_timespec_time");
        let frames = std::env::var("SHADECAST_SIM_FRAMES").ok();
        if let Some(frames) = frames.and_then(|text| text.parse().ok()) {
            script.faults.push((frames, Fault::Exit));
        }
        script
    }
}

/// A person who stands, sways and looks around: up to 40°/s.
fn look_around(seconds: f64) -> Posef {
    let turn = 0.6 * (1.1 * seconds).sin() as f32;
    Posef {
        orientation: sys::Quaternionf {
            x: 0.0,
            y: (turn * 0.5).sin(),
            z: 0.0,
            w: (turn * 0.5).cos(),
        },
        position: Vector3f {
            x: 0.15 * (0.9 * seconds).sin() as f32,
            y: 1.6 + 0.02 * (2.3 * seconds).sin() as f32,
            z: 0.1 * (0.7 * seconds).cos() as f32,
        },
    }
}

impl Controller {
    /// At the hip, at rest.
    pub const AT_REST: Self = Self {
        aim: Posef {
            position: Vector3f {
                x: 0.2,
                y: 1.0,
                z: -0.3,
            },
            ..pose::IDENTITY
        },
        pressed: false,
        stick: Vector2f { x: 0.0, y: 0.0 },
    };
}
