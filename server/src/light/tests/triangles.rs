//! What a triangle's slot holds is what the triangle has there, and stays with it.

use glam::{IVec2, Vec3, Vec4};
use shadecast_protocol::{Method, PatchId, Slot, TriangleSlot};
use shadecast_shaders::light::{AtlasTriangle, PatchPoint};

use super::{ATLAS, EYE, Lasting, Schedule, VIEWER, four_quarters, glow_at, placed};
use crate::{
    gpu::{Gpu, GpuScene, Integrator},
    light::{Job, Light, keeps_texels},
    patches::PatchedScene,
};

const EVEN: [u16; 3] = [u16::MAX; 3];

/// The light of a square of two triangles.
struct Bench {
    gpu: Gpu,
    gpu_scene: GpuScene,
    scene: PatchedScene,
    light: Light,
    schedule: Schedule,
}

impl Bench {
    fn new() -> Self {
        let scene = four_quarters(Method::Tss);
        let gpu = Gpu::open().expect("a GPU");
        let gpu_scene = GpuScene::new(&gpu, &scene.scene, Integrator::with_bounces(1), &mut |_| ())
            .expect("a scene");
        let light = Light::new(&gpu, &gpu_scene, [ATLAS; 2], Method::Tss).expect("an atlas");
        let lasting = Lasting {
            longest_history: 64.0,
            point: Vec3::ZERO,
            alpha: 1.0,
            shine: 0.0,
        };
        Self {
            schedule: Schedule::new(vec![lasting; 2]),
            gpu,
            gpu_scene,
            scene,
            light,
        }
    }

    fn job(&self, patch: u32, slot: Slot) -> Job {
        self.schedule
            .job(&self.scene.patches, PatchId(patch), slot, &[EYE])
    }

    fn place(&mut self, slot: Slot, old: Option<Slot>) {
        let mut encoder = (self.gpu.device).create_command_encoder(&Default::default());
        self.light
            .record_moves(&self.gpu, &mut encoder, &placed(slot, old))
            .expect("room");
        self.gpu.queue.submit([encoder.finish()]);
    }

    fn trace(&self, jobs: &[Job]) {
        (self.light).trace(&self.gpu, &self.gpu_scene, jobs, VIEWER);
    }

    /// What is shown of all texels when `jobs` were made to be shown; last the samples.
    fn shown(&self, jobs: &[Job]) -> Vec<Vec4> {
        self.light
            .show(&self.gpu, &self.gpu_scene, &[], jobs, VIEWER)
            .expect("light");
        let bytes = self.light.shown().size();
        self.gpu.read(self.light.shown(), 0..bytes).expect("light")
    }

    /// Light and samples of a slot's texels, in an order that no shift or turn changes.
    fn remembered(&self, triangle: &AtlasTriangle) -> Vec<[f32; 4]> {
        let diffuse = &self.light.texels.diffuse;
        let all: Vec<[f32; 4]> = (self.gpu).read(diffuse, 0..diffuse.size()).expect("light");
        let owned = texels(triangle).filter(|(.., owned)| *owned);
        let mut found: Vec<[f32; 4]> = owned.map(|(at, ..)| all[at]).collect();
        found.sort_by(|a, b| a.partial_cmp(b).expect("numbers"));
        found
    }

    /// What a texel shows that is `texel` within the bounds of the slot of patch 0.
    fn glow(&self, triangle: &AtlasTriangle, texel: IVec2) -> (Vec3, bool) {
        let point = triangle.point_of_texel(texel);
        let first = self.scene.patches[0].first_triangle;
        glow_at(
            &self.scene,
            PatchPoint {
                triangle: first + point.triangle,
                ..point
            },
        )
    }
}

fn slot(corners: [[u16; 2]; 3], weights: [u16; 3]) -> (Slot, AtlasTriangle) {
    let slot = Slot::Triangle(TriangleSlot { corners, weights });
    (slot, AtlasTriangle::new(corners, weights))
}

/// Texels of the whole atlas, and where they are within the bounds of a slot.
fn texels(triangle: &AtlasTriangle) -> impl Iterator<Item = (usize, IVec2, bool)> {
    let triangle = *triangle;
    let side = i32::from(ATLAS);
    (0..side * side).map(move |index| {
        let texel = IVec2::new(index % side, index / side) - triangle.first;
        let inside = texel.cmpge(IVec2::ZERO).all() && texel.cmplt(triangle.size).all();
        (index as usize, texel, inside && triangle.owns(texel))
    })
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_triangle_is_lit_as_itself_and_keeps_its_light_wherever_it_goes() {
    let mut bench = Bench::new();
    let slots = [
        slot([[4, 4], [124, 4], [4, 124]], EVEN),
        // Aside, upside down, and elsewhere in another shape, foreshortened and mirrored.
        slot([[196, 28], [316, 28], [196, 148]], EVEN),
        slot([[404, 324], [284, 324], [404, 204]], EVEN),
        slot([[100, 402], [118, 501], [267, 423]], [65535, 30000, 50000]),
        slot([[20, 300], [20, 412], [132, 300]], EVEN),
    ];
    let mut old: Option<Slot> = None;
    let mut before = Vec::new();
    for (index, (slot, triangle)) in slots.into_iter().enumerate() {
        bench.place(slot, old);
        let job = [bench.job(0, slot)];
        // Only the first is traced, three times; the others take over its light.
        for _ in 0..if old.is_none() { 3 } else { 0 } {
            bench.trace(&job);
        }
        if old.is_none() {
            // A black square remembers no light: now each texel has its own.
            let own: Vec<[f32; 4]> = (0..u32::from(ATLAS).pow(2))
                .map(|at| [at as f32, 0.0, 0.0, 3.0])
                .collect();
            let diffuse = &bench.light.texels.diffuse;
            (bench.gpu.queue).write_buffer(diffuse, 0, bytemuck::cast_slice(&own));
        }
        // What lies alike is shown already.
        let alike = [true, true, true, false, false][index];
        let shown = bench.shown(if alike && old.is_some() { &[] } else { &job });
        let mut compared = 0;
        for (at, texel, owned) in texels(&triangle) {
            if !owned {
                assert!(
                    old.is_some() || shown[at] == Vec4::ZERO,
                    "{texel} is not lit"
                );
                continue;
            }
            assert!((shown[at].w - 3.0).abs() < 1e-3, "{texel}: {}", shown[at].w);
            let (expected, is_inside) = bench.glow(&triangle, texel);
            if is_inside {
                let found = shown[at].truncate();
                assert!(
                    found.abs_diff_eq(expected, 0.02),
                    "{index} {texel}: {found}"
                );
                compared += 1;
            }
        }
        assert!(compared > 40, "{compared}");
        assert_eq!(old.is_none_or(|old| keeps_texels(old, slot)), alike);
        let remembered = bench.remembered(&triangle);
        if alike && old.is_some() {
            assert!(remembered == before, "nothing is lost on the way");
        }
        before = remembered;
        old = Some(slot);
    }
}

/// Two triangles in each other's bounds: whatever lights one leaves the other alone,
/// finely or coarsely, and no texel is left out.
#[test]
#[ignore = "needs a Vulkan driver"]
fn triangles_share_a_rectangle_and_no_texel() {
    for budget in [u32::MAX, 120, 40, 0] {
        let mut bench = Bench::new();
        let (upper, of_upper) = slot([[4, 4], [124, 4], [4, 124]], EVEN);
        let (lower, of_lower) = slot([[156, 124], [36, 124], [156, 4]], EVEN);
        bench.place(upper, None);
        bench.place(lower, None);
        let both = [(PatchId(0), upper, 9), (PatchId(1), lower, 9)];
        let schedule = &bench.schedule;
        let jobs = schedule.choose(&bench.scene.patches, both.into_iter(), budget, &[EYE]);
        assert_eq!(jobs.len(), 2);
        bench.trace(&jobs[..1]);
        let shown = bench.shown(&jobs);
        for ((at, _, of_first), (_, _, of_other)) in texels(&of_upper).zip(texels(&of_lower)) {
            assert!(!(of_first && of_other));
            assert_eq!(shown[at].w > 0.0, of_first, "{budget}: {at}");
        }
        bench.trace(&jobs[1..]);
        let shown = bench.shown(&jobs);
        for ((at, _, of_first), (_, _, of_other)) in texels(&of_upper).zip(texels(&of_lower)) {
            assert_eq!(shown[at].w > 0.0, of_first || of_other, "{budget}: {at}");
        }
    }
}
