//! The node tree, flattened.

use glam::{DMat4, DQuat, DVec3, Quat};
use gltf::scene::Transform;
use shadecast_protocol::{ObjectId, Pose};

use super::LoadError;
use super::animation::Motions;
use crate::scene::spawn::EYE_HEIGHT;
use crate::scene::{RigidObject, Scene};

/// A node of the scene with its place at rest.
pub(super) struct Instance<'a> {
    pub(super) node: gltf::Node<'a>,
    pub(super) world_from_node: DMat4,
    /// What its mesh moves with.
    pub(super) object: ObjectId,
    /// The same as `world_from_node` for what stands still.
    pub(super) object_from_node: DMat4,
}

/// All nodes of the default scene, parents before children. Adds a rigid
/// object for every animated node that moves a mesh.
pub(super) fn flatten<'a>(
    document: &'a gltf::Document,
    motions: &Motions,
    scene: &mut Scene,
) -> Result<Vec<Instance<'a>>, LoadError> {
    let nodes: Vec<gltf::Node<'a>> = document.nodes().collect();
    let mut visited = vec![false; nodes.len()];
    let mut walk = Walk {
        parents: vec![None; nodes.len()],
        locals: nodes.iter().map(local).collect(),
        objects: vec![None; nodes.len()],
    };
    // A node, where its parent is, and its deepest animated ancestor.
    let mut pending: Vec<(usize, DMat4, Option<usize>)> = roots(document)
        .into_iter()
        .rev()
        .map(|root| (root, DMat4::IDENTITY, None))
        .collect();
    let mut instances = Vec::new();
    while let Some((index, world_from_parent, mover)) = pending.pop() {
        if std::mem::replace(&mut visited[index], true) {
            return Err(LoadError::Cycle { node: index });
        }
        let world_from_node = world_from_parent * walk.locals[index];
        if !world_from_node.as_mat4().is_finite() {
            let place = format!("nodes[{index}]");
            return Err(LoadError::invalid(place, "its transform is not finite"));
        }
        let node = nodes[index].clone();
        let mover = if motions.moves(index) {
            Some(index)
        } else {
            mover
        };
        for child in node.children() {
            walk.parents[child.index()] = Some(index);
            pending.push((child.index(), world_from_node, mover));
        }
        let (object, object_from_world) = match mover {
            Some(mover) if node.mesh().is_some() => {
                walk.object(mover, &nodes[mover], motions, scene)?
            }
            _ => (ObjectId::WORLD, DMat4::IDENTITY),
        };
        instances.push(Instance {
            node,
            world_from_node,
            object,
            object_from_node: object_from_world * world_from_node,
        });
    }
    Ok(instances)
}

/// What is known of the tree while walking it.
struct Walk {
    parents: Vec<Option<usize>>,
    locals: Vec<DMat4>,
    /// By animated node: its object and `object_from_world` at rest.
    objects: Vec<Option<(ObjectId, DMat4)>>,
}

impl Walk {
    /// The object that moves with animated node `mover`.
    fn object(
        &mut self,
        mover: usize,
        node: &gltf::Node<'_>,
        motions: &Motions,
        scene: &mut Scene,
    ) -> Result<(ObjectId, DMat4), LoadError> {
        if let Some(known) = self.objects[mover] {
            return Ok(known);
        }
        let mut chain: Vec<usize> =
            std::iter::successors(Some(mover), |&node| self.parents[node]).collect();
        chain.reverse();
        let number = u16::try_from(scene.objects.len() + 1).map_err(|_| LoadError::TooLarge {
            what: "the number of moving objects".to_owned(),
            size: scene.objects.len() as u64 + 1,
            limit: u64::from(u16::MAX),
        })?;
        let world_from_mover: DMat4 = chain.iter().map(|&node| self.locals[node]).product();
        let (orientation, position) = rigid(world_from_mover);
        let world_from_object = DMat4::from_rotation_translation(orientation, position);
        scene.objects.push(RigidObject {
            name: node.name().unwrap_or_default().to_owned(),
            keys: motions.keys(&chain, &self.locals),
        });
        let object = (ObjectId(number), world_from_object.inverse());
        self.objects[mover] = Some(object);
        Ok(object)
    }
}

/// The rigid part of a transform, as a pose.
pub(super) fn pose(matrix: DMat4) -> Pose {
    let (orientation, position) = rigid(matrix);
    Pose {
        position: position.as_vec3(),
        orientation: orientation.as_quat().normalize(),
    }
}

fn rigid(matrix: DMat4) -> (DQuat, DVec3) {
    let (_, orientation, position) = matrix.to_scale_rotation_translation();
    if orientation.is_finite() {
        (orientation.normalize(), position)
    } else {
        (DQuat::IDENTITY, position)
    }
}

/// The nodes that the default scene begins with; all parentless nodes where
/// the file has no scene.
fn roots(document: &gltf::Document) -> Vec<usize> {
    if let Some(scene) = document.default_scene().or(document.scenes().next()) {
        return scene.nodes().map(|node| node.index()).collect();
    }
    let mut is_child = vec![false; document.nodes().len()];
    for child in document.nodes().flat_map(|node| node.children()) {
        is_child[child.index()] = true;
    }
    (0..is_child.len())
        .filter(|&node| !is_child[node])
        .collect()
}

fn local(node: &gltf::Node<'_>) -> DMat4 {
    match node.transform() {
        Transform::Matrix { matrix } => {
            DMat4::from_cols_array_2d(&matrix.map(|column| column.map(f64::from)))
        }
        Transform::Decomposed {
            translation,
            rotation,
            scale,
        } => DMat4::from_scale_rotation_translation(
            DVec3::from_array(scale.map(f64::from)),
            unit(rotation.map(f64::from)),
            DVec3::from_array(translation.map(f64::from)),
        ),
    }
}

/// A unit quaternion from four numbers that a file calls one.
pub(super) fn unit(xyzw: [f64; 4]) -> DQuat {
    let length = xyzw.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 1e-9 && length.is_finite() {
        DQuat::from_array(xyzw.map(|x| x / length))
    } else {
        DQuat::IDENTITY
    }
}

/// The first camera is where the viewer stands: below it, upright, looking
/// where it looks.
pub(super) fn stand_at_camera(instance: &Instance<'_>, scene: &mut Scene) {
    if scene.spawn.is_some() || instance.node.camera().is_none() {
        return;
    }
    let world_from_camera = pose(instance.world_from_node);
    let ahead = world_from_camera.orientation * glam::Vec3::NEG_Z;
    let floor = world_from_camera.position - glam::Vec3::Y * EYE_HEIGHT;
    scene.spawn = Some(Pose {
        position: floor,
        orientation: Quat::from_rotation_y((-ahead.x).atan2(-ahead.z)),
    });
}
