//! What stands and hangs in the courtyard: the fountain, plants, vessels,
//! banners and lanterns.

use std::f32::consts::{PI, TAU};

use glam::{Affine3A, Vec2, Vec3, vec2, vec3};

use super::building::{ARCH_RADIUS, BAYS, WALKWAY, side};
use super::materials::Palette;
use super::mesh::{Mesh, Point, smooth};
use super::paint::hash;

pub(super) fn furnish(mesh: &mut Mesh, palette: &Palette) {
    fountain(mesh, palette);
    for (x, z, seed) in [
        (-3.4, -2.6, 1),
        (3.4, -2.6, 2),
        (-3.4, 3.3, 3),
        (3.4, 3.3, 4),
    ] {
        mesh.at(place(x, 0.0, z), |mesh| orange_tree(mesh, palette, seed));
    }
    for (x, y, z, seed) in [
        (-2.5, WALKWAY + 0.12, -3.75, 5),
        (2.5, WALKWAY + 0.12, -3.75, 6),
        (-4.75, WALKWAY, 1.25, 7),
        (4.75, WALKWAY, 1.25, 8),
    ] {
        mesh.at(place(x, y, z), |mesh| shrub(mesh, palette, seed));
    }
    vessels(mesh, palette);
    banners(mesh, palette);
    lanterns(mesh, palette);
}

fn place(x: f32, y: f32, z: f32) -> Affine3A {
    Affine3A::from_translation(vec3(x, y, z))
}

fn fountain(mesh: &mut Mesh, palette: &Palette) {
    let around = mesh.segments(22, 12);
    let basin = [
        vec2(1.22, -0.02),
        vec2(1.22, 0.08),
        vec2(1.22, 0.08),
        vec2(1.14, 0.12),
        vec2(1.10, 0.22),
        vec2(1.13, 0.36),
        vec2(1.22, 0.44),
        vec2(1.22, 0.44),
        vec2(1.22, 0.52),
        vec2(1.22, 0.52),
        vec2(1.00, 0.52),
        vec2(1.00, 0.52),
        vec2(1.00, 0.30),
    ];
    mesh.lathe(
        palette.limestone,
        &smooth(&basin, mesh.segments(13, 9)),
        around,
    );
    let disc = |radius: f32, y: f32| [vec2(radius, y), vec2(0.5 * radius, y), vec2(0.0, y)];
    mesh.lathe(palette.water, &disc(1.02, 0.43), around);

    let stem = [
        vec2(0.30, 0.30),
        vec2(0.26, 0.50),
        vec2(0.12, 0.62),
        vec2(0.10, 0.80),
        vec2(0.15, 0.90),
        vec2(0.11, 0.96),
        vec2(0.30, 1.04),
        vec2(0.52, 1.17),
        vec2(0.56, 1.22),
        vec2(0.56, 1.22),
        vec2(0.50, 1.22),
        vec2(0.50, 1.22),
        vec2(0.42, 1.12),
    ];
    let around = mesh.segments(16, 10);
    mesh.lathe(
        palette.limestone,
        &smooth(&stem, mesh.segments(16, 12)),
        around,
    );
    mesh.lathe(palette.water, &disc(0.49, 1.18), around);
    let spindle = [
        vec2(0.09, 1.15),
        vec2(0.07, 1.25),
        vec2(0.03, 1.30),
        vec2(0.045, 1.35),
        vec2(0.018, 1.40),
        vec2(0.014, 1.95),
    ];
    mesh.lathe(
        palette.brass,
        &smooth(&spindle, mesh.segments(8, 6)),
        mesh.segments(8, 6),
    );
}

/// The armillary sphere's rings and globe, in its own space.
pub(super) fn armillary(mesh: &mut Mesh, palette: &Palette) {
    let ring = [mesh.segments(20, 10), mesh.segments(5, 3)];
    let upright = Affine3A::from_rotation_x(0.5 * PI);
    let across = Affine3A::from_rotation_y(0.5 * PI) * upright;
    let ecliptic = Affine3A::from_rotation_z(23.4_f32.to_radians());
    mesh.at(upright, |mesh| mesh.torus(palette.brass, 0.45, 0.018, ring));
    mesh.at(across, |mesh| mesh.torus(palette.brass, 0.43, 0.016, ring));
    mesh.torus(palette.copper, 0.41, 0.016, ring);
    mesh.at(ecliptic, |mesh| {
        mesh.torus(palette.brass, 0.37, 0.022, ring)
    });
    ball(mesh, palette.copper, 0.13, mesh.segments(8, 6));
}

fn ball(mesh: &mut Mesh, material: u32, radius: f32, rows: usize) {
    let profile: Vec<Vec2> = (0..=rows)
        .map(|i| {
            let (sin, cos) = (PI * i as f32 / rows as f32).sin_cos();
            let radius_here = if i == 0 || i == rows {
                0.0
            } else {
                radius * sin
            };
            vec2(radius_here, -radius * cos)
        })
        .collect();
    mesh.lathe(material, &profile, 2 * rows);
}

/// A pot of the given size, its rim at `height`.
fn pot(mesh: &mut Mesh, material: u32, soil: u32, radius: f32, height: f32) {
    let profile = [
        vec2(0.62, 0.0),
        vec2(0.80, 0.35),
        vec2(0.92, 0.80),
        vec2(0.92, 0.80),
        vec2(1.02, 0.82),
        vec2(1.02, 1.0),
        vec2(1.02, 1.0),
        vec2(0.88, 1.0),
        vec2(0.88, 1.0),
        vec2(0.86, 0.85),
    ]
    .map(|p| p * vec2(radius, height));
    let around = mesh.segments(11, 6);
    mesh.lathe(material, &smooth(&profile, mesh.segments(7, 4)), around);
    let earth = [vec2(0.88 * radius, 0.9 * height), vec2(0.0, 0.92 * height)];
    mesh.lathe(soil, &earth, around);
}

fn orange_tree(mesh: &mut Mesh, palette: &Palette, seed: u32) {
    pot(mesh, palette.clay, palette.soil, 0.34, 0.55);
    let trunk = [vec2(0.045, 0.48), vec2(0.032, 0.9), vec2(0.04, 1.5)];
    let around = mesh.segments(6, 5);
    mesh.lathe(palette.wood, &smooth(&trunk, mesh.segments(3, 2)), around);
    crown(mesh, palette.orange_tree, vec3(0.0, 1.72, 0.0), 0.5, seed);
}

fn shrub(mesh: &mut Mesh, palette: &Palette, seed: u32) {
    pot(mesh, palette.glaze, palette.soil, 0.2, 0.32);
    crown(
        mesh,
        palette.bougainvillea,
        vec3(0.0, 0.52, 0.0),
        0.26,
        seed,
    );
}

/// Leaf cards on shells about `centre`, turned outwards with some disorder.
fn crown(mesh: &mut Mesh, material: u32, centre: Vec3, radius: f32, seed: u32) {
    let count = mesh.segments(8, 4).pow(2) as u32;
    let half = radius * 0.42 * (64.0 / count as f32).powf(0.3);
    for i in 0..count {
        let random = |salt: u32| hash(i, salt, seed);
        // Directions of equal area (golden angle), nudged.
        let y = 1.0 - 2.0 * (i as f32 + 0.5) / count as f32;
        let angle = i as f32 * 2.399_963 + random(0);
        let ring = (1.0 - y * y).sqrt();
        let outwards = vec3(ring * angle.cos(), y, ring * angle.sin());
        let middle = centre + outwards * radius * (0.62 + 0.38 * random(1));
        let tilt = vec3(random(2), random(3), random(4)) - 0.5;
        let normal = (outwards + 1.1 * tilt).normalize();
        let spin = glam::Quat::from_axis_angle(normal, random(5) * TAU);
        let x = spin * normal.any_orthonormal_vector();
        let y = normal.cross(x);
        mesh.surface(material, [1, 1], |u, v| Point {
            position: middle + (x * (2.0 * u - 1.0) + y * (2.0 * v - 1.0)) * half,
            normal,
            uv: vec2(u, 1.0 - v),
        });
    }
}

fn vessels(mesh: &mut Mesh, palette: &Palette) {
    let pedestal = |mesh: &mut Mesh, height: f32| {
        mesh.block(
            palette.limestone,
            vec3(-0.27, -0.02, -0.27),
            vec3(0.27, 0.1, 0.27),
        );
        let top = height - 0.08;
        mesh.block(
            palette.blocks,
            vec3(-0.21, 0.08, -0.21),
            vec3(0.21, top, 0.21),
        );
        mesh.beam(
            palette.limestone,
            vec3(-0.26, top, -0.26),
            vec3(0.26, height, 0.26),
        );
    };
    mesh.at(place(-2.0, 0.0, 0.1), |mesh| {
        pedestal(mesh, 0.85);
        mesh.at(place(0.0, 1.1, 0.0), |mesh| {
            ball(mesh, palette.brass, 0.26, mesh.segments(10, 8));
        });
    });
    let vase = [
        vec2(0.0, 0.0),
        vec2(0.12, 0.0),
        vec2(0.12, 0.0),
        vec2(0.10, 0.05),
        vec2(0.20, 0.22),
        vec2(0.21, 0.36),
        vec2(0.10, 0.52),
        vec2(0.075, 0.60),
        vec2(0.13, 0.70),
        vec2(0.13, 0.70),
        vec2(0.10, 0.68),
        vec2(0.04, 0.62),
        vec2(0.0, 0.61),
    ];
    let around = mesh.segments(14, 8);
    let vase = smooth(&vase, mesh.segments(14, 8));
    mesh.at(place(2.2, 0.0, -0.6), |mesh| {
        pedestal(mesh, 0.7);
        mesh.at(place(0.0, 0.7, 0.0), |mesh| {
            mesh.lathe(palette.copper, &vase, around)
        });
    });
    for (x, y, z, size) in [(1.75, 0.0, 1.2, 1.1), (1.25, WALKWAY, -7.3, 1.4)] {
        let scaled = place(x, y, z) * Affine3A::from_scale(Vec3::splat(size));
        mesh.at(scaled, |mesh| mesh.lathe(palette.glaze, &vase, around));
    }
}

fn banners(mesh: &mut Mesh, palette: &Palette) {
    let [crimson, teal, indigo] = palette.banners;
    for (index, x, cloth) in [
        (0, -2.5, crimson),
        (0, 0.0, indigo),
        (0, 2.5, crimson),
        (1, 0.0, teal),
        (3, 0.0, teal),
        (2, -2.5, indigo),
        (2, 2.5, indigo),
    ] {
        mesh.at(side(index) * place(x, 6.1, -4.55), |mesh| {
            banner(mesh, cloth, palette.brass, x);
        });
    }
}

/// Cloth hanging from a rod at the origin, three times as long as wide.
fn banner(mesh: &mut Mesh, cloth: u32, rod: u32, phase: f32) {
    const WIDTH: f32 = 0.84;
    const LENGTH: f32 = 2.52;
    let position = |u: f32, v: f32| {
        let folds = (TAU * 1.6 * u + 1.4 * v + phase).sin() * (0.015 + 0.06 * v);
        let billow = 0.10 * v * v * (2.0 * v + phase).sin();
        vec3((u - 0.5) * WIDTH, -v * LENGTH, folds + billow)
    };
    let grid = [mesh.segments(7, 4), mesh.segments(14, 8)];
    mesh.surface(cloth, grid, |u, v| {
        const H: f32 = 1e-3;
        let along = position(u + H, v) - position(u - H, v);
        let down = position(u, v + H) - position(u, v - H);
        Point {
            position: position(u, v),
            normal: down.cross(along).normalize(),
            uv: vec2(u, v),
        }
    });
    let half = 0.5 * WIDTH + 0.06;
    mesh.beam(rod, vec3(-half, -0.02, -0.02), vec3(half, 0.02, 0.02));
    for x in [-half + 0.08, half - 0.1] {
        mesh.beam(rod, vec3(x, -0.01, -0.22), vec3(x + 0.02, 0.01, -0.02));
    }
}

fn lanterns(mesh: &mut Mesh, palette: &Palette) {
    let crown = 3.0 + ARCH_RADIUS;
    for (index, bays) in [(0, &BAYS[..]), (1, &BAYS[1..3]), (3, &BAYS[1..3])] {
        for &x in bays {
            mesh.at(side(index) * place(x, crown, -5.0), |mesh| {
                lantern(mesh, palette)
            });
        }
    }
    for position in POINT_LIGHTS {
        let hook = place(position.x, position.y + 1.1, position.z);
        mesh.at(hook, |mesh| lantern(mesh, palette));
    }
}

/// Where the lamps of the two far corners shine from: below their lanterns.
pub(super) const POINT_LIGHTS: [Vec3; 2] = [Vec3::new(-6.6, 3.1, -6.6), Vec3::new(6.6, 3.1, -6.6)];

/// A six-sided lantern on a chain, hanging from the origin. Its panes do not
/// get finer: every one of them is a light that is sampled.
fn lantern(mesh: &mut Mesh, palette: &Palette) {
    mesh.beam(
        palette.iron,
        vec3(-0.008, -0.52, -0.008),
        vec3(0.008, 0.02, 0.008),
    );
    let cap = [vec2(0.15, -0.62), vec2(0.09, -0.56), vec2(0.0, -0.46)];
    let under = [vec2(0.0, -0.62), vec2(0.15, -0.62)];
    let foot = [vec2(0.0, -0.96), vec2(0.10, -0.91), vec2(0.09, -0.88)];
    mesh.lathe(palette.brass, &cap, 6);
    mesh.lathe(palette.brass, &under, 6);
    mesh.lathe(palette.brass, &foot, 6);
    mesh.lathe(palette.lamp, &[vec2(0.09, -0.9), vec2(0.13, -0.62)], 6);
}
