//! Pictures of the codec as images that Vulkan samples: what they are called there,
//! and what holds them.

use std::any::Any;
use std::sync::Arc;

use shadecast_client::render::foreign::{
    BufferParts, ConvertError, HardwareBuffers, ImageSource, SourceImage,
};

use crate::codec::HeldImage;

/// Pictures of a [`Codec`](crate::codec::Codec), on one device.
#[derive(Debug)]
pub(crate) struct Images(pub(crate) HardwareBuffers);

impl ImageSource for Images {
    fn image(
        &mut self,
        picture: &(dyn Any + Send + Sync),
    ) -> Result<Arc<SourceImage>, ConvertError> {
        let held = picture
            .downcast_ref::<HeldImage>()
            .ok_or_else(|| ConvertError::Picture("a picture of no codec of this device".into()))?;
        let buffer = held
            .buffer()
            .map_err(|error| ConvertError::Picture(format!("a picture has no buffer: {error}")))?;
        let description = buffer.describe();
        let parts = BufferParts {
            buffer: buffer.as_ptr().cast(),
            size: [description.width, description.height],
        };
        // SAFETY: the picture holds the buffer, and then a reference of its own does.
        unsafe {
            self.0.image(parts, || {
                Box::new(Held {
                    _buffer: buffer.acquire(),
                })
            })
        }
    }
}

/// A reference to a buffer.
struct Held {
    _buffer: ndk::hardware_buffer::HardwareBufferRef,
}

// SAFETY: references to buffers are counted atomically, and may be given up on
// any thread.
unsafe impl Send for Held {}
