//! How far a streamed picture is from the picture that it should have been, and
//! what it costs to come near.
//!
//! The metrics of the field; the demo, which is a server and a client over
//! loopback with path-traced references at the poses at which the client drew;
//! and measurements of the light alone. Nothing here is needed to run the product.

pub mod convergence;
pub mod demo;
pub mod leave_out;
mod metrics;
mod ours;
pub mod packing;
mod progress;
mod reference;
mod report;
mod scenes;
pub mod sequence;
pub mod speed;
pub mod stress;
pub mod svgf;
pub mod visibility;

/// Where figures go unless told otherwise; their files have the commands' names.
pub(crate) const OUT: &str = "eval-out";

pub use metrics::{
    FlipMap, MetricError, flip, mean_squared_error, psnr, psnr_from_mean_squared_error, relmse,
    rmse, ssim,
};
