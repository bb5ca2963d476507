//! The GPU packs as its twin does, and what it packs keeps the promises.

use std::{cell::RefCell, collections::HashMap};

use glam::{Vec3, vec3};
use proptest::{
    prelude::*,
    test_runner::{Config, TestRunner},
};
use shadecast_protocol::Method;
use shadecast_shaders::tss::{ActiveTriangle, Outcome, Packer, SeenTriangle, Shape, shape, status};

use super::{
    passes::{Passes, parameters_of},
    *,
};
use crate::{
    atlas::KEEP_UNSEEN,
    gpu::Integrator,
    patches::{self, PatchLimits},
    scene::courtyard,
};

/// Random sequences of frames for each size of atlas on the GPU.
const SEQUENCES: u32 = 60;
/// Patches that random frames are about.
const PATCHES: u32 = 600;

/// A frame: what is visible of the triangles, each with its shape.
type View = Vec<(SeenTriangle, Shape)>;

fn any_shape() -> impl Strategy<Value = Shape> {
    let lengths = (0_u16..2400, 0_u16..2400, 0_u8..=8, 0_u8..3);
    let depths = prop::array::uniform3(0_u8..=64);
    (lengths, depths).prop_map(|((a, b, foot, longest), mut depths)| {
        depths[usize::from(longest)] = 0;
        Shape {
            width: a.max(b),
            height: a.min(b),
            foot,
            longest,
            depths,
        }
    })
}

fn any_view(most: usize) -> impl Strategy<Value = View> {
    let triangle = (0..PATCHES, 1_u32..50, any_shape());
    prop::collection::vec(triangle, 0..most).prop_map(|mut view| {
        view.sort_by_key(|(patch, ..)| *patch);
        view.dedup_by_key(|(patch, ..)| *patch);
        let seen = |(patch, pixels, shape)| (SeenTriangle { patch, pixels }, shape);
        view.into_iter().map(seen).collect()
    })
}

/// The twin, with what it remembers of shapes.
struct Twin {
    size: [u16; 2],
    packer: Packer,
    shapes: HashMap<u32, Shape>,
}

impl Twin {
    fn new(size: [u16; 2]) -> Self {
        Self {
            size,
            packer: Packer::default(),
            shapes: HashMap::new(),
        }
    }

    fn place(&mut self, view: &View) -> Outcome {
        self.shapes
            .extend(view.iter().map(|(seen, shape)| (seen.patch, *shape)));
        let seen: Vec<SeenTriangle> = view.iter().map(|(seen, _)| *seen).collect();
        let parameters = parameters_of(PATCHES, self.size);
        let shapes = &self.shapes;
        self.packer
            .place(&parameters, &seen, |patch| shapes[&patch])
    }
}

/// What must be true of every frame: each texel is one slot's at most, lookups inside
/// of a triangle find its own texels, and all lies in the atlas.
fn check(size: [u16; 2], active: &[ActiveTriangle]) {
    let [width, height] = size.map(usize::from);
    let mut owner = vec![u32::MAX; width * height];
    let slots: Vec<(u32, TriangleSlot)> = (active.iter())
        .filter_map(|triangle| Some((triangle.patch_id, slot_of(triangle)?)))
        .collect();
    for &(patch, slot) in &slots {
        assert!(slot.weights.contains(&u16::MAX) && !slot.weights.contains(&0));
        let bounds = slot.bounds();
        for y in bounds.y..bounds.y + bounds.height {
            for x in bounds.x..bounds.x + bounds.width {
                if slot.owns(x, y) {
                    let texel = &mut owner[y as usize * width + x as usize];
                    assert_eq!(*texel, u32::MAX, "{slot:?} shares a texel");
                    *texel = patch;
                }
            }
        }
    }
    for &(patch, slot) in &slots {
        let corners = slot
            .corners
            .map(|corner| corner.map(|at| f32::from(at) / 8.0 - 0.5));
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.5), (0.31, 0.64)] {
            let at = [0, 1].map(|axis| {
                corners[0][axis]
                    + u * (corners[1][axis] - corners[0][axis])
                    + v * (corners[2][axis] - corners[0][axis])
            });
            let texel = at.map(|at| (at + 1e-3).floor() as usize);
            assert_eq!(owner[texel[1] * width + texel[0]], patch);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]

    #[test]
    fn any_sequence_keeps_the_promises(
        frames in prop::collection::vec(any_view(500), 1..6),
        size in prop_oneof![Just([256, 256]), Just([512, 128]), Just([64, 64]), Just([80, 336])],
    ) {
        let mut twin = Twin::new(size);
        let mut told = Told::nothing(PATCHES as usize, size);
        let mut known: HashMap<PatchId, Slot> = HashMap::new();
        for view in frames {
            let outcome = twin.place(&view);
            check(size, &outcome.active);
            let overfull = outcome.status & status::OVERFULL != 0;
            let visible = |triangle: &&ActiveTriangle| triangle.pixels > 0;
            let waiting = outcome.active.iter().filter(visible).filter(|t| t.corners[0] == NONE);
            prop_assert_eq!(overfull, waiting.count() > 0);
            // What a client knows is what is placed.
            let state = TssState { seen: outcome.seen, steps: outcome.steps, ..TssState::default() };
            let placed = told.placed(&state, &outcome.active);
            for patch in &placed.removals {
                prop_assert!(known.remove(patch).is_some());
            }
            for placement in &placed.placements {
                let old = known.insert(placement.patch, placement.slot);
                prop_assert!(old != Some(placement.slot), "told twice");
                let moved = placed.moved.iter().find(|(patch, ..)| *patch == placement.patch);
                prop_assert_eq!(moved.map(|(_, old, _)| *old), old);
            }
            let holders = outcome.active.iter().filter_map(|t| Some((PatchId(t.patch_id), slot_of(t)?)));
            let holders: HashMap<_, _> = holders.map(|(patch, slot)| (patch, Slot::Triangle(slot))).collect();
            prop_assert_eq!(&holders, &known);
            prop_assert_eq!(placed.visible.len(), view.len());
        }
    }
}

fn square(patch: u32, log2_side: u16) -> (SeenTriangle, Shape) {
    let shape = Shape {
        width: log2_side * 256,
        height: log2_side * 256,
        ..Shape::default()
    };
    (SeenTriangle { patch, pixels: 9 }, shape)
}

#[test]
fn what_fits_is_as_large_as_it_is_seen() {
    let mut twin = Twin::new([256; 2]);
    let outcome = twin.place(&(0..60).map(|patch| square(patch, 4)).collect());
    assert_eq!((outcome.steps, outcome.status), (0, 0));
    let slot = slot_of(&outcome.active[0]).expect("room");
    assert_eq!(slot.corners, [[4, 4], [132, 4], [4, 132]]);
    // Two of them in twenty columns and seventeen rows.
    assert_eq!(outcome.used_texels, 30 * 20 * 17);
}

#[test]
fn ten_times_too_much_scales_all_down_and_loses_nothing() {
    let mut twin = Twin::new([128; 2]);
    let view = (0..600).map(|patch| square(patch, 4)).collect();
    let outcome = twin.place(&view);
    assert!((4..10).contains(&outcome.steps), "{}", outcome.steps);
    assert_eq!(outcome.status, 0);
    assert!(outcome.active.iter().all(|t| t.corners[0] != NONE));
    let fill = outcome.used_texels as f32 / (128.0 * 128.0);
    assert!(fill > 0.6, "{fill}");
}

#[test]
fn more_than_the_smallest_is_told() {
    let mut twin = Twin::new([16, 16]);
    let outcome = twin.place(&(0..600).map(|patch| square(patch, 4)).collect());
    assert_eq!(outcome.status & status::OVERFULL, status::OVERFULL);
    let placed = outcome.active.iter().filter(|t| t.corners[0] != NONE);
    assert_eq!(placed.count(), 2 * 4 * 8);
    check([16, 16], &outcome.active);
}

#[test]
fn what_goes_out_of_sight_stays_for_a_while_where_there_is_room() {
    let mut twin = Twin::new([256; 2]);
    let first = twin.place(&vec![square(1, 4), square(2, 4)]);
    for _ in 0..KEEP_UNSEEN {
        let next = twin.place(&vec![square(2, 4)]);
        assert_eq!(next.active.len(), 2);
        assert_eq!(next.active[1].corners, first.active[1].corners);
    }
    assert_eq!(twin.place(&vec![square(2, 4)]).active.len(), 1);
    // Not where the visible ones would have to be smaller for it.
    twin.place(&(0..100).map(|patch| square(patch, 4)).collect());
    let crowd = (100..450).map(|patch| square(patch, 4)).collect();
    let crowded = twin.place(&crowd);
    assert_eq!((crowded.steps, crowded.status), (0, status::EVICTED));
    assert!(crowded.active[0].corners[0] == NONE);
}

/// Both beside each other.
struct Both {
    gpu: Gpu,
    pixels: wgpu::Buffer,
    passes: Passes,
    twin: Twin,
}

impl Both {
    fn new(size: [u16; 2], threads: Threads) -> Self {
        let gpu = Gpu::open().expect("a GPU");
        let (scene, gpu_scene) = scene_of_triangles(&gpu, 2_000);
        let pixels = gpu.scratch("pixels", scene.patches.len() as u64 * 4);
        let pixels = pixels.expect("room");
        let passes = Passes::new(&gpu, &gpu_scene, &scene, size, &pixels, threads);
        Self {
            passes: passes.expect("room"),
            gpu,
            pixels,
            twin: Twin::new(size),
        }
    }

    fn begin_anew(&mut self) {
        // All that was seen is forgotten when it has long been out of sight.
        for _ in 0..=KEEP_UNSEEN {
            self.place_on_gpu(&Vec::new());
        }
        self.twin = Twin::new(self.twin.size);
    }

    fn place_on_gpu(&mut self, view: &View) -> (TssState, Vec<ActiveTriangle>) {
        let mut pixels = vec![0_u32; (self.pixels.size() / 4) as usize];
        for (seen, shape) in view {
            pixels[seen.patch as usize] = seen.pixels;
            let at = u64::from(seen.patch) * 8;
            let words = shape.words();
            let shapes = self.passes.shapes();
            (self.gpu.queue).write_buffer(shapes, at, bytemuck::cast_slice(&words));
        }
        (self.gpu.queue).write_buffer(&self.pixels, 0, bytemuck::cast_slice(&pixels));
        let mut encoder = (self.gpu.device).create_command_encoder(&Default::default());
        self.passes.record_packing(&mut encoder);
        let placed = self.passes.outcomes.submit_and_read(&self.gpu, encoder);
        placed.expect("a GPU")
    }

    fn place(&mut self, view: &View) {
        let (state, active) = self.place_on_gpu(view);
        let twin = self.twin.place(view);
        assert_eq!(state.seen, twin.seen);
        assert_eq!(state.steps, twin.steps);
        assert_eq!(state.status, twin.status);
        assert_eq!(state.used_texels, twin.used_texels);
        assert_eq!(active.len(), twin.active.len());
        for (found, expected) in active.iter().zip(&twin.active) {
            let ids = (found.patch_id, found.pixels);
            assert_eq!(ids, (expected.patch_id, expected.pixels));
            assert_eq!(found.corners[0], expected.corners[0]);
            // Without a slot the rest is left over from frames before.
            if found.corners[0] != NONE {
                assert_eq!(found, expected);
            }
        }
    }
}

fn scene_of_triangles(gpu: &Gpu, triangles: usize) -> (PatchedScene, GpuScene) {
    let limits = PatchLimits::for_atlas(64, 300.0);
    let scene = patches::cut_for(Method::Tss, courtyard(triangles), limits);
    let integrator = Integrator::with_bounces(0);
    let gpu_scene = GpuScene::new(gpu, &scene.scene, integrator, &mut |_| ());
    (scene, gpu_scene.expect("a valid scene"))
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn the_gpu_packs_as_its_twin_does() {
    for (size, run, lanes) in [
        ([256, 256], 128, 8),
        ([64, 64], 32, 256),
        ([80, 336], 1, 16),
    ] {
        let both = RefCell::new(Both::new(size, Threads { run, lanes }));
        let mut runner = TestRunner::new(Config {
            failure_persistence: None,
            ..Config::with_cases(SEQUENCES)
        });
        let frames = prop::collection::vec(any_view(400), 1..6);
        runner
            .run(&frames, |frames| {
                let mut both = both.borrow_mut();
                both.begin_anew();
                for view in frames {
                    both.place(&view);
                }
                Ok(())
            })
            .expect("both alike");
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn the_kernel_measures_as_its_twin_does() {
    let gpu = Gpu::open().expect("a GPU");
    let (scene, gpu_scene) = scene_of_triangles(&gpu, 5_000);
    let count = scene.patches.len();
    let visible = vec![1_u32; count];
    let pixels = gpu.storage("pixels", bytemuck::cast_slice(&visible));
    let pixels = pixels.expect("room");
    let threads = Threads::best(&gpu);
    let mut passes =
        Passes::new(&gpu, &gpu_scene, &scene, [512; 2], &pixels, threads).expect("room");
    let at_a_corner = scene.scene.positions[scene.patches[0].corners[0] as usize];
    let (mut all, mut near, mut depths) = (0_u32, 0_u32, 0_u32);
    for eye in [
        vec3(0.3, 1.6, 0.2),
        vec3(-4.0, 0.4, 7.0),
        at_a_corner,
        vec3(0.0, 1e4, 0.0),
        Vec3::splat(f32::NAN),
        Vec3::splat(1e38),
    ] {
        for pixels_per_radian in [30.0, 1222.0, 110_000.0] {
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            let eyes = vec![eye; scene.scene.objects.len() + 1];
            passes.record(&gpu, &gpu_scene, &mut encoder, &eyes, pixels_per_radian);
            let (_, active) = passes
                .outcomes
                .submit_and_read(&gpu, encoder)
                .expect("a GPU");
            check([512; 2], &active);
            let bytes = 0..count as u64 * 8;
            let words: Vec<[u32; 2]> = gpu.read(passes.shapes(), bytes).expect("a GPU");
            if eye.is_nan() || eye.length() > 1e6 {
                continue;
            }
            for (words, patch) in words.into_iter().zip(&scene.patches) {
                let found = Shape::of_words(words);
                let corners = [0, 1, 2].map(|i| scene.scene.positions[patch.corners[i] as usize]);
                let twin = shape(corners, eye, pixels_per_radian);
                let close = |a: u16, b: u16| a.abs_diff(b) <= 2;
                all += 1;
                near += u32::from(
                    close(found.width, twin.width)
                        && close(found.height, twin.height)
                        && (found.longest != twin.longest || found.foot.abs_diff(twin.foot) <= 1),
                );
                let steps = found.depths.iter().zip(twin.depths);
                depths += u32::from(steps.clone().all(|(a, b)| a.abs_diff(b) <= 1));
            }
        }
    }
    // Needles and triangles seen edge on differ by rounding.
    let found = format!("{near} and {depths} of {all} alike");
    assert!(near * 100 > all * 95 && depths * 100 > all * 99, "{found}");
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn runs_and_threads_do_not_show() {
    let view: View = (0..500)
        .map(|patch| square(patch, 1 + (patch * 7 % 5) as u16))
        .collect();
    let placed = [(1, 8), (32, 256), (128, 8)].map(|(run, lanes)| {
        let mut both = Both::new([128; 2], Threads { run, lanes });
        both.place_on_gpu(&view)
    });
    assert!(placed[0] == placed[1] && placed[1] == placed[2]);
}
