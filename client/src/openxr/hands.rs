//! Controllers through the action system: where they aim, whether their button
//! is pressed, and how the thumbstick lies.

use ::openxr as xr;
use glam::Vec2;
use shadecast_protocol::Hand;

use super::HeadsetError;
use super::error::refused;
use super::space::pose_from_xr;

/// A profile of controllers, and where it has button and stick. All have an aim.
struct Profile {
    path: &'static str,
    button: &'static str,
    stick: Option<&'static str>,
}

/// The first is one that every runtime maps its controllers to.
const PROFILES: [Profile; 4] = [
    Profile {
        path: "/interaction_profiles/khr/simple_controller",
        button: "select/click",
        stick: None,
    },
    Profile {
        path: "/interaction_profiles/oculus/touch_controller",
        button: "trigger/value",
        stick: Some("thumbstick"),
    },
    Profile {
        path: "/interaction_profiles/valve/index_controller",
        button: "trigger/click",
        stick: Some("thumbstick"),
    },
    Profile {
        path: "/interaction_profiles/bytedance/pico4_controller",
        button: "trigger/click",
        stick: Some("thumbstick"),
    },
];

const SIDES: [&str; 2] = [xr::USER_HAND_LEFT, xr::USER_HAND_RIGHT];

/// What both controllers do. Left, then right.
pub(super) struct Hands {
    // Spaces before the actions that they follow.
    spaces: [xr::Space; 2],
    aim: xr::Action<xr::Posef>,
    button: xr::Action<bool>,
    stick: xr::Action<xr::Vector2f>,
    sides: [xr::Path; 2],
    set: xr::ActionSet,
    pressed: [bool; 2],
    presses: [u16; 2],
}

impl Hands {
    /// Of a session that has no actions yet.
    pub(super) fn new(session: &xr::Session<xr::Vulkan>) -> Result<Self, HeadsetError> {
        let no_actions = refused("takes no actions");
        Self::create(session).map_err(no_actions)
    }

    fn create(session: &xr::Session<xr::Vulkan>) -> xr::Result<Self> {
        let instance = session.instance();
        let [left, right] = SIDES.map(|side| instance.string_to_path(side));
        let sides = [left?, right?];
        let set = instance.create_action_set("play", "Play", 0)?;
        let aim = set.create_action("aim", "Aim", &sides)?;
        let button = set.create_action("press", "Press", &sides)?;
        let stick = set.create_action("walk", "Walk", &sides)?;
        for (rank, profile) in PROFILES.iter().enumerate() {
            let suggested = suggest(instance, profile, &aim, &button, &stick);
            match suggested {
                Err(error) if rank == 0 => return Err(error),
                Err(error) => tracing::debug!("{} is not known: {error}", profile.path),
                Ok(()) => {}
            }
        }
        session.attach_action_sets(&[&set])?;
        let [left, right] = sides.map(|side| aim.create_space(session, side, xr::Posef::IDENTITY));
        Ok(Self {
            spaces: [left?, right?],
            aim,
            button,
            stick,
            sides,
            set,
            pressed: [false; 2],
            presses: [0; 2],
        })
    }

    /// Takes what happened since the last time.
    pub(super) fn sync(&mut self, session: &xr::Session<xr::Vulkan>) -> Result<(), HeadsetError> {
        let set = xr::ActiveActionSet::new(&self.set);
        session
            .sync_actions(&[set])
            .map_err(refused("does not tell of the controllers"))?;
        for hand in 0..2 {
            let state = self.button.state(session, self.sides[hand]);
            let pressed = state.is_ok_and(|state| state.is_active && state.current_state);
            if pressed && !self.pressed[hand] {
                self.presses[hand] = self.presses[hand].wrapping_add(1);
            }
            self.pressed[hand] = pressed;
        }
        Ok(())
    }

    /// The controllers at a time, in the space `base`; none for one that is not
    /// there.
    pub(super) fn locate(
        &self,
        session: &xr::Session<xr::Vulkan>,
        base: &xr::Space,
        time: xr::Time,
    ) -> [Option<Hand>; 2] {
        [0, 1].map(|hand: usize| {
            let is_there = self.aim.is_active(session, self.sides[hand]);
            if !is_there.unwrap_or(false) {
                return None;
            }
            let location = self.spaces[hand].locate(base, time).ok()?;
            let valid =
                xr::SpaceLocationFlags::POSITION_VALID | xr::SpaceLocationFlags::ORIENTATION_VALID;
            if !location.location_flags.contains(valid) {
                return None;
            }
            Some(Hand {
                world_from_aim: pose_from_xr(location.pose)?,
                pressed: self.pressed[hand],
                presses: self.presses[hand],
            })
        })
    }

    /// The stick that is pushed the furthest: right and ahead.
    pub(super) fn stick(&self, session: &xr::Session<xr::Vulkan>) -> Vec2 {
        let sticks = self.sides.map(|side| {
            let state = self.stick.state(session, side);
            state
                .ok()
                .filter(|state| state.is_active)
                .map_or(Vec2::ZERO, |state| {
                    Vec2::new(state.current_state.x, state.current_state.y)
                })
        });
        let [left, right] = sticks;
        if right.length_squared() > left.length_squared() {
            right
        } else {
            left
        }
    }
}

fn suggest(
    instance: &xr::Instance,
    profile: &Profile,
    aim: &xr::Action<xr::Posef>,
    button: &xr::Action<bool>,
    stick: &xr::Action<xr::Vector2f>,
) -> xr::Result<()> {
    let mut bindings = Vec::new();
    for side in SIDES {
        let path = |input: &str| instance.string_to_path(&format!("{side}/input/{input}"));
        bindings.push(xr::Binding::new(aim, path("aim/pose")?));
        bindings.push(xr::Binding::new(button, path(profile.button)?));
        if let Some(input) = profile.stick {
            bindings.push(xr::Binding::new(stick, path(input)?));
        }
    }
    let profile = instance.string_to_path(profile.path)?;
    instance.suggest_interaction_profile_bindings(profile, &bindings)
}
