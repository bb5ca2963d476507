//! Which texels of an alpha-masked patch are there. Video has no alpha, so the
//! client gets one bit a texel beside it.

use glam::{IVec2, Vec2};
use shadecast_protocol::{Block, PatchShape, Placement, Slot, SlotMask};
use shadecast_shaders::light::{AtlasTriangle, PatchPoint, patch_point, texel_coordinates};

use crate::{
    patches::Patch,
    scene::{Alpha, Image, Material, Scene, TextureRef, Wrap},
};

/// The mask of a patch at the texel centres of its slot.
pub(crate) fn slot_mask(scene: &Scene, patch: &Patch, placement: Placement) -> SlotMask {
    let bounds = placement.slot.bounds();
    let mut bits = vec![0; (bounds.area() as usize).div_ceil(8)];
    let triangle = match placement.slot {
        Slot::Triangle(slot) => Some(AtlasTriangle::new(slot.corners, slot.weights)),
        Slot::Block(_) => None,
    };
    for y in 0..bounds.height {
        for x in 0..bounds.width {
            let texel = IVec2::new(x as i32, y as i32);
            let point = match (placement.slot, &triangle) {
                (Slot::Block(block), _) => point_in_block(patch.shape, block, [x, y]),
                (_, Some(triangle)) if triangle.owns(texel) => triangle.point_of_texel(texel),
                _ => continue,
            };
            let index = (y * bounds.width + x) as usize;
            if is_there(
                scene,
                (patch.first_triangle + point.triangle) as usize,
                point.weights,
            ) {
                bits[index / 8] |= 1 << (index % 8);
            }
        }
    }
    SlotMask {
        patch: placement.patch,
        bits,
    }
}

fn point_in_block(shape: PatchShape, block: Block, [x, y]: [u32; 2]) -> PatchPoint {
    let shape = match shape {
        PatchShape::Solo => 0,
        PatchShape::Pair => 1,
        PatchShape::Triple => 2,
    };
    let (width, height) = block.level.size();
    let coordinates = texel_coordinates(x, y, width, height).to_array();
    patch_point(shape, Vec2::from(block.level.turn(coordinates)))
}

/// Twin of `is_there` in `trace.wgsl`.
fn is_there(scene: &Scene, triangle: usize, weights: Vec2) -> bool {
    let triangle = &scene.triangles[triangle];
    let material: &Material = &scene.materials[triangle.material as usize];
    let Alpha::Mask { cutoff } = material.alpha else {
        return true;
    };
    let mut alpha = material.base_color.w;
    if let Some(texture) = material.base_color_texture {
        let [a, b, c] = triangle
            .corners
            .map(|corner| scene.corners[corner as usize].uv[usize::from(texture.uv_set)]);
        let uv = a * (1.0 - weights.x - weights.y) + b * weights.x + c * weights.y;
        alpha *= alpha_at(&scene.images[texture.image as usize], &texture, uv);
    }
    alpha >= cutoff
}

fn alpha_at(image: &Image, texture: &TextureRef, uv: Vec2) -> f32 {
    let size = [image.width, image.height];
    let p = texture.transform.transform_point2(uv) * Vec2::new(size[0] as f32, size[1] as f32);
    let texel = |x: f32, y: f32| {
        let column = wrapped(x as i64, size[0], texture.wrap[0]);
        let row = wrapped(y as i64, size[1], texture.wrap[1]);
        f32::from(image.rgba[(row * image.width as usize + column) * 4 + 3]) / 255.0
    };
    if !texture.linear {
        return texel(p.x.floor(), p.y.floor());
    }
    let low = (p - 0.5).floor();
    let f = p - 0.5 - low;
    let upper = texel(low.x, low.y) * (1.0 - f.x) + texel(low.x + 1.0, low.y) * f.x;
    let lower = texel(low.x, low.y + 1.0) * (1.0 - f.x) + texel(low.x + 1.0, low.y + 1.0) * f.x;
    upper * (1.0 - f.y) + lower * f.y
}

fn wrapped(index: i64, size: u32, wrap: Wrap) -> usize {
    let size = i64::from(size);
    let inside = match wrap {
        Wrap::Repeat => index.rem_euclid(size),
        Wrap::Mirror => {
            let there_and_back = index.rem_euclid(2 * size);
            if there_and_back >= size {
                2 * size - 1 - there_and_back
            } else {
                there_and_back
            }
        }
        Wrap::Clamp => index.clamp(0, size - 1),
    };
    inside as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrap_modes() {
        let row = |wrap| (-5..7).map(|i| wrapped(i, 3, wrap)).collect::<Vec<_>>();
        assert_eq!(row(Wrap::Repeat), [1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0]);
        assert_eq!(row(Wrap::Mirror), [1, 2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0]);
        assert_eq!(row(Wrap::Clamp), [0, 0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2]);
    }
}
