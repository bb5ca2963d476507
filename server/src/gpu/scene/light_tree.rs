//! A binary tree over the lamps, by which one is chosen for a point by how much
//! light it can send there at most: its cost grows with the logarithm of their
//! number.
//!
//! Source: Conty Estévez and Kulla, "Importance Sampling of Many Lights with
//! Adaptive Tree Splitting", 2018, without the splitting. Halves are equal in
//! number, so that no branch is deeper than a lamp's trail has bits.

use glam::Vec3;
use shadecast_protocol::Pose;
use shadecast_shaders::light::{LIGHT_LEAF, LightNode};

/// Where a lamp is and how it shines, in the space of its object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Emitter {
    /// Zero for the world, else what it moves with.
    pub(super) instance: u32,
    pub(super) centre: Vec3,
    /// Of a sphere that holds it; negative where it is infinitely far.
    pub(super) radius: f32,
    /// Middle of the directions that it shines to.
    pub(super) axis: Vec3,
    /// Of the angle about the axis beyond which its surface's normals do not
    /// lie; -1 where it shines all around.
    pub(super) cos_spread: f32,
    /// Greatest intensity, or irradiance where it is infinitely far.
    pub(super) power: f32,
}

/// The nodes, root first, and what they are made from.
#[derive(Debug)]
pub(super) struct LightTree {
    pub(super) nodes: Vec<LightNode>,
    emitters: Vec<Emitter>,
}

impl LightTree {
    /// Over emitters in the order of the lights. Returns also each one's trail:
    /// bit `n` says which child of the node at depth `n` leads to it.
    pub(super) fn build(emitters: Vec<Emitter>) -> (Self, Vec<u32>) {
        let mut order: Vec<u32> = (0..emitters.len() as u32).collect();
        let mut tree = Self {
            nodes: Vec::new(),
            emitters,
        };
        let mut trails = vec![0; order.len()];
        if !order.is_empty() {
            tree.nodes.push(LightNode::default());
            tree.split(0, &mut order, 0, 0, &mut trails);
        }
        tree.refit(&[]);
        (tree, trails)
    }

    fn split(
        &mut self,
        node: usize,
        lights: &mut [u32],
        depth: u32,
        trail: u32,
        trails: &mut [u32],
    ) {
        if let [light] = *lights {
            self.nodes[node].child = light | LIGHT_LEAF;
            trails[light as usize] = trail;
            return;
        }
        let emitter = |light: u32| &self.emitters[light as usize];
        let (low, high) = lights
            .iter()
            .fold((Vec3::MAX, Vec3::MIN), |(low, high), &light| {
                let centre = emitter(light).centre;
                (low.min(centre), high.max(centre))
            });
        let axis = (high - low).max_position();
        // What is infinitely far or moves stands apart from what is not.
        lights.sort_by(|&a, &b| {
            let (a, b) = (emitter(a), emitter(b));
            (b.radius < 0.0)
                .cmp(&(a.radius < 0.0))
                .then(a.instance.cmp(&b.instance))
                .then(a.centre[axis].total_cmp(&b.centre[axis]))
        });
        let far = lights.partition_point(|&light| emitter(light).radius < 0.0);
        let middle = if (1..lights.len()).contains(&far) && depth == 0 {
            far
        } else {
            lights.len() / 2
        };
        let child = self.nodes.len();
        self.nodes[node].child = child as u32;
        self.nodes.extend([LightNode::default(); 2]);
        let (left, right) = lights.split_at_mut(middle);
        self.split(child, left, depth + 1, trail, trails);
        self.split(child + 1, right, depth + 1, trail | 1 << depth, trails);
    }

    /// Whether any lamp moves with an object.
    pub(super) fn moves(&self) -> bool {
        self.emitters.iter().any(|emitter| emitter.instance != 0)
    }

    /// Fits the nodes to where the objects are; `poses[n]` is that of instance
    /// `n + 1`, and those that are missing stand at the identity.
    pub(super) fn refit(&mut self, poses: &[Pose]) {
        for index in (0..self.nodes.len()).rev() {
            let child = self.nodes[index].child;
            let fitted = if child & LIGHT_LEAF != 0 {
                leaf(&self.emitters[(child & !LIGHT_LEAF) as usize], poses)
            } else {
                union(&self.nodes[child as usize], &self.nodes[child as usize + 1])
            };
            self.nodes[index] = LightNode { child, ..fitted };
        }
    }
}

fn leaf(emitter: &Emitter, poses: &[Pose]) -> LightNode {
    let pose = (emitter.instance as usize)
        .checked_sub(1)
        .and_then(|instance| poses.get(instance).copied())
        .unwrap_or(Pose::IDENTITY);
    LightNode {
        centre: pose.transform_point(emitter.centre).to_array(),
        radius: emitter.radius,
        axis: (pose.orientation * emitter.axis).to_array(),
        cos_spread: emitter.cos_spread,
        power: emitter.power,
        ..LightNode::default()
    }
}

/// A sphere and a cone about those of two nodes.
fn union(a: &LightNode, b: &LightNode) -> LightNode {
    let power = a.power + b.power;
    if a.radius < 0.0 || b.radius < 0.0 {
        // Infinitely far: importance is the power alone.
        return LightNode {
            radius: -1.0,
            cos_spread: -1.0,
            power,
            ..LightNode::default()
        };
    }
    let (centre_a, centre_b) = (Vec3::from(a.centre), Vec3::from(b.centre));
    let distance = centre_a.distance(centre_b);
    let (centre, radius) = if distance + b.radius <= a.radius {
        (centre_a, a.radius)
    } else if distance + a.radius <= b.radius {
        (centre_b, b.radius)
    } else {
        let radius = 0.5 * (distance + a.radius + b.radius);
        let t = (radius - a.radius) / distance;
        (centre_a.lerp(centre_b, t), radius)
    };
    let (axis_a, axis_b) = (Vec3::from(a.axis), Vec3::from(b.axis));
    let axis = (axis_a + axis_b).normalize_or_zero();
    let spread = |of: Vec3, cosine: f32| axis.angle_between(of) + cosine.acos();
    let widest = spread(axis_a, a.cos_spread).max(spread(axis_b, b.cos_spread));
    let all_around = axis == Vec3::ZERO || widest.is_nan() || widest >= std::f32::consts::PI;
    LightNode {
        centre: centre.to_array(),
        // Rounding must not leave a lamp outside.
        radius: radius * (1.0 + 1e-5),
        axis: axis.to_array(),
        cos_spread: if all_around { -1.0 } else { widest.cos() },
        power,
        ..LightNode::default()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn emitter() -> impl Strategy<Value = Emitter> {
        let numbers = prop::array::uniform6(-1.0_f32..1.0);
        (numbers, 0.0_f32..2.0, 0_u32..3, any::<bool>()).prop_map(|(n, size, instance, far)| {
            Emitter {
                instance,
                centre: Vec3::new(n[0], n[1], n[2]) * 50.0,
                radius: if far && instance == 0 { -1.0 } else { size },
                axis: Vec3::new(n[3], n[4], n[5])
                    .try_normalize()
                    .unwrap_or(Vec3::Y),
                cos_spread: n[0],
                power: size + 0.1,
            }
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn trails_lead_to_their_lamps_through_nodes_that_hold_them(
            emitters in prop::collection::vec(emitter(), 1..200),
            angle in 0.0_f32..3.0,
        ) {
            let (mut tree, trails) = LightTree::build(emitters.clone());
            let poses = [Vec3::X, Vec3::Y].map(|axis| Pose {
                position: axis * 7.0,
                orientation: glam::Quat::from_axis_angle(axis, angle),
            });
            tree.refit(&poses);
            prop_assert_eq!(tree.nodes.len(), 2 * emitters.len() - 1);
            let total: f32 = emitters.iter().map(|e| e.power).sum();
            prop_assert!((tree.nodes[0].power - total).abs() < 1e-3 * total);
            for (light, (&trail, emitter)) in (0..).zip(trails.iter().zip(&emitters)) {
                let own = leaf(emitter, &poses);
                let (mut node, mut depth) = (&tree.nodes[0], 0);
                while node.child & LIGHT_LEAF == 0 {
                    let away = Vec3::from(node.centre).distance(Vec3::from(own.centre));
                    let holds = away + own.radius <= node.radius * 1.0001 + 1e-3;
                    prop_assert!(node.radius < 0.0 || holds);
                    let apart = Vec3::from(node.axis).angle_between(Vec3::from(own.axis));
                    prop_assert!(node.cos_spread <= -1.0
                        || apart + own.cos_spread.acos() <= node.cos_spread.acos() + 1e-2);
                    node = &tree.nodes[(node.child + (trail >> depth & 1)) as usize];
                    depth += 1;
                }
                prop_assert_eq!(node.child, light | LIGHT_LEAF);
                prop_assert!(depth <= 10);
            }
        }
    }

    #[test]
    fn no_lamps_make_no_tree() {
        let (tree, trails) = LightTree::build(Vec::new());
        assert!(tree.nodes.is_empty() && trails.is_empty() && !tree.moves());
    }
}
