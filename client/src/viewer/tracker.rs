//! Where a head is, of a phone that only knows how it is turned.
//!
//! A phone's sensors tell its orientation in a world whose Z is up (Android's
//! rotation vector) and how fast it turns about its own axes. The head turns about
//! the neck: eyes that look elsewhere move by some centimetres, and the world then
//! moves as it does for real. Until the light leaves the display the head turns on.

use std::f32::consts::FRAC_PI_2;

use glam::{Quat, Vec3};
use shadecast_protocol::{ClientTime, Motion, Pose};

/// Of someone who stands, metres.
const EYE_HEIGHT: f32 = 1.6;
/// The eyes, seen from where the neck turns, metres.
const NECK_TO_EYES: Vec3 = Vec3::new(0.0, 0.075, -0.08);
/// Longest time that a head is believed to turn on, seconds.
const LONGEST: f32 = 0.1;
/// Faster no head turns, radians a second.
const FASTEST: f32 = 20.0;

/// What a phone's sensors have told.
#[derive(Clone, Copy, Debug)]
pub struct HeadTracker {
    /// The phone's own axes, which are those of its upright screen, from the axes of
    /// what it shows.
    device_from_screen: Quat,
    /// World from screen, with Y up.
    orientation: Quat,
    /// When that was.
    turned_at: Option<ClientTime>,
    /// About the phone's own axes, radians a second.
    spin: Vec3,
    /// What turns the direction that counts as ahead to where it is ahead.
    ahead: Option<Quat>,
}

impl HeadTracker {
    /// Of a phone that shows its pictures turned by so many quarters, as Android
    /// counts them: 1 is a phone that was turned to the left.
    #[must_use]
    pub fn new(quarters: u8) -> Self {
        Self {
            device_from_screen: Quat::from_rotation_z(-FRAC_PI_2 * f32::from(quarters % 4)),
            orientation: Quat::IDENTITY,
            turned_at: None,
            spin: Vec3::ZERO,
            ahead: None,
        }
    }

    /// How the phone was turned at a time: a rotation vector's x, y, z and w. What is
    /// no rotation is passed over.
    pub fn take_rotation(&mut self, at: ClientTime, rotation: [f32; 4]) {
        let rotation = Quat::from_array(rotation);
        let length = rotation.length_squared();
        if !(length.is_finite() && length > 0.25) {
            return;
        }
        let y_up_from_z_up = Quat::from_rotation_x(-FRAC_PI_2);
        self.orientation =
            (y_up_from_z_up * rotation.normalize() * self.device_from_screen).normalize();
        self.turned_at = Some(at);
        if self.ahead.is_none() {
            self.recentre();
        }
    }

    /// How fast it turns about its own axes, radians a second. What is not finite is
    /// passed over.
    pub fn take_spin(&mut self, spin: [f32; 3]) {
        let spin = Vec3::from_array(spin);
        if spin.is_finite() {
            self.spin = spin.clamp_length_max(FASTEST);
        }
    }

    /// Ahead is now where the head looks.
    pub fn recentre(&mut self) {
        let looks = self.orientation * Vec3::NEG_Z;
        // Straight up or down, any direction is as good as another.
        let yaw = (-looks.x).atan2(-looks.z);
        self.ahead = Some(Quat::from_rotation_y(-yaw));
    }

    /// Where the head is in the play space, at a time shortly after the last reading.
    #[must_use]
    pub fn at(&self, time: ClientTime) -> Motion {
        let seconds = self
            .turned_at
            .map_or(0.0, |at| time.0.saturating_sub(at.0) as f32 * 1e-9);
        let now = self.ahead.unwrap_or(Quat::IDENTITY) * self.orientation;
        let turns = now * (self.device_from_screen.inverse() * self.spin);
        let orientation = (Quat::from_scaled_axis(turns * seconds.min(LONGEST)) * now).normalize();
        let from_neck = orientation * NECK_TO_EYES;
        Motion {
            pose: Pose {
                position: Vec3::Y * EYE_HEIGHT + from_neck - NECK_TO_EYES,
                orientation,
            },
            linear_velocity: turns.cross(from_neck),
            angular_velocity: turns,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: ClientTime = ClientTime(5_000_000_000);

    /// The rotation vector of a phone whose axes point there, in Android's world: X
    /// and Y level, Z up.
    fn phone(x: Vec3, y: Vec3) -> [f32; 4] {
        let axes = glam::Mat3::from_cols(x, y, x.cross(y));
        Quat::from_mat3(&axes).to_array()
    }

    /// In a viewer, turned to the left, looking along Android's +Y: its own +X is up,
    /// its +Y to the left, its screen faces the user.
    fn level() -> [f32; 4] {
        phone(Vec3::Z, Vec3::NEG_X)
    }

    fn looks(motion: &Motion) -> Vec3 {
        motion.pose.orientation * Vec3::NEG_Z
    }

    #[test]
    fn a_phone_that_is_put_in_looks_ahead_upright() {
        for (quarters, rotation) in [
            (1, level()),
            (3, phone(Vec3::NEG_Z, Vec3::X)),
            (0, phone(Vec3::X, Vec3::Z)),
        ] {
            let mut tracker = HeadTracker::new(quarters);
            tracker.take_rotation(NOW, rotation);
            let motion = tracker.at(NOW);
            assert!((looks(&motion) - Vec3::NEG_Z).length() < 1e-5, "{quarters}");
            let up = motion.pose.orientation * Vec3::Y;
            assert!((up - Vec3::Y).length() < 1e-5, "{quarters}: {up}");
            assert!((motion.pose.position.y - EYE_HEIGHT).abs() < 1e-5);
        }
    }

    #[test]
    fn ahead_is_where_it_was_put_in_and_the_head_turns_from_there() {
        let mut tracker = HeadTracker::new(1);
        // Put in looking along -X, which is then ahead.
        tracker.take_rotation(NOW, phone(Vec3::Z, Vec3::NEG_Y));
        assert!((looks(&tracker.at(NOW)) - Vec3::NEG_Z).length() < 1e-5);
        // A quarter to the right of it: along +Y.
        tracker.take_rotation(NOW, level());
        let motion = tracker.at(NOW);
        assert!((looks(&motion) - Vec3::X).length() < 1e-5, "{motion:?}");
        // The eyes went about the neck, and not away.
        let from_neck = motion.pose.position - (Vec3::Y * EYE_HEIGHT - NECK_TO_EYES);
        assert!((from_neck.length() - NECK_TO_EYES.length()).abs() < 1e-5);
        tracker.recentre();
        assert!((looks(&tracker.at(NOW)) - Vec3::NEG_Z).length() < 1e-5);
    }

    #[test]
    fn the_head_turns_on_until_the_light_leaves_but_not_for_ever() {
        let mut tracker = HeadTracker::new(1);
        tracker.take_rotation(NOW, level());
        // To the left: about up, which is the phone's own X.
        tracker.take_spin([2.0, 0.0, 0.0]);
        let later = |ms: u64| tracker.at(ClientTime(NOW.0 + ms * 1_000_000));
        let motion = later(50);
        let angle = looks(&motion).angle_between(Vec3::NEG_Z);
        assert!(
            (angle - 0.1).abs() < 1e-4 && looks(&motion).x < 0.0,
            "{motion:?}"
        );
        assert!((motion.angular_velocity - Vec3::Y * 2.0).length() < 1e-4);
        // The eyes are ahead of the neck: they go left.
        assert!(motion.linear_velocity.x < -0.1, "{motion:?}");
        assert_eq!(later(60_000).pose, later(200).pose);
        assert_eq!(
            tracker.at(ClientTime(0)).pose,
            later(0).pose,
            "time that went back"
        );
    }

    #[test]
    fn what_no_sensor_tells_is_passed_over() {
        let mut tracker = HeadTracker::new(1);
        let before = tracker.at(NOW);
        assert!(before.pose.position.is_finite(), "nothing was told yet");
        tracker.take_rotation(NOW, [f32::NAN; 4]);
        tracker.take_rotation(NOW, [0.0; 4]);
        tracker.take_spin([f32::INFINITY, 0.0, 0.0]);
        assert_eq!(tracker.at(NOW), before);
        tracker.take_spin([0.0, 1e30, 0.0]);
        assert!(tracker.at(NOW).angular_velocity.length() <= FASTEST * 1.001);
        // Straight down, where no direction is ahead.
        tracker.take_rotation(NOW, phone(Vec3::X, Vec3::Y));
        assert!(tracker.at(NOW).pose.orientation.is_finite());
    }
}
