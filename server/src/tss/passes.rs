//! The kernels of TSS, in their order, and the buffers between them.

use glam::Vec3;
use shadecast_shaders::tss::{
    ActiveTriangle, CLASSES, CellPlace, Class, MEASURE_SOURCE, MeasureParameters, NONE, SOURCE,
    TALLY_BYTES, TssParameters, TssState,
};
use wgpu::ShaderStages;

use crate::{
    atlas::KEEP_UNSEEN,
    gpu::{Binding, Gpu, GpuError, GpuScene, bind, layout, workgroups},
    packer::passes::{CountsActive, Outcomes, Threads},
    patches::PatchedScene,
};

/// Threads of a group, where a thread has a run of patches or a triangle.
const GROUP: u32 = 64;
/// How many groups a kernel gets.
#[derive(Clone, Copy, Debug)]
enum Groups {
    /// A thread for each run of patches.
    Runs,
    /// A thread for each patch.
    Patches,
    /// One.
    One,
}

/// The kernels after measuring, and which of two digits they sort by.
const FRAME: [(&str, Groups, bool); 11] = [
    ("count_active", Groups::Runs, false),
    ("scan_active", Groups::One, false),
    ("gather", Groups::Runs, false),
    ("choose_scale", Groups::One, false),
    ("count_digits", Groups::Runs, false),
    ("scan_digits", Groups::One, false),
    ("scatter", Groups::Runs, false),
    ("count_digits", Groups::Runs, true),
    ("scan_digits", Groups::One, true),
    ("scatter", Groups::Runs, true),
    ("place", Groups::Patches, false),
];

/// Everything of the method that lies on the GPU.
#[derive(Debug)]
pub(super) struct Passes {
    measure: wgpu::ComputePipeline,
    measure_group: wgpu::BindGroup,
    measuring: wgpu::Buffer,
    eyes: wgpu::Buffer,
    kernels: Vec<(wgpu::ComputePipeline, Groups)>,
    group: wgpu::BindGroup,
    #[cfg(test)]
    shapes: wgpu::Buffer,
    tally: wgpu::Buffer,
    pub(super) outcomes: Outcomes<TssState, ActiveTriangle>,
    patches: u32,
    run: u32,
}

impl Passes {
    pub(super) fn new(
        gpu: &Gpu,
        gpu_scene: &GpuScene,
        scene: &PatchedScene,
        size: [u16; 2],
        pixels: &wgpu::Buffer,
        threads: Threads,
    ) -> Result<Self, GpuError> {
        let records: Vec<[u32; 2]> = (scene.patches.iter())
            .map(|patch| [patch.first_triangle, u32::from(patch.object.0)])
            .collect();
        let patches = records.len() as u32;
        let Threads { run, lanes } = threads;
        let of_patches = |bytes: u64| u64::from(patches.max(1)) * bytes;
        let runs = u64::from(patches.div_ceil(run)).max(1);
        let parameters = gpu.uniform("TSS parameters", size_of::<TssParameters>());
        let never = vec![NONE; patches.max(1) as usize];
        let ages = gpu.storage("ages of triangles", bytemuck::cast_slice(&never))?;
        let shapes = gpu.scratch("shapes of triangles", of_patches(8))?;
        let active = gpu.scratch(
            "active triangles",
            of_patches(size_of::<ActiveTriangle>() as u64),
        )?;
        let run_counts = gpu.scratch("active triangles of runs", runs * 8)?;
        let tally = gpu.scratch("tally of triangles", TALLY_BYTES)?;
        let cell_bytes = (CLASSES * CLASSES * size_of::<CellPlace>()) as u64;
        let cells = gpu.scratch("places of kinds", cell_bytes)?;
        let digits = gpu.scratch("digits of runs", runs * 4 * CLASSES as u64)?;
        let order = gpu.scratch("order of triangles", of_patches(8))?;
        let state = gpu.scratch("state of TSS", size_of::<TssState>() as u64)?;

        let own_layout = layout(
            gpu,
            ShaderStages::COMPUTE,
            &[
                Binding::Uniform,
                Binding::Read,
                Binding::Read,
                Binding::Write,
                Binding::Write,
                Binding::Write,
                Binding::Write,
                Binding::Write,
                Binding::Write,
                Binding::Write,
                Binding::Write,
            ],
        );
        let buffers = [
            &parameters,
            pixels,
            &shapes,
            &ages,
            &active,
            &run_counts,
            &tally,
            &cells,
            &digits,
            &order,
            &state,
        ];
        let group = bind(gpu, &own_layout, &buffers);
        let kernels = FRAME.map(|(name, groups, second)| {
            let constants = [
                ("RUN", f64::from(run)),
                ("LANES", f64::from(lanes)),
                ("SECOND_DIGIT", f64::from(u8::from(second))),
            ];
            let kernel = gpu.compute_pipeline(SOURCE, name, &[&own_layout], &constants);
            (kernel, groups)
        });

        let measure_layout = layout(
            gpu,
            ShaderStages::COMPUTE,
            &[
                Binding::Uniform,
                Binding::Read,
                Binding::Read,
                Binding::Read,
                Binding::Read,
                Binding::Write,
            ],
        );
        let measuring = gpu.uniform("measuring of triangles", size_of::<MeasureParameters>());
        let records = gpu.storage("triangles of patches", bytemuck::cast_slice(&records))?;
        let eyes = gpu.scratch("eyes", 16 * (scene.scene.objects.len() as u64 + 1))?;
        let buffers = [&measuring, pixels, &ages, &records, &eyes, &shapes];
        let measure_group = bind(gpu, &measure_layout, &buffers);
        gpu.queue.write_buffer(
            &parameters,
            0,
            bytemuck::bytes_of(&parameters_of(patches, size)),
        );
        Ok(Self {
            outcomes: Outcomes::new(gpu, &state, &active, patches),
            measure: gpu.compute_pipeline(
                MEASURE_SOURCE,
                "measure_triangles",
                &[&gpu_scene.layout, &measure_layout],
                &gpu_scene.constants,
            ),
            measure_group,
            measuring,
            eyes,
            kernels: kernels.into(),
            group,
            #[cfg(test)]
            shapes,
            tally,
            patches,
            run,
        })
    }

    /// Records the measuring and the placement of a frame; `eyes[n]` is the eye in the
    /// space of `ObjectId(n)`.
    pub(super) fn record(
        &self,
        gpu: &Gpu,
        gpu_scene: &GpuScene,
        encoder: &mut wgpu::CommandEncoder,
        eyes: &[Vec3],
        pixels_per_radian: f32,
    ) {
        let measuring = MeasureParameters {
            patch_count: self.patches,
            pixels_per_radian,
            keep_unseen: KEEP_UNSEEN,
            padding: 0,
        };
        gpu.queue
            .write_buffer(&self.measuring, 0, bytemuck::bytes_of(&measuring));
        let eyes: Vec<[f32; 4]> = (eyes.iter())
            .map(|eye| eye.extend(0.0).to_array())
            .take((self.eyes.size() / 16) as usize)
            .collect();
        gpu.queue
            .write_buffer(&self.eyes, 0, bytemuck::cast_slice(&eyes));
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("measure triangles"),
                timestamp_writes: None,
            });
            pass.set_pipeline(&self.measure);
            pass.set_bind_group(0, &gpu_scene.group, &[]);
            pass.set_bind_group(1, &self.measure_group, &[]);
            let (x, y) = workgroups(self.patches, GROUP);
            pass.dispatch_workgroups(x, y, 1);
        }
        self.record_packing(encoder);
    }

    /// Records the placement of what has been measured.
    pub(super) fn record_packing(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.clear_buffer(&self.tally, 0, None);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("TSS"),
            timestamp_writes: None,
        });
        pass.set_bind_group(0, &self.group, &[]);
        for (kernel, groups) in &self.kernels {
            let (x, y) = match groups {
                Groups::Runs => workgroups(self.patches.div_ceil(self.run), GROUP),
                Groups::Patches => workgroups(self.patches, GROUP),
                Groups::One => (1, 1),
            };
            pass.set_pipeline(kernel);
            pass.dispatch_workgroups(x, y, 1);
        }
    }

    #[cfg(test)]
    pub(super) fn shapes(&self) -> &wgpu::Buffer {
        &self.shapes
    }
}

/// What frames of an atlas of `size` texels are placed with.
pub(super) fn parameters_of(patches: u32, size: [u16; 2]) -> TssParameters {
    let [width, height] = size.map(u32::from);
    TssParameters {
        patch_count: patches,
        width,
        height,
        most_class: Class::most(width.min(height)),
        keep_unseen: KEEP_UNSEEN,
        ..TssParameters::default()
    }
}

impl CountsActive for TssState {
    fn active_count(&self) -> u32 {
        self.active_count
    }
}
