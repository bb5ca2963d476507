//! Where a viewer begins.

use glam::{Quat, Vec3};
use shadecast_protocol::Pose;

use super::Scene;

/// Height of a standing viewer's eyes, metres.
pub(super) const EYE_HEIGHT: f32 = 1.6;
/// A scene smaller than this is an object, metres.
const ROOM: f32 = 4.0;

impl Scene {
    /// Where the viewer's feet are at first: the scene's spawn, or else in the
    /// middle of a room, or before an object that is smaller than one.
    #[must_use]
    pub fn place_to_stand(&self) -> Pose {
        self.spawn.unwrap_or_else(|| Pose {
            position: self.guess(),
            orientation: Quat::IDENTITY,
        })
    }

    /// Where the viewer's eyes are at first.
    #[must_use]
    pub fn first_eye(&self) -> Pose {
        self.place_to_stand().then(Pose {
            position: Vec3::Y * EYE_HEIGHT,
            orientation: Quat::IDENTITY,
        })
    }

    fn guess(&self) -> Vec3 {
        let (low, high) = self.bounds();
        let (middle, size) = ((low + high) * 0.5, high - low);
        if size.max_element() < ROOM {
            let before = high.z + size.max_element().max(0.3);
            Vec3::new(middle.x, middle.y - EYE_HEIGHT, before)
        } else {
            Vec3::new(middle.x, low.y, middle.z)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Triangle, courtyard};

    #[test]
    fn a_small_scene_is_stood_before_and_a_large_one_in() {
        let mut scene = Scene {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            triangles: vec![Triangle {
                positions: [0, 1, 2],
                corners: [0; 3],
                material: 0,
                object: shadecast_protocol::ObjectId::WORLD,
            }],
            ..Scene::default()
        };
        let eye = scene.first_eye().position;
        assert!(eye.abs_diff_eq(Vec3::new(0.5, 0.5, 1.0), 1e-6), "{eye}");
        for position in &mut scene.positions {
            *position *= 100.0;
        }
        assert_eq!(scene.place_to_stand().position, Vec3::new(50.0, 0.0, 0.0));
        assert_eq!(Scene::default().place_to_stand().position.x, 0.0);
        let courtyard = courtyard(10_000);
        assert_eq!(Some(courtyard.place_to_stand()), courtyard.spawn);
    }
}
