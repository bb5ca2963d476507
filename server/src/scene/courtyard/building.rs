//! The building: floors, four arcades with an upper storey, and the eaves.
//!
//! One side is built facing +Z and turned to the four sides of the court.
//! The court spans 9 m, the walkway behind the arcade is raised by three steps.

use glam::{Affine3A, Mat3, Vec3, vec2, vec3};

use super::materials::Palette;
use super::mesh::{Mesh, Point, smooth, steps};
use super::roof;
use super::wall::{Opening, Wall, archivolt, closing, face, moulding, reveal, sill};

/// Half the court, to the edge of the walkway.
const COURT: f32 = 4.5;
/// From the middle to the axes of the columns.
pub(super) const AXIS: f32 = 5.0;
/// From the middle to the walls behind the walkway.
pub(super) const OUTER: f32 = 8.0;
const BAY: f32 = 2.5;
/// Height of the walkway above the court.
pub(super) const WALKWAY: f32 = 0.6;
const WALL_THICKNESS: f32 = 0.5;
/// Where the arches begin, on the columns.
const SPRING: f32 = 3.0;
pub(super) const ARCH_RADIUS: f32 = 0.95;
const CEILING: f32 = 4.25;
const FIRST_FLOOR: f32 = 4.65;
const CORNICE: f32 = 6.3;
pub(super) const EAVES: f32 = 6.64;

/// The middles of a side's four bays.
pub(super) const BAYS: [f32; 4] = [-1.5 * BAY, -0.5 * BAY, 0.5 * BAY, 1.5 * BAY];

/// Side `0..4`: turned so that its local -Z is that side; exact in floats.
pub(super) fn side(index: usize) -> Affine3A {
    let turns = [
        Mat3::from_cols(Vec3::X, Vec3::Y, Vec3::Z),
        Mat3::from_cols(Vec3::NEG_Z, Vec3::Y, Vec3::X),
        Mat3::from_cols(Vec3::NEG_X, Vec3::Y, Vec3::NEG_Z),
        Mat3::from_cols(Vec3::Z, Vec3::Y, Vec3::NEG_X),
    ];
    Affine3A::from_mat3(turns[index % 4])
}

pub(super) fn building(mesh: &mut Mesh, palette: &Palette) {
    court(mesh, palette);
    for index in 0..4 {
        mesh.at(side(index), |mesh| {
            walkway(mesh, palette);
            arcade(mesh, palette);
            back_wall(mesh, palette);
            upper_storey(mesh, palette);
            roof::eaves(mesh, palette);
        });
    }
    stairs(mesh, palette);
}

fn court(mesh: &mut Mesh, palette: &Palette) {
    let inner = COURT - 0.5;
    let origin = vec3(-inner, 0.0, inner);
    mesh.panel(
        palette.court,
        origin,
        Vec3::X * 2.0 * inner,
        Vec3::NEG_Z * 2.0 * inner,
    );
    // A border of stone: four strips, each ending at the flank of the next.
    let cells = mesh.cells(2.0 * inner);
    let mut stations = vec![-COURT];
    stations.extend(steps(-inner, inner, cells));
    for index in 0..4 {
        mesh.at(side(index), |mesh| {
            floor(mesh, palette.limestone, &stations, &[-inner, -COURT], 0.0);
        });
    }
}

/// A level floor over stations along x and along z.
fn floor(mesh: &mut Mesh, material: u32, xs: &[f32], zs: &[f32], y: f32) {
    let (columns, rows) = (xs.len() - 1, zs.len() - 1);
    mesh.surface(material, [columns, rows], |u, v| {
        let x = xs[(u * columns as f32).round() as usize];
        let z = zs[(v * rows as f32).round() as usize];
        Point {
            position: vec3(x, y, z),
            normal: Vec3::Y,
            uv: vec2(x, z),
        }
    });
}

fn walkway(mesh: &mut Mesh, palette: &Palette) {
    let depth: Vec<f32> = steps(-COURT, -OUTER, mesh.cells(OUTER - COURT)).collect();
    let mut along: Vec<f32> = depth.iter().rev().copied().collect();
    along.extend(steps(-COURT, COURT, mesh.cells(2.0 * COURT)).skip(1));
    floor(mesh, palette.bricks, &along, &depth, WALKWAY);
    let foot = vec3(-COURT, 0.0, -COURT);
    mesh.panel(
        palette.blocks,
        foot,
        Vec3::X * 2.0 * COURT,
        Vec3::Y * WALKWAY,
    );

    // The ceiling hangs between wall and arcade; the corners belong to every
    // other side's strip in turn.
    let inner = AXIS + 0.5 * WALL_THICKNESS;
    let origin = vec3(-OUTER, CEILING, -OUTER);
    let along = Vec3::X * (OUTER + inner);
    mesh.panel(palette.wood, origin, along, Vec3::Z * (OUTER - inner));
    for x in steps(-AXIS, AXIS, 8) {
        let (left, right, low) = (x - 0.07, x + 0.07, CEILING - 0.2);
        let (length, height) = (Vec3::Z * (OUTER - inner), Vec3::Y * 0.2);
        mesh.panel(palette.wood, vec3(left, low, -OUTER), length, height);
        mesh.panel(
            palette.wood,
            vec3(left, low, -OUTER),
            Vec3::X * 0.14,
            length,
        );
        mesh.panel(palette.wood, vec3(right, low, -inner), -length, height);
    }
}

fn arcade(mesh: &mut Mesh, palette: &Palette) {
    let (front, back) = (-AXIS + 0.5 * WALL_THICKNESS, -AXIS - 0.5 * WALL_THICKNESS);
    for (i, centre) in BAYS.into_iter().enumerate() {
        let opening = Opening {
            centre,
            half_width: ARCH_RADIUS,
            sill: SPRING,
            spring: SPRING,
            rise: ARCH_RADIUS,
            depth: WALL_THICKNESS,
            segments: 2 * mesh.segments(6, 3),
        };
        // Inner corners end at the neighbour's face, on either side of the wall.
        let ends = |z: f32| {
            let limit = -z;
            let left = if i == 0 { -limit } else { centre - 0.5 * BAY };
            let right = if i == 3 { limit } else { centre + 0.5 * BAY };
            [left, right]
        };
        let wall = |z: f32| Wall {
            x: ends(z),
            y: [SPRING, FIRST_FLOOR],
            z,
            material: palette.plaster,
        };
        face(mesh, wall(front), opening, Vec3::Z);
        face(mesh, wall(back), opening, Vec3::NEG_Z);
        reveal(mesh, opening, front, palette.plaster, palette.voussoirs);
        archivolt(mesh, opening, front, 0.26, palette.voussoirs);
        // One column of each corner belongs to each side.
        mesh.at(
            Affine3A::from_translation(vec3(centre - 0.5 * BAY, WALKWAY, -AXIS)),
            |mesh| column(mesh, palette),
        );
    }
    let string_course = [
        vec2(front - 0.02, FIRST_FLOOR - 0.16),
        vec2(front + 0.05, FIRST_FLOOR - 0.12),
        vec2(front + 0.05, FIRST_FLOOR - 0.04),
        vec2(front + 0.09, FIRST_FLOOR),
        vec2(front + 0.09, FIRST_FLOOR + 0.05),
        vec2(front - 0.02, FIRST_FLOOR + 0.08),
    ];
    moulding(mesh, palette.limestone, &string_course, [front, -front]);
}

/// A column from the walkway to the foot of the arches.
fn column(mesh: &mut Mesh, palette: &Palette) {
    let top = SPRING - WALKWAY;
    mesh.block(
        palette.limestone,
        vec3(-0.25, -0.02, -0.25),
        vec3(0.25, 0.12, 0.25),
    );
    let around = mesh.segments(11, 6);
    let base = [
        vec2(0.23, 0.12),
        vec2(0.245, 0.16),
        vec2(0.22, 0.20),
        vec2(0.19, 0.22),
        vec2(0.2, 0.25),
        vec2(0.165, 0.29),
    ];
    mesh.lathe(
        palette.limestone,
        &smooth(&base, mesh.segments(5, 2)),
        around,
    );
    let shaft = [vec2(0.165, 0.28), vec2(0.168, 0.9), vec2(0.145, top - 0.52)];
    mesh.lathe(
        palette.limestone,
        &smooth(&shaft, mesh.segments(3, 2)),
        around,
    );
    let capital = [
        vec2(0.145, top - 0.53),
        vec2(0.175, top - 0.50),
        vec2(0.15, top - 0.46),
        vec2(0.165, top - 0.36),
        vec2(0.23, top - 0.22),
        vec2(0.29, top - 0.14),
    ];
    mesh.lathe(
        palette.limestone,
        &smooth(&capital, mesh.segments(5, 2)),
        around,
    );
    mesh.beam(
        palette.limestone,
        vec3(-0.31, top - 0.14, -0.31),
        vec3(0.31, top, 0.31),
    );
}

fn back_wall(mesh: &mut Mesh, palette: &Palette) {
    const DADO: f32 = 1.85;
    let foot = WALKWAY - 0.02;
    let segments = 2 * mesh.segments(4, 2);
    for (i, centre) in BAYS.into_iter().enumerate() {
        let x = [centre - 0.5 * BAY, centre + 0.5 * BAY];
        let is_door = i == 1;
        let opening = Opening {
            centre,
            half_width: if is_door { 0.6 } else { 0.4 },
            sill: if is_door { foot } else { DADO + 0.35 },
            spring: if is_door { 2.45 } else { 3.0 },
            rise: if is_door { 0.6 } else { 0.4 },
            depth: 0.3,
            segments,
        };
        let wall = Wall {
            x,
            y: [if is_door { foot } else { DADO }, CEILING],
            z: -OUTER,
            material: palette.plaster,
        };
        face(mesh, wall, opening, Vec3::Z);
        reveal(mesh, opening, -OUTER, palette.limestone, palette.limestone);
        if is_door {
            closing(mesh, opening, -OUTER, palette.door);
            archivolt(mesh, opening, -OUTER, 0.2, palette.voussoirs);
        } else {
            closing(mesh, opening, -OUTER, palette.azulejo);
            sill(mesh, opening, -OUTER, palette.limestone);
            dado(mesh, palette, x, [foot, DADO]);
        }
    }
    for x in [[-OUTER, -AXIS], [AXIS, OUTER]] {
        dado(mesh, palette, x, [foot, DADO]);
        let origin = vec3(x[0], DADO, -OUTER);
        mesh.panel(
            palette.plaster,
            origin,
            Vec3::X * (x[1] - x[0]),
            Vec3::Y * (CEILING - DADO),
        );
    }
}

/// Glazed tiles on the lower part of a wall, with a stone rail on top.
fn dado(mesh: &mut Mesh, palette: &Palette, x: [f32; 2], y: [f32; 2]) {
    let along = Vec3::X * (x[1] - x[0]);
    mesh.panel(
        palette.azulejo,
        vec3(x[0], y[0], -OUTER),
        along,
        Vec3::Y * (y[1] - y[0]),
    );
    let rail = [
        vec2(-OUTER, y[1] - 0.03),
        vec2(-OUTER + 0.04, y[1] - 0.03),
        vec2(-OUTER + 0.04, y[1] + 0.04),
        vec2(-OUTER, y[1] + 0.06),
    ];
    moulding(mesh, palette.limestone, &rail, x);
}

fn upper_storey(mesh: &mut Mesh, palette: &Palette) {
    let front = -AXIS + 0.5 * WALL_THICKNESS;
    let segments = 2 * mesh.segments(3, 2);
    for (i, centre) in BAYS.into_iter().enumerate() {
        let opening = Opening {
            centre,
            half_width: 0.42,
            sill: FIRST_FLOOR + 0.45,
            spring: FIRST_FLOOR + 1.0,
            rise: 0.42,
            depth: 0.22,
            segments,
        };
        let wall = Wall {
            x: [
                if i == 0 { front } else { centre - 0.5 * BAY },
                if i == 3 { -front } else { centre + 0.5 * BAY },
            ],
            y: [FIRST_FLOOR, EAVES],
            z: front,
            material: palette.plaster,
        };
        face(mesh, wall, opening, Vec3::Z);
        reveal(mesh, opening, front, palette.plaster, palette.plaster);
        closing(mesh, opening, front, palette.door);
        archivolt(mesh, opening, front, 0.14, palette.limestone);
        let ledge = [
            vec2(front, opening.sill - 0.12),
            vec2(front + 0.08, opening.sill - 0.06),
            vec2(front + 0.08, opening.sill),
            vec2(front - opening.depth, opening.sill),
        ];
        moulding(
            mesh,
            palette.limestone,
            &ledge,
            [centre - 0.42, centre + 0.42],
        );
    }
    let cornice = [
        vec2(front - 0.02, CORNICE),
        vec2(front + 0.04, CORNICE + 0.04),
        vec2(front + 0.06, CORNICE + 0.12),
        vec2(front + 0.14, CORNICE + 0.2),
        vec2(front + 0.22, CORNICE + 0.24),
        vec2(front + 0.22, EAVES - 0.1),
    ];
    moulding(mesh, palette.limestone, &cornice, [front, -front]);
}

/// Three steps from the court up to the -Z walkway, between two cheeks.
fn stairs(mesh: &mut Mesh, palette: &Palette) {
    const TREAD: f32 = 0.34;
    for step in 0..3 {
        let low = vec3(-2.2, -0.02, -COURT - 0.02);
        let front = -COURT + TREAD * (3 - step) as f32;
        let height = WALKWAY * (step + 1) as f32 / 4.0;
        mesh.block(palette.limestone, low, vec3(2.2, height, front));
    }
    for x in [-2.5, 2.5] {
        let front = -COURT + 3.0 * TREAD + 0.1;
        let low = vec3(x - 0.3, -0.02, -COURT - 0.02);
        mesh.block(palette.blocks, low, vec3(x + 0.3, WALKWAY + 0.05, front));
        let cap = vec3(x - 0.34, WALKWAY + 0.05, -COURT - 0.02);
        mesh.beam(
            palette.limestone,
            cap,
            vec3(x + 0.34, WALKWAY + 0.12, front + 0.04),
        );
    }
}
