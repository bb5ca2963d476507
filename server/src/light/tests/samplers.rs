//! What the kernels draw at random falls where their densities say, on the GPU.
//!
//! Samples are counted in cells whose probabilities are known, and Pearson's
//! chi-square test says how likely such counts are.

mod bsdf;
mod lamps;
mod points;
mod shapes;
mod sky;

use bytemuck::Pod;
use shadecast_shaders::light::ADVANCE_SOURCE;
use wgpu::ShaderStages;

use crate::{
    gpu::{Binding, Gpu, GpuScene, Integrator, bind, layout, workgroups},
    scene::Scene,
};

/// Chance that any of a test's tables of counts looks wrong though none is.
const FALSE_ALARM: f64 = 1e-4;

/// A device and a scene, for kernels that call those of the light.
struct Bench {
    gpu: Gpu,
    scene: GpuScene,
}

impl Bench {
    fn new(scene: &Scene) -> Self {
        let gpu = Gpu::open().expect("a GPU");
        let scene =
            GpuScene::new(&gpu, scene, Integrator::with_bounces(1), &mut |_| ()).expect("a scene");
        Self { gpu, scene }
    }

    /// Runs a kernel of `source` with so many threads for each input; each
    /// thread makes one output.
    fn run<I: Pod, O: Pod>(
        &self,
        source: &str,
        entry: &str,
        inputs: &[I],
        per_input: usize,
    ) -> Vec<O> {
        let Self { gpu, scene } = self;
        let count = inputs.len() * per_input;
        let bytes = (count * size_of::<O>()) as u64;
        let unused = layout(gpu, ShaderStages::COMPUTE, &[]);
        let own = layout(gpu, ShaderStages::COMPUTE, &[Binding::Read, Binding::Write]);
        let inputs = gpu
            .storage("inputs", bytemuck::cast_slice(inputs))
            .expect("room");
        let outputs = gpu.scratch("outputs", bytes).expect("room");
        let source = [
            ADVANCE_SOURCE,
            include_str!("samplers/samplers.wgsl"),
            source,
        ]
        .concat();
        let layouts = [&scene.layout, &unused, &own];
        let pipeline = gpu.compute_pipeline(&source, entry, &layouts, &scene.constants);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &scene.group, &[]);
            pass.set_bind_group(1, &bind(gpu, &unused, &[]), &[]);
            pass.set_bind_group(2, &bind(gpu, &own, &[&inputs, &outputs]), &[]);
            let (x, y) = workgroups(count as u32, 64);
            pass.dispatch_workgroups(x, y, 1);
        }
        gpu.queue.submit([encoder.finish()]);
        gpu.read(&outputs, 0..bytes).expect("the device answers")
    }
}

/// How often each number below `cells` comes.
fn counts(cells: usize, found: impl IntoIterator<Item = usize>) -> Vec<f64> {
    let mut counts = vec![0.0; cells];
    for cell in found {
        counts[cell] += 1.0;
    }
    counts
}

/// Fails if counts are farther from what `probabilities` let expect than chance
/// would explain in one of so many tables.
fn assert_likely(what: &str, counts: &[f64], probabilities: &[f64], tables: usize) {
    let p = chi_square_tail(counts, probabilities);
    let alarm = FALSE_ALARM / tables as f64;
    assert!(
        p > alarm,
        "{what}: p = {p:.2e}, and {alarm:.2e} is too rare"
    );
}

/// Probability of counts as unlikely as these or more so.
fn chi_square_tail(counts: &[f64], probabilities: &[f64]) -> f64 {
    assert_eq!(counts.len(), probabilities.len());
    let total: f64 = counts.iter().sum();
    let mut cells: Vec<(f64, f64)> = (counts.iter())
        .zip(probabilities)
        .map(|(count, p)| (*count, p.max(0.0) * total))
        .collect();
    cells.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (mut chi_square, mut groups) = (0.0, 0.0_f64);
    let mut pooled = (0.0, 0.0);
    for (count, expected) in cells {
        pooled = (pooled.0 + count, pooled.1 + expected);
        // Fewer are not distributed as the test has it.
        if pooled.1 >= 5.0 {
            chi_square += (pooled.0 - pooled.1).powi(2) / pooled.1;
            groups += 1.0;
            pooled = (0.0, 0.0);
        }
    }
    // Wilson and Hilferty 1931: the cube root is nearly normal.
    let freedom = groups - 1.0;
    let variance = 2.0 / (9.0 * freedom);
    let z = ((chi_square / freedom).cbrt() - (1.0 - variance)) / variance.sqrt();
    // Sampford 1953: an upper bound of the normal tail, within 2% of it beyond one.
    let density = (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt();
    if z > 0.0 {
        density * 4.0 / (3.0 * z + (z * z + 8.0).sqrt())
    } else {
        0.5
    }
}

#[test]
fn chi_square_tails_are_those_of_tables() {
    // 10 and 100 degrees of freedom: exceeded once in a thousand.
    for (cells, critical) in [(11, 29.588), (101, 149.449)] {
        let expected = 1e6;
        let mut counts = vec![expected; cells];
        let off = (critical * expected / 2.0_f64).sqrt();
        counts[0] += off;
        counts[1] -= off;
        let p = chi_square_tail(&counts, &vec![1.0 / cells as f64; cells]);
        assert!((p / 1e-3 - 1.0).abs() < 0.1, "{p}");
    }
}
