//! The roof of one side: barrel tiles at the eaves, the slope behind them.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3, vec2, vec3};

use super::building::{AXIS, EAVES, OUTER};
use super::materials::Palette;
use super::mesh::{Mesh, Point};

/// Barrel tiles along the eaves and the flat of the roof behind them.
pub(super) fn eaves(mesh: &mut Mesh, palette: &Palette) {
    /// Distance of the drip edge from the middle of the court.
    const DRIP: f32 = 4.3;
    const SLOPE: f32 = 0.36;
    let edge = |from: Vec2, to: Vec2| {
        move |u: f32, v: f32| {
            let section = from.lerp(to, v);
            vec3((2.0 * u - 1.0) * section.x, section.y, -section.x)
        }
    };
    let barrels = 20;
    let columns = barrels * mesh.segments(4, 2);
    let row = edge(vec2(DRIP, EAVES), vec2(DRIP + 0.7, EAVES + 0.7 * SLOPE));
    mesh.surface(palette.roof, [columns, 1], |u, v| {
        let (sin, cos) = (u * barrels as f32 * TAU).sin_cos();
        Point {
            position: row(u, v) + Vec3::Y * 0.05 * (1.0 - cos),
            normal: vec3(-sin, 1.0, SLOPE),
            uv: vec2(u, v),
        }
    });
    let lip = edge(vec2(DRIP, EAVES - 0.04), vec2(DRIP, EAVES));
    mesh.surface(palette.roof, [columns, 1], |u, v| {
        let cos = (u * barrels as f32 * TAU).cos();
        Point {
            position: lip(u, v) + Vec3::Y * v * 0.05 * (1.0 - cos),
            normal: Vec3::Z,
            uv: vec2(u, v),
        }
    });
    let soffit = edge(vec2(DRIP, EAVES - 0.04), vec2(AXIS, EAVES - 0.04));
    let cells = mesh.cells(2.0 * DRIP);
    mesh.surface(palette.wood, [cells, 1], |u, v| Point {
        position: soffit(u, v),
        normal: Vec3::NEG_Y,
        uv: vec2(u * 2.0 * DRIP, v),
    });
    let roof = edge(
        vec2(DRIP + 0.7, EAVES + 0.7 * SLOPE),
        vec2(OUTER + 0.3, EAVES + (OUTER + 0.3 - DRIP) * SLOPE),
    );
    mesh.surface(palette.roof, [10, 3], |u, v| Point {
        position: roof(u, v),
        normal: vec3(0.0, 1.0, SLOPE),
        uv: vec2(u, v),
    });
}
