//! Twin of `sampler.wgsl`: Owen-scrambled Sobol points.

/// Draws pairs of dimensions of one sample of a sequence.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    index: u32,
    seed: u32,
    dimension: u32,
}

/// Samples after which a pair of dimensions starts over with another scrambling, log2.
const SHUFFLE_BITS: u32 = 12;

fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x21f0_aaad);
    x ^= x >> 15;
    x = x.wrapping_mul(0xd35a_2d97);
    x ^ (x >> 15)
}

fn laine_karras(x: u32, seed: u32) -> u32 {
    let mut x = x.wrapping_add(seed);
    for factor in [0x6c50_b47c_u32, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6] {
        x ^= x.wrapping_mul(factor);
    }
    x
}

fn owen(x: u32, seed: u32) -> u32 {
    laine_karras(x.reverse_bits(), seed).reverse_bits()
}

fn unit_from_bits(x: u32) -> f32 {
    (x >> 8) as f32 / 16_777_216.0
}

impl Sampler {
    /// Sample `index` of the sequence that `seed` names.
    #[must_use]
    pub fn new(index: u32, seed: u32) -> Self {
        Self {
            index,
            seed,
            dimension: 0,
        }
    }

    /// The next pair of dimensions, uniform in [0, 1)².
    pub fn sample_2d(&mut self) -> [f32; 2] {
        let pair = hash(
            self.seed
                ^ self.dimension.wrapping_mul(0x9e37_79b9)
                ^ (self.index >> SHUFFLE_BITS).wrapping_mul(0x85eb_ca6b),
        );
        self.dimension += 1;
        let index = owen(self.index, pair) & ((1 << SHUFFLE_BITS) - 1);
        let mut y = 0;
        let mut direction = 0x8000_0000_u32;
        let mut i = index;
        while i != 0 {
            if i & 1 != 0 {
                y ^= direction;
            }
            direction ^= direction >> 1;
            i >>= 1;
        }
        [
            unit_from_bits(owen(index.reverse_bits(), hash(pair ^ 0x68bc_21eb))),
            unit_from_bits(owen(y, hash(pair ^ 0x02e5_be93))),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every elementary interval of 16 equal rectangles holds one of 16
    /// consecutive points: what stratification promises.
    #[test]
    fn sixteen_points_are_stratified() {
        for seed in [0, 1, 77, 0xdead_beef] {
            for dimension in 0..4 {
                for (columns, rows) in [(16, 1), (8, 2), (4, 4), (2, 8), (1, 16)] {
                    let mut seen = [0; 16];
                    for index in 32..48 {
                        let mut sampler = Sampler::new(index, seed);
                        let mut point = sampler.sample_2d();
                        for _ in 0..dimension {
                            point = sampler.sample_2d();
                        }
                        let column = (point[0] * columns as f32) as usize;
                        let row = (point[1] * rows as f32) as usize;
                        seen[row * columns + column] += 1;
                    }
                    assert_eq!(seen, [1; 16], "seed {seed}, {columns} by {rows}");
                }
            }
        }
    }

    #[test]
    fn points_are_uniform() {
        // Chi-square over 64 cells of 4096 points of unrelated seeds.
        let mut cells = [0.0_f64; 64];
        for seed in 0..4096 {
            let [x, y] = Sampler::new(seed & 7, hash(seed)).sample_2d();
            cells[(y * 8.0) as usize * 8 + (x * 8.0) as usize] += 1.0;
        }
        let chi_square: f64 = cells.iter().map(|n| (n - 64.0) * (n - 64.0) / 64.0).sum();
        // 63 degrees of freedom: 103.4 is exceeded once in a thousand.
        assert!(chi_square < 103.4, "{chi_square}");
    }
}
