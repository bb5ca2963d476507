//! The points that everything is sampled with.

use glam::Vec2;
use shadecast_shaders::light::Sampler;

use super::Bench;
use crate::scene::Scene;

const SOURCE: &str = include_str!("points.wgsl");

/// Pairs of dimensions that a path draws at its beginning and later.
const PAIRS: [u32; 4] = [0, 1, 2, 13];
/// Sequences whose points are compared.
const SEQUENCES: usize = 4096;
/// Five standard deviations of the correlation of so many independent points.
const LEAST_CORRELATION: f64 = 5.0 / 64.0;

/// On the CPU.
fn twin(index: u32, seed: u32, pair: u32) -> Vec2 {
    let mut sampler = Sampler::new(index, seed);
    let points = (0..=pair).map(|_| sampler.sample_2d());
    points.last().expect("a point").into()
}

/// The kernel's points for a list of four numbers each; see `points.wgsl`.
fn draw(entry: &str, draws: &[[u32; 4]]) -> Vec<Vec2> {
    Bench::new(&Scene::default()).run(SOURCE, entry, draws, 1)
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn every_elementary_interval_holds_one_point() {
    const COUNT: u32 = 1024;
    let mut draws = Vec::new();
    for seed in [0, 1, 77, 0xdead_beef] {
        for pair in PAIRS {
            draws.extend((0..COUNT).map(|index| [index, seed, pair, 0]));
        }
    }
    let points = draw("draw", &draws);
    for (&[index, seed, pair, _], point) in draws.iter().zip(&points) {
        assert_eq!(*point, twin(index, seed, pair));
    }
    for (draws, points) in draws
        .chunks(COUNT as usize)
        .zip(points.chunks(COUNT as usize))
    {
        for count in [256, COUNT as usize] {
            for columns in (0..=count.ilog2()).map(|log| 1 << log) {
                let size = Vec2::new(columns as f32, (count / columns) as f32);
                let mut is_taken = vec![false; count];
                for point in &points[..count] {
                    let at = (*point * size).as_usizevec2();
                    let was_taken = &mut is_taken[at.y * columns + at.x];
                    assert!(!*was_taken, "{:?}, {columns} columns of {count}", draws[0]);
                    *was_taken = true;
                }
            }
        }
    }
}

/// Of coordinate `i` of points with coordinate `j` of their partners.
fn correlation(partners: &[(Vec2, Vec2)], i: usize, j: usize) -> f64 {
    let mut sums = [0.0; 5];
    for (a, b) in partners {
        let (a, b) = (f64::from(a[i]), f64::from(b[j]));
        for (sum, term) in sums.iter_mut().zip([a, b, a * a, b * b, a * b]) {
            *sum += term;
        }
    }
    let [a, b, aa, bb, ab] = sums.map(|sum| sum / partners.len() as f64);
    (ab - a * b) / ((aa - a * a) * (bb - b * b)).sqrt()
}

fn assert_uncorrelated(what: &str, partners: &[(Vec2, Vec2)]) {
    for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let found = correlation(partners, i, j);
        assert!(found.abs() < LEAST_CORRELATION, "{what}: {found}");
    }
}

#[test]
fn seeds_and_pairs_are_uncorrelated() {
    for pair in PAIRS {
        let partners = |next: u32, other: u32| -> Vec<(Vec2, Vec2)> {
            (0..SEQUENCES as u32)
                .map(|seed| (twin(0, seed, pair), twin(0, seed + next, other)))
                .collect()
        };
        assert_uncorrelated("seeds", &partners(1, pair));
        for other in PAIRS.into_iter().filter(|other| *other != pair) {
            assert_uncorrelated("pairs", &partners(0, other));
        }
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn neighbouring_texels_are_uncorrelated() {
    const SAMPLES: u32 = 64;
    const SIDE: u32 = 64;
    for pair in PAIRS {
        let texels = (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y)));
        let draws: Vec<[u32; 4]> = texels
            .flat_map(|(x, y)| (0..SAMPLES).map(move |index| [index, x, y, pair]))
            .collect();
        let points = draw("draw_at_texels", &draws);
        let texels: Vec<&[Vec2]> = points.chunks(SAMPLES as usize).collect();
        for step in [1, SIDE as usize] {
            let neighbours = texels.iter().zip(texels.iter().cycle().skip(step));
            let firsts: Vec<_> = neighbours.clone().map(|(a, b)| (a[0], b[0])).collect();
            assert_uncorrelated("texels", &firsts);
            let sequences = neighbours.map(|(a, b)| {
                let partners: Vec<_> = a.iter().copied().zip(b.iter().copied()).collect();
                correlation(&partners, 0, 0)
            });
            let (sum, squares) = sequences.fold((0.0, 0.0), |(s, q), r| (s + r, q + r * r));
            // Every other point of a sequence lies opposite to the one before it, so
            // that those of two vary together as half as many independent ones do.
            let deviation = 1.0 / f64::from(SAMPLES / 2).sqrt();
            let (mean, root) = (sum / SEQUENCES as f64, (squares / SEQUENCES as f64).sqrt());
            assert!(mean.abs() < LEAST_CORRELATION * deviation, "{mean}");
            assert!(root < deviation, "{root}");
        }
    }
}
