//! Two eyes see from two places, in one pass as in two.

use glam::Vec3;
use shadecast_protocol::Pose;

use super::*;

fn quad_at(distance: f32) -> ClientFrame {
    Geometry::default()
        .whole_quad(Vec3::new(0.0, 0.0, -distance), distance * 0.5)
        .frame(four_colors())
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn what_is_near_lies_further_right_for_the_left_eye() {
    let cameras = EyeCamera::pair(Pose::IDENTITY, &eyes());
    // At 0.2 m an eye's 32 mm are 5.1 of the 64 pixels of 90 degrees.
    let [left, right] = Bench::with_frame(&quad_at(0.2)).draw(cameras);
    assert_eq!(left.columns_in_row(32), Some((21, 52)));
    assert_eq!(right.columns_in_row(32), Some((11, 42)));
    let [left, right] = Bench::with_frame(&quad_at(100.0)).draw(cameras);
    assert_eq!(left.columns_in_row(32), right.columns_in_row(32));
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn an_eye_may_see_further_to_one_side() {
    let mut camera = camera(Pose::IDENTITY);
    camera.fov.left = 0.0;
    let [seen, _] = Bench::with_frame(&quad_at(1.0)).draw([camera; 2]);
    // Half of the quad takes half of a picture that begins straight ahead.
    assert_eq!(seen.columns_in_row(32), Some((0, 31)));
    assert_close(seen.at(5, 20), [0, 255, 0], 1);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn one_pass_draws_what_two_passes_draw() {
    let cameras = EyeCamera::pair(Pose::IDENTITY, &eyes());
    // Wholly inside the view: lavapipe's multiview is right only there.
    let frame = quad_at(0.5);
    let [one, two] = [Stereo::Multiview, Stereo::TwoPass].map(|stereo| {
        let mut bench = Bench::new(stereo);
        bench.renderer.upload(&frame).expect("a sound frame");
        bench.draw(cameras)
    });
    assert_eq!(one, two);
    assert_ne!(one[0], one[1]);
}
