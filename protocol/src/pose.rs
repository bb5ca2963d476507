//! Where a head is, and what its eyes see.

use glam::{Mat4, Quat, Vec3};
use serde::{Deserialize, Serialize};

/// A rigid transform `a_from_b`: the orientation and origin of `b` in `a`.
///
/// Metres, right-handed, +Y up, -Z forward, as OpenXR has it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Origin of the inner space in the outer one, metres.
    pub position: Vec3,
    /// Unit quaternion.
    pub orientation: Quat,
}

impl Pose {
    /// The identity.
    pub const IDENTITY: Self = Self {
        position: Vec3::ZERO,
        orientation: Quat::IDENTITY,
    };

    /// `a_from_c = a_from_b * b_from_c`.
    #[must_use]
    pub fn then(self, inner: Self) -> Self {
        Self {
            position: self.position + self.orientation * inner.position,
            orientation: (self.orientation * inner.orientation).normalize(),
        }
    }

    /// `b_from_a`.
    #[must_use]
    pub fn inverse(self) -> Self {
        let orientation = self.orientation.conjugate();
        Self {
            position: -(orientation * self.position),
            orientation,
        }
    }

    /// The same transform as a matrix, `outer_from_inner`.
    #[must_use]
    pub fn matrix(self) -> Mat4 {
        Mat4::from_rotation_translation(self.orientation, self.position)
    }

    /// The transform of a point from the inner space to the outer one.
    #[must_use]
    pub fn transform_point(self, point_in_inner: Vec3) -> Vec3 {
        self.position + self.orientation * point_in_inner
    }

    /// Where a body with these velocities (m/s and rad/s about world axes)
    /// is after `seconds`.
    #[must_use]
    pub fn extrapolate(self, linear: Vec3, angular: Vec3, seconds: f32) -> Self {
        Self {
            position: self.position + linear * seconds,
            orientation: (Quat::from_scaled_axis(angular * seconds) * self.orientation).normalize(),
        }
    }

    /// True when every number is finite and the quaternion has unit length.
    #[must_use]
    pub fn is_valid(self) -> bool {
        self.position.is_finite()
            && self.orientation.is_finite()
            && (self.orientation.length_squared() - 1.0).abs() < 1e-2
    }
}

/// A pose and how it changes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// `outer_from_inner` at some moment.
    pub pose: Pose,
    /// m/s in the outer space.
    pub linear_velocity: Vec3,
    /// rad/s about axes of the outer space.
    pub angular_velocity: Vec3,
}

impl Motion {
    /// A pose that stays.
    #[must_use]
    pub const fn still(pose: Pose) -> Self {
        Self {
            pose,
            linear_velocity: Vec3::ZERO,
            angular_velocity: Vec3::ZERO,
        }
    }

    /// At `pose`, with the mean velocities of a way from `before` to `after` in
    /// `seconds`, which turns by less than half a circle. No time, no velocity.
    #[must_use]
    pub fn along(pose: Pose, [before, after]: [Pose; 2], seconds: f32) -> Self {
        let turned = (after.orientation * before.orientation.conjugate()).normalize();
        // Of the two quaternions of a rotation, the one of the short way.
        let turned = if turned.w < 0.0 { -turned } else { turned };
        let per_second = if seconds > 0.0 { seconds.recip() } else { 0.0 };
        Self {
            pose,
            linear_velocity: (after.position - before.position) * per_second,
            angular_velocity: turned.to_scaled_axis() * per_second,
        }
    }

    /// The pose `seconds` after the moment.
    #[must_use]
    pub fn after(self, seconds: f32) -> Pose {
        self.pose
            .extrapolate(self.linear_velocity, self.angular_velocity, seconds)
    }

    /// The same motion seen from a space in which the outer one stands still.
    #[must_use]
    pub fn seen_from(self, space_from_outer: Pose) -> Self {
        Self {
            pose: space_from_outer.then(self.pose),
            linear_velocity: space_from_outer.orientation * self.linear_velocity,
            angular_velocity: space_from_outer.orientation * self.angular_velocity,
        }
    }
}

/// A field of view by the signed angles of its four sides, radians, as
/// `XrFovf`: left and down are negative for an ordinary eye.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fov {
    /// Angle of the left side, usually negative.
    pub left: f32,
    /// Angle of the right side.
    pub right: f32,
    /// Angle of the upper side.
    pub up: f32,
    /// Angle of the lower side, usually negative.
    pub down: f32,
}

impl Fov {
    /// A symmetric field of view of `radians` on both axes.
    #[must_use]
    pub fn symmetric(radians: f32) -> Self {
        let half = radians * 0.5;
        Self {
            left: -half,
            right: half,
            up: half,
            down: -half,
        }
    }

    /// Tangents of the four sides: left, right, up, down.
    #[must_use]
    pub fn tangents(self) -> [f32; 4] {
        [
            self.left.tan(),
            self.right.tan(),
            self.up.tan(),
            self.down.tan(),
        ]
    }

    /// The field of view whose image plane is `factor` times as wide and high
    /// about the same centre of projection (SAS 2018, section 3.1: the pixels
    /// in the middle keep their size).
    #[must_use]
    pub fn enlarged(self, factor: f32) -> Self {
        let scale = |angle: f32| (angle.tan() * factor).atan();
        Self {
            left: scale(self.left),
            right: scale(self.right),
            up: scale(self.up),
            down: scale(self.down),
        }
    }

    /// Reversed-Z projection with an infinite far plane: depth is 1 at `near`
    /// and falls to 0 at infinity, so that precision does not end at a far plane.
    #[must_use]
    pub fn projection(self, near: f32) -> Mat4 {
        let [l, r, u, d] = self.tangents();
        let (w, h) = (r - l, u - d);
        Mat4::from_cols_array(&[
            2.0 / w,
            0.0,
            0.0,
            0.0,
            0.0,
            2.0 / h,
            0.0,
            0.0,
            (r + l) / w,
            (u + d) / h,
            0.0,
            -1.0,
            0.0,
            0.0,
            near,
            0.0,
        ])
    }

    /// True when the four angles span a real picture below 180 degrees.
    #[must_use]
    pub fn is_valid(self) -> bool {
        let limit = 89.5_f32.to_radians();
        let inside = |a: f32| a.is_finite() && a.abs() <= limit;
        inside(self.left)
            && inside(self.right)
            && inside(self.up)
            && inside(self.down)
            && self.right - self.left > 1e-3
            && self.up - self.down > 1e-3
    }
}

/// One eye of a headset.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EyeView {
    /// The eye in the head.
    pub head_from_eye: Pose,
    /// What it sees.
    pub fov: Fov,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_turns_with_its_space() {
        let quarter = Pose {
            position: Vec3::X,
            orientation: Quat::from_rotation_y(std::f32::consts::FRAC_PI_2),
        };
        let motion = Motion {
            pose: Pose::IDENTITY,
            linear_velocity: Vec3::NEG_Z,
            angular_velocity: Vec3::Y,
        };
        let turned = motion.seen_from(quarter);
        assert!((turned.linear_velocity - Vec3::NEG_X).length() < 1e-6);
        assert!((turned.angular_velocity - Vec3::Y).length() < 1e-6);
        assert_eq!(turned.pose.position, Vec3::X);
    }

    #[test]
    fn a_motion_leads_from_one_end_of_its_way_to_the_other() {
        let before = Pose {
            position: Vec3::new(1e5, 2.0, 3.0),
            orientation: Quat::from_rotation_x(3.0),
        };
        let after = Pose {
            position: Vec3::new(1e5 + 1.0, 1.0, 3.0),
            // The other quaternion of the same rotation: the short way counts.
            orientation: -Quat::from_rotation_x(3.5),
        };
        let motion = Motion::along(before, [before, after], 0.25);
        assert_eq!(motion.linear_velocity, Vec3::new(4.0, -4.0, 0.0));
        let found = motion.after(0.25);
        assert!(found.orientation.angle_between(after.orientation) < 1e-3);
        assert_eq!(found.position, after.position);
        let standstill = Motion::along(before, [before, after], 0.0);
        assert_eq!(standstill, Motion::still(before));
    }
}
