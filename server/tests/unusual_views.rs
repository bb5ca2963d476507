//! Views and triangles that hardly occur: what is seen of them is what rays would
//! meet, and the rest of the scene does not suffer.

use std::time::Duration;

use glam::{Quat, Vec3, vec3};
use shadecast_protocol::{
    ClientTime, EyeView, Fov, FrameId, ObjectId, Pose, UpdateTiming, ViewReport, ViewSeq,
};
use shadecast_server::{
    Frame, FrameOrder, Gpu, GpuScene, Integrator, Pipeline, Prediction, Visibility,
    encode::OpenH264,
    patches::{self, PatchLimits, PatchedScene},
    prediction::{Doubt, PredictedHead, Viewpoint},
    scene::{Corner, Material, RigidObject, Scene, Triangle},
};

const SIDE: u16 = 64;

fn view(fov: Fov) -> ViewReport {
    ViewReport {
        seq: ViewSeq(0),
        sampled_at: ClientTime(0),
        display_at: ClientTime(0),
        world_from_head: Pose::IDENTITY,
        linear_velocity: Vec3::ZERO,
        angular_velocity: Vec3::ZERO,
        eyes: [EyeView {
            head_from_eye: Pose::IDENTITY,
            fov,
        }; 2],
        eye_resolution: [SIDE; 2],
        hands: [None; 2],
    }
}

fn at(position: Vec3, orientation: Quat) -> Pose {
    Pose {
        position,
        orientation,
    }
}

fn ahead(degrees: f32, world_from_eye: Pose) -> Viewpoint {
    let view = view(Fov::symmetric(degrees.to_radians()));
    Viewpoint::new(Duration::ZERO, world_from_eye, view.eyes[0], &view, 1.0)
}

/// A room of 4 m with six walls, seen from inside; walls are patches by ascending
/// material.
fn room() -> Scene {
    let mut scene = Scene::default();
    let material = scene.add_material(Material::default());
    scene.add_box(Vec3::ZERO, Vec3::splat(-2.0), material);
    scene
}

/// A triangle that may be seen from both sides.
fn add_triangle(scene: &mut Scene, corners: [Vec3; 3]) {
    let material = scene.add_material(Material {
        double_sided: true,
        ..Material::default()
    });
    let first_position = scene.positions.len() as u32;
    let first_corner = scene.corners.len() as u32;
    scene.positions.extend(corners);
    scene.corners.extend(
        [Corner {
            normal: Vec3::Z,
            tangent: glam::Vec4::ZERO,
            uv: [glam::Vec2::ZERO; 2],
            color: glam::Vec4::ONE,
        }; 3],
    );
    scene.triangles.push(Triangle {
        positions: [0, 1, 2].map(|corner| first_position + corner),
        corners: [0, 1, 2].map(|corner| first_corner + corner),
        material,
        object: ObjectId::WORLD,
    });
}

/// A scene whose triangles are not split.
fn cut(scene: Scene) -> PatchedScene {
    let limits = PatchLimits {
        longest_edge: f32::MAX,
        most_triangles: 1000,
    };
    patches::cut(scene, limits)
}

/// Pixels of the room's walls, and of each other patch, from each of the viewpoints.
fn seen(scene: Scene, viewpoints: &[Viewpoint]) -> Vec<(u32, Vec<u32>)> {
    let scene = cut(scene);
    let gpu = Gpu::open().expect("a GPU");
    let gpu_scene = GpuScene::new(&gpu, &scene.scene, Integrator::with_bounces(0), &mut |_| ())
        .expect("it fits");
    let mut visibility = Visibility::new(&gpu, &gpu_scene, &scene).expect("room");
    let is_wall = |patch: &patches::Patch| {
        let first = scene.scene.triangles[patch.first_triangle as usize];
        first.material == 0
    };
    let pixels = |viewpoint: &Viewpoint| {
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let objects_after = |after| scene.scene.poses(after);
        let viewpoints = &[*viewpoint];
        visibility.record(&gpu, &mut encoder, &gpu_scene, viewpoints, objects_after);
        gpu.queue.submit([encoder.finish()]);
        let bytes = scene.patches.len() as u64 * 4;
        let pixels: Vec<u32> = gpu.read(visibility.pixels(), 0..bytes).expect("pixels");
        let of = |walls: bool| -> Vec<u32> {
            let all = scene.patches.iter().zip(&pixels);
            let some = all.filter(|(patch, _)| is_wall(patch) == walls);
            some.map(|(_, pixels)| *pixels).collect()
        };
        (of(true).iter().sum(), of(false))
    };
    viewpoints.iter().map(pixels).collect()
}

const ALL: u32 = SIDE as u32 * SIDE as u32;

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_room_fills_the_narrowest_and_the_widest_view() {
    for degrees in [1.0, 90.0, 170.0] {
        for turned in 0..7 {
            let turned = Quat::from_axis_angle(vec3(0.6, 0.0, 0.8), turned as f32);
            let from = at(vec3(0.3, -0.2, 0.1), turned);
            let (walls, _) = seen(room(), &[ahead(degrees, from)])[0];
            assert_eq!(walls, ALL, "{degrees} degrees");
        }
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn an_eye_in_a_triangle_still_sees_the_room() {
    let mut scene = room();
    let corners = [
        vec3(-1.0, 0.0, -1.0),
        vec3(1.0, 0.0, -1.0),
        vec3(0.0, 0.0, 1.0),
    ];
    add_triangle(&mut scene, corners);
    let turned = [0.0, 0.5, -0.5, 3.0].map(Quat::from_rotation_x);
    // Within its plane, at a corner, and on an edge.
    for from in [Vec3::ZERO, corners[0], (corners[0] + corners[1]) * 0.5] {
        for turned in turned {
            let found = seen(scene.clone(), &[ahead(90.0, at(from, turned))]);
            let (walls, others) = &found[0];
            assert_eq!(walls + others[0], ALL, "at {from}");
            assert!(*walls > ALL / 2, "{walls} of the room's pixels at {from}");
        }
    }
    // Just above it, it hides all that is below, but for what is nearer than the near plane.
    let above = at(vec3(0.0, 0.05, 0.0), Quat::from_rotation_x(-1.5));
    let (walls, others) = &seen(scene, &[ahead(90.0, above)])[0];
    assert!(
        walls + others[0] == ALL && others[0] > ALL * 9 / 10,
        "{walls} {others:?}"
    );
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn what_is_behind_the_eye_is_not_seen_and_what_reaches_past_it_is() {
    let mut scene = room();
    // Behind; and from behind to ahead, below.
    add_triangle(
        &mut scene,
        [
            vec3(-1.0, -1.0, 1.0),
            vec3(1.0, -1.0, 1.0),
            vec3(0.0, 1.0, 1.0),
        ],
    );
    add_triangle(
        &mut scene,
        [
            vec3(-1.9, -0.5, 1.9),
            vec3(1.9, -0.5, 1.9),
            vec3(0.0, -0.5, -1.9),
        ],
    );
    let found = seen(scene, &[ahead(90.0, Pose::IDENTITY)]);
    let (walls, others) = &found[0];
    assert_eq!(walls + others.iter().sum::<u32>(), ALL);
    let mut others = others.clone();
    others.sort_unstable();
    assert_eq!(others[0], 0, "it is behind");
    // At one metre below per two ahead, its tip is 0.5 / 1.9 below the horizon, and it
    // is as wide as the picture at its lower edge.
    let share = f64::from(others[1]) / f64::from(ALL);
    assert!((0.15..0.35).contains(&share), "{share}");
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn broken_triangles_hide_nothing() {
    // What is no number, no scene is loaded with.
    let broken = [
        [Vec3::ZERO; 3],
        [vec3(0.0, 0.0, -1.0); 3],
        [
            vec3(-1.0, 0.0, -1.0),
            vec3(0.0, 0.0, -1.0),
            vec3(1.0, 0.0, -1.0),
        ],
        [
            vec3(-1.0, 0.0, -1.0),
            vec3(1.0, 0.0, -1.0),
            vec3(1.0, 1e-30, -1.0),
        ],
        // Of numbers that products of do not hold.
        [
            vec3(1e18, -1e18, -1.0),
            vec3(1e18, 1e18, -1.0),
            vec3(1e18, 0.0, -1.0),
        ],
        [
            vec3(-1e30, 0.0, 1e-3),
            vec3(1e30, 0.0, 1e-3),
            vec3(0.0, 1e-3, 1e-3),
        ],
    ];
    for corners in broken {
        let mut scene = room();
        add_triangle(&mut scene, corners);
        let found = seen(
            scene,
            &[ahead(90.0, Pose::IDENTITY), ahead(90.0, Pose::IDENTITY)],
        );
        for (walls, others) in found {
            assert!(
                walls + others[0] == ALL && walls > ALL - 70,
                "{corners:?}: {others:?}"
            );
        }
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn objects_are_seen_where_they_will_be() {
    let mut scene = room();
    let corners = [
        vec3(-0.5, -0.5, -1.0),
        vec3(0.5, -0.5, -1.0),
        vec3(0.0, 0.5, -1.0),
    ];
    add_triangle(&mut scene, corners);
    scene.triangles.last_mut().expect("it was added").object = ObjectId(1);
    // From behind the eye to before it in a second.
    let keys = [(0, 1.5), (1, 0.0), (2, 0.0)];
    scene.objects.push(RigidObject {
        name: "slide".to_owned(),
        keys: keys
            .map(|(seconds, z)| {
                (
                    Duration::from_secs(seconds),
                    at(Vec3::Z * z, Quat::IDENTITY),
                )
            })
            .into(),
    });
    let after = |milliseconds| Viewpoint {
        after: Duration::from_millis(milliseconds),
        ..ahead(90.0, Pose::IDENTITY)
    };
    let found = seen(scene, &[after(0), after(500), after(1000)]);
    let pixels: Vec<u32> = found.iter().map(|(_, others)| others[0]).collect();
    assert_eq!(pixels[0], 0, "it is behind");
    // A metre away it is half as wide and half as high as the picture; a quarter of that
    // away it overfills it.
    assert!(pixels[1] > ALL / 2, "{pixels:?}");
    assert!(pixels[2].abs_diff(ALL / 8) < ALL / 100, "{pixels:?}");
}

/// A frame of the whole server for heads at these places.
fn frame(pipeline: &mut Pipeline, fov: Fov, number: u32, heads: &[Pose], doubt: Doubt) -> Frame {
    let view = view(fov);
    let heads = heads.iter().map(|head| PredictedHead {
        after: Duration::from_millis(30),
        world_from_head: *head,
        doubt,
    });
    let order = FrameOrder {
        frame: FrameId(number),
        prediction: Prediction {
            heads: heads.collect(),
            view,
        },
        scene_time: Duration::ZERO,
        objects_lead: Duration::ZERO,
        paths: 1024,
        reset: number == 0,
        new_client: number == 0,
        timing: UpdateTiming::default(),
    };
    pipeline.frame(&order, &|| Duration::ZERO).expect("a frame")
}

fn pipeline() -> Pipeline {
    let scene = cut(room());
    let gpu = Gpu::open().expect("a GPU");
    let gpu_scene = GpuScene::new(&gpu, &scene.scene, Integrator::with_bounces(0), &mut |_| ())
        .expect("it fits");
    let encoder = Box::new(OpenH264::new(1_000_000, 30.0).expect("an encoder"));
    Pipeline::new(gpu, gpu_scene, scene, [256; 2], 32, encoder, 1.0).expect("a pipeline")
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_frame_in_which_nothing_is_seen_is_a_frame() {
    let mut pipeline = pipeline();
    let fov = Fov::symmetric(1.5);
    let nowhere = at(Vec3::Z * 1e6, Quat::from_rotation_y(std::f32::consts::PI));
    for (number, from) in (0..).zip([nowhere, Pose::IDENTITY, nowhere, Pose::IDENTITY]) {
        let frame = frame(&mut pipeline, fov, number, &[from], Doubt::NONE);
        let is_seen = from == Pose::IDENTITY;
        assert_eq!(frame.stats.visible > 0, is_seen, "frame {number}");
        assert_eq!(frame.stats.unplaced, 0);
        assert!(!frame.picture.bytes.is_empty());
        if number < 2 {
            assert_eq!(!frame.update.placements.is_empty(), is_seen);
        }
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn any_head_however_doubtful_gives_a_frame() {
    let mut pipeline = pipeline();
    let mut number = 0;
    for degrees in [1.0_f32, 90.0, 170.0] {
        for doubt in [0.0, 0.1, 1e9, f32::INFINITY] {
            let doubt = Doubt {
                metres: doubt,
                radians: doubt,
            };
            let heads = [Pose::IDENTITY; 12];
            for count in [1, 2, 12] {
                let fov = Fov::symmetric(degrees.to_radians());
                let heads = &heads[..count];
                let frame = frame(&mut pipeline, fov, number, heads, doubt);
                assert!(frame.stats.visible > 0, "{degrees} {doubt:?}");
                assert_eq!(frame.stats.unplaced, 0);
                number += 1;
            }
        }
    }
}
