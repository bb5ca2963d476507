//! Trees over the triangles: one for the world, one for each moving object.

use std::time::Duration;

use glam::{Mat3, Vec3A};
use obvhs::{BvhBuildParams, cwbvh::builder::build_cwbvh_from_tris};
use shadecast_protocol::{ObjectId, Pose};
use shadecast_shaders::light::{Instance, NO_TEXTURE, rows_of_affine};

use crate::scene::{Alpha, Scene};

pub(super) type Rows = [[f32; 4]; 3];

pub(super) fn transforms(pose: Pose) -> (Rows, Rows) {
    let inverse = pose.inverse();
    (
        rows_of_affine(Mat3::from_quat(pose.orientation), pose.position),
        rows_of_affine(Mat3::from_quat(inverse.orientation), inverse.position),
    )
}

/// One tree for the world and one for each moving object, end to end.
pub(super) struct Trees {
    pub(super) nodes: Vec<obvhs::cwbvh::node::CwBvhNode>,
    /// Corner and two edges, in tree order; the scene's triangle and its flags
    /// in the fourth components.
    pub(super) triangles: Vec<[[f32; 4]; 3]>,
    pub(super) instances: Vec<Instance>,
}

impl Trees {
    pub(super) fn build(scene: &Scene, progress: &mut dyn FnMut(f32)) -> Self {
        let mut trees = Self {
            nodes: Vec::new(),
            triangles: Vec::new(),
            instances: Vec::new(),
        };
        for object in 0..=scene.objects.len() {
            progress(object as f32 / (scene.objects.len() + 1) as f32);
            trees.add(scene, ObjectId(object as u16));
        }
        progress(1.0);
        trees
    }

    fn add(&mut self, scene: &Scene, object: ObjectId) {
        let members: Vec<u32> = (0..)
            .zip(&scene.triangles)
            .filter(|(_, triangle)| triangle.object == object)
            .map(|(index, _)| index)
            .collect();
        let corners_of = |triangle: u32| {
            scene.triangles[triangle as usize]
                .positions
                .map(|p| scene.positions[p as usize])
        };
        let shapes: Vec<_> = members
            .iter()
            .map(|&triangle| {
                let [v0, v1, v2] = corners_of(triangle).map(Vec3A::from);
                obvhs::triangle::Triangle { v0, v1, v2 }
            })
            .collect();
        let (world_from_object, object_from_world) = transforms(Pose::IDENTITY);
        let mut instance = Instance {
            world_from_object,
            object_from_world,
            root_node: NO_TEXTURE,
            first_triangle: self.triangles.len() as u32,
            padding: [0; 2],
        };
        if !shapes.is_empty() {
            instance.root_node = self.nodes.len() as u32;
            let tree = build_cwbvh_from_tris(
                &shapes,
                BvhBuildParams::very_slow_build(),
                &mut Duration::default(),
            );
            self.nodes.extend(tree.nodes);
            self.triangles
                .extend(tree.primitive_indices.iter().map(|&local| {
                    let triangle = members[local as usize];
                    let material =
                        &scene.materials[scene.triangles[triangle as usize].material as usize];
                    let flags = u32::from(material.alpha != Alpha::Opaque)
                        | u32::from(material.double_sided) << 1;
                    let [a, b, c] = corners_of(triangle);
                    [
                        a.extend(f32::from_bits(triangle)).to_array(),
                        (b - a).extend(f32::from_bits(flags)).to_array(),
                        (c - a).extend(0.0).to_array(),
                    ]
                }));
        }
        self.instances.push(instance);
    }
}
