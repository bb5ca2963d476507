//! Sparse bins are mapped to fuller ones. Twin of `map_bins` in `mapping.wgsl`.
//!
//! A bin that would fill a row of its own, or has room in the atlas already, is a
//! *sink*. Any other is a *source* and goes to the sink in range that costs the
//! least; where there is none, it gathers with its neighbours in every second bin
//! of the grid, which is promoted. Heights and lengths only ever grow, so nobody
//! is undersampled, and cost at most doubles.
//!
//! Source: Hladky et al., "SnakeBinning", 2021, section 3.4, algorithm 1. We differ
//! in letting each source look about in place of each sink, which gives the same
//! without a hierarchy; in measuring distance in texels; in how many triangles
//! make a sink (a row, in place of 16); in gathering sources that reach no sink; and
//! in mapping every frame, which is safe since a triangle asks again only where it
//! has outgrown its bin.

use super::bins::{ASIDE, STRETCHES, TIPS, Template, bin, parts};

/// Bins that a source looks up in height and in length (R).
const RANGE: u32 = 2;
/// The first size whose sparse bins gather.
const FIRST_COARSE: u32 = 4;

/// Where the triangles of a bin go. `is_sink` tells of every bin.
#[must_use]
pub fn map_bin(
    templates: &[Template],
    source: u32,
    largest: u32,
    is_sink: impl Fn(u32) -> bool,
) -> u32 {
    if is_sink(source) {
        return source;
    }
    let (height, length, tip) = parts(source);
    let most = 2 * templates[source as usize].cost;
    let (mut nearest, mut found) = (u32::MAX, source);
    for step in 0..(RANGE + 1) * (RANGE + 1) * TIPS {
        let h = height + step / TIPS / (RANGE + 1);
        let l = length + step / TIPS % (RANGE + 1);
        if l > largest || l < h || l - h >= STRETCHES {
            continue;
        }
        let other = step % TIPS;
        let candidate = bin(h, l, other);
        let template = &templates[candidate as usize];
        let distance = template.cost * TIPS + other.abs_diff(tip);
        let is_like = other.abs_diff(tip) <= ASIDE && template.cost <= most;
        let is_new = template.same == candidate && is_like;
        if is_new && distance < nearest && is_sink(candidate) {
            (nearest, found) = (distance, candidate);
        }
    }
    if nearest == u32::MAX && height >= FIRST_COARSE {
        let l = (length | 1).min(largest);
        let h = (height | 1)
            .min(l)
            .max(l.max(STRETCHES - 1) - (STRETCHES - 1));
        return templates[bin(h, l, TIPS / 2) as usize].same;
    }
    found
}
