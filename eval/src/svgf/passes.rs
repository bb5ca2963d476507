//! The kernels of a frame, each with what it binds.

use shadecast_server::{
    Gpu, GpuScene,
    kernels::{Binding, Paths, bind, layout, workgroups},
};
use shadecast_shaders::light::{ADVANCE_SOURCE, TRACE_SOURCE};
use wgpu::{BindGroup, Buffer, ComputePass, ComputePipeline, ShaderStages};

use super::records::Records;

const RECORDS: &str = include_str!("records.wgsl");
const ACCUMULATE: &str = include_str!("accumulate.wgsl");
const ATROUS: &str = include_str!("atrous.wgsl");
const RESOLVE: &str = include_str!("resolve.wgsl");
/// Threads of a workgroup in all kernels here.
const GROUP: u32 = 64;
/// Pixels between the samples of each iteration of the wavelet transform.
const STRIDES: [i32; 5] = [1, 2, 4, 8, 16];

pub(super) fn light_source() -> String {
    [ADVANCE_SOURCE, RECORDS, include_str!("see.wgsl")].concat()
}

/// The scene's source lends its functions; its bindings are not used.
fn filter_source(kernels: &str) -> String {
    [TRACE_SOURCE, RECORDS, kernels].concat()
}

#[cfg(test)]
pub(super) fn filter_sources() -> [String; 3] {
    [ACCUMULATE, ATROUS, RESOLVE].map(filter_source)
}

/// The kernels around the paths, which see the scene.
#[derive(Debug)]
pub(super) struct LightPasses {
    pub(super) see: ComputePipeline,
    pub(super) start: ComputePipeline,
    pub(super) gather: ComputePipeline,
    pub(super) remember: ComputePipeline,
    pub(super) group: BindGroup,
}

impl LightPasses {
    pub(super) fn new(gpu: &Gpu, gpu_scene: &GpuScene, paths: &Paths, records: &Records) -> Self {
        let buffers = [
            &records.view,
            &records.primary,
            &records.seen.now,
            &records.guides,
            &records.coats,
            &records.fresh,
            &records.suns,
            &records.poses_before,
        ];
        let mut bindings = [Binding::Write; 8];
        bindings[0] = Binding::Uniform;
        let own = layout(gpu, ShaderStages::COMPUTE, &bindings);
        let source = light_source();
        let layouts = [&gpu_scene.layout, &paths.layout, &own];
        let pipeline = |entry| gpu.compute_pipeline(&source, entry, &layouts, &gpu_scene.constants);
        Self {
            see: pipeline("see"),
            start: pipeline("start_at_seen"),
            gather: pipeline("gather"),
            remember: pipeline("remember_poses"),
            group: bind(gpu, &own, &buffers),
        }
    }

    pub(super) fn dispatch(
        &self,
        pass: &mut ComputePass<'_>,
        pipeline: &ComputePipeline,
        (gpu_scene, paths): (&GpuScene, &Paths),
        threads: u32,
    ) {
        pass.set_bind_group(0, &gpu_scene.group, &[]);
        pass.set_bind_group(1, &paths.group, &[]);
        pass.set_bind_group(2, &self.group, &[]);
        dispatch(pass, pipeline, threads);
    }
}

/// From what paths brought to the picture, in this order.
#[derive(Debug)]
pub(super) struct FilterPasses {
    passes: Vec<(ComputePipeline, BindGroup)>,
    nothing: BindGroup,
}

impl FilterPasses {
    pub(super) fn new(gpu: &Gpu, records: &Records) -> Self {
        use Binding::{Read, Uniform, Write};
        let nothing = layout(gpu, ShaderStages::COMPUTE, &[]);
        let kernel = |source, entry, bindings: &[Binding]| {
            let own = layout(gpu, ShaderStages::COMPUTE, bindings);
            let layouts = [&nothing, &nothing, &own];
            let pipeline = gpu.compute_pipeline(&filter_source(source), entry, &layouts, &[]);
            move |buffers: &[&Buffer]| (pipeline.clone(), bind(gpu, &own, buffers))
        };
        let Records {
            view,
            seen,
            guides,
            coats,
            fresh,
            history,
            light: [one, other],
            moments,
            picture,
            ..
        } = records;

        let mut bindings = vec![Uniform];
        bindings.extend([Read; 6]);
        bindings.extend([Write; 2]);
        let accumulate = kernel(ACCUMULATE, "accumulate", &bindings);
        let mut passes = vec![accumulate(&[
            view,
            &seen.now,
            &seen.before,
            guides,
            fresh,
            history,
            &moments.before,
            one,
            &moments.now,
        ])];

        let strides = STRIDES.map(|stride| {
            let buffer = gpu.uniform("stride", 16);
            gpu.queue
                .write_buffer(&buffer, 0, bytemuck::bytes_of(&stride));
            buffer
        });
        let bindings = [Uniform, Uniform, Read, Read, Read, Write];
        let estimate = kernel(ATROUS, "estimate_variance", &bindings);
        let smooth = kernel(ATROUS, "smooth_light", &bindings);
        let between = |stride, given, made| [view, stride, guides, &moments.now, given, made];
        passes.push(estimate(&between(&strides[0], one, other)));
        // What the first iteration makes is the history of the next frame.
        let ways = [
            (other, history),
            (history, one),
            (one, other),
            (other, one),
            (one, other),
        ];
        for (stride, (given, made)) in strides.iter().zip(ways) {
            passes.push(smooth(&between(stride, given, made)));
        }

        let bindings = [Uniform, Read, Read, Read, Read, Write];
        let resolve = kernel(RESOLVE, "resolve", &bindings);
        let buffers = [view, guides, coats, other, &picture.before, &picture.now];
        passes.push(resolve(&buffers));
        Self {
            nothing: bind(gpu, &nothing, &[]),
            passes,
        }
    }

    pub(super) fn dispatch(&self, pass: &mut ComputePass<'_>, pixels: u32) {
        pass.set_bind_group(0, &self.nothing, &[]);
        pass.set_bind_group(1, &self.nothing, &[]);
        for (pipeline, group) in &self.passes {
            pass.set_bind_group(2, group, &[]);
            dispatch(pass, pipeline, pixels);
        }
    }
}

fn dispatch(pass: &mut ComputePass<'_>, pipeline: &ComputePipeline, threads: u32) {
    pass.set_pipeline(pipeline);
    let (x, y) = workgroups(threads, GROUP);
    pass.dispatch_workgroups(x, y, 1);
}
