//! From the soup to the scene: positions become `f32` and one where they are
//! equal, triangles without area go, triangles without normals get flat ones.

use std::collections::HashMap;

use glam::{DVec3, Vec3};
use shadecast_protocol::ObjectId;

use super::LoadError;
use super::mesh::{Soup, SoupTriangle};
use crate::scene::{Scene, Triangle};

/// Moves `soup` into `scene`; what stands still is moved by `-offset`.
pub(super) fn weld(soup: Soup, offset: DVec3, scene: &mut Scene) -> Result<(), LoadError> {
    let mut welder = Welder {
        known: HashMap::new(),
        moved_corner: vec![u32::MAX; soup.corners.len()],
    };
    let mut without_area = 0_usize;
    for triangle in &soup.triangles {
        let offset = if triangle.object == ObjectId::WORLD {
            offset
        } else {
            DVec3::ZERO
        };
        // Adding zero makes one of the two zeros.
        let points = triangle
            .positions
            .map(|i| (soup.positions[i as usize] - offset).as_vec3() + Vec3::ZERO);
        if !points.iter().all(|point| point.is_finite()) {
            return Err(LoadError::invalid("a vertex", "lies beyond all numbers"));
        }
        let [a, b, c] = points.map(|point| point.as_dvec3());
        let Some(normal) = (b - a).cross(c - a).try_normalize() else {
            without_area += 1;
            continue;
        };
        let positions = points.map(|point| welder.position(point, triangle.object, scene));
        let corners = welder.corners(triangle, normal.as_vec3(), &soup, scene);
        scene.triangles.push(Triangle {
            positions,
            corners,
            material: triangle.material,
            object: triangle.object,
        });
    }
    if without_area > 0 {
        scene
            .notes
            .warnings
            .push(format!("{without_area} triangles without area are dropped"));
    }
    if scene.triangles.is_empty() {
        return Err(LoadError::NoTriangles);
    }
    Ok(())
}

struct Welder {
    known: HashMap<(ObjectId, [u32; 3]), u32>,
    /// By corner of the soup: where it is in the scene, if it is.
    moved_corner: Vec<u32>,
}

impl Welder {
    fn position(&mut self, point: Vec3, object: ObjectId, scene: &mut Scene) -> u32 {
        let key = (object, point.to_array().map(f32::to_bits));
        *self.known.entry(key).or_insert_with(|| {
            scene.positions.push(point);
            scene.positions.len() as u32 - 1
        })
    }

    fn corners(
        &mut self,
        triangle: &SoupTriangle,
        flat: Vec3,
        soup: &Soup,
        scene: &mut Scene,
    ) -> [u32; 3] {
        triangle.corners.map(|index| {
            let mut corner = soup.corners[index as usize];
            let next = scene.corners.len() as u32;
            if corner.normal == Vec3::ZERO {
                corner.normal = flat;
                scene.corners.push(corner);
                return next;
            }
            let moved = &mut self.moved_corner[index as usize];
            if *moved == u32::MAX {
                *moved = next;
                scene.corners.push(corner);
            }
            *moved
        })
    }
}
