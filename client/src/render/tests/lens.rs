//! The lens bends pictures outwards from the middle and keeps the middle.

use glam::Vec3;
use shadecast_protocol::Pose;

use super::*;
use crate::render::{LensError, LensPass, LensProfile, Viewport};

/// A face-on quad through a lens: both eyes side by side.
fn through(bench: &Bench, profile: LensProfile) -> Pixels {
    let device = &bench.gpu.device;
    let lens = LensPass::new(device, &bench.eyes, FORMAT, profile.eyes(1.0));
    let target = device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d {
            width: SIZE * 2,
            height: SIZE,
            depth_or_array_layers: 1,
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: FORMAT,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let view = target.create_view(&wgpu::TextureViewDescriptor::default());
    let mut encoder = bench.encoder();
    lens.draw(&mut encoder, &view, Viewport::halves([SIZE * 2, SIZE]));
    let copy = Readback::record(device, &mut encoder, &target, 0);
    bench.gpu.queue.submit([encoder.finish()]);
    copy.take(device).expect("the device answers")
}

fn bench() -> (Bench, [Pixels; 2]) {
    let frame = Geometry::default()
        .whole_quad(Vec3::new(0.0, 0.0, -1.0), 1.5)
        .frame(four_colors());
    let bench = Bench::with_frame(&frame);
    let eyes = bench.draw(EyeCamera::pair(Pose::IDENTITY, &eyes()));
    (bench, eyes)
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn no_distortion_changes_nothing() {
    let (bench, eyes) = bench();
    let seen = through(&bench, LensProfile::IDENTITY);
    for (x, y) in (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y))) {
        assert_eq!(seen.at(x, y), eyes[0].at(x, y));
        assert_eq!(seen.at(x + SIZE, y), eyes[1].at(x, y));
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn the_mild_lens_keeps_the_middle_and_leaves_the_corners_black() {
    let (bench, eyes) = bench();
    let seen = through(&bench, LensProfile::mild());
    for offset in [28, 30, 34, 36] {
        assert_close(seen.at(offset, offset), eyes[0].at(offset, offset), 2);
    }
    // The corner at r = 1.4 would show what lies outside of the picture.
    assert_eq!(seen.at(0, 0), [0, 0, 0]);
    assert_ne!(eyes[0].at(0, 0), [0, 0, 0]);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn blue_is_bent_more_than_red() {
    let frame = Geometry::default()
        .whole_quad(Vec3::new(0.0, 0.0, -1.0), 1.5)
        .frame(picture(16, |_, _| WHITE));
    let bench = Bench::with_frame(&frame);
    bench.look(Pose::IDENTITY);
    let strong = LensProfile {
        centre: [0.0; 2],
        k: [[0.1, 0.0], [0.2, 0.0], [0.4, 0.0]],
    };
    let seen = through(&bench, strong);
    let lit = |channel: usize| (0..SIZE).filter(|x| seen.at(*x, 32)[channel] > 0).count();
    assert!(lit(0) > lit(1) && lit(1) > lit(2) && lit(2) > 0);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn the_right_lens_is_the_mirror_of_the_left() {
    let frame = Geometry::default()
        .whole_quad(Vec3::new(0.0, 0.0, -1.0), 1.5)
        .frame(picture(16, |_, _| WHITE));
    let bench = Bench::with_frame(&frame);
    bench.look(Pose::IDENTITY);
    let seen = through(
        &bench,
        LensProfile {
            centre: [0.3, 0.0],
            k: [[0.3, 0.0]; 3],
        },
    );
    for x in 0..SIZE {
        assert_close(seen.at(x, 32), seen.at(2 * SIZE - 1 - x, 32), 1);
    }
    // It is black sooner on the side that is further from the axis.
    let lit = |x: u32| seen.at(x, 32) != [0, 0, 0];
    let black_left = (0..SIZE).take_while(|x| !lit(*x)).count();
    let black_right = (0..SIZE).rev().take_while(|x| !lit(*x)).count();
    assert!(black_left > black_right, "{black_left} {black_right}");
}

#[test]
fn impossible_lenses_are_refused() {
    let mut lens = LensProfile::mild();
    assert_eq!(lens.checked(), Ok(lens));
    lens.k[1][0] = f32::NAN;
    assert_eq!(lens.checked(), Err(LensError::NotFinite));
    lens.k[1][0] = 50.0;
    assert_eq!(lens.checked(), Err(LensError::Coefficient));
    lens = LensProfile {
        centre: [2.0, 0.0],
        ..LensProfile::mild()
    };
    assert_eq!(lens.checked(), Err(LensError::Centre));
}
