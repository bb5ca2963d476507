//! Host structs of `path.wgsl` and `trace.wgsl`.

use bytemuck::{Pod, Zeroable};

/// One dispatch's worth of paths.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Wave {
    /// Paths in the wave.
    pub path_count: u32,
    /// Index of the wave's first job.
    pub first_job: u32,
    /// 1 where rays onwards do not see single-sided triangles from behind.
    pub cull: u32,
    /// Times that the wave's rays were traced before.
    pub step: u32,
}

/// Bytes of the three rays of a path.
pub const RAY_BYTES: u64 = 3 * 32;
/// Bytes of their hits.
pub const HIT_BYTES: u64 = 3 * 16;
/// Bytes of a path's state.
pub const STATE_BYTES: u64 = 128;
