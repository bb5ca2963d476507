//! Where things appear: right pixels, right side up, nearest first.

use std::f32::consts::FRAC_PI_2;
use std::sync::Arc;

use glam::{Quat, Vec2, Vec3};
use shadecast_protocol::{Motion, Pose, Sky};

use super::*;

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_quad_covers_its_pixels_right_side_up() {
    // At 2 m the view is 4 m wide, so that 1 m takes 16 of 64 pixels.
    let frame = Geometry::default()
        .whole_quad(Vec3::new(0.0, 0.0, -2.0), 1.0)
        .frame(four_colors());
    let seen = Bench::with_frame(&frame).look(Pose::IDENTITY);
    assert_eq!(seen.columns_in_row(32), Some((16, 47)));
    assert_eq!(seen.columns_in_row(16), Some((16, 47)));
    assert_eq!(seen.columns_in_row(15), None);
    assert_eq!(seen.columns_in_row(48), None);
    assert_close(seen.at(20, 20), [255, 0, 0], 1);
    assert_close(seen.at(44, 20), [0, 255, 0], 1);
    assert_close(seen.at(20, 44), [0, 0, 255], 1);
    assert_close(seen.at(44, 44), [255, 255, 255], 1);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn the_back_of_a_quad_is_not_there() {
    let frame = Geometry::default()
        .whole_quad(Vec3::new(0.0, 0.0, -2.0), 1.0)
        .frame(four_colors());
    let behind = Pose {
        position: Vec3::new(0.0, 0.0, -4.0),
        orientation: Quat::from_rotation_y(2.0 * FRAC_PI_2),
    };
    let seen = Bench::with_frame(&frame).look(behind);
    assert!((0..SIZE).all(|y| seen.columns_in_row(y).is_none()));
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn the_nearest_is_seen_whatever_is_drawn_last() {
    let red = [Vec2::splat(1.5), Vec2::splat(2.5)];
    let white = [Vec2::splat(12.5), Vec2::splat(13.5)];
    let frame = Geometry::default()
        .quad(Vec3::new(0.0, 0.0, -2.0), 0.5, 0, red)
        .quad(Vec3::new(0.0, 0.0, -3.0), 3.0, 0, white)
        .frame(four_colors());
    let seen = Bench::with_frame(&frame).look(Pose::IDENTITY);
    assert_close(seen.at(32, 32), [255, 0, 0], 1);
    assert_close(seen.at(2, 2), [255, 255, 255], 1);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn what_is_a_hundred_kilometres_away_is_drawn_before_the_sky() {
    let frame = Geometry::default()
        .whole_quad(Vec3::new(0.0, 0.0, -1e5), 5e4)
        .frame(picture(16, |_, _| RED));
    let mut bench = Bench::with_frame(&frame);
    bench.renderer.set_sky(Some(&plain_sky([0, 0, 255])));
    let seen = bench.look(Pose::IDENTITY);
    assert_close(seen.at(32, 32), [255, 0, 0], 1);
    assert_close(seen.at(20, 20), [255, 0, 0], 1);
    assert_close(seen.at(4, 4), [0, 0, 255], 1);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_frame_without_triangles_shows_the_sky() {
    let mut bench = Bench::with_frame(&Geometry::default().frame(four_colors()));
    assert_close(bench.look(Pose::IDENTITY).at(32, 32), [0, 0, 0], 0);
    bench.renderer.set_sky(Some(&plain_sky([10, 20, 30])));
    assert_close(bench.look(Pose::IDENTITY).at(32, 32), [10, 20, 30], 0);
    bench.renderer.set_sky(None);
    assert_close(bench.look(Pose::IDENTITY).at(32, 32), [0, 0, 0], 0);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn the_sky_is_looked_up_by_direction() {
    // Columns of a hue for each quarter turn, the top row white.
    let (width, height) = (16_u16, 8_u16);
    let rgb = (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .flat_map(|(x, y)| match (y, (x + 2) / 4 % 4) {
            (0, _) => [255, 255, 255],
            (_, 0) => [255, 0, 0],
            (_, 1) => [0, 255, 0],
            (_, 2) => [0, 0, 255],
            _ => [255, 255, 0],
        })
        .collect();
    let mut bench = Bench::new(Stereo::TwoPass);
    bench.renderer.set_sky(Some(&Sky { width, height, rgb }));
    let towards = |orientation| {
        let pose = Pose {
            position: Vec3::new(3.0, 1.0, -7.0),
            orientation,
        };
        bench.look(pose).at(32, 32)
    };
    assert_close(towards(Quat::IDENTITY), [0, 0, 255], 0);
    assert_close(towards(Quat::from_rotation_y(-FRAC_PI_2)), [255, 255, 0], 0);
    assert_close(towards(Quat::from_rotation_y(FRAC_PI_2)), [0, 255, 0], 0);
    assert_close(
        towards(Quat::from_rotation_y(2.0 * FRAC_PI_2)),
        [255, 0, 0],
        0,
    );
    assert_close(towards(Quat::from_rotation_x(1.5)), [255, 255, 255], 0);
    // Right in the picture is right in the world.
    let ahead = bench.look(Pose::IDENTITY);
    assert!(ahead.at(63, 32)[0] > 100, "yellow begins at the right edge");
    assert!(ahead.at(0, 32)[1] > 100, "green ends at the left edge");
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn an_object_is_drawn_where_it_has_moved_to() {
    let red = [Vec2::splat(1.5), Vec2::splat(2.5)];
    let mut frame = Geometry::default()
        .quad(Vec3::ZERO, 0.5, 1, red)
        .frame(four_colors());
    let still = |x| Motion::still(at(Vec3::new(x, 0.0, -2.0)));
    frame.motions = Arc::new(vec![still(0.0), still(1.0)]);
    let mut bench = Bench::with_frame(&frame);
    assert_eq!(
        bench.look(Pose::IDENTITY).columns_in_row(32),
        Some((40, 55))
    );
    let moving = Motion {
        linear_velocity: Vec3::X,
        ..still(-1.0)
    };
    frame.motions = Arc::new(vec![still(0.0), moving]);
    bench.renderer.upload(&frame).expect("a sound frame");
    assert_eq!(bench.look(Pose::IDENTITY).columns_in_row(32), Some((8, 23)));
    // Two seconds later it is where it was first.
    bench.seconds_of_motion = 2.0;
    assert_eq!(
        bench.look(Pose::IDENTITY).columns_in_row(32),
        Some((40, 55))
    );
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_larger_frame_and_then_a_smaller_one_are_drawn_whole() {
    let white = [Vec2::splat(12.5), Vec2::splat(13.5)];
    let near = |n: u32| {
        (0..n)
            .fold(Geometry::default(), |geometry, _| {
                geometry.quad(Vec3::new(1.0, 0.0, -2.0), 0.5, 0, white)
            })
            .quad(Vec3::new(-1.0, 0.0, -2.0), 0.5, 0, white)
            .frame(four_colors())
    };
    let mut bench = Bench::new(Stereo::TwoPass);
    for (count, expected) in [(0, (8, 23)), (500, (8, 55)), (0, (8, 23)), (900, (8, 55))] {
        bench.renderer.upload(&near(count)).expect("a sound frame");
        let seen = bench.look(Pose::IDENTITY);
        assert_eq!(seen.columns_in_row(32), Some(expected), "{count} quads");
    }
}

fn plain_sky(color: [u8; 3]) -> Sky {
    Sky {
        width: 2,
        height: 1,
        rgb: [color, color].concat(),
    }
}
