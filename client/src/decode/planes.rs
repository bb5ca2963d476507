//! Planes of a decoder's own layout, and their way into a tight picture.

use crate::YuvPicture;

/// A plane whose rows, and whose texels, may lie apart: codecs pad rows, and put both
/// chroma planes into one, turn by turn (NV12).
#[derive(Clone, Copy, Debug)]
pub struct StridedPlane<'a> {
    /// From the first texel on.
    pub bytes: &'a [u8],
    /// Bytes between the first texels of two rows.
    pub row_stride: usize,
    /// Bytes between two texels of a row.
    pub texel_stride: usize,
}

impl StridedPlane<'_> {
    /// The first `width` times `height` texels; none where there are not as many.
    fn tight(self, [width, height]: [usize; 2]) -> Option<Vec<u8>> {
        let mut tight = Vec::with_capacity(width.checked_mul(height)?);
        let span = width.checked_sub(1)?.checked_mul(self.texel_stride)? + 1;
        for row in 0..height {
            let first = row.checked_mul(self.row_stride)?;
            let row = self.bytes.get(first..first.checked_add(span)?)?;
            if self.texel_stride == 1 {
                tight.extend_from_slice(row);
            } else {
                tight.extend(row.iter().step_by(self.texel_stride.max(1)));
            }
        }
        Some(tight)
    }
}

impl YuvPicture {
    /// A picture of an even width and height out of planes of a decoder: luma, blue
    /// and red chroma. None where a plane is smaller than that.
    #[must_use]
    pub fn of_planes([width, height]: [u32; 2], planes: [StridedPlane<'_>; 3]) -> Option<Self> {
        let luma = [width as usize, height as usize];
        let chroma = luma.map(|side| side / 2);
        let [y, u, v] = planes;
        Some(Self {
            width,
            height,
            y: y.tight(luma)?,
            u: u.tight(chroma)?,
            v: v.tight(chroma)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Texel (x, y) of plane `n`.
    fn texel(n: usize, x: usize, y: usize) -> u8 {
        (n * 64 + y * 8 + x) as u8
    }

    fn expected() -> YuvPicture {
        let plane = |n: usize, [width, height]: [usize; 2]| {
            let rows = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
            rows.map(|(x, y)| texel(n, x, y)).collect()
        };
        YuvPicture {
            width: 6,
            height: 4,
            y: plane(0, [6, 4]),
            u: plane(1, [3, 2]),
            v: plane(2, [3, 2]),
        }
    }

    #[test]
    fn padded_rows_and_chroma_turn_by_turn_become_tight() {
        // Rows of eight bytes, the last one without its padding.
        let luma: Vec<u8> = (0..3 * 8 + 6).map(|i| texel(0, i % 8, i / 8)).collect();
        let chroma: Vec<u8> = (0..8 + 6)
            .map(|i| texel(1 + i % 2, i % 8 / 2, i / 8))
            .collect();
        let plane = |bytes, texel_stride| StridedPlane {
            bytes,
            row_stride: 8,
            texel_stride,
        };
        let planes = |chroma| {
            let [blue, red]: [&[u8]; 2] = chroma;
            [plane(&luma, 1), plane(blue, 2), plane(red, 2)]
        };
        let made = YuvPicture::of_planes([6, 4], planes([&chroma, &chroma[1..]]));
        assert_eq!(made, Some(expected()));

        // A byte less is a plane too small, and nothing is a picture of nothing.
        let short = planes([&chroma[..12], &chroma[1..]]);
        assert_eq!(YuvPicture::of_planes([6, 4], short), None);
        assert_eq!(YuvPicture::of_planes([0, 0], planes([&[], &[]])), None);
        let endless = StridedPlane {
            bytes: &luma,
            row_stride: usize::MAX,
            texel_stride: usize::MAX,
        };
        assert_eq!(YuvPicture::of_planes([6, 4], [endless; 3]), None);
    }
}
