//! How much smaller than ideal blocks must be so that all of them fit.
//!
//! The bias is subtracted from log2 of every block's area: 0 accepts the ideal
//! sizes, 1 halves them. It rises as far as it must, so that a crowded view
//! gets coarser and nothing of it is lost.
//!
//! Source: Mueller et al., "Shading Atlas Streaming", 2018, section 4.3,
//! equation 3. We differ in solving it for blocks that only become smallest
//! because of the bias itself: the equation is repeated until it holds.

/// Steps after which equation 3 has settled far below [`FINEST_STEP`].
const MOST_STEPS: u32 = 64;

/// Least rise of one step, so that rounding cannot make the iteration stand still.
const FINEST_STEP: f64 = 1.0 / 64.0;

/// The least bias at which blocks of these areas take no more than `space`.
///
/// `areas` are ideal areas in texels, none larger than `largest`; none becomes
/// smaller than `smallest`. Never negative, and at most what makes every block
/// smallest, even where that is not enough.
#[must_use]
pub fn bias(areas: &[f32], smallest: f32, largest: f32, space: f64) -> f32 {
    let most = f64::from(largest / smallest).log2();
    let smallest = f64::from(smallest);
    let mut bias = 0.0_f64;
    for _ in 0..MOST_STEPS {
        let scale = (-bias).exp2();
        let (mut shrinkable, mut fixed) = (0.0, 0.0);
        for &area in areas {
            let area = f64::from(area) * scale;
            if area > smallest {
                shrinkable += area;
            } else {
                fixed += smallest;
            }
        }
        if shrinkable + fixed <= space {
            break;
        }
        if fixed >= space {
            return most as f32;
        }
        bias += (shrinkable / (space - fixed)).log2().max(FINEST_STEP);
    }
    bias.min(most) as f32
}

#[cfg(test)]
mod tests {
    use super::bias;

    #[test]
    fn ideal_sizes_that_fit_are_accepted() {
        assert_eq!(bias(&[], 4.0, 4096.0, 100.0), 0.0);
        assert_eq!(bias(&[64.0, 36.0], 4.0, 4096.0, 100.0), 0.0);
    }

    #[test]
    fn is_log2_of_the_excess_where_nothing_is_smallest() {
        let areas = [1024.0; 64];
        assert!((bias(&areas, 4.0, 4096.0, 8192.0) - 3.0).abs() < 1e-5);
    }

    #[test]
    fn smallest_blocks_are_taken_out_of_both_sides() {
        // I = 800 + 400, d = 400, S = 600: b = log2(800 / 200).
        let areas: Vec<f32> = std::iter::repeat_n(4.0, 100).chain([400.0; 2]).collect();
        assert!((bias(&areas, 4.0, 4096.0, 600.0) - 2.0).abs() < 1e-5);
    }

    #[test]
    fn space_of_the_smallest_blocks_alone_makes_all_smallest() {
        let areas: Vec<f32> = std::iter::repeat_n(4.0, 100).chain([400.0; 2]).collect();
        assert_eq!(bias(&areas, 4.0, 4096.0, 400.0), 10.0);
        assert_eq!(bias(&areas, 4.0, 4096.0, 0.0), 10.0);
    }

    #[test]
    fn blocks_that_become_smallest_on_the_way_are_allowed_for() {
        let areas: Vec<f32> = (1..=1000).map(|n| n as f32).collect();
        let b = bias(&areas, 4.0, 4096.0, 20_000.0);
        let total: f32 = areas.iter().map(|a| (a * (-b).exp2()).max(4.0)).sum();
        assert!((19_000.0..=20_000.5).contains(&total), "{total} at {b}");
    }
}
