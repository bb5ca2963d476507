//! A piece of wall with an arched or straight opening in it: arcade bays,
//! doors, niches and windows are all this.
//!
//! The wall stands in a plane of constant z and faces +Z. The same stations
//! along x carry every band of it, so that no edge has a vertex on one side only.

use std::f32::consts::PI;

use glam::{Vec2, Vec3, vec2, vec3};

use super::mesh::{Mesh, Point, steps};

/// The hole in a wall, from its sill up.
#[derive(Clone, Copy)]
pub(super) struct Opening {
    pub(super) centre: f32,
    pub(super) half_width: f32,
    pub(super) sill: f32,
    /// Where the arch begins.
    pub(super) spring: f32,
    /// Height of the arch over its spring; zero for a straight lintel.
    pub(super) rise: f32,
    pub(super) depth: f32,
    /// Segments of the arch.
    pub(super) segments: usize,
}

/// A rectangle of wall.
#[derive(Clone, Copy)]
pub(super) struct Wall {
    pub(super) x: [f32; 2],
    pub(super) y: [f32; 2],
    pub(super) z: f32,
    pub(super) material: u32,
}

impl Opening {
    /// The arch from its left to its right foot.
    fn arch(&self) -> Vec<Vec2> {
        (0..=self.segments)
            .map(|i| {
                let (sin, cos) = match i {
                    0 => (0.0, 1.0),
                    i if i == self.segments => (0.0, -1.0),
                    i => (PI * i as f32 / self.segments as f32).sin_cos(),
                };
                vec2(
                    self.centre - self.half_width * cos,
                    self.spring + self.rise * sin,
                )
            })
            .collect()
    }
}

/// The face of `wall` around `opening`.
pub(super) fn face(mesh: &mut Mesh, wall: Wall, opening: Opening, normal: Vec3) {
    let arch = opening.arch();
    let (left, right) = (arch[0].x, arch[arch.len() - 1].x);
    let margin = |mesh: &Mesh, from: f32, to: f32| -> Vec<f32> {
        steps(from, to, mesh.cells((to - from).abs())).collect()
    };
    let left_side = margin(mesh, wall.x[0], left);
    let right_side = margin(mesh, right, wall.x[1]);
    let level = |xs: &[f32], y: f32| -> Vec<Vec2> { xs.iter().map(|&x| vec2(x, y)).collect() };
    let mut whole = left_side.clone();
    whole.extend(arch[1..arch.len() - 1].iter().map(|p| p.x));
    whole.extend(&right_side);

    if opening.sill > wall.y[0] {
        let rows = mesh.cells(opening.sill - wall.y[0]);
        let band = [level(&whole, wall.y[0]), level(&whole, opening.sill)];
        mesh.strip(wall.material, [&band[0], &band[1]], rows, wall.z, normal);
    }
    if opening.spring > opening.sill {
        let rows = mesh.cells(opening.spring - opening.sill);
        for side in [&left_side, &right_side] {
            let band = [level(side, opening.sill), level(side, opening.spring)];
            mesh.strip(wall.material, [&band[0], &band[1]], rows, wall.z, normal);
        }
    }
    let mut over = level(&left_side, opening.spring);
    over.extend(&arch[1..arch.len() - 1]);
    over.extend(level(&right_side, opening.spring));
    let rows = mesh.cells(wall.y[1] - opening.spring);
    let top = level(&whole, wall.y[1]);
    mesh.strip(wall.material, [&over, &top], rows, wall.z, normal);
}

/// The inner sides of the opening, from the face at `z` backwards.
pub(super) fn reveal(mesh: &mut Mesh, opening: Opening, z: f32, jambs: u32, soffit: u32) {
    let arch = opening.arch();
    let rows = mesh.cells(opening.depth);
    let back = Vec3::NEG_Z * opening.depth;
    let rise = Vec3::Y * (opening.spring - opening.sill);
    if rise.y > 0.0 {
        let foot = |x: f32| vec3(x, opening.sill, z);
        mesh.panel(jambs, foot(arch[0].x), back, rise);
        let right = foot(arch[arch.len() - 1].x) + back;
        mesh.panel(jambs, right, -back, rise);
    }
    let columns = opening.segments;
    mesh.surface(soffit, [columns, rows], |u, v| {
        let i = (u * columns as f32).round() as usize;
        let to_middle = vec2(
            (opening.centre - arch[i].x) * opening.rise / opening.half_width,
            (opening.spring - arch[i].y) * opening.half_width / opening.rise.max(1e-6),
        );
        let normal = if opening.rise > 0.0 {
            to_middle
        } else {
            Vec2::NEG_Y
        };
        Point {
            position: arch[i].extend(z) + back * v,
            normal: normal.extend(0.0),
            uv: vec2(u * VOUSSOIRS * 0.5, v * opening.depth),
        }
    });
}

/// The level bottom of the opening.
pub(super) fn sill(mesh: &mut Mesh, opening: Opening, z: f32, material: u32) {
    let columns: Vec<Vec2> = opening.arch();
    let rows = mesh.cells(opening.depth);
    mesh.surface(material, [columns.len() - 1, rows], |u, v| {
        let i = (u * (columns.len() - 1) as f32).round() as usize;
        let position = vec3(columns[i].x, opening.sill, z - opening.depth * v);
        Point {
            position,
            normal: Vec3::Y,
            uv: vec2(position.x, position.z),
        }
    });
}

/// What closes the opening at its back: a door, a shutter, the back of a
/// niche. Texture coordinates run once over it.
pub(super) fn closing(mesh: &mut Mesh, opening: Opening, z: f32, material: u32) {
    let arch = opening.arch();
    let z = z - opening.depth;
    let bottom: Vec<Vec2> = arch.iter().map(|p| vec2(p.x, opening.sill)).collect();
    let middle: Vec<Vec2> = arch.iter().map(|p| vec2(p.x, opening.spring)).collect();
    let rows = mesh.cells(opening.spring - opening.sill);
    mesh.strip(material, [&bottom, &middle], rows, z, Vec3::Z);
    if opening.rise > 0.0 {
        let rows = mesh.cells(opening.rise);
        mesh.strip(material, [&middle, &arch], rows, z, Vec3::Z);
    }
}

/// Stones of an arch, an odd number: the keystone and both feet are alike.
const VOUSSOIRS: f32 = 13.0;

/// The ring of stones around an arch, `width` wide, standing proud of the wall.
pub(super) fn archivolt(mesh: &mut Mesh, opening: Opening, z: f32, width: f32, material: u32) {
    const PROUD: f32 = 0.03;
    let columns = opening.segments;
    let at = |u: f32, radius: f32| {
        let (sin, cos) = (PI * u).sin_cos();
        vec2(opening.centre - radius * cos, opening.spring + radius * sin)
    };
    let inner = opening.half_width;
    let outer = inner + width;
    let ring = |mesh: &mut Mesh, from: Vec2, to: Vec2, outwards: f32| {
        // From (radius, z) to (radius, z).
        mesh.surface(material, [columns, 1], |u, v| {
            let section = from.lerp(to, v);
            let position = at(u, section.x).extend(section.y);
            let radial = (at(u, 1.0) - vec2(opening.centre, opening.spring)).extend(0.0);
            let normal = if from.y == to.y {
                Vec3::Z
            } else {
                radial * outwards
            };
            Point {
                position,
                normal,
                uv: vec2(u * VOUSSOIRS * 0.5, v * width),
            }
        });
    };
    let proud = z + PROUD;
    ring(mesh, vec2(inner, proud), vec2(outer, proud), 1.0);
    ring(mesh, vec2(outer, proud), vec2(outer, z), 1.0);
    ring(mesh, vec2(inner, z), vec2(inner, proud), -1.0);
}

/// A moulding: the profile (z, height) from bottom to top, an even number of
/// points, drawn along x and closed at both ends.
pub(super) fn moulding(mesh: &mut Mesh, material: u32, profile: &[Vec2], x: [f32; 2]) {
    let columns = mesh.cells(x[1] - x[0]);
    for pair in profile.windows(2) {
        let along = (pair[1] - pair[0]).normalize_or(Vec2::Y);
        let normal = vec3(0.0, -along.x, along.y);
        mesh.surface(material, [columns, 1], |u, v| {
            let section = pair[0].lerp(pair[1], v);
            let position = vec3(x[0] + (x[1] - x[0]) * u, section.y, section.x);
            Point {
                position,
                normal,
                uv: vec2(position.x, -section.y - section.x),
            }
        });
    }
    let rows = profile.len() / 2 - 1;
    for (x, normal) in [(x[0], Vec3::NEG_X), (x[1], Vec3::X)] {
        mesh.surface(material, [1, rows], |u, v| {
            let i = (v * rows as f32).round() as usize;
            let section = profile[if u == 0.0 { i } else { profile.len() - 1 - i }];
            Point {
                position: vec3(x, section.y, section.x),
                normal,
                uv: vec2(section.x, -section.y),
            }
        });
    }
}
