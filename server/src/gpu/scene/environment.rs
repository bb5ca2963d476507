//! The picture of all directions as the kernels read and sample it.

use std::{borrow::Cow, f64::consts::PI};

use shadecast_shaders::light::EnvironmentCell;

use super::luminance;
use crate::scene::EnvironmentMap;

/// Most cells on a side of the table that directions are sampled by: fine enough
/// for a sun of half a degree, small enough for caches.
const MOST_CELLS: u32 = 512;

/// Radiance and the table by which it is sampled; of no size where there is none.
#[derive(Default)]
pub(super) struct Environment {
    /// Three floats a pixel.
    pub(super) radiance: Vec<f32>,
    pub(super) size: [u32; 2],
    pub(super) cells: Vec<EnvironmentCell>,
    /// Side of a cell in pixels.
    pub(super) cell: u32,
}

impl Environment {
    /// Halves the picture until it takes at most `most_bytes`.
    pub(super) fn of(map: &EnvironmentMap, most_bytes: u64) -> Self {
        let mut map = Cow::Borrowed(map);
        while map.pixels().len() as u64 * 12 > most_bytes {
            map = Cow::Owned(map.halved());
        }
        let [width, height] = map.size();
        let cell = width.max(height).div_ceil(MOST_CELLS);
        Self {
            radiance: map.pixels().iter().flat_map(|p| p.to_array()).collect(),
            size: map.size(),
            cells: cells(&map, cell, [width.div_ceil(cell), height.div_ceil(cell)]),
            cell,
        }
    }
}

/// What each cell of the picture sends, and how it is found by that.
fn cells(map: &EnvironmentMap, cell: u32, counts: [u32; 2]) -> Vec<EnvironmentCell> {
    let [width, height] = map.size();
    let mut sent = vec![0.0; (counts[0] * counts[1]) as usize];
    let mut angles = sent.clone();
    for y in 0..height {
        let angle = solid_angle(y, map.size());
        for x in 0..width {
            let index = (y / cell * counts[0] + x / cell) as usize;
            sent[index] += mean_in_pixel(map, x, y) * angle;
            angles[index] += angle;
        }
    }
    // Without any light all directions are alike.
    let total: f64 = sent.iter().sum();
    let (weights, total) = if total > 0.0 {
        (sent, total)
    } else {
        (angles.clone(), 4.0 * PI)
    };
    let aliases = alias_table(weights.iter().map(|weight| weight / total));
    (aliases.into_iter().zip(weights).zip(angles))
        .map(
            |(((threshold, otherwise), weight), angle)| EnvironmentCell {
                threshold: threshold as f32,
                otherwise,
                density: (weight / total / angle) as f32,
                padding: 0,
            },
        )
        .collect()
}

/// Of a pixel in row `y`.
fn solid_angle(y: u32, [width, height]: [u32; 2]) -> f64 {
    let cosine = |y: u32| (PI * f64::from(y) / f64::from(height)).cos();
    2.0 * PI / f64::from(width) * (cosine(y) - cosine(y + 1))
}

/// Mean luminance over a pixel of what is read bilinearly: an eighth of each
/// neighbour reaches in.
fn mean_in_pixel(map: &EnvironmentMap, x: u32, y: u32) -> f64 {
    let [width, height] = map.size();
    let columns = [(x + width - 1) % width, x, (x + 1) % width];
    let rows = [y.saturating_sub(1), y, (y + 1).min(height - 1)];
    let weights = [0.125, 0.75, 0.125];
    let pixel = |x: u32, y: u32| f64::from(luminance(map.pixels()[(y * width + x) as usize]));
    let row = |y: u32| -> f64 { (0..3).map(|i| weights[i] * pixel(columns[i], y)).sum() };
    (0..3).map(|i| weights[i] * row(rows[i])).sum()
}

/// For each of the shares, which sum to one: the chance that what is drawn is
/// kept, and what is taken otherwise. Source: Vose, "A Linear Algorithm for
/// Generating Random Numbers with a Given Distribution", 1991.
fn alias_table(shares: impl ExactSizeIterator<Item = f64>) -> Vec<(f64, u32)> {
    let count = shares.len() as f64;
    let mut table: Vec<(f64, u32)> = (0..).zip(shares).map(|(i, p)| (p * count, i)).collect();
    let (mut small, mut large): (Vec<u32>, Vec<u32>) =
        (0..table.len() as u32).partition(|index| table[*index as usize].0 < 1.0);
    while let (Some(less), Some(more)) = (small.pop(), large.last().copied()) {
        table[less as usize].1 = more;
        table[more as usize].0 -= 1.0 - table[less as usize].0;
        if table[more as usize].0 < 1.0 {
            large.pop();
            small.push(more);
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn an_alias_table_keeps_every_share() {
        let shares = [0.5, 0.0, 0.125, 0.3, 0.075];
        let table = alias_table(shares.into_iter());
        let mut found = [0.0; 5];
        for (index, (threshold, alias)) in table.iter().enumerate() {
            found[index] += threshold / 5.0;
            found[*alias as usize] += (1.0 - threshold) / 5.0;
        }
        for (found, share) in found.iter().zip(shares) {
            assert!((found - share).abs() < 1e-12, "{found} {share}");
        }
    }

    #[test]
    fn densities_integrate_to_one_whatever_the_size() {
        for [width, height] in [[1, 1], [7, 3], [1300, 40], [512, 256]] {
            let sun = |i: u32| Vec3::splat(if i == width { 1e7 } else { 0.1 });
            for radiance in [&sun as &dyn Fn(u32) -> Vec3, &|_| Vec3::ZERO] {
                let pixels = (0..width * height).map(radiance).collect();
                let map = EnvironmentMap::new(width, height, pixels).unwrap();
                let found = Environment::of(&map, u64::MAX);
                let columns = width.div_ceil(found.cell);
                let sum: f64 = (0..height)
                    .flat_map(|y| (0..width).map(move |x| (x, y)))
                    .map(|(x, y)| {
                        let index = y / found.cell * columns + x / found.cell;
                        let density = found.cells[index as usize].density;
                        f64::from(density) * solid_angle(y, [width, height])
                    })
                    .sum();
                assert!((sum - 1.0).abs() < 1e-5, "{sum} at {width} x {height}");
            }
        }
    }

    #[test]
    fn a_picture_larger_than_the_device_binds_is_halved() {
        let map = EnvironmentMap::new(64, 32, vec![Vec3::ONE; 64 * 32]).unwrap();
        assert_eq!(Environment::of(&map, 64 * 32 * 12).size, [64, 32]);
        assert_eq!(Environment::of(&map, 64 * 32 * 12 - 1).size, [32, 16]);
        assert_eq!(Environment::of(&map, 100).size, [4, 2]);
    }
}
