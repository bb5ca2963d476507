//! What an atlas would be asked for by culling whole objects against the view, as
//! engines do, instead of finding which patches are visible.
//!
//! An object is what hangs together by its triangles' corners and moves together.
//! It counts as visible where its bounding box meets the enlarged view's frustum.
//!
//! Source: SAS 2018, section 5.2.

use glam::{Vec3, vec3};
use shadecast_protocol::Pose;
use shadecast_server::scene::Scene;

/// A bounding box in the space of what the object moves with, and its triangles.
struct Object {
    moves_with: u16,
    low: Vec3,
    high: Vec3,
    triangles: Vec<[Vec3; 3]>,
}

/// The objects of a scene.
pub(super) struct Objects(Vec<Object>);

impl Objects {
    pub(super) fn of(scene: &Scene) -> Self {
        let mut leads: Vec<u32> = (0..scene.positions.len() as u32).collect();
        for triangle in &scene.triangles {
            let [a, b, c] = triangle.positions.map(|corner| lead_of(&mut leads, corner));
            let least = a.min(b).min(c);
            for lead in [a, b, c] {
                leads[lead as usize] = least;
            }
        }
        let mut of_lead = std::collections::HashMap::new();
        let mut objects: Vec<Object> = Vec::new();
        for triangle in &scene.triangles {
            let key = (
                lead_of(&mut leads, triangle.positions[0]),
                triangle.object.0,
            );
            let at = *of_lead.entry(key).or_insert_with(|| {
                objects.push(Object {
                    moves_with: triangle.object.0,
                    low: Vec3::INFINITY,
                    high: Vec3::NEG_INFINITY,
                    triangles: Vec::new(),
                });
                objects.len() - 1
            });
            let corners = triangle
                .positions
                .map(|corner| scene.positions[corner as usize]);
            let object = &mut objects[at];
            for corner in corners {
                object.low = object.low.min(corner);
                object.high = object.high.max(corner);
            }
            object.triangles.push(corners);
        }
        Self(objects)
    }

    /// Steradians that the triangles cover, one by one, of all objects that a head at
    /// `world_from_head` may see within `tangents`, across and up, on either side;
    /// `from_world[n]` leads into the space of `ObjectId(n)`.
    pub(super) fn asked(
        &self,
        world_from_head: Pose,
        tangents: [f32; 2],
        from_world: &[Pose],
        solid_angle: fn([Vec3; 3]) -> f64,
    ) -> f64 {
        let mut asked = 0.0;
        for object in &self.0 {
            let head = from_world[usize::from(object.moves_with)].then(world_from_head);
            if !meets(head, tangents, object.low, object.high) {
                continue;
            }
            let eye = head.position;
            asked += (object.triangles.iter())
                .map(|corners| solid_angle(corners.map(|corner| corner - eye)))
                .sum::<f64>();
        }
        asked
    }
}

/// The least position that hangs together with this one, as far as is known.
fn lead_of(leads: &mut [u32], position: u32) -> u32 {
    let mut lead = position;
    while leads[lead as usize] != lead {
        // Halves the way for whoever asks next.
        leads[lead as usize] = leads[leads[lead as usize] as usize];
        lead = leads[lead as usize];
    }
    lead
}

/// Whether no side of the frustum has all of the box beyond it.
fn meets(head: Pose, [across, up]: [f32; 2], low: Vec3, high: Vec3) -> bool {
    let from_object = head.inverse();
    let corners: [Vec3; 8] = std::array::from_fn(|i| {
        let pick = |bit: usize, low: f32, high: f32| if i >> bit & 1 == 0 { low } else { high };
        from_object.transform_point(vec3(
            pick(0, low.x, high.x),
            pick(1, low.y, high.y),
            pick(2, low.z, high.z),
        ))
    });
    let beyond = |outside: &dyn Fn(&Vec3) -> bool| corners.iter().all(outside);
    !(beyond(&|c| c.z >= 0.0)
        || beyond(&|c| c.x > -c.z * across)
        || beyond(&|c| -c.x > -c.z * across)
        || beyond(&|c| c.y > -c.z * up)
        || beyond(&|c| -c.y > -c.z * up))
}

#[cfg(test)]
mod tests {
    use super::*;
    use shadecast_server::scene::Material;

    #[test]
    fn boxes_behind_and_beside_the_view_are_culled_and_hidden_ones_are_not() {
        let mut scene = Scene::default();
        let material = scene.add_material(Material::default());
        // In front, behind that, to the right, and behind the head.
        for place in [
            vec3(0.0, 0.0, -2.0),
            vec3(0.0, 0.0, -6.0),
            vec3(9.0, 0.0, -2.0),
            vec3(0.0, 0.0, 4.0),
        ] {
            scene.add_box(place, Vec3::splat(0.5), material);
        }
        let objects = Objects::of(&scene);
        let asked = objects.asked(Pose::IDENTITY, [1.0; 2], &[Pose::IDENTITY], |_| 1.0);
        let each = (scene.triangles.len() / 4) as f64;
        assert_eq!(asked, 2.0 * each);
    }
}
