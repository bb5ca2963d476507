//! Which patches can be seen.

mod recall;

pub use recall::{FEW, LIFETIME, Recall};

/// Entries `id_vertex`, `id_fragment` and `id_fragment_masked`.
pub const IDS_SOURCE: &str = concat!(
    include_str!("../light/scene.wgsl"),
    include_str!("../light/trace.wgsl"),
    include_str!("ids.wgsl"),
);

/// Kernel `mark`.
pub const MARK_SOURCE: &str = include_str!("mark.wgsl");

/// Kernel `recall`.
pub const RECALL_SOURCE: &str = include_str!("recall.wgsl");

/// Words that `mark` fills: the pixels of each patch, then a bit for each with any.
#[must_use]
pub fn seen_words(patches: u32) -> u32 {
    patches + patches.div_ceil(32)
}

/// The words that `mark` leaves where patches cover so many pixels.
#[must_use]
pub fn with_seen_bits(mut pixels: Vec<u32>) -> Vec<u32> {
    let bits: Vec<u32> = (pixels.chunks(32))
        .map(|some| (some.iter().rev()).fold(0, |bits, &pixels| bits << 1 | u32::from(pixels > 0)))
        .collect();
    pixels.extend(bits);
    pixels
}

/// Twin of `mark`: pixels of each patch in a picture of patch ids plus one.
#[must_use]
pub fn mark(ids: &[u32], patches: usize) -> Vec<u32> {
    let mut pixels = vec![0; patches];
    for &id in ids {
        if let Some(count) = (id as usize)
            .checked_sub(1)
            .and_then(|patch| pixels.get_mut(patch))
        {
            *count += 1;
        }
    }
    pixels
}
