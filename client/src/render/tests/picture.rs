//! Colours arrive as they were encoded, and masks cut holes.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use shadecast_protocol::Pose;

use super::*;
use crate::render::UploadError;
use crate::{DecodedPicture, MaskAtlas};

/// BT.709 in double precision.
fn expected(yuv: [u8; 3]) -> [u8; 3] {
    let [y, cb, cr] = yuv.map(f64::from);
    let (y, cb, cr) = (
        (y - 16.0) / 219.0,
        (cb - 128.0) / 224.0,
        (cr - 128.0) / 224.0,
    );
    let (kr, kb) = (0.2126, 0.0722);
    let red = y + 2.0 * (1.0 - kr) * cr;
    let blue = y + 2.0 * (1.0 - kb) * cb;
    let green = (y - kr * red - kb * blue) / (1.0 - kr - kb);
    [red, green, blue].map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8)
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn every_shade_becomes_the_rgb_that_the_standard_gives() {
    // All luma values along rows; chroma pairs along columns.
    let color = |x: u32, y: u32| [(x * 2) as u8, (y * 37) as u8, (y * 101 + x) as u8];
    let frame = Geometry::default().frame(picture(256, color));
    let bench = Bench::with_frame(&frame);
    let mut encoder = bench.encoder();
    let atlas = bench.renderer.atlas().expect("a picture was uploaded");
    let copy = Readback::record(&bench.gpu.device, &mut encoder, atlas, 0);
    bench.gpu.queue.submit([encoder.finish()]);
    let atlas = copy.take(&bench.gpu.device).expect("the device answers");
    for y in 0..256 {
        for x in 0..256 {
            // Single precision may round a tie the other way.
            assert_close(atlas.at(x, y), expected(color(x / 2, y / 2)), 1);
        }
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn an_srgb_eye_shows_the_same_bytes() {
    let grey = [100, 120, 140];
    let frame = Geometry::default()
        .whole_quad(Vec3::new(0.0, 0.0, -1.0), 1.0)
        .frame(picture(16, |_, _| grey));
    let mut bench = Bench::with(RendererConfig {
        eye_size: [SIZE; 2],
        eye_format: wgpu::TextureFormat::Rgba8UnormSrgb,
        stereo: Stereo::TwoPass,
        antialias: false,
    });
    bench.renderer.upload(&frame).expect("a sound frame");
    assert_close(bench.look(Pose::IDENTITY).at(32, 32), expected(grey), 1);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn antialiasing_takes_means_of_light() {
    let (plain, srgb) = (
        wgpu::TextureFormat::Rgba8Unorm,
        wgpu::TextureFormat::Rgba8UnormSrgb,
    );
    for (eye_format, luma, whole, half) in [
        // Half of the light is 0.707 of the square root, and less on the sRGB curve.
        (plain, 188, 200, 141),
        (srgb, 188, 200, 147),
        // White may have been any brightness: half of it is hardly darker.
        (plain, 235, 255, 254),
        (srgb, 235, 255, 254),
    ] {
        // Its left and right edges run through the middle of a pixel.
        let frame = Geometry::default()
            .whole_quad(Vec3::new(0.0, 0.0, -2.0), 1.0 + 1.0 / 32.0)
            .frame(picture(16, |_, _| [luma, 128, 128]));
        let mut bench = Bench::with(RendererConfig {
            eye_size: [SIZE; 2],
            eye_format,
            stereo: Stereo::TwoPass,
            antialias: true,
        });
        bench.renderer.upload(&frame).expect("a sound frame");
        let seen = bench.look(Pose::IDENTITY);
        assert_eq!(seen.columns_in_row(32), Some((15, 48)));
        assert_close(seen.at(15, 32), [half; 3], 2);
        assert_close(seen.at(16, 32), [whole; 3], 2);
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn blocks_do_not_bleed_into_each_other() {
    // Blocks of 2x2 texels in a chequerboard of red and blue, the finest there
    // is: each is shown large and must be one colour to its edges.
    let chequered = picture(16, |x, y| if (x + y) % 2 == 0 { RED } else { BLUE });
    let block = |x: f32, y: f32| {
        let first = Vec2::new(x, y) * 2.0 + 0.5;
        [first, first + 1.0]
    };
    for (texels, color) in [
        (block(2.0, 2.0), expected(RED)),
        (block(3.0, 2.0), expected(BLUE)),
    ] {
        let frame = Geometry::default()
            .quad(Vec3::new(0.0, 0.0, -1.0), 1.0, 0, texels)
            .frame(chequered.clone());
        let seen = Bench::with_frame(&frame).look(Pose::IDENTITY);
        for (x, y) in (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y))) {
            assert_close(seen.at(x, y), color, 1);
        }
    }
}

/// A floor that recedes: its far edge has half of the weight, and so the row of the
/// atlas that is seen halfway up the picture is the one in the middle.
#[test]
#[ignore = "needs a Vulkan driver"]
fn foreshortened_texels_are_spaced_as_the_eye_sees_them() {
    let rows = picture(16, |_, y| if y < 4 { RED } else { BLUE });
    for foreshortened in [false, true] {
        // Upper corners at two metres, lower ones at one: a trapezoid that an eye at the
        // origin sees as a square from -0.5 to 0.5 at a distance of one.
        let mut geometry = Geometry::default();
        for (x, y) in [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
            let depth = if y > 0.0 { 2.0 } else { 1.0 };
            let w = if foreshortened { depth } else { 1.0 };
            let texel = Vec2::new(x, -y) * 7.5 + 8.0;
            geometry.vertices.push(DrawVertex {
                position: (Vec3::new(x * 0.5, y * 0.5, -1.0) * depth).to_array(),
                object: 0,
                texel: [texel.x * w, texel.y * w, w],
            });
        }
        geometry.indices.extend([0, 3, 1, 1, 3, 2]);
        let mut frame = geometry.frame(rows.clone());
        frame.foreshortened = foreshortened;
        let seen = Bench::with_frame(&frame).look(Pose::IDENTITY);
        let is_red = |y: u32| seen.at(32, y)[0] > 128;
        let border = (0..SIZE).find(|&y| seen.at(32, y) != [0; 3] && !is_red(y));
        // Rows 16 to 47 show it. Without weights the middle of the surface is the
        // border, which is seen a third of the way down.
        let expected = if foreshortened { 31..33 } else { 26..28 };
        assert!(
            border.is_some_and(|border| expected.contains(&border)),
            "{border:?}"
        );
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_mask_cuts_away_its_texels() {
    let mut frame = Geometry::default()
        .whole_quad(Vec3::new(0.0, 0.0, -2.0), 1.0)
        .frame(four_colors());
    let coverage = (0..16 * 16)
        .map(|texel| if texel % 16 < 8 { 0 } else { 255 })
        .collect();
    frame.masks = Some(Arc::new(MaskAtlas {
        width: 16,
        height: 16,
        coverage,
    }));
    let all = std::mem::take(&mut frame.opaque_indices);
    let mut bench = Bench::with_frame(&frame);
    let seen = bench.look(Pose::IDENTITY);
    assert_eq!(seen.columns_in_row(20), Some((32, 47)));
    // The next frame has no mask.
    frame.masks = None;
    frame.opaque_indices = all;
    bench.renderer.upload(&frame).expect("a sound frame");
    let seen = bench.look(Pose::IDENTITY);
    assert_eq!(seen.columns_in_row(20), Some((16, 47)));
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_frame_that_the_device_cannot_hold_is_refused_and_the_last_one_stays() {
    let good = Geometry::default()
        .whole_quad(Vec3::new(0.0, 0.0, -1.0), 1.0)
        .frame(picture(16, |_, _| RED));
    let mut bench = Bench::with_frame(&good);
    let with_size = |width, height, luma| {
        let mut frame = good.clone();
        frame.picture = DecodedPicture::from(YuvPicture {
            width,
            height,
            y: vec![0; luma],
            u: Vec::new(),
            v: Vec::new(),
        });
        frame
    };
    for frame in [
        with_size(0, 0, 0),
        with_size(16, 16, 10),
        with_size(3, 3, 4),
    ] {
        let refused = bench.renderer.upload(&frame);
        assert!(matches!(refused, Err(UploadError::Plane { .. })));
    }
    let refused = bench.renderer.upload(&with_size(1 << 20, 2, 0));
    assert!(matches!(refused, Err(UploadError::Atlas { .. })));
    assert_close(bench.look(Pose::IDENTITY).at(32, 32), [255, 0, 0], 1);
}
