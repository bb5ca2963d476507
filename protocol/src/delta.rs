//! Lists of numbers as what each differs by from the one before.

/// Ascending numbers as the count of numbers left out before each.
pub(crate) fn gaps(ascending: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut next = 0;
    ascending
        .map(|id| id - std::mem::replace(&mut next, id + 1))
        .collect()
}

/// The inverse of [`gaps`], or `None` where a number reaches `limit`.
pub(crate) fn ids(gaps: &[u32], limit: u32) -> Option<Vec<u32>> {
    let mut next = 0_u32;
    gaps.iter()
        .map(|&gap| {
            let id = next.checked_add(gap).filter(|&id| id < limit)?;
            next = id + 1;
            Some(id)
        })
        .collect()
}

/// Numbers as their first (highest) bytes, then their second bytes and so on:
/// signs and exponents of neighbouring positions are alike, mantissas are not.
pub(crate) fn planes(numbers: &[f32]) -> impl Iterator<Item = u8> {
    (0..4).flat_map(move |plane| {
        numbers
            .iter()
            .map(move |number| number.to_be_bytes()[plane])
    })
}

/// The inverse of [`planes`].
pub(crate) fn from_planes(bytes: &[u8]) -> impl Iterator<Item = f32> {
    let count = bytes.len() / 4;
    (0..count).map(move |i| f32::from_be_bytes([0, 1, 2, 3].map(|plane| bytes[plane * count + i])))
}
