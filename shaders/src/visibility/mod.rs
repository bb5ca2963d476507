//! Which patches can be seen.

/// Entries `id_vertex`, `id_fragment` and `id_fragment_masked`.
pub const IDS_SOURCE: &str = concat!(
    include_str!("../light/scene.wgsl"),
    include_str!("../light/trace.wgsl"),
    include_str!("ids.wgsl"),
);

/// Kernel `mark`.
pub const MARK_SOURCE: &str = include_str!("mark.wgsl");

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
