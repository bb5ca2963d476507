//! Pictures of patch ids: from where, how wide, and of how many pixels.

use std::time::Duration;

use glam::{Mat4, vec3};
use shadecast_protocol::{EyeView, Fov, Pose, ViewReport};

/// Nearest thing that is drawn, metres: nearer than a face lets things come.
const NEAR: f32 = 0.02;
/// Largest factor by which an image plane grows: beyond it most of the pictures would
/// be margin.
const MOST_ENLARGED: f32 = 1.2;
/// Farthest that viewpoints stand aside of where eyes are expected, metres: about as
/// far as eyes are apart. From farther away they would see another scene.
const MOST_ASIDE: f32 = 0.06;

/// Two eyes moved apart, up and down by `aside`: they stand at the corners of a
/// rectangle that every head so far aside has its eyes in. Source: Kravec 2023,
/// algorithm 1, whose one camera has the corners beside it.
#[must_use]
pub fn corners(eyes: [EyeView; 2], aside: f32) -> [EyeView; 4] {
    let [left, right] = eyes;
    let aside = aside.min(MOST_ASIDE);
    let moved = |eye: EyeView, x: f32, y: f32| EyeView {
        head_from_eye: Pose {
            position: eye.head_from_eye.position + vec3(x, y, 0.0) * aside,
            ..eye.head_from_eye
        },
        ..eye
    };
    [
        moved(left, -1.0, 1.0),
        moved(right, 1.0, 1.0),
        moved(left, -1.0, -1.0),
        moved(right, 1.0, -1.0),
    ]
}

/// The factor of an image plane that shows `margin` radians more on its widest side.
#[must_use]
pub fn enlargement(fov: Fov, margin: f32) -> f32 {
    let widest = widest(fov);
    let beyond = (widest + margin).min(89.5_f32.to_radians());
    let factor = beyond.tan() / widest.tan();
    // False for NaN, which no valid field of view gives.
    if factor > 1.0 {
        factor.min(MOST_ENLARGED)
    } else {
        1.0
    }
}

/// The margin that an image plane larger by this factor shows.
pub(super) fn margin(fov: Fov, factor: f32) -> f32 {
    let widest = widest(fov);
    (widest.tan() * factor).atan() - widest
}

/// The angle of the widest side.
fn widest(fov: Fov) -> f32 {
    let sides = [fov.left, fov.right, fov.up, fov.down];
    sides.into_iter().map(f32::abs).fold(0.0, f32::max)
}

/// A picture of patch ids that is to be drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// From the beginning of the frame; objects are where they are then.
    pub after: Duration,
    /// The eye.
    pub world_from_eye: Pose,
    /// What the picture shows.
    pub fov: Fov,
    /// Its width and height, pixels.
    pub size: [u32; 2],
}

impl Viewpoint {
    /// Largest side of an id picture; beyond it pixels grow instead.
    pub const LARGEST_SIDE: u32 = 4096;
    /// Smallest side.
    const SMALLEST_SIDE: u32 = 16;

    /// What `eye` of a head sees on an image plane `enlargement` times as wide and
    /// high as the eye's own, with pixels as large as those of `view` (SAS 2018,
    /// section 3.1).
    #[must_use]
    pub fn new(
        after: Duration,
        world_from_head: Pose,
        eye: EyeView,
        view: &ViewReport,
        enlargement: f32,
    ) -> Self {
        let side = |side: u16| {
            let pixels = (f32::from(side) * enlargement).round() as u32;
            pixels.clamp(Self::SMALLEST_SIDE, Self::LARGEST_SIDE)
        };
        Self {
            after,
            world_from_eye: world_from_head.then(eye.head_from_eye),
            fov: eye.fov.enlarged(enlargement),
            size: view.eye_resolution.map(side),
        }
    }

    /// From the world into clip space.
    #[must_use]
    pub fn clip_from_world(&self) -> Mat4 {
        self.fov.projection(NEAR) * self.world_from_eye.inverse().matrix()
    }
}

#[cfg(test)]
mod tests {
    use super::{super::tests::view, *};

    #[test]
    fn pictures_grow_with_doubt_and_keep_the_size_of_their_pixels() {
        let view = view(Fov::symmetric(1.5));
        let wide = |fov, radians| enlargement(fov, radians);
        assert_eq!(wide(view.eyes[0].fov, 0.0), 1.0);
        let factor = wide(view.eyes[0].fov, 0.05);
        assert!((factor - (0.8_f32.tan() / 0.75_f32.tan())).abs() < 1e-4);
        for factor in [1.0, 1.1, 1.2, 1.4] {
            let fov = view.eyes[0].fov;
            let grown = enlargement(fov, margin(fov, factor));
            assert!((grown - factor.min(MOST_ENLARGED)).abs() < 1e-5);
        }
        let viewpoint = |factor| {
            let head = Pose::IDENTITY;
            Viewpoint::new(Duration::ZERO, head, view.eyes[0], &view, factor)
        };
        assert_eq!(viewpoint(1.2).size, [120, 96]);
        assert_eq!(viewpoint(1.0).fov, view.eyes[0].fov);
    }

    #[test]
    fn the_narrowest_and_the_widest_eyes_stay_possible() {
        for degrees in [1.0_f32, 170.0, 178.0] {
            for doubt in [0.0, 0.1, 3.0, f32::INFINITY, f32::NAN] {
                let view = view(Fov::symmetric(degrees.to_radians()));
                let factor = enlargement(view.eyes[0].fov, doubt);
                assert!((1.0..=MOST_ENLARGED).contains(&factor), "{degrees} {doubt}");
                let head = Pose::IDENTITY;
                let seen = Viewpoint::new(Duration::ZERO, head, view.eyes[0], &view, factor);
                assert!(seen.fov.right > seen.fov.left && seen.clip_from_world().is_finite());
            }
        }
    }
}
