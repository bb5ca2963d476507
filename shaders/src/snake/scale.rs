//! How much smaller than ideal all triangles must be so that they fit. Twin of
//! `scale.wgsl`.
//!
//! The bias is subtracted from log2 of all areas, half of it from log2 of every
//! length. Wishes are counted in cells of a quarter of an octave of height and
//! of stretch; what a cell costs at a bias is the cost of the bin in its middle.
//!
//! Source: ours, after SAS 2018, section 4.3. SnakeBinning 2021, section 5.2,
//! multiplies heights by 0.7 and says no more.

use super::bins::{LONGEST, PIXEL, STRETCHES, TIPS, Template, Wish, bin, size_of};

/// Cells of heights, and of stretches.
const HEIGHTS: usize = 64;
const CELL_STRETCHES: usize = 20;
/// All cells.
pub const CELLS: usize = HEIGHTS * CELL_STRETCHES;
/// Steps of the bias from one that is tried to the next: a quarter of an octave.
pub const BIAS_STEP: i32 = 64;
/// The largest bias: all triangles are smallest.
pub const MOST_BIAS: i32 = 100 * BIAS_STEP;
/// The bias of the last frame stays while this much less would do.
pub const DEAD_BAND: i32 = 128;

/// The cell of a wish.
#[must_use]
pub fn cell(wish: Wish) -> usize {
    let [height, length] = [wish.height, wish.length].map(|log| i32::from(log).min(LONGEST));
    let row = (height / 64).min(HEIGHTS as i32 - 1);
    let column = ((length - height).max(0) / 64).min(CELL_STRETCHES as i32 - 1);
    row as usize * CELL_STRETCHES + column as usize
}

/// What the triangle in the middle of a cell costs at a bias, texels.
fn cost(templates: &[Template], cell: usize, bias: i32, largest: u32) -> u64 {
    let height = (cell / CELL_STRETCHES) as i32 * 64 + 32 - PIXEL - bias / 2;
    let length = height + (cell % CELL_STRETCHES) as i32 * 64;
    let (height, length) = (size_of(height), size_of(length).min(largest));
    let length = length.max(height.min(largest));
    let height = height
        .min(length)
        .max(length.max(STRETCHES - 1) - (STRETCHES - 1));
    let bin = bin(height, length, TIPS / 2);
    u64::from(templates[bin as usize].cost)
}

/// The least bias, steps, at which wishes counted by cell cost no more than so many texels.
#[must_use]
pub fn least_bias(templates: &[Template], counts: &[u32; CELLS], largest: u32, budget: u32) -> i32 {
    let fits = |bias: i32| {
        let mut texels = 0_u64;
        for (cell, &count) in counts.iter().enumerate().filter(|(_, count)| **count != 0) {
            texels += u64::from(count) * cost(templates, cell, bias, largest);
        }
        texels <= u64::from(budget)
    };
    let tried = (0..=MOST_BIAS).step_by(BIAS_STEP as usize);
    tried
        .into_iter()
        .find(|&bias| fits(bias))
        .unwrap_or(MOST_BIAS)
}
