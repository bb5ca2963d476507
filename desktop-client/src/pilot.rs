//! A head that is moved by mouse and keyboard.

use std::collections::HashSet;
use std::f32::consts::FRAC_PI_2;

use glam::{EulerRot, Quat, Vec3};
use shadecast_protocol::{Motion, Pose};
use winit::keyboard::KeyCode;

use crate::trace::EYE_HEIGHT;

/// A brisk walk, m/s.
const SPEED: f32 = 1.5;
/// Radians a count of the mouse: half a turn in a hand's width at 1600 counts
/// an inch.
const TURN: f32 = 0.0005;

/// Where the head is and which keys are held.
#[derive(Debug)]
pub(crate) struct Pilot {
    position: Vec3,
    yaw: f32,
    pitch: f32,
    held: HashSet<KeyCode>,
}

impl Pilot {
    /// In the middle of the play space, looking ahead.
    pub(crate) fn new() -> Self {
        Self {
            position: Vec3::new(0.0, EYE_HEIGHT, 0.0),
            yaw: 0.0,
            pitch: 0.0,
            held: HashSet::new(),
        }
    }

    /// A key went down or up.
    pub(crate) fn key(&mut self, key: KeyCode, down: bool) {
        if down {
            self.held.insert(key);
        } else {
            self.held.remove(&key);
        }
    }

    /// The mouse moved right and down.
    pub(crate) fn look(&mut self, (right, down): (f64, f64)) {
        self.yaw -= right as f32 * TURN;
        self.pitch = (self.pitch - down as f32 * TURN).clamp(-FRAC_PI_2, FRAC_PI_2);
    }

    /// Moves on by `seconds`.
    pub(crate) fn step(&mut self, seconds: f32) -> Motion {
        let along = |forward: KeyCode, backward: KeyCode| {
            f32::from(self.held.contains(&forward)) - f32::from(self.held.contains(&backward))
        };
        let wish = Vec3::new(
            along(KeyCode::KeyD, KeyCode::KeyA),
            along(KeyCode::KeyE, KeyCode::KeyQ),
            along(KeyCode::KeyS, KeyCode::KeyW),
        );
        let velocity = Quat::from_rotation_y(self.yaw) * wish.normalize_or_zero() * SPEED;
        self.position += velocity * seconds;
        Motion {
            pose: Pose {
                position: self.position,
                orientation: Quat::from_euler(EulerRot::YXZ, self.yaw, self.pitch, 0.0),
            },
            linear_velocity: velocity,
            // A mouse says nothing of where it is going.
            angular_velocity: Vec3::ZERO,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forward_is_where_one_looks() {
        let mut pilot = Pilot::new();
        pilot.look((-f64::from(FRAC_PI_2 / TURN), 0.0));
        pilot.key(KeyCode::KeyW, true);
        let motion = pilot.step(1.0);
        assert!((motion.linear_velocity - Vec3::NEG_X * SPEED).length() < 1e-3);
        assert!((motion.pose.orientation * Vec3::NEG_Z - Vec3::NEG_X).length() < 1e-3);
        pilot.key(KeyCode::KeyW, false);
        assert_eq!(pilot.step(1.0).linear_velocity, Vec3::ZERO);
    }

    #[test]
    fn nobody_looks_further_up_than_up() {
        let mut pilot = Pilot::new();
        pilot.look((0.0, -1e9));
        let up = pilot.step(0.0).pose.orientation * Vec3::NEG_Z;
        assert!((up - Vec3::Y).length() < 1e-3);
    }
}
