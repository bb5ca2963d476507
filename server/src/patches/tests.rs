//! What must stay true of every cut.

mod meshes;

use std::collections::{HashMap, HashSet};

use glam::{Vec2, Vec3};
use proptest::prelude::*;
use shadecast_protocol::ObjectId;

use super::*;
use crate::scene::Material;
use meshes::{grid, icosphere, scene};

const UNLIMITED: PatchLimits = PatchLimits {
    longest_edge: f32::INFINITY,
    most_triangles: usize::MAX,
};

/// Triangles with the least position in front, in order.
fn canonical(scene: &Scene) -> Vec<([u32; 3], [u32; 3])> {
    let mut triangles: Vec<_> = scene
        .triangles
        .iter()
        .map(|triangle| {
            let rotations = [0, 1, 2].map(|first| {
                let turn = |of: [u32; 3]| [0, 1, 2].map(|k| of[(first + k) % 3]);
                (turn(triangle.positions), turn(triangle.corners))
            });
            rotations.into_iter().min().expect("three rotations")
        })
        .collect();
    triangles.sort_unstable();
    triangles
}

/// The contract of [`PatchedScene`].
fn check(patched: &PatchedScene) {
    let mut next = 0;
    for patch in &patched.patches {
        assert_eq!(patch.first_triangle, next);
        for (k, corners) in patch.shape.triangles().iter().enumerate() {
            let triangle = &patched.scene.triangles[next as usize + k];
            assert_eq!(
                triangle.positions,
                corners.map(|corner| patch.corners[corner])
            );
            assert_eq!(triangle.object, patch.object);
            let kind = Kind::of(&patched.scene, triangle);
            assert_eq!(
                (kind.double_sided, kind.masked),
                (patch.double_sided, patch.masked)
            );
        }
        let used = patch.shape.corners().len();
        assert!(
            patch.corners[used..]
                .iter()
                .all(|&c| c == patch.corners[used - 1])
        );
        next += patch.shape.triangles().len() as u32;
    }
    assert_eq!(next as usize, patched.scene.triangles.len());
    let mut next = 0;
    for range in &patched.ranges {
        assert_eq!(range.first_triangle, next);
        assert!(range.triangle_count > 0);
        next += range.triangle_count;
    }
    assert_eq!(next as usize, patched.scene.triangles.len());
    let shares: f32 = patched.report.shares().iter().sum();
    assert!(patched.patches.is_empty() || (shares - 1.0).abs() < 1e-5);
}

#[test]
fn a_grid_is_cut_into_its_quads() {
    let source = grid(40);
    let patched = cut(source.clone(), UNLIMITED);
    check(&patched);
    assert_eq!(canonical(&source), canonical(&patched.scene));
    assert_eq!(patched.report.pairs, 1600, "{}", patched.report);
    for patch in &patched.patches {
        let [a, _, c, ..] = patch.corners.map(|i| patched.scene.positions[i as usize]);
        assert!(
            (c - a).abs().truncate().abs_diff_eq(Vec2::ONE, 1e-5),
            "{patch:?}"
        );
    }
}

#[test]
fn closed_meshes_of_equal_triangles_leave_hardly_any_over() {
    for subdivisions in 2..6 {
        let patched = cut(icosphere(subdivisions), UNLIMITED);
        check(&patched);
        let [solo, pair, _] = patched.report.shares();
        assert!(pair > 0.97 && solo == 0.0, "{}", patched.report);
    }
}

#[test]
fn three_in_a_strip_make_one_patch() {
    let strip = (0..5).map(|i| Vec3::new(i as f32 * 0.5, (i % 2) as f32, 0.0));
    let patched = cut(
        scene(strip.collect(), [[0, 2, 1], [1, 2, 3], [2, 4, 3]]),
        UNLIMITED,
    );
    check(&patched);
    assert_eq!(patched.report.triples, 1);
    assert_eq!(
        patched.patches[0].corners[1], 2,
        "the shared corner lies in the middle"
    );
}

#[test]
fn neighbours_near_in_space_have_near_ids() {
    let patched = cut(grid(64), UNLIMITED);
    let owners: HashMap<u32, u32> = (0..)
        .zip(&patched.patches)
        .flat_map(|(id, patch)| patch.corners.map(|corner| (corner, id)))
        .collect();
    let far = (0..)
        .zip(&patched.patches)
        .filter(|(id, patch)| patch.corners.iter().any(|c| owners[c].abs_diff(*id) > 512));
    assert!(far.count() * 10 < patched.patches.len());
}

#[test]
fn kinds_and_objects_are_not_mixed() {
    let mut source = grid(8);
    let mask = Alpha::Mask { cutoff: 0.5 };
    source.materials.push(Material {
        double_sided: true,
        ..Material::default()
    });
    source.materials.push(Material {
        alpha: mask,
        ..Material::default()
    });
    for (i, triangle) in source.triangles.iter_mut().enumerate() {
        triangle.material = (i / 5 % 3) as u32;
        triangle.object = ObjectId((i / 64) as u16);
    }
    let patched = cut(source.clone(), UNLIMITED);
    check(&patched);
    assert_eq!(canonical(&source), canonical(&patched.scene));
    assert_eq!(patched.ranges.len(), 6, "two objects of three kinds");
}

#[test]
fn a_crease_separates() {
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 0.0, 1.0)];
    let patched = cut(scene(corners.to_vec(), [[0, 1, 2], [1, 0, 3]]), UNLIMITED);
    assert_eq!(patched.report.solos, 2);
}

/// Each edge of a closed mesh is run through once in either direction.
fn is_watertight(scene: &Scene) -> bool {
    let edges: HashSet<(u32, u32)> = scene
        .triangles
        .iter()
        .flat_map(|t| [0, 1, 2].map(|k| (t.positions[k], t.positions[(k + 1) % 3])))
        .collect();
    edges.len() == 3 * scene.triangles.len() && edges.iter().all(|&(a, b)| edges.contains(&(b, a)))
}

/// Of triangles that are no lines.
fn longest_edge(scene: &Scene) -> f32 {
    let different = |[a, b, c]: [u32; 3]| a != b && b != c && c != a;
    let visible = scene.triangles.iter().filter(|t| different(t.positions));
    let edges = visible.flat_map(|t| {
        let [a, b, c] = t.positions.map(|i| scene.positions[i as usize]);
        [a.distance(b), b.distance(c), c.distance(a)]
    });
    edges.fold(0.0, f32::max)
}

fn area(scene: &Scene) -> f32 {
    let triangles = scene.triangles.iter().map(|t| {
        let [a, b, c] = t.positions.map(|i| scene.positions[i as usize]);
        0.5 * (b - a).cross(c - a).length()
    });
    triangles.sum()
}

#[test]
fn long_edges_are_split_without_cracks() {
    let source = icosphere(1);
    let limits = PatchLimits {
        longest_edge: 0.1,
        ..UNLIMITED
    };
    let patched = cut(source.clone(), limits);
    check(&patched);
    assert!(is_watertight(&patched.scene));
    assert!(longest_edge(&patched.scene) <= 0.1);
    assert!((area(&patched.scene) - area(&source)).abs() < 1e-3);
    let [_, pair, _] = patched.report.shares();
    assert!(pair > 0.95, "{}", patched.report);
    assert_eq!(
        patched.report.added_triangles,
        2 * patched.report.split_edges
    );
    assert!(
        patched
            .scene
            .corners
            .iter()
            .all(|corner| corner.normal.is_normalized())
    );
}

#[test]
fn splitting_stops_at_the_bound_without_cracks() {
    let limits = PatchLimits {
        longest_edge: 0.01,
        most_triangles: 999,
    };
    let patched = cut(icosphere(1), limits);
    check(&patched);
    assert!((990..=999).contains(&patched.scene.triangles.len()));
    assert!(is_watertight(&patched.scene));
}

#[test]
fn limits_follow_from_the_atlas() {
    let limits = PatchLimits::for_atlas(64, 163.0);
    let angle = 2.0 * (limits.longest_edge * 0.5 / 2.0).atan();
    assert!((angle * 163.0 - 64.0).abs() < 1e-3);
    assert!(PatchLimits::for_atlas(256, 0.0).longest_edge.is_finite());
}

#[test]
fn nothing_and_the_impossible_are_harmless() {
    assert!(cut(Scene::default(), UNLIMITED).patches.is_empty());
    let limits = PatchLimits {
        longest_edge: 1.0,
        most_triangles: 10_000,
    };
    let impossible = vec![
        Vec3::NAN,
        Vec3::INFINITY,
        Vec3::ZERO,
        Vec3::splat(1e30),
        Vec3::X,
        Vec3::new(1e-30, 0.0, 0.0),
    ];
    let all = (0..6).flat_map(|a| (0..6).flat_map(move |b| (0..6).map(move |c| [a, b, c])));
    check(&cut(scene(impossible, all), limits));
    for longest_edge in [0.0, -1.0, f32::NAN] {
        check(&cut(
            grid(2),
            PatchLimits {
                longest_edge,
                ..UNLIMITED
            },
        ));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_soup_of_triangles_keeps_the_contract(
        points in prop::collection::vec((-1.0_f32..1.0, -1.0_f32..1.0, -0.1_f32..0.1), 3..40),
        corners in prop::collection::vec((0_u32..40, 0_u32..40, 0_u32..40), 0..200),
        limit in 0.2_f32..3.0,
    ) {
        let positions: Vec<Vec3> = points.into_iter().map(Vec3::from).collect();
        let count = positions.len() as u32;
        let triangles = corners.into_iter().map(|(a, b, c)| [a % count, b % count, c % count]);
        let source = scene(positions, triangles);
        let patched = cut(source.clone(), UNLIMITED);
        check(&patched);
        prop_assert_eq!(canonical(&source), canonical(&patched.scene));
        let limits = PatchLimits { longest_edge: limit, most_triangles: 100_000 };
        let split = cut(source.clone(), limits);
        check(&split);
        prop_assert!(longest_edge(&split.scene) <= 1.002 * limit);
        prop_assert_eq!(&cut(source, limits).scene.triangles, &split.scene.triangles);
    }
}
