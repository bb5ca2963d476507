//! Primitives become a soup of triangles, still in `f64` and not yet welded.

use glam::{DMat3, DMat4, DVec3, Vec2, Vec3, Vec4};
use gltf::Semantic;
use gltf::mesh::Mode;
use shadecast_protocol::ObjectId;

use super::accessor::Data;
use super::nodes::Instance;
use super::{LoadError, MAX_TRIANGLES};
use crate::scene::{Corner, Scene};

/// Triangles with positions of their own.
#[derive(Default)]
pub(super) struct Soup {
    pub(super) positions: Vec<DVec3>,
    /// A zero normal asks for the triangle's own.
    pub(super) corners: Vec<Corner>,
    pub(super) triangles: Vec<SoupTriangle>,
}

/// A triangle of a [`Soup`].
pub(super) struct SoupTriangle {
    pub(super) positions: [u32; 3],
    pub(super) corners: [u32; 3],
    pub(super) material: u32,
    pub(super) object: ObjectId,
}

impl Soup {
    /// Adds the mesh of a node, if it has one.
    pub(super) fn add(
        &mut self,
        instance: &Instance<'_>,
        document: &gltf::Document,
        data: &Data<'_>,
        scene: &mut Scene,
    ) -> Result<(), LoadError> {
        let Some(mesh) = instance.node.mesh() else {
            return Ok(());
        };
        let default_material = document.materials().len();
        for primitive in mesh.primitives() {
            let place = format!("meshes[{}].primitives[{}]", mesh.index(), primitive.index());
            let warn = |what: &str, scene: &mut Scene| {
                scene.notes.warnings.push(format!("{place} {what}"));
            };
            if instance.node.skin().is_some() || primitive.morph_targets().next().is_some() {
                warn("is skinned or morphed: it is drawn in its rest pose", scene);
            }
            if !matches!(
                primitive.mode(),
                Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
            ) {
                warn(
                    "has no triangles but points or lines: it is left out",
                    scene,
                );
                continue;
            }
            let Some(positions) = primitive.get(&Semantic::Positions) else {
                warn("has no positions: it is left out", scene);
                continue;
            };
            let positions = data.floats::<3>(&positions)?;
            let indices = match primitive.indices() {
                Some(accessor) => data.indices(&accessor)?,
                None => (0..positions.len() as u32).collect(),
            };
            if let Some(wrong) = indices.iter().find(|&&i| i as usize >= positions.len()) {
                let fault = format!(
                    "index {wrong} is out of range of {} vertices",
                    positions.len()
                );
                return Err(LoadError::invalid(place, fault));
            }
            let triangles = triangles(&indices, primitive.mode());
            let total = self.triangles.len() + triangles.len();
            if total > MAX_TRIANGLES {
                return Err(LoadError::TooLarge {
                    what: "the number of triangles".to_owned(),
                    size: total as u64,
                    limit: MAX_TRIANGLES as u64,
                });
            }
            let place_in_object = instance.object_from_node;
            let material = primitive.material().index().unwrap_or(default_material) as u32;
            let corners = corners(&primitive, positions.len(), place_in_object, data, &place)?;
            let flips = DMat3::from_mat4(place_in_object).determinant() < 0.0;
            let first = self.positions.len() as u32;
            self.positions.extend(positions.iter().map(|&position| {
                place_in_object.transform_point3(DVec3::from_array(position.map(f64::from)))
            }));
            let first_corner = self.corners.len() as u32;
            self.corners.extend(corners);
            for mut triangle in triangles {
                if flips {
                    triangle.swap(1, 2);
                }
                self.triangles.push(SoupTriangle {
                    positions: triangle.map(|i| first + i),
                    corners: triangle.map(|i| first_corner + i),
                    material,
                    object: instance.object,
                });
            }
        }
        Ok(())
    }

    /// Lowest and highest coordinates; of moving objects, at their own origin.
    pub(super) fn bounds(&self) -> (DVec3, DVec3) {
        let used = self
            .triangles
            .iter()
            .filter(|triangle| triangle.object == ObjectId::WORLD)
            .flat_map(|triangle| triangle.positions)
            .map(|i| self.positions[i as usize]);
        used.fold(
            (DVec3::INFINITY, DVec3::NEG_INFINITY),
            |(low, high), point| (low.min(point), high.max(point)),
        )
    }
}

/// The glTF specification's section 3.7.2.1.
fn triangles(indices: &[u32], mode: Mode) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => indices
            .windows(3)
            .enumerate()
            .map(|(i, w)| {
                if i % 2 == 0 {
                    [w[0], w[1], w[2]]
                } else {
                    [w[0], w[2], w[1]]
                }
            })
            .collect(),
        Mode::TriangleFan => match indices {
            [hub, rim @ ..] => rim.windows(2).map(|w| [*hub, w[0], w[1]]).collect(),
            [] => Vec::new(),
        },
        _ => indices.as_chunks().0.to_vec(),
    }
}

/// One corner for every vertex.
fn corners(
    primitive: &gltf::Primitive<'_>,
    count: usize,
    object_from_node: DMat4,
    data: &Data<'_>,
    place: &str,
) -> Result<Vec<Corner>, LoadError> {
    let linear = DMat3::from_mat4(object_from_node);
    let handedness = linear.determinant().signum() as f32;
    // The cofactor matrix: the inverse transpose but for a factor, and
    // defined where there is no inverse.
    let cofactor = DMat3::from_cols(
        linear.y_axis.cross(linear.z_axis),
        linear.z_axis.cross(linear.x_axis),
        linear.x_axis.cross(linear.y_axis),
    ) * f64::from(handedness);
    let direction = |matrix: DMat3, [x, y, z]: [f32; 3]| -> Vec3 {
        let direction = matrix * DVec3::new(f64::from(x), f64::from(y), f64::from(z));
        direction.normalize_or_zero().as_vec3()
    };
    let mut corners = vec![
        Corner {
            normal: Vec3::ZERO,
            tangent: Vec4::ZERO,
            uv: [Vec2::ZERO; 2],
            color: Vec4::ONE,
        };
        count
    ];
    let check = |semantic: &Semantic, length: usize| {
        if length == count {
            return Ok(());
        }
        let fault = format!("{} has {length} of {count} vertices", semantic.to_string());
        Err(LoadError::invalid(place, fault))
    };
    if let Some(accessor) = primitive.get(&Semantic::Normals) {
        let normals = data.floats::<3>(&accessor)?;
        check(&Semantic::Normals, normals.len())?;
        for (corner, normal) in corners.iter_mut().zip(normals) {
            corner.normal = direction(cofactor, normal);
        }
        // Tangents without normals are ignored, as the specification says.
        if let Some(accessor) = primitive.get(&Semantic::Tangents) {
            let tangents = data.floats::<4>(&accessor)?;
            check(&Semantic::Tangents, tangents.len())?;
            for (corner, [x, y, z, sign]) in corners.iter_mut().zip(tangents) {
                let tangent = direction(linear, [x, y, z]);
                if tangent != Vec3::ZERO {
                    let sign = if sign < 0.0 { -handedness } else { handedness };
                    corner.tangent = tangent.extend(sign);
                }
            }
        }
    }
    for set in 0..2 {
        let semantic = Semantic::TexCoords(set);
        if let Some(accessor) = primitive.get(&semantic) {
            let coordinates = data.floats::<2>(&accessor)?;
            check(&semantic, coordinates.len())?;
            for (corner, uv) in corners.iter_mut().zip(coordinates) {
                corner.uv[set as usize] = Vec2::from_array(uv);
            }
        }
    }
    if let Some(accessor) = primitive.get(&Semantic::Colors(0)) {
        let colors: Vec<Vec4> = if accessor.dimensions().multiplicity() == 3 {
            let opaque = |rgb| Vec3::from_array(rgb).extend(1.0);
            data.floats::<3>(&accessor)?
                .into_iter()
                .map(opaque)
                .collect()
        } else {
            data.floats::<4>(&accessor)?
                .into_iter()
                .map(Vec4::from_array)
                .collect()
        };
        check(&Semantic::Colors(0), colors.len())?;
        for (corner, color) in corners.iter_mut().zip(colors) {
            corner.color = color;
        }
    }
    Ok(corners)
}
