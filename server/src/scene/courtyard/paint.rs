//! The courtyard's pictures, painted by code: each tiles without a seam unless
//! it says otherwise. Colours are sRGB between 0 and 1.

use glam::{Vec2, Vec3, Vec4, vec2, vec3};

use crate::scene::Image;

/// Asks `color` for every pixel; `(0, 0)` is the upper left corner.
pub(super) fn paint(name: &str, [width, height]: [u32; 2], color: impl Fn(Vec2) -> Vec4) -> Image {
    let size = vec2(width as f32, height as f32);
    let rgba = (0..height)
        .flat_map(|y| (0..width).map(move |x| vec2(x as f32 + 0.5, y as f32 + 0.5)))
        .flat_map(|pixel| {
            let color = color(pixel / size).clamp(Vec4::ZERO, Vec4::ONE);
            (color * 255.0).round().to_array().map(|c| c as u8)
        })
        .collect();
    Image {
        name: name.to_owned(),
        width,
        height,
        rgba,
    }
}

/// A tangent-space normal map of a height field over `[0, 1]²`, heights in
/// units of the picture's width.
pub(super) fn normal_map(name: &str, size: u32, height: impl Fn(Vec2) -> f32) -> Image {
    let texel = 1.0 / size as f32;
    paint(name, [size, size], |p| {
        let dx = height(p + Vec2::X * texel) - height(p - Vec2::X * texel);
        let dy = height(p - Vec2::Y * texel) - height(p + Vec2::Y * texel);
        let normal = vec3(-dx, -dy, 2.0 * texel).normalize();
        (normal * 0.5 + 0.5).extend(1.0)
    })
}

/// Between 0 and 1, from nothing but its arguments.
pub(super) fn hash(x: u32, y: u32, seed: u32) -> f32 {
    let mut h = x
        .wrapping_mul(0x9e37_79b1)
        .wrapping_add(y.wrapping_mul(0x85eb_ca77))
        .wrapping_add(seed.wrapping_mul(0xc2b2_ae3d));
    h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
    h = (h ^ (h >> 12)).wrapping_mul(0x297a_2d39);
    ((h ^ (h >> 15)) >> 8) as f32 / (1 << 24) as f32
}

/// Value noise with `period` cells over the picture.
fn noise(p: Vec2, period: u32, seed: u32) -> f32 {
    let q = p.rem_euclid(Vec2::ONE) * period as f32;
    let cell = q.floor();
    let t = q - cell;
    let t = t * t * (Vec2::splat(3.0) - 2.0 * t);
    let at = |dx: u32, dy: u32| {
        hash(
            (cell.x as u32 + dx) % period,
            (cell.y as u32 + dy) % period,
            seed,
        )
    };
    let lower = at(0, 0) + (at(1, 0) - at(0, 0)) * t.x;
    let upper = at(0, 1) + (at(1, 1) - at(0, 1)) * t.x;
    lower + (upper - lower) * t.y
}

/// Noise of several octaves, between 0 and 1.
pub(super) fn cloud(p: Vec2, period: u32, seed: u32) -> f32 {
    let octaves = [(1, 0.5), (2, 0.25), (4, 0.15), (8, 0.1)];
    octaves
        .iter()
        .map(|&(scale, weight)| weight * noise(p, period * scale, seed + scale))
        .sum()
}

/// 0 below `edge`, 1 above it, smooth over `width`.
fn step(edge: f32, width: f32, x: f32) -> f32 {
    let t = ((x - edge) / width + 0.5).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn opaque(color: Vec3) -> Vec4 {
    color.extend(1.0)
}

/// Lime plaster: broad mottling and a little grain.
pub(super) fn plaster(p: Vec2) -> Vec4 {
    let tone = cloud(p, 3, 1) - 0.5;
    let grain = cloud(p, 48, 2) - 0.5;
    let warm = vec3(0.925, 0.875, 0.785);
    opaque(
        warm * (1.0 + 0.11 * tone + 0.05 * grain) + vec3(0.02, 0.0, -0.03) * (cloud(p, 2, 3) - 0.5),
    )
}

/// Limestone for columns and mouldings.
pub(super) fn limestone(p: Vec2) -> Vec4 {
    let tone = cloud(p, 4, 11) - 0.5;
    let pits = step(0.66, 0.1, cloud(p, 24, 12));
    opaque(vec3(0.87, 0.82, 0.73) * (1.0 + 0.14 * tone - 0.10 * pits))
}

/// A running bond of `columns` x `rows` stones: which one, how far from its
/// edge (in rows), and where.
fn bond(p: Vec2, columns: u32, rows: u32) -> (u32, u32, f32) {
    let p = p.rem_euclid(Vec2::ONE);
    let y = p.y * rows as f32;
    let row = y as u32;
    let shift = if row.is_multiple_of(2) { 0.0 } else { 0.5 };
    let x = (p.x * columns as f32 + shift).rem_euclid(columns as f32);
    let aspect = rows as f32 / columns as f32;
    let edge_x = x.fract().min(1.0 - x.fract()) * aspect;
    let edge_y = y.fract().min(1.0 - y.fract());
    (x as u32, row, edge_x.min(edge_y))
}

/// Dressed stone blocks, 3 x 6 over the picture.
pub(super) fn blocks(p: Vec2) -> Vec4 {
    let (column, row, edge) = bond(p, 3, 6);
    let stone = vec3(0.80, 0.74, 0.64) * (0.92 + 0.14 * hash(column, row, 21));
    let mottle = 1.0 + 0.16 * (cloud(p, 6, 22) - 0.5) + 0.1 * (cloud(p, 40, 23) - 0.5);
    let joint = vec3(0.62, 0.57, 0.49);
    opaque(joint.lerp(stone * mottle, step(0.05, 0.04, edge)))
}

/// The height of [`blocks`].
pub(super) fn blocks_height(p: Vec2) -> f32 {
    let (_, _, edge) = bond(p, 3, 6);
    0.006 * step(0.06, 0.1, edge) + 0.004 * cloud(p, 20, 24)
}

/// Terracotta floor bricks, 4 x 8 over the picture.
pub(super) fn bricks(p: Vec2) -> Vec4 {
    let (column, row, edge) = bond(p, 4, 8);
    let pick = hash(column, row, 31);
    let clay = vec3(0.74, 0.45, 0.32).lerp(vec3(0.83, 0.57, 0.42), pick);
    let mottle = 1.0 + 0.18 * (cloud(p, 10, 32) - 0.5);
    let joint = vec3(0.70, 0.63, 0.54);
    opaque(joint.lerp(clay * mottle, step(0.05, 0.04, edge)))
}

/// The height of [`bricks`].
pub(super) fn bricks_height(p: Vec2) -> f32 {
    let (column, row, edge) = bond(p, 4, 8);
    0.004 * step(0.07, 0.1, edge) + 0.003 * hash(column, row, 33) + 0.003 * cloud(p, 16, 34)
}

/// Alternating red and cream stones of an arch: one of each along u.
pub(super) fn voussoirs(p: Vec2) -> Vec4 {
    let u = p.x * 2.0;
    let red = u < 1.0;
    let edge = u.fract().min(1.0 - u.fract());
    let stone = if red {
        vec3(0.71, 0.37, 0.28)
    } else {
        vec3(0.90, 0.84, 0.74)
    };
    let mottle = 1.0 + 0.16 * (cloud(p, 5, 41) - 0.5) + 0.08 * (cloud(p, 30, 42) - 0.5);
    opaque((stone * mottle).lerp(vec3(0.66, 0.58, 0.49), 1.0 - step(0.02, 0.02, edge)))
}

/// Distance-like value of an eight-pointed star: at most `r` inside it.
fn star(q: Vec2) -> f32 {
    let square = q.x.abs().max(q.y.abs());
    let diamond = (q.x.abs() + q.y.abs()) * std::f32::consts::FRAC_1_SQRT_2;
    square.min(diamond)
}

/// The court's floor: one star of cut marble and glazed tile a picture.
pub(super) fn court_tiles(p: Vec2) -> Vec4 {
    let q = p - 0.5;
    let corner = Vec2::splat(0.5) - q.abs();
    let marble = vec3(0.87, 0.83, 0.75) * (1.0 + 0.10 * (cloud(p, 5, 51) - 0.5));
    let blue = vec3(0.16, 0.33, 0.52) * (1.0 + 0.25 * (cloud(p, 8, 52) - 0.5));
    let clay = vec3(0.76, 0.47, 0.33) * (1.0 + 0.20 * (cloud(p, 9, 53) - 0.5));
    let ochre = vec3(0.86, 0.67, 0.36);
    let s = star(q);
    let mut color = marble;
    color = color.lerp(clay, 1.0 - step(0.20, 0.008, corner.x + corner.y));
    color = color.lerp(blue, 1.0 - step(0.30, 0.006, s));
    color = color.lerp(marble, 1.0 - step(0.265, 0.006, s));
    color = color.lerp(clay, 1.0 - step(0.215, 0.006, s));
    color = color.lerp(ochre, 1.0 - step(0.12, 0.006, s));
    color = color.lerp(blue, 1.0 - step(0.075, 0.006, s));
    let joint = step(0.006, 0.006, corner.min_element());
    opaque(vec3(0.62, 0.57, 0.50).lerp(color, joint))
}

/// Roughness and metalness of [`court_tiles`]: polished, with dull joints.
pub(super) fn court_polish(p: Vec2) -> Vec4 {
    let s = star(p - 0.5);
    let glazed = 1.0 - step(0.30, 0.006, s);
    let worn = 0.2 * (cloud(p, 6, 54) - 0.5);
    let corner = (Vec2::splat(0.5) - (p - 0.5).abs()).min_element();
    let roughness = if corner < 0.006 {
        0.9
    } else {
        0.48 - 0.2 * glazed + worn
    };
    Vec4::new(1.0, roughness, 0.0, 1.0)
}

/// Glazed wall tiles in blue, white and ochre, 2 x 2 over the picture.
pub(super) fn azulejo(p: Vec2) -> Vec4 {
    let tile = (p * 2.0).fract() - 0.5;
    let r = tile.length();
    let angle = tile.y.atan2(tile.x);
    let white = vec3(0.90, 0.90, 0.86);
    let blue = vec3(0.10, 0.25, 0.52) * (1.0 + 0.3 * (cloud(p, 8, 61) - 0.5));
    let green = vec3(0.18, 0.44, 0.40);
    let ochre = vec3(0.85, 0.63, 0.26);
    let petal = 0.30 + 0.10 * (8.0 * angle).cos();
    let corner = vec2(0.5, 0.5) - tile.abs();
    let mut color = white;
    color = color.lerp(blue, 1.0 - step(petal, 0.015, r));
    color = color.lerp(white, 1.0 - step(petal - 0.09, 0.015, r));
    color = color.lerp(ochre, 1.0 - step(0.12, 0.015, r));
    color = color.lerp(blue, 1.0 - step(0.06, 0.012, r));
    color = color.lerp(green, 1.0 - step(0.22, 0.015, corner.length()));
    color = color.lerp(blue, 1.0 - step(0.10, 0.015, corner.length()));
    let joint = step(0.012, 0.01, corner.min_element());
    opaque(vec3(0.74, 0.72, 0.66).lerp(color, joint))
}

/// Planks along v, four over the picture.
pub(super) fn wood(p: Vec2) -> Vec4 {
    let x = p.x * 4.0;
    let plank = x as u32 % 4;
    let edge = x.fract().min(1.0 - x.fract());
    let fibre = cloud(vec2(p.x * 4.0, p.y * 0.25 + hash(plank, 0, 71)), 8, 72);
    let tone = 0.85 + 0.3 * hash(plank, 1, 73);
    let brown = vec3(0.45, 0.30, 0.19) * tone * (0.8 + 0.4 * fibre);
    opaque(brown.lerp(vec3(0.14, 0.09, 0.06), 1.0 - step(0.03, 0.03, edge)))
}

/// A banner, once over the cloth: woven ground, a golden border and a star.
pub(super) fn banner(p: Vec2, ground: Vec3) -> Vec4 {
    // The cloth is three times as long as it is wide.
    let q = vec2(p.x, p.y * 3.0);
    let gold = vec3(0.87, 0.68, 0.34);
    let weave = 0.5 + 0.25 * ((q.x * 400.0).sin() + (q.y * 400.0).sin());
    let edge = q.x.min(1.0 - q.x).min(q.y).min(3.0 - q.y);
    let line = |at: f32, width: f32| 1.0 - step(width, 0.012, (edge - at).abs());
    let emblem = star(vec2(q.x - 0.5, (q.y - 1.125).rem_euclid(0.75) - 0.375));
    let inside = step(0.55, 0.02, q.y) * (1.0 - step(2.45, 0.02, q.y));
    let mut mix = line(0.08, 0.03).max(line(0.16, 0.008));
    mix = mix.max(inside * (1.0 - step(0.20, 0.012, emblem)) * step(0.165, 0.012, emblem));
    mix = mix.max(inside * (1.0 - step(0.09, 0.012, emblem)));
    opaque(ground.lerp(gold, mix) * (0.9 + 0.15 * weave))
}

/// A twig with leaves; alpha is zero beside them. Does not tile.
pub(super) fn leaves(p: Vec2, fruit: Vec3) -> Vec4 {
    let mut color = vec3(0.22, 0.35, 0.12).extend(0.0);
    for i in 0..26 {
        let at = vec2(hash(i, 0, 81), hash(i, 1, 81)) * 0.72 + 0.14;
        let (sin, cos) = (hash(i, 2, 81) * std::f32::consts::TAU).sin_cos();
        let q = p - at;
        let along = q.dot(vec2(cos, sin)) / 0.135;
        let across = q.dot(vec2(-sin, cos)) / 0.052;
        let blade = 1.0 - along * along;
        if across.abs() < blade {
            let tone = 0.7 + 0.6 * hash(i, 3, 81) - 0.15 * along;
            let rib = 1.0 + 0.25 * (1.0 - step(0.1, 0.1, across.abs()));
            let green = vec3(0.27, 0.42, 0.14).lerp(vec3(0.42, 0.50, 0.17), hash(i, 4, 81));
            color = (green * tone * rib).extend(1.0);
        }
    }
    for i in 0..3 {
        let at = vec2(hash(i, 5, 82), hash(i, 6, 82)) * 0.6 + 0.2;
        let r = p.distance(at) / 0.085;
        if r < 1.0 {
            let light = 1.0 - 0.35 * p.distance(at + vec2(0.02, 0.02)) / 0.085;
            color = (fruit * light).extend(1.0);
        }
    }
    color
}
