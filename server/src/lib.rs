//! The shadecast server: from a scene on the workstation to encoded pictures
//! and updates for a headset.
//!
//! Read `frame.rs` first: one frame from top to bottom.

pub mod atlas;
pub mod encode;
mod frame;
mod gpu;
mod known;
mod light;
mod mask;
mod packer;
pub mod patches;
mod picture;
pub mod prediction;
pub mod scene;
mod session;
pub mod snake;
pub mod still;
mod tss;
mod visibility;

/// What kernels of other crates need to read the same scene and follow the same paths.
pub mod kernels {
    pub use crate::{
        gpu::{Binding, bind, layout, workgroups},
        light::{Ends, Paths, Repeats},
    };
}

pub use frame::{Frame, FrameError, FrameOrder, FrameStats, Pipeline, Stages};
pub use gpu::{Gpu, GpuError, GpuScene, Integrator};
pub use prediction::Prediction;
pub use session::{Hands, Input, Output, Session, SessionConfig};
pub use shadecast_shaders::picture::displayed as tone_map;
pub use visibility::{Recent, Visibility};
