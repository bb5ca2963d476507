//! Draws the newest [`ClientFrame`](crate::ClientFrame) for two eyes, at any
//! pose, as often as the display asks.
//!
//! The geometry is real and only the shading is streamed: one draw call over
//! the triangles of all placed patches looks its colour up in the atlas (SAS
//! 2018, section 3.6). The pose is an argument of every draw, nothing here
//! reads a clock, and nothing waits for the network. What a frame does not
//! have (masks, moving objects, a sky, a lens) is not built, bound or drawn.

mod atlas;
mod backdrop;
mod cover;
mod eyes;
#[cfg(feature = "vulkan")]
pub mod foreign;
mod gpu;
mod handover;
mod lens;
mod mesh;
#[cfg(feature = "notice")]
mod notice;
mod optics;
mod pipelines;
mod planes;
mod readback;
mod renderer;
mod screen;
mod shrink;
mod sky;
#[cfg(test)]
mod tests;
#[cfg(all(feature = "vulkan", not(target_vendor = "apple")))]
pub mod vulkan;

#[cfg(all(feature = "openxr", not(target_vendor = "apple")))]
pub(crate) use eyes::NEAR;
pub use eyes::{EyeCamera, EyeImages};
pub use gpu::{Gpu, GpuError, Stereo};
pub use handover::{FrameReceiver, FrameSender, frame_channel};
pub use lens::{EyeLens, LensError, LensPass, LensProfile, Viewport};
pub use optics::{Eyes, Optics, OpticsError, PhoneScreen};
pub use readback::{Pixels, Readback, ReadbackError};
pub use renderer::{Renderer, RendererConfig, UploadError};
pub use screen::{Screen, ScreenError};
