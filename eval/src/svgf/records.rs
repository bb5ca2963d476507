//! Host side of `records.wgsl`: the view of a frame, and what is stored of each pixel.

use bytemuck::{Pod, Zeroable};
use shadecast_server::{Gpu, GpuError};
use wgpu::Buffer;

pub(super) const HIT_BYTES: u64 = 16;
pub(super) const SEEN_BYTES: u64 = 32;
pub(super) const GUIDE_BYTES: u64 = 32;
pub(super) const COAT_BYTES: u64 = 48;
pub(super) const LIGHT_BYTES: u64 = 32;
pub(super) const MOMENTS_BYTES: u64 = 24;
const PICTURE_BYTES: u64 = 16;
/// Bytes of what the sun brings a path.
const SUN_BYTES: u64 = 16;
/// Instances that a triangle's last word can name, and bytes of the pose of each.
pub(super) const MOST_INSTANCES: u32 = 1 << 12;
const POSE_BYTES: u64 = 48;

/// The cameras of a frame and of the one before.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(super) struct View {
    pub(super) world_from_eye: [[f32; 4]; 3],
    pub(super) eye_from_world_before: [[f32; 4]; 3],
    pub(super) tangents: [f32; 4],
    pub(super) tangents_before: [f32; 4],
    pub(super) size: [u32; 2],
    pub(super) jitter: [f32; 2],
    pub(super) sample_index: u32,
    pub(super) seed: u32,
    pub(super) samples: u32,
    pub(super) age: u32,
}

/// What a frame writes and the next one reads.
#[derive(Debug)]
pub(super) struct Kept {
    pub(super) now: Buffer,
    pub(super) before: Buffer,
}

/// A record a pixel in each, but for `view`, `suns` and `poses_before`.
#[derive(Debug)]
pub(super) struct Records {
    pub(super) view: Buffer,
    pub(super) primary: Buffer,
    pub(super) seen: Kept,
    pub(super) guides: Buffer,
    pub(super) coats: Buffer,
    /// What paths brought in this frame.
    pub(super) fresh: Buffer,
    /// What the first iteration of the frame before made.
    pub(super) history: Buffer,
    /// What iterations read and write in turn.
    pub(super) light: [Buffer; 2],
    pub(super) moments: Kept,
    pub(super) picture: Kept,
    pub(super) suns: Buffer,
    pub(super) poses_before: Buffer,
}

impl Records {
    /// For this many pixels, and paths at a time.
    pub(super) fn new(gpu: &Gpu, pixels: u64, paths: u64) -> Result<Self, GpuError> {
        let kept = |what, bytes| {
            Ok(Kept {
                now: gpu.scratch(what, pixels * bytes)?,
                before: gpu.scratch(what, pixels * bytes)?,
            })
        };
        let light = || gpu.scratch("filtered light", pixels * LIGHT_BYTES);
        Ok(Self {
            view: gpu.uniform("view", size_of::<View>()),
            primary: gpu.scratch("primary hits", pixels * HIT_BYTES)?,
            seen: kept("seen points", SEEN_BYTES)?,
            guides: gpu.scratch("guides", pixels * GUIDE_BYTES)?,
            coats: gpu.scratch("coats", pixels * COAT_BYTES)?,
            fresh: light()?,
            history: light()?,
            light: [light()?, light()?],
            moments: kept("moments", MOMENTS_BYTES)?,
            picture: kept("filtered pictures", PICTURE_BYTES)?,
            suns: gpu.scratch("sunlight", paths * SUN_BYTES)?,
            poses_before: gpu.scratch("poses", u64::from(MOST_INSTANCES) * POSE_BYTES)?,
        })
    }

    pub(super) fn kept(&self) -> [&Kept; 3] {
        [&self.seen, &self.moments, &self.picture]
    }
}
