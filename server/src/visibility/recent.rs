//! What was seen in the last updates, and may be too small to be found in this one.

use shadecast_shaders::visibility::{FEW, LIFETIME, RECALL_SOURCE};
use wgpu::ShaderStages;

use crate::gpu::{Binding, Gpu, GpuError, bind, layout, workgroups};

/// Threads of a group, each with 32 patches.
const GROUP: u32 = 64;

/// The pass that adds to what [`Visibility`](super::Visibility) has found what had few
/// pixels in one of the last [`LIFETIME`] updates.
#[derive(Debug)]
pub struct Recent {
    recall: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    had_few: wgpu::Buffer,
    /// Of 32 patches each.
    words: u32,
}

impl Recent {
    /// Nothing was seen yet. `pixels` are [`Visibility::pixels`](super::Visibility::pixels).
    ///
    /// # Errors
    /// When a bit for each patch and update is more than the device binds.
    pub fn new(gpu: &Gpu, patches: u32, pixels: &wgpu::Buffer) -> Result<Self, GpuError> {
        let words = patches.div_ceil(32);
        let bytes = u64::from(words) * u64::from(LIFETIME) * 4;
        let had_few = gpu.scratch("patches that had few pixels", bytes)?;
        let own_layout = layout(gpu, ShaderStages::COMPUTE, &[Binding::Write; 2]);
        let constants = [
            ("PATCHES", f64::from(patches)),
            ("LIFETIME", f64::from(LIFETIME)),
            ("FEW", f64::from(FEW)),
        ];
        Ok(Self {
            recall: gpu.compute_pipeline(RECALL_SOURCE, "recall", &[&own_layout], &constants),
            group: bind(gpu, &own_layout, &[pixels, &had_few]),
            had_few,
            words,
        })
    }

    /// Records that nothing was seen before, for a head that may be anywhere.
    pub fn forget(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.clear_buffer(&self.had_few, 0, None);
    }

    /// Records that an update's visible set is completed and remembered: once for each.
    pub fn recall(&self, encoder: &mut wgpu::CommandEncoder) {
        let (x, y) = workgroups(self.words, GROUP);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.recall);
        pass.set_bind_group(0, &self.group, &[]);
        pass.dispatch_workgroups(x, y, 1);
    }
}

#[cfg(test)]
mod tests {
    use proptest::{
        collection::vec,
        prelude::*,
        test_runner::{Config, TestRunner},
    };
    use shadecast_shaders::visibility::{Recall, seen_words, with_seen_bits};

    use super::*;

    /// Pixels of each patch in each update, most of them none; and whether it is the
    /// first of another client.
    fn any_updates(patches: usize) -> impl Strategy<Value = Vec<(bool, Vec<u32>)>> {
        let pixels = prop_oneof![3 => Just(0), 2 => 1..=2 * FEW, 1 => Just(u32::MAX)];
        let update = (prop::bool::weighted(0.1), vec(pixels, patches));
        vec(update, 1..4 * LIFETIME as usize)
    }

    #[test]
    #[ignore = "needs a Vulkan driver"]
    fn the_gpu_recalls_what_its_twin_does() {
        let gpu = Gpu::open().expect("a GPU");
        for patches in [1, 31, 32, 33, 4133] {
            let bytes = u64::from(seen_words(patches)) * 4;
            let pixels = gpu.scratch("pixels", bytes).expect("room");
            let recent = Recent::new(&gpu, patches, &pixels).expect("room");
            let mut runner = TestRunner::new(Config {
                failure_persistence: None,
                ..Config::with_cases(30)
            });
            let check = |updates: Vec<(bool, Vec<u32>)>| {
                let mut twin = Recall::default();
                for (index, (is_new, mut seen)) in updates.into_iter().enumerate() {
                    let words = with_seen_bits(seen.clone());
                    gpu.queue
                        .write_buffer(&pixels, 0, bytemuck::cast_slice(&words));
                    let mut encoder = gpu
                        .device
                        .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                    if is_new || index == 0 {
                        recent.forget(&mut encoder);
                        twin = Recall::default();
                    }
                    recent.recall(&mut encoder);
                    gpu.queue.submit([encoder.finish()]);
                    twin.recall(&mut seen);
                    let found: Vec<u32> = gpu.read(&pixels, 0..bytes).expect("a GPU");
                    prop_assert_eq!(found, with_seen_bits(seen));
                }
                Ok(())
            };
            runner
                .run(&any_updates(patches as usize), check)
                .expect("alike");
        }
    }

    /// A scene without triangles has no word at all.
    #[test]
    #[ignore = "needs a Vulkan driver"]
    fn nothing_is_recalled_of_nothing() {
        let gpu = Gpu::open().expect("a GPU");
        let pixels = gpu.scratch("pixels", 8).expect("room");
        let recent = Recent::new(&gpu, 0, &pixels).expect("room");
        gpu.queue.write_buffer(&pixels, 0, &[0xff; 8]);
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        recent.recall(&mut encoder);
        gpu.queue.submit([encoder.finish()]);
        let found: Vec<u32> = gpu.read(&pixels, 0..8).expect("a GPU");
        assert_eq!(found, [u32::MAX; 2]);
    }
}
