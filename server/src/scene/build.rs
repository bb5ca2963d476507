//! Scenes put together piece by piece.

use glam::{Vec2, Vec3, Vec4, vec2};
use shadecast_protocol::ObjectId;

use super::{Corner, Material, Scene, Triangle};

impl Scene {
    /// Adds a material; the result names it in triangles.
    pub fn add_material(&mut self, material: Material) -> u32 {
        self.materials.push(material);
        self.materials.len() as u32 - 1
    }

    /// Adds a flat four-sided face of two triangles. From its front the corners run
    /// counter-clockwise; a texture's corner (0, 0) lies at the first of them.
    pub fn add_quad(&mut self, corners: [Vec3; 4], material: u32) {
        let first = self.positions.len() as u32;
        let first_corner = self.corners.len() as u32;
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let uvs = [Vec2::ZERO, Vec2::X, vec2(1.0, 1.0), Vec2::Y];
        for (position, uv) in corners.into_iter().zip(uvs) {
            self.positions.push(position);
            self.corners.push(Corner {
                normal: normal.normalize_or(Vec3::Y),
                tangent: Vec4::ZERO,
                uv: [uv; 2],
                color: Vec4::ONE,
            });
        }
        for corners in [[0, 1, 2], [0, 2, 3]] {
            self.triangles.push(Triangle {
                positions: corners.map(|corner| first + corner),
                corners: corners.map(|corner| first_corner + corner),
                material,
                object: ObjectId::WORLD,
            });
        }
    }

    /// Adds the six faces of a box with these half sides; they look outwards, or
    /// inwards where the half sides are negative.
    pub fn add_box(&mut self, centre: Vec3, half: Vec3, material: u32) {
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let (mut n, mut u) = (Vec3::ZERO, Vec3::ZERO);
                n[axis] = side;
                u[(axis + 1) % 3] = 1.0;
                let v = n.cross(u);
                let corner = |a: f32, b: f32| centre + (n + u * a + v * b) * half;
                let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
                self.add_quad(corners.map(|(a, b)| corner(a, b)), material);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_looks_outwards_and_its_negative_inwards() {
        for (half, outwards) in [(Vec3::new(1.0, 2.0, 3.0), 1.0), (Vec3::splat(-2.0), -1.0)] {
            let centre = Vec3::new(5.0, 0.0, -1.0);
            let mut scene = Scene::default();
            let material = scene.add_material(Material::default());
            scene.add_box(centre, half, material);
            assert_eq!(scene.triangles.len(), 12);
            for triangle in &scene.triangles {
                let [a, b, c] = triangle.positions.map(|p| scene.positions[p as usize]);
                let faces = (b - a).cross(c - a).dot(a - centre) * outwards;
                let normal = scene.corners[triangle.corners[0] as usize].normal;
                assert!(faces > 0.0 && normal.dot(a - centre) * outwards > 0.0);
            }
        }
    }
}
