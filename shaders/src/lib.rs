//! The GPU kernels of shadecast: WGSL source, the host struct of every GPU
//! record, and the plain CPU twin of what can be said plainly.
//!
//! A kernel is a pair of files with one stem, `foo.wgsl` and `foo.rs`. Sources
//! are joined as text; what varies is an `override` constant. A test holds the
//! layout of every host struct against naga's, so that the two cannot drift.

pub mod atlas;
pub mod light;
pub mod picture;
pub mod snake;
pub mod tss;
pub mod visibility;

#[cfg(test)]
mod layout;
