//! How far a streamed picture is from the picture that it should have been.
//!
//! The metrics of the field on pictures of 8-bit sRGB, and beside them the
//! demo: a server and a client over loopback, path-traced references at the
//! poses at which the client drew, and a report. Nothing here is needed to run
//! the product.

pub mod demo;
mod metrics;

pub use metrics::{
    FlipMap, MetricError, flip, mean_squared_error, psnr, psnr_from_mean_squared_error, ssim,
};
