//! Why there is no headset to draw for, in sentences for its user.

use ::openxr as xr;
use thiserror::Error;

use crate::render::UploadError;
use crate::render::vulkan::VulkanError;

/// Why the headset cannot be used.
#[derive(Debug, Error)]
pub enum HeadsetError {
    /// The library that finds runtimes is not installed.
    #[error(
        "there is no OpenXR loader: install libopenxr-loader1, or the software of the headset ({0})"
    )]
    NoLoader(String),
    /// The loader found no runtime.
    #[error(
        "no OpenXR runtime is active: start the software of the headset, or name its manifest in XR_RUNTIME_JSON ({0})"
    )]
    NoRuntime(xr::sys::Result),
    /// The runtime draws with other APIs only.
    #[error("the OpenXR runtime does not draw with Vulkan: it lacks XR_KHR_vulkan_enable2")]
    NoVulkan,
    /// The runtime is of another major version.
    #[error("the OpenXR runtime does not speak OpenXR 1.0, which this client is written for")]
    ApiVersion,
    /// The runtime asks for a newer Vulkan than the renderer is written for.
    #[error(
        "the OpenXR runtime asks for Vulkan {}.{} or newer, and this client draws with at most 1.3",
        .0.major(), .0.minor()
    )]
    VulkanVersion(xr::Version),
    /// The runtime runs, and no headset is there.
    #[error("no headset is connected: the OpenXR runtime has none to show pictures on ({0})")]
    NoHeadset(xr::sys::Result),
    /// Not a headset for two eyes.
    #[error("the headset shows {0} views, and this client draws two")]
    Views(usize),
    /// Pictures of a size that no device makes.
    #[error("the OpenXR runtime asks for pictures of {0}x{1} pixels, which is not possible")]
    Size(u32, u32),
    /// None of the formats that the renderer draws.
    #[error(
        "the OpenXR runtime takes no 8-bit sRGB pictures, which this client draws; it offers the Vulkan formats {0:?}"
    )]
    Format(Vec<i64>),
    /// No device.
    #[error(transparent)]
    Gpu(#[from] VulkanError),
    /// The device cannot hold a frame.
    #[error(transparent)]
    Upload(#[from] UploadError),
    /// The runtime refused something that it has to do.
    #[error("the OpenXR runtime {what}: {result}")]
    Refused {
        /// What it did not do.
        what: &'static str,
        /// In its own words.
        result: xr::sys::Result,
    },
}

impl HeadsetError {
    /// Whether there is no headset at all, so that pictures may be shown elsewhere.
    #[must_use]
    pub fn is_absence(&self) -> bool {
        matches!(
            self,
            Self::NoLoader(_) | Self::NoRuntime(_) | Self::NoHeadset(_)
        )
    }

    /// Whether the session, the instance or the headset is gone and may come
    /// back.
    #[must_use]
    pub fn is_loss(&self) -> bool {
        use xr::sys::Result as R;
        match self {
            Self::Refused { result, .. } => matches!(
                *result,
                R::ERROR_SESSION_LOST
                    | R::ERROR_INSTANCE_LOST
                    | R::ERROR_FORM_FACTOR_UNAVAILABLE
                    | R::ERROR_RUNTIME_UNAVAILABLE
                    | R::SESSION_LOSS_PENDING
            ),
            Self::NoHeadset(result) => *result == R::ERROR_FORM_FACTOR_UNAVAILABLE,
            Self::NoRuntime(_) => true,
            _ => false,
        }
    }
}

/// Names what the runtime did not do.
pub(super) fn refused(what: &'static str) -> impl Fn(xr::sys::Result) -> HeadsetError {
    move |result| HeadsetError::Refused { what, result }
}
