//! The GPU and its twin do the very same, whatever is asked of them.

use std::cell::RefCell;

use proptest::test_runner::{Config, TestRunner};
use shadecast_shaders::snake::{Seen, Wish};

use super::{
    super::{SnakeShape, SnakeTwin, place::Snake},
    any_frames, nearer, seen, shape, view,
    watched::Told,
};
use crate::{
    atlas::{KEEP_UNSEEN, Placed, tests::watched::Noise},
    gpu::Gpu,
    packer::passes::Threads,
};

/// Random sequences of frames for each shape of atlas.
const SEQUENCES: u32 = 60;

/// An atlas on the GPU beside its twin, and what a client knows of both.
pub(super) struct Both {
    pub(super) gpu: Gpu,
    pub(super) pixels: wgpu::Buffer,
    pub(super) atlas: Snake,
    twin: SnakeTwin,
    told: Told,
    shape: SnakeShape,
    patches: u32,
}

impl Both {
    pub(super) fn new(shape: SnakeShape, patches: u32) -> Self {
        let gpu = Gpu::open().expect("a GPU");
        let pixels = gpu.scratch("pixels", u64::from(patches) * 4).expect("room");
        let atlas = Snake::new(&gpu, shape, patches, &pixels).expect("room");
        Self {
            gpu,
            pixels,
            atlas,
            twin: SnakeTwin::new(shape),
            told: Told::nothing(shape),
            shape,
            patches,
        }
    }

    fn with_threads(self, run: u32, lanes: u32) -> Self {
        let threads = Threads { run, lanes };
        let atlas = self.atlas.with_threads(&self.gpu, threads, &self.pixels);
        Self { atlas, ..self }
    }

    fn begin_anew(&mut self) {
        self.atlas.begin_anew(&self.gpu);
        self.twin = SnakeTwin::new(self.shape);
        self.told = Told::nothing(self.shape);
    }

    fn force_reset(&mut self) {
        self.atlas.force_reset();
        self.twin.force_reset();
    }

    /// Places on the GPU alone.
    pub(super) fn place_on_gpu(&mut self, visible: &[Seen]) -> Placed {
        let mut pixels = vec![0_u32; self.patches as usize];
        let mut wishes = vec![Wish::default().words(); self.patches as usize];
        for seen in visible {
            pixels[seen.patch as usize] = seen.pixels;
            wishes[seen.patch as usize] = seen.wish.words();
        }
        let queue = &self.gpu.queue;
        queue.write_buffer(&self.pixels, 0, bytemuck::cast_slice(&pixels));
        queue.write_buffer(self.atlas.wishes(), 0, bytemuck::cast_slice(&wishes));
        let encoder = self
            .gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.atlas.place(&self.gpu, encoder).expect("a GPU")
    }

    /// Places on both, without a look at every texel.
    pub(super) fn place_alike(&mut self, visible: &[Seen]) -> Placed {
        let placed = self.place_on_gpu(visible);
        assert!(placed == self.twin.place(visible), "the twin differs");
        placed
    }

    pub(super) fn place(&mut self, visible: &[Seen]) -> Placed {
        let placed = self.place_on_gpu(visible);
        assert_eq!(placed, self.twin.place(visible));
        self.told.take_in(visible, &placed);
        placed
    }
}

/// Thousands of frames: the twin agrees in all that is told, and no promise is broken.
#[test]
#[ignore = "needs a Vulkan driver"]
fn the_gpu_does_what_its_twin_does() {
    for (width, height, run, lanes) in [
        (128, 128, 128, 8),
        (64, 192, 32, 256),
        (16, 16, 1, 16),
        (256, 64, 7, 2),
        (6, 1100, 9, 32),
    ] {
        let both = Both::new(shape(width, height), 400).with_threads(run, lanes);
        let both = RefCell::new(both);
        let mut runner = TestRunner::new(Config {
            failure_persistence: None,
            ..Config::with_cases(SEQUENCES)
        });
        runner
            .run(&any_frames(), |frames| {
                let mut both = both.borrow_mut();
                both.begin_anew();
                for (visible, forced) in frames {
                    if forced {
                        both.force_reset();
                    }
                    both.place(&visible);
                }
                Ok(())
            })
            .expect("both alike");
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn churn_leaks_nothing_on_the_gpu() {
    let mut both = Both::new(shape(256, 256), 1500);
    let mut noise = Noise(3);
    let scene = view(&mut noise, 1500, [0.0, 3.0]);
    let (mut begin, mut unplaced) = (0, 0);
    for turn in 0..10_000_u32 {
        begin += noise.below(3);
        let zoom = (turn as f32 * 0.013).sin() * 0.5;
        let mut view: Vec<_> = (begin..begin + 400)
            .map(|i| scene[i as usize % 1500])
            .collect();
        view.sort_unstable_by_key(|seen| seen.patch);
        unplaced += both.place_alike(&nearer(&view, zoom)).unplaced;
    }
    assert_eq!(unplaced, 0);
    let last = (0..=KEEP_UNSEEN).map(|_| both.place_alike(&[])).last();
    let stats = last.expect("a frame").stats;
    assert_eq!((stats.used_texels, stats.patches), (0, 0));
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn ten_times_too_much_raises_the_bias_on_the_gpu() {
    let mut both = Both::new(shape(512, 512), 3000);
    both.place(&view(&mut Noise(5), 200, [0.0, 4.0]));
    let crowd: Vec<_> = (0..1640).map(|i| seen(i, 40.0, 80.0)).collect();
    let placed = both.place(&crowd);
    assert_eq!(placed.unplaced, 0);
    assert!((3.0..6.0).contains(&placed.bias), "{}", placed.bias);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_crowd_of_a_hundred_thousand_is_placed_alike() {
    let mut both = Both::new(shape(2048, 2048), 100_000);
    let crowd = view(&mut Noise(12), 100_000, [0.0, 3.0]);
    for octaves in [0.0, 0.3, 0.6, -0.4] {
        let placed = both.place_alike(&nearer(&crowd, octaves));
        assert_eq!(placed.unplaced, 0);
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn two_runs_are_the_same() {
    let frames: Vec<_> = (0..30)
        .map(|turn| view(&mut Noise(turn + 9), 1500, [0.0, 3.0]))
        .collect();
    let runs = [(1, 8), (32, 256)].map(|(run, lanes)| {
        let mut both = Both::new(shape(256, 256), 1500).with_threads(run, lanes);
        let placed: Vec<_> = frames
            .iter()
            .map(|frame| both.place_on_gpu(frame))
            .collect();
        placed
    });
    assert_eq!(runs[0], runs[1]);
}
