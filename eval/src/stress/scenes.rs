//! What the cases are built from, and a look at it.

use std::{ops::Range, time::Duration};

use anyhow::Result;
use glam::{Quat, Vec2, Vec3, Vec4, vec3};
use shadecast_protocol::{Fov, ObjectId, Pose};
use shadecast_server::{
    Integrator,
    scene::{Corner, Light, Material, Scene, Triangle},
    still::{Camera, StillRenderer},
};

use super::property::greatest;

/// Of a picture, pixels: with 64 samples each the noise of a mean is below a percent.
const SIDE: u32 = 16;

/// Lambert's surface: where the refractive index does not change, nothing is
/// reflected but at grazing angles.
pub(super) fn matte(albedo: f32) -> Material {
    Material {
        base_color: Vec3::splat(albedo).extend(1.0),
        metallic: 0.0,
        ior: 1.0,
        ..Material::default()
    }
}

/// White.
pub(super) fn metal(roughness: f32) -> Material {
    Material {
        roughness,
        ..Material::default()
    }
}

/// Reflects nothing, but for what Schlick's term has at grazing angles.
pub(super) fn glowing(radiance: f32) -> Material {
    Material {
        emissive: Vec3::splat(radiance),
        ..matte(0.0)
    }
}

pub(super) fn point_lamp(position: Vec3, intensity: f32) -> Light {
    Light::Point {
        position,
        intensity: Vec3::splat(intensity),
        range: f32::INFINITY,
    }
}

/// A horizontal square that faces up.
pub(super) fn add_floor(scene: &mut Scene, middle: Vec3, half: f32, material: u32) {
    let corners = [(-half, half), (half, half), (half, -half), (-half, -half)];
    scene.add_quad(corners.map(|(x, z)| middle + vec3(x, 0.0, z)), material);
}

/// An upright square that faces +Z.
pub(super) fn add_wall(scene: &mut Scene, middle: Vec3, half: f32, material: u32) {
    let corners = [(-half, -half), (half, -half), (half, half), (-half, half)];
    scene.add_quad(corners.map(|(x, y)| middle + vec3(x, y, 0.0)), material);
}

/// A ball of 512 triangles that has the surface of a sphere of this radius: seen from
/// all sides, such a convex body covers as much as the sphere in the mean.
pub(super) fn add_ball(scene: &mut Scene, middle: Vec3, radius: f32, material: u32) {
    let mut faces: Vec<[Vec3; 3]> = Vec::new();
    for signs in 0..8 {
        let side = |axis: u32| if signs >> axis & 1 == 0 { 1.0 } else { -1.0 };
        let corners = [Vec3::X * side(0), Vec3::Y * side(1), Vec3::Z * side(2)];
        let [a, b, c] = corners;
        let outwards = (b - a).cross(c - a).dot(a) > 0.0;
        faces.push(if outwards { [a, b, c] } else { [a, c, b] });
    }
    for _ in 0..3 {
        let split = |[a, b, c]: [Vec3; 3]| {
            let between = |p: Vec3, q: Vec3| (p + q).normalize();
            let (d, e, f) = (between(a, b), between(b, c), between(c, a));
            [[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
        };
        faces = faces.into_iter().flat_map(split).collect();
    }
    let area: f32 = (faces.iter())
        .map(|[a, b, c]| (*b - *a).cross(*c - *a).length() * 0.5)
        .sum();
    let size = radius * (4.0 * std::f32::consts::PI / area).sqrt();
    for face in faces {
        add_triangle(scene, face.map(|corner| middle + corner * size), material);
    }
}

fn add_triangle(scene: &mut Scene, corners: [Vec3; 3], material: u32) {
    let first = scene.positions.len() as u32;
    let first_corner = scene.corners.len() as u32;
    let [a, b, c] = corners;
    let corner = Corner {
        normal: (b - a).cross(c - a).normalize(),
        tangent: Vec4::ZERO,
        uv: [Vec2::ZERO; 2],
        color: Vec4::ONE,
    };
    scene.positions.extend(corners);
    scene.corners.extend([corner; 3]);
    scene.triangles.push(Triangle {
        positions: [0, 1, 2].map(|corner| first + corner),
        corners: [0, 1, 2].map(|corner| first_corner + corner),
        material,
        object: ObjectId::WORLD,
    });
}

/// From where to where, and how wide.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    pub(super) eye: Vec3,
    pub(super) forward: Vec3,
    /// Of the picture's sides, radians.
    pub(super) angle: f32,
}

impl View {
    pub(super) fn new(eye: Vec3, forward: Vec3, angle: f32) -> Self {
        Self {
            eye,
            forward,
            angle,
        }
    }

    pub(super) fn pose(self) -> Pose {
        Pose {
            position: self.eye,
            orientation: Quat::from_rotation_arc(Vec3::NEG_Z, self.forward.normalize()),
        }
    }

    fn camera(self) -> Camera {
        Camera {
            world_from_eye: self.pose(),
            fov: Fov::symmetric(self.angle),
            width: SIDE,
            height: SIDE,
        }
    }
}

/// The pixels of a picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Picture(pub(super) Vec<Vec3>);

impl Picture {
    /// By the green of its pixels.
    pub(super) fn mean(&self) -> f64 {
        let sum: f64 = self.0.iter().map(|pixel| f64::from(pixel.y)).sum();
        sum / self.0.len() as f64
    }

    /// Of columns and rows, in sixteenths of the picture.
    pub(super) fn part(&self, columns: Range<usize>, rows: Range<usize>) -> Self {
        let side = self.0.len().isqrt();
        let within = |range: &Range<usize>, at: usize| range.contains(&(at * 16 / side));
        let pixels = self.0.iter().enumerate();
        let inside =
            pixels.filter(|(at, _)| within(&columns, at % side) && within(&rows, at / side));
        Self(inside.map(|(_, pixel)| *pixel).collect())
    }

    /// Pixels that are no radiance.
    pub(super) fn unsound(&self) -> f64 {
        let unsound = |pixel: &&Vec3| !pixel.is_finite() || pixel.min_element() < 0.0;
        self.0.iter().filter(unsound).count() as f64
    }

    /// Greatest relative difference of a pixel's green from `expected`;
    /// no number where one of them is none.
    pub(super) fn farthest_from(&self, expected: f64) -> f64 {
        greatest((self.0.iter()).map(|pixel| (f64::from(pixel.y) / expected - 1.0).abs()))
    }
}

/// A path tracer of a scene.
pub(super) struct Tracer(StillRenderer);

impl Tracer {
    pub(super) fn new(scene: &Scene, bounces: u32) -> Result<Self> {
        Self::with(scene, Integrator::with_bounces(bounces))
    }

    pub(super) fn with(scene: &Scene, integrator: Integrator) -> Result<Self> {
        Ok(Self(StillRenderer::new(scene, integrator, &mut |_| ())?))
    }

    pub(super) fn picture(&mut self, view: View, samples: u32, seed: u32) -> Result<Picture> {
        self.picture_at(view, Duration::ZERO, samples, seed)
    }

    /// With objects where they are at `time`.
    pub(super) fn picture_at(
        &mut self,
        view: View,
        time: Duration,
        samples: u32,
        seed: u32,
    ) -> Result<Picture> {
        let still = self.0.render(&view.camera(), time, samples, seed)?;
        Ok(Picture(still.radiance))
    }
}

/// A path-traced picture of a scene.
pub(super) fn picture(
    scene: &Scene,
    view: View,
    bounces: u32,
    samples: u32,
    seed: u32,
) -> Result<Picture> {
    Tracer::new(scene, bounces)?.picture(view, samples, seed)
}
