//! Grows a scene from parametric surfaces.
//!
//! Every surface is a grid of quads over `[0, 1]²`. Positions are rounded to a
//! fine lattice and welded, so surfaces that meet share their vertices, and
//! the winding of every triangle follows the normals of its corners, so no
//! face can turn its back on its own normal.

use std::collections::HashMap;

use glam::{Affine3A, Vec2, Vec3, Vec4, vec2, vec3};
use shadecast_protocol::ObjectId;

use crate::scene::{Corner, Scene, Triangle};

/// Lattice steps per metre: fine enough to be invisible, coarse enough that
/// rounding errors of two surfaces meet in one point.
const LATTICE: f32 = 4096.0;

/// A point of a surface.
#[derive(Clone, Copy)]
pub(super) struct Point {
    pub(super) position: Vec3,
    pub(super) normal: Vec3,
    pub(super) uv: Vec2,
}

/// The scene under construction.
pub(super) struct Mesh {
    pub(super) scene: Scene,
    /// 1 is the default courtyard; segments grow in proportion.
    density: f32,
    welded: HashMap<(ObjectId, [u32; 3]), u32>,
    object: ObjectId,
    world_from_local: Affine3A,
}

impl Mesh {
    pub(super) fn new(density: f32) -> Self {
        Self {
            scene: Scene::default(),
            density,
            welded: HashMap::new(),
            object: ObjectId::WORLD,
            world_from_local: Affine3A::IDENTITY,
        }
    }

    /// Segments of a curve that has `base` of them by default.
    pub(super) fn segments(&self, base: usize, least: usize) -> usize {
        ((base as f32 * self.density).round() as usize).max(least)
    }

    /// Cells along a flat `length`: never longer than a metre, but for scenes
    /// coarser than the default.
    pub(super) fn cells(&self, length: f32) -> usize {
        let longest = self.density.recip().clamp(1.0, 1.6);
        let by_size = (length / longest - 1e-3).ceil();
        let by_density = (length * 0.75 * self.density).round();
        by_size.max(by_density).max(1.0) as usize
    }

    /// Builds with local coordinates that `parent_from_local` places.
    pub(super) fn at(&mut self, parent_from_local: Affine3A, build: impl FnOnce(&mut Self)) {
        let outer = self.world_from_local;
        self.world_from_local = outer * parent_from_local;
        build(self);
        self.world_from_local = outer;
    }

    /// Builds triangles that belong to a moving object, in its own space.
    pub(super) fn moving(&mut self, object: ObjectId, build: impl FnOnce(&mut Self)) {
        let outer = std::mem::replace(&mut self.world_from_local, Affine3A::IDENTITY);
        self.object = object;
        build(self);
        self.object = ObjectId::WORLD;
        self.world_from_local = outer;
    }

    /// The grid of `columns` x `rows` quads over the surface `point(u, v)`.
    pub(super) fn surface(
        &mut self,
        material: u32,
        [columns, rows]: [usize; 2],
        point: impl Fn(f32, f32) -> Point,
    ) {
        let first = self.scene.corners.len() as u32;
        let mut positions = Vec::with_capacity((columns + 1) * (rows + 1));
        for row in 0..=rows {
            for column in 0..=columns {
                let local = point(column as f32 / columns as f32, row as f32 / rows as f32);
                positions.push(self.weld(local.position));
                self.scene.corners.push(Corner {
                    normal: self
                        .world_from_local
                        .transform_vector3(local.normal)
                        .normalize(),
                    tangent: Vec4::ZERO,
                    uv: [local.uv, Vec2::ZERO],
                    color: Vec4::ONE,
                });
            }
        }
        let stride = columns + 1;
        for row in 0..rows {
            for column in 0..columns {
                let lower = row * stride + column;
                let upper = lower + stride;
                for local in [[lower, lower + 1, upper + 1], [lower, upper + 1, upper]] {
                    self.triangle(
                        local.map(|i| positions[i]),
                        local.map(|i| first + i as u32),
                        material,
                    );
                }
            }
        }
    }

    fn weld(&mut self, local: Vec3) -> u32 {
        let rounded = (self.world_from_local.transform_point3(local) * LATTICE).round() / LATTICE;
        // Adding zero makes one of the two zeros.
        let position = rounded + Vec3::ZERO;
        let key = (self.object, position.to_array().map(f32::to_bits));
        *self.welded.entry(key).or_insert_with(|| {
            self.scene.positions.push(position);
            self.scene.positions.len() as u32 - 1
        })
    }

    fn triangle(&mut self, mut positions: [u32; 3], mut corners: [u32; 3], material: u32) {
        let [a, b, c] = positions.map(|i| self.scene.positions[i as usize]);
        let normal = (b - a).cross(c - a);
        if normal.length_squared() < 1e-14 {
            return;
        }
        let wanted: Vec3 = corners
            .iter()
            .map(|&i| self.scene.corners[i as usize].normal)
            .sum();
        if normal.dot(wanted) < 0.0 {
            positions.swap(1, 2);
            corners.swap(1, 2);
        }
        self.scene.triangles.push(Triangle {
            positions,
            corners,
            material,
            object: self.object,
        });
    }

    /// The flat strip between two polylines in a plane of constant z, `rows`
    /// quads high; texture coordinates in metres.
    pub(super) fn strip(
        &mut self,
        material: u32,
        [bottom, top]: [&[Vec2]; 2],
        rows: usize,
        z: f32,
        normal: Vec3,
    ) {
        let columns = bottom.len() - 1;
        self.surface(material, [columns, rows], |u, v| {
            let i = (u * columns as f32).round() as usize;
            let p = bottom[i].lerp(top[i], v);
            Point {
                position: p.extend(z),
                normal,
                uv: vec2(p.x, -p.y),
            }
        });
    }

    /// The flat parallelogram `origin + u * along + v * up`, gridded; texture
    /// coordinates in metres along its sides.
    pub(super) fn panel(&mut self, material: u32, origin: Vec3, along: Vec3, up: Vec3) {
        let cells = [self.cells(along.length()), self.cells(up.length())];
        let normal = along.cross(up).normalize();
        let (x, y) = (along.normalize(), up.normalize());
        self.surface(material, cells, |u, v| {
            let position = origin + along * u + up * v;
            Point {
                position,
                normal,
                uv: vec2(position.dot(x), -position.dot(y)),
            }
        });
    }

    /// A box without its underside, gridded.
    pub(super) fn block(&mut self, material: u32, low: Vec3, high: Vec3) {
        let size = high - low;
        let (x, y, z) = (size.x * Vec3::X, size.y * Vec3::Y, size.z * Vec3::Z);
        self.panel(material, low + z, x, y);
        self.panel(material, low + x, -x, y);
        self.panel(material, low, z, y);
        self.panel(material, low + x + z, -z, y);
        self.panel(material, low + y + z, x, -z);
    }

    /// A box with its underside too, for what hangs.
    pub(super) fn beam(&mut self, material: u32, low: Vec3, high: Vec3) {
        self.block(material, low, high);
        let size = high - low;
        self.panel(material, low, size.x * Vec3::X, size.z * Vec3::Z);
    }

    /// The profile (radius, height) turned about +Y, from bottom to top.
    /// A point that occurs twice is a crease.
    pub(super) fn lathe(&mut self, material: u32, profile: &[Vec2], around: usize) {
        for smooth in between_creases(profile) {
            let lengths = arc_lengths(smooth);
            let rows = smooth.len() - 1;
            self.surface(material, [around, rows], |u, v| {
                let i = (v * rows as f32).round() as usize;
                let before = smooth[i.saturating_sub(1)];
                let after = smooth[(i + 1).min(rows)];
                let along = (after - before).normalize_or(Vec2::Y);
                // The first and the last column are one.
                let angle = if u == 1.0 {
                    0.0
                } else {
                    u * std::f32::consts::TAU
                };
                let outwards = vec3(angle.cos(), 0.0, -angle.sin());
                Point {
                    position: outwards * smooth[i].x + Vec3::Y * smooth[i].y,
                    normal: outwards * along.y - Vec3::Y * along.x,
                    uv: vec2(
                        u * (smooth[0].x.max(0.1) * 6.0).round().max(1.0),
                        -lengths[i],
                    ),
                }
            });
        }
    }

    /// A ring of radius `major` about +Y with a round section of radius `minor`.
    pub(super) fn torus(&mut self, material: u32, major: f32, minor: f32, segments: [usize; 2]) {
        self.surface(material, segments, |u, v| {
            let (su, cu) = (u * std::f32::consts::TAU).sin_cos();
            let (sv, cv) = (v * std::f32::consts::TAU).sin_cos();
            let outwards = vec3(cu, 0.0, -su);
            let normal = outwards * cv + Vec3::Y * sv;
            Point {
                position: outwards * major + normal * minor,
                normal,
                uv: vec2(u * 8.0, v),
            }
        });
    }
}

fn arc_lengths(line: &[Vec2]) -> Vec<f32> {
    let mut length = 0.0;
    std::iter::once(0.0)
        .chain(line.windows(2).map(|pair| {
            length += pair[0].distance(pair[1]);
            length
        }))
        .collect()
}

/// The pieces of a polyline between points that occur twice in a row.
fn between_creases(line: &[Vec2]) -> impl Iterator<Item = &[Vec2]> {
    line.chunk_by(|a, b| a != b).filter(|piece| piece.len() > 1)
}

/// A smooth curve through `points` (Catmull-Rom), `steps` pieces in all;
/// points that occur twice stay creases.
pub(super) fn smooth(points: &[Vec2], steps: usize) -> Vec<Vec2> {
    let mut curve = Vec::new();
    let spans: usize = points.len() - 1;
    for piece in between_creases(points) {
        let count = ((steps * (piece.len() - 1)) as f32 / spans as f32)
            .round()
            .max(1.0) as usize;
        for step in 0..=count {
            let t = step as f32 / count as f32 * (piece.len() - 1) as f32;
            let i = (t as usize).min(piece.len() - 2);
            curve.push(catmull_rom(piece, i, t - i as f32));
        }
    }
    curve
}

fn catmull_rom(points: &[Vec2], i: usize, t: f32) -> Vec2 {
    let at = |k: isize| points[k.clamp(0, points.len() as isize - 1) as usize];
    let i = i as isize;
    let (a, b, c, d) = (at(i - 1), at(i), at(i + 1), at(i + 2));
    let (into, out) = ((c - a) * 0.5, (d - b) * 0.5);
    let (t2, t3) = (t * t, t * t * t);
    b * (2.0 * t3 - 3.0 * t2 + 1.0)
        + into * (t3 - 2.0 * t2 + t)
        + c * (3.0 * t2 - 2.0 * t3)
        + out * (t3 - t2)
}

/// `count` equal steps from `from` to `to`, both ends included.
pub(super) fn steps(from: f32, to: f32, count: usize) -> impl Iterator<Item = f32> {
    (0..=count).map(move |i| from + (to - from) * (i as f32 / count as f32))
}
