//! Walking with a thumbstick: the play space moves through the scene, and the
//! head moves in the play space as it does.

use glam::{Vec2, Vec3};
use shadecast_protocol::Pose;

/// A brisk walk, m/s.
const SPEED: f32 = 1.5;
/// How far a stick rests from its middle without being touched.
const DEAD_ZONE: f32 = 0.15;

/// Where a stick moves the play space, m/s in the world: ahead is where the
/// head looks, level with the floor.
pub(super) fn velocity(world_from_head: Pose, stick: Vec2) -> Vec3 {
    let length = stick.length();
    if length.is_nan() || length <= DEAD_ZONE {
        return Vec3::ZERO;
    }
    let ahead = world_from_head.orientation * Vec3::NEG_Z;
    let Some(ahead) = Vec3::new(ahead.x, 0.0, ahead.z).try_normalize() else {
        return Vec3::ZERO;
    };
    let right = ahead.cross(Vec3::Y);
    let strength = ((length - DEAD_ZONE) / (1.0 - DEAD_ZONE)).min(1.0);
    (ahead * stick.y + right * stick.x) * (SPEED * strength / length)
}

#[cfg(test)]
mod tests {
    use glam::Quat;

    use super::*;

    fn looking(orientation: Quat) -> Pose {
        Pose {
            position: Vec3::ZERO,
            orientation,
        }
    }

    #[test]
    fn ahead_is_where_one_looks_and_the_floor_is_kept() {
        let left_and_down = Quat::from_rotation_y(1.5707964) * Quat::from_rotation_x(-0.7);
        let walks = velocity(looking(left_and_down), Vec2::Y);
        assert!((walks - Vec3::NEG_X * SPEED).length() < 1e-3, "{walks}");
        let aside = velocity(looking(Quat::IDENTITY), Vec2::X);
        assert!((aside - Vec3::X * SPEED).length() < 1e-3, "{aside}");
        let corner = velocity(looking(Quat::IDENTITY), Vec2::ONE);
        assert!((corner.length() - SPEED).abs() < 1e-3, "no faster aslant");
    }

    #[test]
    fn a_stick_at_rest_or_broken_moves_nothing() {
        for stick in [Vec2::ZERO, Vec2::new(0.1, -0.1), Vec2::NAN] {
            assert_eq!(velocity(looking(Quat::IDENTITY), stick), Vec3::ZERO);
        }
        let up = looking(Quat::from_rotation_x(1.5707964));
        assert!(velocity(up, Vec2::Y).is_finite());
    }
}
