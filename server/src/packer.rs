//! Who gives patches their slots in the atlas: one of the methods, by what the scene
//! was cut for.

pub(crate) mod passes;

use glam::Vec3;
use shadecast_protocol::Method;

use crate::{
    atlas::{Atlas, AtlasShape, Footprints, Placed},
    frame::FrameError,
    gpu::{Gpu, GpuError, GpuScene},
    patches::PatchedScene,
    snake::{Snake, SnakeFootprints, SnakeShape},
    tss::Tss,
};

/// A method at work.
#[derive(Debug)]
pub enum Packer {
    /// Blocks that stay, of the size that footprints ask for.
    Sas {
        /// What patches deserve.
        footprints: Footprints,
        /// Who has which block.
        atlas: Atlas,
    },
    /// Triangles, anew for every picture.
    Tss(Tss),
    /// Triangles by their shape, in slots that stay.
    Snake {
        /// What triangles deserve.
        footprints: SnakeFootprints,
        /// Who has which slot.
        snake: Snake,
    },
}

impl Packer {
    /// An empty atlas of `size` texels, which SAS cuts into superblocks. `pixels` will
    /// hold those that each patch covers in a frame, as words.
    ///
    /// # Errors
    /// When the atlas is impossible or does not fit the device.
    pub fn new(
        gpu: &Gpu,
        gpu_scene: &GpuScene,
        scene: &PatchedScene,
        size: [u16; 2],
        superblock: u16,
        pixels: &wgpu::Buffer,
    ) -> Result<Self, FrameError> {
        Ok(match scene.method {
            Method::Sas => {
                let shape = AtlasShape::new(size, superblock)?;
                let atlas = Atlas::new(gpu, shape, scene.patches.len() as u32, pixels)?;
                let footprints = Footprints::new(gpu, gpu_scene, scene, pixels, atlas.wishes())?;
                Self::Sas { footprints, atlas }
            }
            Method::Tss => Self::Tss(Tss::new(gpu, gpu_scene, scene, size, pixels)?),
            Method::Snake => {
                let shape = SnakeShape::new(size)?;
                let snake = Snake::new(gpu, shape, scene.patches.len() as u32, pixels)?;
                let footprints = SnakeFootprints::new(gpu, gpu_scene, scene, pixels, &snake)?;
                Self::Snake { footprints, snake }
            }
        })
    }

    /// Makes the next [`place`](Self::place) begin a new epoch.
    pub fn force_reset(&mut self) {
        match self {
            Self::Sas { atlas, .. } => atlas.force_reset(),
            Self::Tss(tss) => tss.force_reset(),
            Self::Snake { snake, .. } => snake.force_reset(),
        }
    }

    /// Gives every visible patch a slot. Submits what is recorded before; `eyes[n]` is
    /// the eye in the space of `ObjectId(n)`.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn place(
        &mut self,
        gpu: &Gpu,
        gpu_scene: &GpuScene,
        mut encoder: wgpu::CommandEncoder,
        eyes: &[Vec3],
        pixels_per_radian: f32,
    ) -> Result<Placed, GpuError> {
        match self {
            Self::Sas { footprints, atlas } => {
                footprints.record(gpu, &mut encoder, gpu_scene, eyes, pixels_per_radian);
                atlas.place(gpu, encoder)
            }
            Self::Tss(tss) => tss.place(gpu, gpu_scene, encoder, eyes, pixels_per_radian),
            Self::Snake { footprints, snake } => {
                footprints.record(gpu, &mut encoder, gpu_scene, eyes, pixels_per_radian);
                snake.place(gpu, encoder)
            }
        }
    }
}
