//! The part of a picture that is compared with a reference.
//!
//! A reference is worth little while its own noise is as large as the error to
//! be measured, and a software driver takes minutes for whole pictures without
//! noise. So each sample is compared in one square window with many samples a
//! pixel. The windows of a run stand on a grid, one sample a place in a fixed
//! order, so that together they cover the picture evenly.

use glam::Vec2;
use image::{RgbImage, imageops};
use shadecast_protocol::Fov;
use shadecast_server::still::Camera;

/// Side of a window, as a share of the picture's: 64 of 256 pixels. In the
/// demo's time two cores then trace enough samples to put the references' noise
/// well below the error that is to be measured, and the window is still wide
/// against the reach of the metrics' filters (5 pixels for SSIM, 10 for FLIP).
const SHARE: f32 = 0.25;
/// Never less: the window of SSIM must fit.
const MIN_SIDE: u32 = 16;

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Window {
    /// Left column.
    pub(super) x: u32,
    /// Upper row.
    pub(super) y: u32,
    pub(super) width: u32,
    pub(super) height: u32,
}

impl Window {
    /// The whole picture.
    pub(super) fn whole(camera: &Camera) -> Self {
        Self {
            x: 0,
            y: 0,
            width: camera.width,
            height: camera.height,
        }
    }

    /// The window of the `index`-th of `count` samples.
    pub(super) fn of_sample(index: usize, count: usize, camera: &Camera) -> Self {
        let shorter = camera.width.min(camera.height);
        let side = ((shorter as f32 * SHARE) as u32).max(MIN_SIDE).min(shorter);
        let rows = count.isqrt().max(1);
        let columns = (count / rows).max(1);
        let place = place(index, rows * columns);
        // From border to border; a single column or row stands in the middle.
        let along = |place: usize, places: usize, free: u32| match places {
            1 => free / 2,
            _ => (place * free as usize / (places - 1)) as u32,
        };
        Self {
            x: along(place % columns, columns, camera.width - side),
            y: along(place / columns, rows, camera.height - side),
            width: side,
            height: side,
        }
    }

    /// Sees through the window exactly what `camera` sees there.
    pub(super) fn camera(&self, camera: &Camera) -> Camera {
        let [left, right, up, down] = camera.fov.tangents();
        let size = Vec2::new(camera.width as f32, camera.height as f32);
        let angles_at = |x: u32, y: u32| {
            let at = Vec2::new(x as f32, y as f32) / size;
            let tangents = Vec2::new(left, up) + at * Vec2::new(right - left, down - up);
            (tangents.x.atan(), tangents.y.atan())
        };
        let (left, up) = angles_at(self.x, self.y);
        let (right, down) = angles_at(self.x + self.width, self.y + self.height);
        Camera {
            fov: Fov {
                left,
                right,
                up,
                down,
            },
            width: self.width,
            height: self.height,
            ..*camera
        }
    }

    /// This part of `picture`.
    pub(super) fn of(&self, picture: &RgbImage) -> RgbImage {
        imageops::crop_imm(picture, self.x, self.y, self.width, self.height).to_image()
    }
}

/// The place of the `index`-th sample: a shuffled but fixed order, in which any
/// few samples that follow each other lie far apart.
fn place(index: usize, places: usize) -> usize {
    // Multiples of the golden ratio, modulo one in 32 bits.
    const GOLDEN_RATIO: u32 = 0x9e37_79b9;
    let mut order: Vec<u32> = (0..places as u32).collect();
    order.sort_by_key(|place| place.wrapping_mul(GOLDEN_RATIO));
    order[index % places] as usize
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use glam::{Quat, Vec3};
    use proptest::prelude::*;
    use shadecast_protocol::Pose;

    use super::*;

    fn camera(width: u32, height: u32) -> Camera {
        Camera {
            world_from_eye: Pose {
                position: Vec3::new(1.0, 1.6, -2.0),
                orientation: Quat::from_rotation_y(0.4),
            },
            fov: Fov {
                left: -0.9,
                right: 0.7,
                up: 0.8,
                down: -0.6,
            },
            width,
            height,
        }
    }

    /// As the kernel of the stills makes a ray, in the eye.
    fn ray(camera: &Camera, pixel: Vec2) -> Vec3 {
        let [left, right, up, down] = camera.fov.tangents();
        let at = pixel / Vec2::new(camera.width as f32, camera.height as f32);
        Vec3::new(left + (right - left) * at.x, up + (down - up) * at.y, -1.0)
    }

    fn windows(count: usize, camera: &Camera) -> Vec<Window> {
        (0..count)
            .map(|index| Window::of_sample(index, count, camera))
            .collect()
    }

    proptest! {
        #[test]
        fn rays_through_a_window_are_those_of_the_picture(
            index in 0_usize..24, x in 0.0_f32..64.0, y in 0.0_f32..64.0,
        ) {
            let full = camera(256, 256);
            let window = Window::of_sample(index, 24, &full);
            let part = window.camera(&full);
            prop_assert_eq!((part.width, part.height), (64, 64));
            prop_assert_eq!(part.world_from_eye, full.world_from_eye);
            let inside = Vec2::new(x, y);
            let corner = Vec2::new(window.x as f32, window.y as f32);
            let distance = ray(&part, inside).distance(ray(&full, corner + inside));
            // A pixel is 0.008 wide; tangents through angles and back are exact to a few bits.
            prop_assert!(distance < 2e-6, "{}", distance);
        }

        #[test]
        fn windows_lie_within_the_picture(
            count in 1_usize..60, width in 16_u32..700, height in 16_u32..700,
        ) {
            for window in windows(count, &camera(width, height)) {
                prop_assert!(window.x + window.width <= width);
                prop_assert!(window.y + window.height <= height);
                prop_assert!(window.width >= MIN_SIDE && window.width == window.height);
            }
        }
    }

    #[test]
    fn windows_of_a_run_cover_the_picture_once_each() {
        let full = camera(256, 256);
        for (count, columns, rows) in [(20, 5, 4), (24, 6, 4), (9, 3, 3)] {
            let windows = windows(count, &full);
            let of = |axis: fn(&Window) -> u32| windows.iter().map(axis).collect::<HashSet<_>>();
            assert_eq!(of(|w| w.x).len(), columns, "{count}");
            assert_eq!(of(|w| w.y).len(), rows, "{count}");
            assert!(of(|w| w.x).contains(&0) && of(|w| w.x).contains(&192));
            let places: HashSet<_> = windows.iter().map(|w| (w.x, w.y)).collect();
            assert_eq!(places.len(), count);
        }
    }

    #[test]
    fn neighbours_in_time_are_not_neighbours_in_place() {
        let order: Vec<usize> = (0..20).map(|index| place(index, 20)).collect();
        assert!(order.windows(2).all(|pair| pair[0].abs_diff(pair[1]) > 1));
        assert_eq!(place(20, 20), order[0]);
    }

    #[test]
    fn one_sample_looks_at_the_middle() {
        let window = Window::of_sample(0, 1, &camera(256, 256));
        assert_eq!((window.x, window.y, window.width), (96, 96, 64));
    }
}
