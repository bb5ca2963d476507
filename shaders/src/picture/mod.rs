//! From linear radiance to the planes of a video picture.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// Kernel `convert`.
pub const SOURCE: &str = include_str!("picture.wgsl");

/// What is the same for all texels.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct PictureParameters {
    /// In texels, multiples of 16.
    pub size: [u32; 2],
    /// Factor before the tone curve.
    pub exposure: f32,
    /// 1 where what was never lit shows the mean of what is lit about it, and not grey.
    pub fills: u32,
}

/// Radiance times exposure that is as white as any: infinity would be no number
/// on the curve.
const BRIGHTEST: f32 = 1e30;

/// Twin of `tone_map`: Khronos PBR Neutral, which leaves colours below 0.8 as
/// they are. Linear in, linear in [0, 1) out.
#[must_use]
pub fn tone_map(radiance: Vec3) -> Vec3 {
    let c = radiance.max(Vec3::ZERO).min(Vec3::splat(BRIGHTEST));
    let start = 0.8 - 0.04;
    let x = c.min_element();
    let offset = if x < 0.08 { x - 6.25 * x * x } else { 0.04 };
    let c = c - offset;
    let peak = c.max_element();
    if peak < start {
        return c;
    }
    let d = 1.0 - start;
    let new_peak = 1.0 - d * d / (peak + d - start);
    let c = c * (new_peak / peak);
    let g = 1.0 - 1.0 / (0.15 * (peak - new_peak) + 1.0);
    c.lerp(Vec3::splat(new_peak), g)
}

/// Twin of `srgb_from_linear`.
#[must_use]
pub fn srgb_from_linear(c: Vec3) -> Vec3 {
    let channel = |c: f32| {
        let encoded = if c <= 0.003_130_8 {
            c * 12.92
        } else {
            1.055 * c.powf(1.0 / 2.4) - 0.055
        };
        encoded.clamp(0.0, 1.0)
    };
    Vec3::new(channel(c.x), channel(c.y), channel(c.z))
}

/// Twin of `ycbcr`: limited-range BT.709 code values, not yet rounded.
#[must_use]
pub fn ycbcr(rgb: Vec3) -> Vec3 {
    let y = rgb.dot(Vec3::new(0.2126, 0.7152, 0.0722));
    Vec3::new(
        16.0 + 219.0 * y,
        128.0 + 224.0 * (rgb.z - y) / 1.8556,
        128.0 + 224.0 * (rgb.x - y) / 1.5748,
    )
}

/// Radiance as it is displayed: exposure, tone curve, sRGB.
#[must_use]
pub fn displayed(radiance: Vec3, exposure: f32) -> [u8; 3] {
    let rgb = srgb_from_linear(tone_map(radiance * exposure)) * 255.0 + 0.5;
    [rgb.x as u8, rgb.y as u8, rgb.z as u8]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tone_curve_is_monotonic_and_bounded() {
        let mut last = -1.0;
        for step in 0..2000 {
            let radiance = 1.01_f32.powi(step) * 1e-4;
            let shown = tone_map(Vec3::splat(radiance)).x;
            assert!(shown >= last && shown <= 1.0, "{radiance} became {shown}");
            last = shown;
        }
        assert_eq!(displayed(Vec3::splat(f32::NAN), 1.0), [0; 3]);
        assert_eq!(displayed(Vec3::splat(-1.0), 1.0), [0; 3]);
        assert_eq!(displayed(Vec3::splat(1e30), 1.0), [255; 3]);
        assert_eq!(displayed(Vec3::splat(3e38), 1e6), [255; 3]);
    }

    #[test]
    fn limited_range_bt709() {
        assert_eq!(ycbcr(Vec3::ZERO).to_array(), [16.0, 128.0, 128.0]);
        assert!(ycbcr(Vec3::ONE).distance(Vec3::new(235.0, 128.0, 128.0)) < 1e-3);
        let red = ycbcr(Vec3::X);
        assert!((red.z - 240.0).abs() < 0.01, "{red}");
        let blue = ycbcr(Vec3::Z);
        assert!((blue.y - 240.0).abs() < 0.01, "{blue}");
    }
}
