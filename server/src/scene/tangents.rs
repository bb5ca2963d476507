//! Tangents where a normal map needs them and the file gives none.
//!
//! Every corner sums the directions in which the first texture coordinate of
//! its triangles grows, weighted by the corner's angle, then makes the sum
//! orthogonal to its normal (Gram-Schmidt). This departs from MikkTSpace in
//! not splitting corners where texture coordinates are mirrored.

use glam::{Vec2, Vec3, Vec4};

use super::Scene;

/// Gives a tangent to every corner that has none and whose material has a
/// normal map.
pub(super) fn complete_tangents(scene: &mut Scene) {
    let mut sums = vec![(Vec3::ZERO, Vec3::ZERO); scene.corners.len()];
    let mut wanted = vec![false; scene.corners.len()];
    for triangle in &scene.triangles {
        let material = &scene.materials[triangle.material as usize];
        let Some(normal_map) = &material.normal_texture else {
            continue;
        };
        let positions = triangle.positions.map(|i| scene.positions[i as usize]);
        let uvs = triangle.corners.map(|i| {
            let uv = scene.corners[i as usize].uv[usize::from(normal_map.uv_set)];
            normal_map.transform.transform_point2(uv)
        });
        let Some((tangent, bitangent)) = gradient(positions, uvs) else {
            continue;
        };
        for (i, &corner) in triangle.corners.iter().enumerate() {
            if scene.corners[corner as usize].tangent != Vec4::ZERO {
                continue;
            }
            let a = positions[(i + 1) % 3] - positions[i];
            let b = positions[(i + 2) % 3] - positions[i];
            let angle = a.angle_between(b);
            let sum = &mut sums[corner as usize];
            sum.0 += tangent * angle;
            sum.1 += bitangent * angle;
        }
        for corner in triangle.corners {
            wanted[corner as usize] = true;
        }
    }
    for ((corner, (tangent, bitangent)), wanted) in scene.corners.iter_mut().zip(sums).zip(wanted) {
        if !wanted || corner.tangent != Vec4::ZERO {
            continue;
        }
        let normal = corner.normal;
        let direction = (tangent - normal * normal.dot(tangent))
            .try_normalize()
            .unwrap_or_else(|| normal.any_orthonormal_vector());
        let sign = if normal.cross(direction).dot(bitangent) < 0.0 {
            -1.0
        } else {
            1.0
        };
        corner.tangent = direction.extend(sign);
    }
}

/// Unit directions in which u grows and in which v falls: glTF's bitangent
/// points up the picture while v runs down it.
fn gradient(positions: [Vec3; 3], uvs: [Vec2; 3]) -> Option<(Vec3, Vec3)> {
    let (e1, e2) = (positions[1] - positions[0], positions[2] - positions[0]);
    let (d1, d2) = (uvs[1] - uvs[0], uvs[2] - uvs[0]);
    let determinant = d1.perp_dot(d2);
    if determinant.abs() < 1e-20 {
        return None;
    }
    let sign = determinant.signum();
    let tangent = ((e1 * d2.y - e2 * d1.y) * sign).try_normalize()?;
    let bitangent = ((e1 * d2.x - e2 * d1.x) * sign).try_normalize()?;
    Some((tangent, bitangent))
}
