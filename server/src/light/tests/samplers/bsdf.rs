//! The surface: what it samples, what it evaluates, and what glTF says.

use std::f32::consts::{FRAC_PI_2, TAU};
use std::f64::consts::PI;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3, Vec4, vec3};
use shadecast_shaders::light::Sampler;

use super::{Bench, assert_likely, counts};
use crate::scene::Scene;

const SOURCE: &str = include_str!("bsdf.wgsl");
/// `RINGS` times `SECTORS`.
const CELLS: usize = 768;

/// A surface and two directions; see `bsdf.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Probe {
    wo: Vec3,
    roughness: f32,
    wi: Vec3,
    metallic: f32,
    ns: Vec3,
    f0: f32,
    ng: Vec3,
    spare: f32,
    base: Vec3,
    spare_too: f32,
}

/// What `evaluate_bsdf` finds there.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Value {
    specular: Vec3,
    diffuse: f32,
    pdf: f32,
    /// Of the samples, by the specular lobe.
    share: f32,
    alpha: f32,
    spare: f32,
}

/// A surface seen at `degrees` from its normal.
fn seen(degrees: f32, roughness: f32, metallic: f32, base: Vec3) -> Probe {
    let ns = vec3(0.3, -0.5, 0.8).normalize();
    Probe {
        wo: above(ns, (90.0 - degrees).to_radians(), 0.1),
        roughness,
        metallic,
        ns,
        ng: ns,
        base,
        f0: 0.04,
        ..Probe::zeroed()
    }
}

/// A direction by its elevation over the surface and its azimuth in turns.
fn above(n: Vec3, elevation: f32, azimuth: f32) -> Vec3 {
    let (x, y) = n.any_orthonormal_pair();
    let (sin, cos) = (TAU * azimuth).sin_cos();
    ((x * cos + y * sin) * elevation.cos() + n * elevation.sin()).normalize()
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn directions_fall_where_their_density_says() {
    const SAMPLES: usize = 1 << 18;
    let mut probes = Vec::new();
    for degrees in [0.0, 45.0, 80.0, 89.0] {
        let surface = |(roughness, metallic)| {
            let base = vec3(0.8, 0.5, 0.2);
            seen(degrees, roughness, metallic, base)
        };
        probes.extend([(0.05, 0.0), (0.3, 0.0), (1.0, 0.0)].map(surface));
        probes.extend([(0.0, 1.0), (0.05, 1.0), (0.4, 1.0)].map(surface));
        let mixed = surface((0.3, 0.5));
        let tilted = Probe {
            ng: above(mixed.ns, 1.0, 0.35),
            ..mixed
        };
        probes.extend([mixed, tilted]);
    }
    let bench = Bench::new(&Scene::default());
    let integrals: Vec<Vec4> = bench.run(SOURCE, "integrate", &probes, CELLS);
    let cells: Vec<u32> = bench.run(SOURCE, "sample", &probes, SAMPLES);
    let tables = integrals.chunks(CELLS).zip(cells.chunks(SAMPLES));
    for (probe, (integrals, cells)) in probes.iter().zip(tables) {
        let mut probabilities: Vec<f64> = integrals.iter().map(|i| i.x.into()).collect();
        // The others leave through the surface.
        probabilities.push(1.0 - probabilities.iter().sum::<f64>());
        let counts = counts(CELLS + 1, cells.iter().map(|cell| *cell as usize));
        let what = format!("{probe:?}");
        assert_likely(&what, &counts, &probabilities, probes.len());
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn no_lobe_sends_more_than_comes() {
    /// Sums over cells are off by up to 1.3e-4, where the narrowest lobe ends.
    const TOLERANCE: f32 = 2e-4;
    let mut probes = Vec::new();
    for degrees in [0.0, 30.0, 60.0, 75.0, 85.0, 89.0, 89.9] {
        for step in 0..=10 {
            let roughness = step as f32 / 10.0;
            probes.extend([0.0, 1.0].map(|metal| seen(degrees, roughness, metal, Vec3::ONE)));
        }
    }
    let bench = Bench::new(&Scene::default());
    let integrals: Vec<Vec4> = bench.run(SOURCE, "integrate", &probes, CELLS);
    for (probe, cells) in probes.iter().zip(integrals.chunks(CELLS)) {
        let [pdf, diffuse, specular, _] = cells.iter().sum::<Vec4>().to_array();
        let cosine = probe.wo.dot(probe.ns);
        let most = if probe.metallic == 1.0 {
            1.0
        } else {
            // glTF takes from Lambert by the half vector's Fresnel reflection. What the
            // lobe reflects of a grazing view is more: if polished by the whole rise.
            1.0 + (1.0 - probe.f0) * (1.0 - cosine).powi(5)
        };
        let both = (1.0 - probe.metallic) * diffuse + specular;
        assert!(pdf <= 1.0 + TOLERANCE, "{probe:?}: {pdf}");
        assert!(
            diffuse <= 1.0 - probe.f0 + TOLERANCE,
            "{probe:?}: {diffuse}"
        );
        assert!(both <= most + TOLERANCE, "{probe:?}: {both}");
        // A polished metal sends all, unless the lobe reaches below the horizon.
        if probe.metallic == 1.0 && probe.roughness == 0.0 && cosine > 0.2 {
            assert!(both >= 1.0 - TOLERANCE, "{probe:?}: {both}");
        }
    }
}

/// glTF 2.0, appendix B, times the cosine: diffuse, specular and, with this
/// share of the specular lobe, the density.
///
/// The masking of the two directions is correlated by height (Heitz 2014,
/// equation 99), the density that of visible normals (Heitz 2018, equation 17).
fn twin(probe: &Probe, alpha: f64, share: f64) -> (f64, DVec3, f64) {
    let vectors = [probe.ns, probe.ng, probe.wo, probe.wi];
    let [n, ng, v, l] = vectors.map(|vector| vector.as_dvec3().normalize());
    let (n_l, n_v) = (n.dot(l), n.dot(v));
    if n_l <= 0.0 || n_v <= 0.0 || ng.dot(l) <= 0.0 {
        return (0.0, DVec3::ZERO, 0.0);
    }
    let h = (l + v).normalize();
    let root = n.dot(h).powi(2) * (alpha * alpha - 1.0) + 1.0;
    let d = alpha * alpha / (PI * root * root);
    let lambda = |cosine: f64| {
        let tan_squared = (1.0 - cosine * cosine) / (cosine * cosine);
        0.5 * ((1.0 + alpha * alpha * tan_squared).sqrt() - 1.0)
    };
    let fresnel = |f0: DVec3| f0 + (1.0 - f0) * (1.0 - v.dot(h)).powi(5);
    let dielectric = fresnel(DVec3::splat(probe.f0.into()));
    let metal = fresnel(probe.base.as_dvec3());
    let visible = d / (4.0 * n_v);
    (
        (1.0 - dielectric.x) * n_l / PI,
        dielectric.lerp(metal, probe.metallic.into()) * visible / (1.0 + lambda(n_l) + lambda(n_v)),
        share * visible / (1.0 + lambda(n_v)) + (1.0 - share) * n_l / PI,
    )
}

/// Any surface and two directions, often grazing down to a millionth, often mirrored.
fn any_probe(index: u32) -> Probe {
    let mut sampler = Sampler::new(index, 1);
    let mut draw = || sampler.sample_2d();
    let on_sphere = |[u, v]: [f32; 2]| above(Vec3::Z, (2.0 * u - 1.0).asin(), v);
    let any_above = |n, [u, v]: [f32; 2]| above(n, 1e-6_f32.powf(u) * FRAC_PI_2, v);
    let [roughness, metallic] = draw();
    let roughness = [0.0, 1e-4, roughness, 1.0][index as usize % 4];
    let ns = [Vec3::Z, on_sphere(draw())][index as usize / 4 % 2];
    let wo = any_above(ns, draw());
    let spread = [0.0, 3.0 * (roughness * roughness).max(1e-3)][index as usize / 8 % 2];
    let mirrored = -wo.reflect((ns + on_sphere(draw()) * spread).normalize());
    let ([red, green], [blue, f0]) = (draw(), draw());
    Probe {
        wo,
        roughness,
        wi: [mirrored.normalize(), any_above(ns, draw())][index as usize / 16 % 2],
        metallic: [0.0, metallic, 1.0][index as usize % 3],
        ns,
        // Not so white or black that colours or their complements cancel.
        f0: 0.02 + 0.48 * f0,
        ng: (ns + on_sphere(draw()) * 0.1).normalize(),
        base: vec3(red, green, blue).max(Vec3::splat(0.02)),
        ..Probe::zeroed()
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn lobes_are_those_of_gltf() {
    let probes: Vec<Probe> = (0..1 << 16).map(any_probe).collect();
    let bench = Bench::new(&Scene::default());
    let values: Vec<Value> = bench.run(SOURCE, "evaluate", &probes, 1);
    let mut close = 0;
    for (probe, value) in probes.iter().zip(&values) {
        assert!((0.0..=1.0).contains(&value.share));
        let alpha = f64::from(value.alpha);
        let (diffuse, specular, pdf) = twin(probe, alpha, value.share.into());
        // Single precision leaves unit vectors off by its rounding, and so the cosines
        // of both directions, which counts where they graze. The half vector is off by
        // the rounding over the sum's length, 2 v·h, which counts against the width of
        // the lobe, and against v·h where Fresnel takes nearly all from Lambert.
        let [n, v, l] = [probe.ns, probe.wo, probe.wi].map(|v| v.as_dvec3().normalize());
        let v_h = 0.5 * (v + l).length();
        let grazing = 1.0 / n.dot(v).abs() + 1.0 / n.dot(l).abs();
        let tolerance = 2.0 * f64::from(f32::EPSILON) * (grazing + (1.0 / alpha + 1.0 / v_h) / v_h);
        let found = [value.diffuse, value.pdf]
            .into_iter()
            .chain(value.specular.to_array());
        let expected = [diffuse, pdf].into_iter().chain(specular.to_array());
        for (found, expected) in found.zip(expected) {
            let off = (f64::from(found) - expected).abs();
            assert!(
                off <= tolerance * expected,
                "{probe:?}: {value:?}, not {expected}"
            );
        }
        close += u32::from(pdf > 0.0 && tolerance < 1e-2);
    }
    assert!(close > 1 << 14, "only {close} are bounded closely");
}
