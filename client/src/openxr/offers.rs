//! Which extensions of OpenXR are used, of those that the runtime offers. What
//! it does not offer is left out: not enabled, not made, not submitted.

use std::fmt;

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
    /// Controllers of Pico under their own name: XR_BD_controller_interaction.
    pub pico_controllers: bool,
    /// A compositor that makes every second frame from motion vectors:
    /// XR_FB_space_warp. It is never enabled, since it would halve the rate at which
    /// we draw, and all that we draw is what is held: the log says which of the two
    /// is why it is left out.
    pub space_warp: bool,
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
            pico_controllers: extensions.bd_controller_interaction,
            space_warp: extensions.fb_space_warp,
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
        set.bd_controller_interaction = self.pico_controllers;
        #[cfg(target_os = "android")]
        {
            set.khr_android_create_instance = true;
        }
        set
    }

    /// Names of what is used, and of what is left out because the runtime does not
    /// offer it.
    fn all(self) -> [(bool, &'static str); 5] {
        [
            (self.depth, "depth"),
            (self.display_rate, "display rate"),
            (self.clock, "clock"),
            (self.local_floor, "local floor"),
            (self.pico_controllers, "controllers of Pico"),
        ]
    }

    /// Names of what is left out because the runtime does not offer it.
    pub fn left_out(self) -> impl Iterator<Item = &'static str> {
        let space_warp = (self.space_warp, "space warp");
        self.all()
            .into_iter()
            .chain([space_warp])
            .filter_map(|(offered, name)| (!offered).then_some(name))
    }
}

/// For the log: what is used, and what is not, with the reason.
impl fmt::Display for Offers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let used = self.all().into_iter().filter(|(offered, _)| *offered);
        let used: Vec<_> = used.map(|(_, name)| name).collect();
        let missing: Vec<_> = self.left_out().collect();
        let or_nothing = |names: Vec<&str>| match &names[..] {
            [] => "nothing".to_owned(),
            names => names.join(", "),
        };
        let (used, missing) = (or_nothing(used), or_nothing(missing));
        write!(f, "with {used}; not offered: {missing}")?;
        if self.space_warp {
            write!(f, "; not needed: space warp, since every frame is drawn")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_used_and_what_is_not_is_said_with_the_reason() {
        let none = Offers::default();
        assert_eq!(
            none.to_string(),
            "with nothing; not offered: depth, display rate, clock, local floor, \
             controllers of Pico, space warp"
        );
        let quest = Offers {
            depth: true,
            display_rate: true,
            clock: true,
            local_floor: true,
            pico_controllers: false,
            space_warp: true,
        };
        assert_eq!(
            quest.to_string(),
            "with depth, display rate, clock, local floor; not offered: controllers of Pico; \
             not needed: space warp, since every frame is drawn"
        );
        assert!(!quest.enable().fb_space_warp);
    }
}
