//! Which extensions of OpenXR are used, of those that the runtime offers. What
//! it does not offer is left out: not enabled, not made, not submitted.

use ::openxr as xr;

/// What a runtime can do beyond the core.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Offers {
    /// Depth beside the pictures, so that the compositor can move what is near
    /// by more than what is far: XR_KHR_composition_layer_depth.
    pub depth: bool,
    /// Rates of the display: XR_FB_display_refresh_rate.
    pub display_rate: bool,
    /// Times of the runtime on the system's clock.
    pub clock: bool,
    /// A floor below the place where the user faced ahead: XR_EXT_local_floor.
    pub local_floor: bool,
}

impl Offers {
    /// Of the extensions of a runtime.
    pub(super) fn of(extensions: &xr::ExtensionSet) -> Self {
        Self {
            depth: extensions.khr_composition_layer_depth,
            display_rate: extensions.fb_display_refresh_rate,
            #[cfg(windows)]
            clock: extensions.khr_win32_convert_performance_counter_time,
            #[cfg(not(windows))]
            clock: extensions.khr_convert_timespec_time,
            local_floor: extensions.ext_local_floor,
        }
    }

    /// The extensions to enable.
    pub(super) fn enable(self) -> xr::ExtensionSet {
        let mut set = xr::ExtensionSet::default();
        set.khr_vulkan_enable2 = true;
        set.khr_composition_layer_depth = self.depth;
        set.fb_display_refresh_rate = self.display_rate;
        #[cfg(windows)]
        {
            set.khr_win32_convert_performance_counter_time = self.clock;
        }
        #[cfg(not(windows))]
        {
            set.khr_convert_timespec_time = self.clock;
        }
        set.ext_local_floor = self.local_floor;
        #[cfg(target_os = "android")]
        {
            set.khr_android_create_instance = true;
        }
        set
    }

    /// Names of what is left out because the runtime does not offer it.
    pub fn left_out(self) -> impl Iterator<Item = &'static str> {
        let all = [
            (self.depth, "depth"),
            (self.display_rate, "display rate"),
            (self.clock, "clock"),
            (self.local_floor, "local floor"),
        ];
        all.into_iter()
            .filter_map(|(offered, name)| (!offered).then_some(name))
    }
}
