//! Pictures that a platform's decoder left on the GPU become the atlas.
//!
//! Such a picture is a Vulkan image that wgpu does not know and that only a
//! sampler of its own kind can read. [`ImageSource`] makes the image known to
//! Vulkan; one pass draws it into an RGBA8 texture of wgpu, once for each
//! picture; from there on nothing tells it from any other atlas. So a display
//! pixel never pays for YCbCr, and the sampler that converts is used in one
//! place.
//!
//! There are three such textures, used in turn, so that a conversion need not
//! wait for the drawing that still reads the one before. A picture goes back to
//! its decoder when the GPU is done with it.

mod device;
mod hardware_buffer;
mod image;
mod pass;
mod pipeline;
mod ring;
mod sampler;
#[cfg(test)]
mod tests;

use std::any::Any;
use std::collections::VecDeque;
use std::fmt::Debug;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use ash::vk;
use thiserror::Error;

use crate::ForeignPicture;
use pass::Pass;
use pipeline::Pipeline;
use ring::{RING, Ring};

pub use device::RawDevice;
pub use hardware_buffer::{BufferParts, HardwareBuffers};
pub use image::{ImageParts, SourceImage};
pub use sampler::{PictureKind, SourceSampler};

/// Makes Vulkan images of pictures of the platform.
pub trait ImageSource: Debug + Send {
    /// The image of a picture, on the device that the source was made for. It
    /// may be one that was made before, as long as it shows the picture.
    ///
    /// # Errors
    /// The picture is of another platform, or Vulkan does not take it.
    fn image(
        &mut self,
        picture: &(dyn Any + Send + Sync),
    ) -> Result<Arc<SourceImage>, ConvertError>;
}

/// Why a picture of the platform did not become RGBA.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum ConvertError {
    /// wgpu draws by something else.
    #[error("pictures of the platform's decoder can only be reached with Vulkan")]
    NotVulkan,
    /// What Vulkan said.
    #[error("cannot {action}: {error}")]
    Vulkan {
        /// What was tried.
        action: &'static str,
        /// The driver's answer.
        error: vk::Result,
    },
    /// The picture is not what it should be.
    #[error("{0}")]
    Picture(String),
}

impl ConvertError {
    /// For `map_err`.
    pub fn when(action: &'static str) -> impl Fn(vk::Result) -> Self {
        move |error| Self::Vulkan { action, error }
    }
}

/// Converts pictures of one device.
#[derive(Debug)]
pub(super) struct Converter {
    /// With the GPU, oldest first; none when this is dropped.
    pending: VecDeque<Pending>,
    ring: Option<Ring>,
    pipeline: Option<Pipeline>,
    pass: Pass,
    images: Box<dyn ImageSource>,
    device: Arc<RawDevice>,
}

/// A conversion that the GPU may not have done yet.
#[derive(Debug)]
struct Pending {
    submission: wgpu::SubmissionIndex,
    done: Arc<AtomicBool>,
    _image: Arc<SourceImage>,
    /// Gives the buffer back to the decoder when it is dropped.
    _picture: ForeignPicture,
}

impl Converter {
    pub(super) fn new(
        device: &wgpu::Device,
        images: Box<dyn ImageSource>,
    ) -> Result<Self, ConvertError> {
        let device = RawDevice::of(device)?;
        Ok(Self {
            pending: VecDeque::new(),
            ring: None,
            pipeline: None,
            pass: Pass::new(&device)?,
            images,
            device,
        })
    }

    /// Submits the conversion of a picture; the texture shows it to whatever is
    /// submitted later, until three more have been converted.
    pub(super) fn convert(
        &mut self,
        queue: &wgpu::Queue,
        picture: &ForeignPicture,
    ) -> Result<wgpu::Texture, ConvertError> {
        self.let_go();
        let image = self.images.image(&*picture.image)?;
        let [width, height] = picture.size;
        if width == 0 || height == 0 || width > image.size()[0] || height > image.size()[1] {
            let [inner, outer] = [picture.size, image.size()].map(|[w, h]| format!("{w}x{h}"));
            let message = format!("a picture of {inner} texels cannot lie in a buffer of {outer}");
            return Err(ConvertError::Picture(message));
        }
        self.prepare(queue, &image, picture.size)?;
        let (Some(pipeline), Some(ring)) = (&self.pipeline, &mut self.ring) else {
            return Err(ConvertError::NotVulkan);
        };

        let slot = ring.next();
        let target = ring.target(slot);
        let mut states = self.device.encoder();
        // Emits nothing, unless something else than drawing used the texture.
        states.transition_resources(
            std::iter::empty(),
            std::iter::once(wgpu::wgt::TextureTransition {
                texture: target.texture(),
                selector: None,
                state: wgpu::wgt::TextureUses::RESOURCE,
            }),
        );
        let mut encoder = self.device.encoder();
        // SAFETY: nothing but the pass is recorded into this encoder; the target
        // is in the layout of a sampled texture and is left in it; all that the
        // pass uses lives until its submission is done (`Pending`, `clear`).
        unsafe {
            self.pass
                .record(&mut encoder, pipeline, slot, &image, target)
        }?;
        let texture = target.texture().clone();
        let submission = queue.submit([states.finish(), encoder.finish()]);
        let done = Arc::new(AtomicBool::new(false));
        let tell = Arc::clone(&done);
        queue.on_submitted_work_done(move || tell.store(true, Ordering::Release));
        self.pending.push_back(Pending {
            submission,
            done,
            _image: image,
            _picture: picture.clone(),
        });
        Ok(texture)
    }

    /// Sees to it that pipeline, textures and a place in the ring are there.
    fn prepare(
        &mut self,
        queue: &wgpu::Queue,
        image: &SourceImage,
        size: [u32; 2],
    ) -> Result<(), ConvertError> {
        let sampler = image.sampler();
        if !self
            .pipeline
            .as_ref()
            .is_some_and(|now| now.is_for(sampler))
        {
            self.wait_until_pending(0);
            self.pipeline = Some(self.pass.pipeline(sampler)?);
        }
        if self.ring.as_ref().is_none_or(|ring| ring.size() != size) {
            self.wait_until_pending(0);
            self.ring = Some(self.pass.ring(&self.device, queue, size)?);
        }
        // The descriptors of a place are its own.
        self.wait_until_pending(RING - 1);
        Ok(())
    }

    /// Lets go of what the GPU is done with.
    fn let_go(&mut self) {
        while self
            .pending
            .pop_front_if(|oldest| oldest.done.load(Ordering::Acquire))
            .is_some()
        {}
    }

    /// Waits for the GPU until it has that many conversions at most.
    fn wait_until_pending(&mut self, most: usize) {
        while self.pending.len() > most {
            if let Some(oldest) = self.pending.pop_front() {
                self.device.wait_for(oldest.submission);
            }
        }
    }
}

impl Drop for Converter {
    fn drop(&mut self) {
        self.wait_until_pending(0);
    }
}
