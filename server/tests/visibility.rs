//! What rays from the eyes meet has a place in the atlas, and what faces away
//! from them has none.

use std::{collections::HashSet, time::Duration};

use glam::{Quat, Vec3, vec3};
use shadecast_protocol::{
    ClientTime, EyeView, Fov, FrameId, PatchId, Pose, UpdateTiming, ViewReport, ViewSeq,
};
use shadecast_server::{
    Frame, FrameOrder, Gpu, GpuScene, Integrator, Pipeline, Prediction,
    encode::OpenH264,
    patches::{self, PatchLimits, PatchedScene},
    scene::courtyard,
};

/// Room for everything that is seen, at 16 texels a patch or more.
const ATLAS: u16 = 1024;
const SUPERBLOCK: u16 = 64;
/// Pixels of an eye's picture, each way.
const EYE_SIDE: u16 = 1024;
/// Rays across an eye's picture, each way.
const RAYS: u16 = 64;

/// A triangle in the world at time zero.
struct Facet {
    patch: PatchId,
    corners: [Vec3; 3],
    double_sided: bool,
    masked: bool,
}

impl Facet {
    fn normal(&self) -> Vec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a)
    }

    /// Where a ray from `origin` meets its front, or either side where it has two.
    fn meets(&self, origin: Vec3, direction: Vec3) -> Option<f32> {
        // Möller and Trumbore, 1997.
        let [a, b, c] = self.corners;
        let (ab, ac) = (b - a, c - a);
        let p = direction.cross(ac);
        let determinant = ab.dot(p);
        if determinant.abs() < 1e-12 || (determinant < 0.0 && !self.double_sided) {
            return None;
        }
        let s = (origin - a) / determinant;
        let (u, q) = (s.dot(p), s.cross(ab));
        let (v, t) = (direction.dot(q), ac.dot(q));
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.02).then_some(t)
    }
}

fn facets(scene: &PatchedScene) -> Vec<Facet> {
    let mut facets = Vec::new();
    for (id, patch) in (0..).map(PatchId).zip(&scene.patches) {
        let world_from_object = match usize::from(patch.object.0).checked_sub(1) {
            None => Pose::IDENTITY,
            Some(object) => scene.scene.objects[object].world_from_object(Duration::ZERO),
        };
        for triangle in patch.shape.triangles() {
            let corners = triangle.map(|corner| {
                let position = scene.scene.positions[patch.corners[corner] as usize];
                world_from_object.transform_point(position)
            });
            facets.push(Facet {
                patch: id,
                corners,
                double_sided: patch.double_sided,
                masked: patch.masked,
            });
        }
    }
    facets
}

fn view(world_from_head: Pose) -> ViewReport {
    ViewReport {
        seq: ViewSeq(0),
        sampled_at: ClientTime(0),
        display_at: ClientTime(0),
        world_from_head,
        linear_velocity: vec3(0.3, 0.0, -0.5),
        angular_velocity: vec3(0.0, 0.4, 0.0),
        eyes: [-0.032, 0.032].map(|x| EyeView {
            head_from_eye: Pose {
                position: Vec3::X * x,
                orientation: Quat::IDENTITY,
            },
            fov: Fov::symmetric(1.6),
        }),
        eye_resolution: [EYE_SIDE; 2],
        hands: [None; 2],
    }
}

fn first_frame(scene: &PatchedScene, prediction: &Prediction) -> Frame {
    let gpu = Gpu::open().expect("a GPU");
    let gpu_scene = GpuScene::new(&gpu, &scene.scene, Integrator::with_bounces(1), &mut |_| ())
        .expect("it fits");
    let encoder = OpenH264::new(4_000_000, 30.0).expect("an encoder");
    let mut pipeline = Pipeline::new(
        gpu,
        gpu_scene,
        scene.clone(),
        [ATLAS; 2],
        SUPERBLOCK,
        Box::new(encoder),
        1.0,
    )
    .expect("a pipeline");
    let order = FrameOrder {
        frame: FrameId(0),
        prediction: prediction.clone(),
        scene_time: Duration::ZERO,
        objects_lead: Duration::ZERO,
        paths: 1024,
        reset: true,
        new_client: true,
        timing: UpdateTiming::default(),
    };
    pipeline.frame(&order, &|| Duration::ZERO).expect("a frame")
}

/// The patches that a grid of rays through an eye's picture meets first, save
/// those seen through holes, which only the shading knows.
fn met(facets: &[Facet], world_from_eye: Pose, fov: Fov) -> Vec<PatchId> {
    let [left, right, up, down] = fov.tangents();
    let across = |n: u16| (f32::from(n) + 0.5) / f32::from(RAYS);
    let mut met = Vec::new();
    for (row, column) in (0..RAYS).flat_map(|row| (0..RAYS).map(move |column| (row, column))) {
        let x = left + (right - left) * across(column);
        let y = up + (down - up) * across(row);
        let direction = world_from_eye.orientation * vec3(x, y, -1.0);
        let first = facets
            .iter()
            .filter_map(|facet| Some((facet.meets(world_from_eye.position, direction)?, facet)))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        met.extend(
            first
                .filter(|(_, facet)| !facet.masked)
                .map(|(_, facet)| facet.patch),
        );
    }
    met
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn what_the_eyes_may_see_is_placed_and_backs_are_not() {
    let scene = patches::cut(courtyard(10_000), PatchLimits::for_atlas(SUPERBLOCK, 165.0));
    let spawn = scene
        .scene
        .spawn
        .expect("the courtyard says where to stand");
    let world_from_head = spawn.then(Pose {
        position: Vec3::Y * 1.6,
        orientation: Quat::IDENTITY,
    });
    let prediction = Prediction::linear(&view(world_from_head), Duration::from_millis(100), 2);
    let frame = first_frame(&scene, &prediction);
    assert_eq!(frame.stats.unplaced, 0);
    let placed: HashSet<PatchId> = frame.update.placements.iter().map(|p| p.patch).collect();
    assert_eq!(placed.len(), frame.stats.visible as usize);
    assert!(placed.len() < scene.patches.len(), "some is out of sight");

    let facets = facets(&scene);
    let eyes: Vec<(Pose, Fov)> = (prediction.viewpoints().iter())
        .map(|viewpoint| (viewpoint.world_from_eye, viewpoint.fov))
        .collect();
    // What is smaller than a pixel may be missed by every pixel's centre.
    let met: HashSet<PatchId> = (eyes.iter())
        .flat_map(|(world_from_eye, fov)| met(&facets, *world_from_eye, *fov))
        .collect();
    let covered = met.intersection(&placed).count();
    assert!(met.len() > 500, "only {} patches are met", met.len());
    assert!(
        covered * 1000 >= met.len() * 995,
        "{covered} of {} patches are placed",
        met.len()
    );

    let faces = |facet: &Facet| {
        let toward = |eye: &(Pose, Fov)| facet.normal().dot(eye.0.position - facet.corners[0]);
        facet.double_sided || eyes.iter().any(|eye| toward(eye) > 0.0)
    };
    let facing: HashSet<PatchId> = (facets.iter())
        .filter(|facet| faces(facet))
        .map(|facet| facet.patch)
        .collect();
    let backs: Vec<_> = placed.difference(&facing).collect();
    assert!(backs.is_empty(), "placed, but seen by nobody: {backs:?}");
}
