//! Path tracing at the texels of an atlas, or at the pixels of a camera.

mod atlas;
mod carry;
mod environment;
mod path;
mod sampler;
mod scene;
mod still;
mod triangle;

pub use atlas::{
    BlockRecord, LightParameters, PatchPoint, Quality, TILE_SIDE, patch_point, texel_coordinates,
};
pub use carry::{CarryParameters, Move, NO_BLOCK, TriangleMove, how};
pub use environment::EnvironmentCell;
pub use path::{HIT_BYTES, RAY_BYTES, STATE_BYTES, Wave};
pub use sampler::Sampler;
pub use scene::{
    BLENDED, Globals, Instance, LIGHT_LEAF, LightNode, LightRecord, Material, NO_TEXTURE,
    TextureRecord, rows_of_affine,
};
pub use still::StillParameters;
pub use triangle::{AtlasTriangle, TriangleRecord};

/// The scene's bindings and everything a path needs.
macro_rules! path_source {
    ($($entry:literal),*) => {
        concat!(
            include_str!("scene.wgsl"),
            include_str!("environment.wgsl"),
            include_str!("trace.wgsl"),
            include_str!("sampler.wgsl"),
            include_str!("bsdf.wgsl"),
            include_str!("lights.wgsl"),
            include_str!("path.wgsl"),
            $(include_str!($entry)),*
        )
    };
}

/// Kernels `trace_rays` and `count_rays`.
pub const TRACE_SOURCE: &str = concat!(include_str!("scene.wgsl"), include_str!("trace.wgsl"));
/// Kernel `advance`.
pub const ADVANCE_SOURCE: &str = path_source!();
/// Kernels `start_at_texels`, `measure_change`, `accumulate`, `measure_noise`, `smooth_slots` and
/// `fade_cells`, where slots are blocks.
pub const ATLAS_SOURCE: &str = path_source!(
    "block_slots.wgsl",
    "cells.wgsl",
    "atlas.wgsl",
    "change.wgsl",
    "noise.wgsl",
    "smooth.wgsl"
);
/// The same kernels where slots are triangles.
pub const ATLAS_OF_TRIANGLES_SOURCE: &str = path_source!(
    "triangle.wgsl",
    "triangle_slots.wgsl",
    "cells.wgsl",
    "atlas.wgsl",
    "change.wgsl",
    "noise.wgsl",
    "smooth.wgsl"
);
/// Kernels `start_at_pixels` and `add_to_pixels`.
pub const STILL_SOURCE: &str = path_source!("still.wgsl");
/// Cells of the hash in which light is shared with its surroundings.
pub const CELL_COUNT: u32 = 1 << 17;
/// Bytes of each.
pub const CELL_BYTES: u64 = 24;
/// Bytes of what is judged of a slot.
pub const JUDGEMENT_BYTES: u64 = 48;
/// Kernel `carry_blocks`.
pub const CARRY_SOURCE: &str = include_str!("carry.wgsl");
/// Functions on triangles in the atlas.
pub const TRIANGLE_SOURCE: &str = include_str!("triangle.wgsl");
/// Kernel `carry_triangles`.
pub const CARRY_TRIANGLES_SOURCE: &str = concat!(
    include_str!("triangle.wgsl"),
    include_str!("carry_triangles.wgsl")
);
