//! What an application did.

use openxr_sys as sys;
use sys::{Fovf, Posef};

/// Everything that a test may want to look at.
#[derive(Clone, Debug, Default)]
pub struct Log {
    /// Frames that were waited for.
    pub waited: u64,
    /// Frames that were ended, in order.
    pub frames: Vec<Submitted>,
    /// Every time at which views were located, and where they were found last.
    pub located: Vec<(i64, [Posef; 2])>,
    /// States that sessions were sent through, in order.
    pub states: Vec<sys::SessionState>,
    /// Calls that broke a rule, and what they earned.
    pub misuse: Vec<(&'static str, sys::Result)>,
    /// Sessions that were created.
    pub sessions: u32,
    /// Swapchains that were created: format, width, height.
    pub swapchains: Vec<(i64, u32, u32)>,
    /// Extensions of the last instance.
    pub extensions: Vec<String>,
    /// Display rates that were asked for.
    pub rates: Vec<f32>,
    /// Frames that were ended too late to be shown in time (system clock only).
    pub late: u64,
    /// Pictures that were read back, by frame.
    pub images: Vec<(u64, [Image; 2])>,
    /// Depths that were read back, by frame.
    pub depths: Vec<(u64, [Image; 2])>,
}

impl Log {
    /// Calls that broke a rule. A loss is not the application's doing, and it may
    /// suggest bindings for controllers that a runtime does not know.
    #[must_use]
    pub fn broken_rules(&self) -> Vec<(&'static str, sys::Result)> {
        let blameless = [
            sys::Result::ERROR_SESSION_LOST,
            sys::Result::ERROR_INSTANCE_LOST,
            sys::Result::ERROR_FORM_FACTOR_UNAVAILABLE,
        ];
        let is_broken = |(name, result): &&(&str, sys::Result)| {
            !blameless.contains(result) && *name != "suggest_bindings"
        };
        self.misuse.iter().filter(is_broken).copied().collect()
    }
}

/// A frame that was ended.
#[derive(Clone, Debug)]
pub struct Submitted {
    /// Which, counted over all sessions.
    pub frame: u64,
    /// When it is shown, nanoseconds.
    pub display_time: i64,
    /// Whether something was to be drawn.
    pub should_render: bool,
    /// What was drawn.
    pub layers: Vec<Layer>,
}

/// A projection layer.
#[derive(Clone, Debug)]
pub struct Layer {
    /// Left and right.
    pub views: [ViewPart; 2],
}

/// One eye of a layer.
#[derive(Clone, Copy, Debug)]
pub struct ViewPart {
    /// Where it was drawn from, in the space of the layer.
    pub pose: Posef,
    /// What it sees.
    pub fov: Fovf,
    /// Layer of the swapchain's images.
    pub array_index: u32,
    /// Pixels.
    pub size: [i32; 2],
    /// Its depth, where one was submitted.
    pub depth: Option<DepthPart>,
}

/// The depth of an eye.
#[derive(Clone, Copy, Debug)]
pub struct DepthPart {
    /// Metres, at the least depth.
    pub near_z: f32,
    /// Metres, at the greatest depth.
    pub far_z: f32,
    /// Least and greatest depth.
    pub range: [f32; 2],
    /// Pixels.
    pub size: [i32; 2],
}

/// A picture that was read back, four bytes a pixel, row by row from the top.
#[derive(Clone, Debug)]
pub struct Image {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `4 * width * height` bytes.
    pub bytes: Vec<u8>,
}
