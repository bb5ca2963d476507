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
