//! MediaCodec as a codec of the platform: units go in under their stamps as
//! presentation times, pictures come out of an ImageReader's queue, where they
//! stay on the GPU, or are copied from where the processor reads them. Nothing here
//! waits, but for the moment in which a picture that was announced is finished.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Duration;

use ndk::hardware_buffer::{HardwareBuffer, HardwareBufferUsage};
use ndk::media::image_reader::{AcquireResult, Image, ImageFormat, ImageReader};
use ndk::media::media_codec::{
    DequeuedInputBufferResult, DequeuedOutputBufferInfoResult, MediaCodec, MediaCodecDirection,
};
use ndk::media::media_format::MediaFormat;
use ndk::media_error::MediaError;
use shadecast_client::{
    DecodeError, DecodedPicture, ForeignPicture, PlatformCodec, StridedPlane, YuvPicture,
};

const H264: &str = "video/avc";

/// Pictures that the client may hold: one or two that wait for their updates, three
/// between network and drawing, the one that is drawn, and up to three that the
/// GPU still converts. The codec waits while more are held, and some codecs
/// allocate as many buffers beforehand.
const MOST_PICTURES: i32 = 9;

/// Between the presentation times of two stamps, microseconds: about what they
/// would be, because some codecs guess the rate of the stream from them.
const STEP: u64 = 33_333;

/// `BUFFER_FLAG_KEY_FRAME`.
const KEY_FRAME: u32 = 1;

/// A running decoder.
#[derive(Debug)]
pub(crate) struct Codec {
    codec: MediaCodec,
    reader: Arc<Reader>,
    is_in_memory: bool,
}

/// A queue of pictures. Deleting it takes back all its pictures, so that each
/// of them holds it.
#[derive(Debug)]
struct Reader(ImageReader);

/// A picture in a buffer of the codec, which it gets back when this is dropped.
#[derive(Debug)]
pub(crate) struct HeldImage {
    // Before its reader.
    image: Image,
    _reader: Arc<Reader>,
}

// SAFETY: the NDK's media objects may be used and deleted on any thread. Of a
// reader and of an image only functions are called that take a lock inside.
unsafe impl Send for Codec {}
unsafe impl Send for Reader {}
unsafe impl Sync for Reader {}
unsafe impl Send for HeldImage {}
unsafe impl Sync for HeldImage {}

impl HeldImage {
    /// The buffer; valid as long as this.
    pub(crate) fn buffer(&self) -> Result<HardwareBuffer, MediaError> {
        self.image.hardware_buffer()
    }
}

impl Codec {
    /// Starts a decoder of H.264 for pictures of a width and a height, which stay on
    /// the GPU or come through memory.
    pub(crate) fn open(size: [u16; 2], is_in_memory: bool) -> Result<Self, DecodeError> {
        let [width, height] = size.map(i32::from);
        let (format, usage) = if is_in_memory {
            let read = HardwareBufferUsage::CPU_READ_OFTEN;
            (ImageFormat::YUV_420_888, read)
        } else {
            let sampled = HardwareBufferUsage::GPU_SAMPLED_IMAGE;
            (ImageFormat::PRIVATE, sampled)
        };
        let reader = ImageReader::new_with_usage(width, height, format, usage, MOST_PICTURES)
            .map_err(unavailable("no queue for its pictures"))?;
        let started = start(&reader, [width, height], true).or_else(|error| {
            tracing::info!("the decoder does not start with low latency: {error}");
            start(&reader, [width, height], false)
        });
        let codec = started?;
        let name = codec.name().unwrap_or_default();
        tracing::info!("decoder {name} for {width}x{height} texels");
        Ok(Self {
            codec,
            reader: Arc::new(Reader(reader)),
            is_in_memory,
        })
    }

    /// Hands finished pictures from the codec to the reader's queue.
    fn forward(&self) -> Result<(), MediaError> {
        loop {
            match self.codec.dequeue_output_buffer(Duration::ZERO)? {
                DequeuedOutputBufferInfoResult::Buffer(buffer) => {
                    self.codec.release_output_buffer(buffer, true)?;
                }
                DequeuedOutputBufferInfoResult::TryAgainLater => return Ok(()),
                // The size is checked with every picture.
                DequeuedOutputBufferInfoResult::OutputFormatChanged
                | DequeuedOutputBufferInfoResult::OutputBuffersChanged => {}
            }
        }
    }

    fn picture(&self, image: Image) -> Result<(u64, DecodedPicture), DecodeError> {
        let (stamp, size) = stamp_and_size(&image).map_err(broken)?;
        if self.is_in_memory {
            let copied = copy(&image, size).map_err(broken)?;
            let message = "a plane is smaller than the picture";
            let picture = copied.ok_or_else(|| DecodeError::Refused(message.into()))?;
            return Ok((stamp, picture.into()));
        }
        let image = Arc::new(HeldImage {
            image,
            _reader: Arc::clone(&self.reader),
        });
        let picture = ForeignPicture { size, image };
        Ok((stamp, DecodedPicture::Foreign(picture)))
    }
}

fn stamp_and_size(image: &Image) -> Result<(u64, [u32; 2]), MediaError> {
    let nanoseconds = u64::try_from(image.timestamp()?).unwrap_or_default();
    // To the nearest, whatever the codec's own clock rounds to.
    let stamp = (nanoseconds / 1000 + STEP / 2) / STEP;
    let crop = image.crop_rect()?;
    let size = if crop.right > crop.left && crop.bottom > crop.top {
        // One that does not begin in the corner is no stream of ours; what it
        // shows is wrong then, and the size tells.
        [crop.right, crop.bottom]
    } else {
        [image.width()?, image.height()?]
    };
    Ok((
        stamp,
        size.map(|side| u32::try_from(side).unwrap_or_default()),
    ))
}

/// The picture in a buffer that the processor reads.
fn copy(image: &Image, size: [u32; 2]) -> Result<Option<YuvPicture>, MediaError> {
    let plane = |index| -> Result<StridedPlane<'_>, MediaError> {
        Ok(StridedPlane {
            bytes: image.plane_data(index)?,
            // What is negative is larger than any plane.
            row_stride: image.plane_row_stride(index)? as usize,
            texel_stride: image.plane_pixel_stride(index)? as usize,
        })
    };
    Ok(YuvPicture::of_planes(
        size,
        [plane(0)?, plane(1)?, plane(2)?],
    ))
}

fn start(
    reader: &ImageReader,
    [width, height]: [i32; 2],
    low_latency: bool,
) -> Result<MediaCodec, DecodeError> {
    let codec = MediaCodec::from_decoder_type(H264)
        .ok_or_else(|| DecodeError::Unavailable("this device has none for H.264".into()))?;
    let mut format = MediaFormat::new();
    format.set_str("mime", H264);
    format.set_i32("width", width);
    format.set_i32("height", height);
    // A picture never takes more bytes than its texels.
    format.set_i32("max-input-size", width.saturating_mul(height).max(1 << 16));
    // BT.709 in limited range: every stream of a shadecast server.
    format.set_i32("color-standard", 1);
    format.set_i32("color-range", 2);
    format.set_i32("color-transfer", 3);
    if low_latency {
        // Real time; then what Android 11 asks by, and what older decoders do.
        format.set_i32("priority", 0);
        format.set_i32("low-latency", 1);
        format.set_i32("vendor.qti-ext-dec-low-latency.enable", 1);
        format.set_i32("vendor.qti-ext-dec-picture-order.enable", 1);
    }
    let window = reader
        .window()
        .map_err(unavailable("no queue for its pictures"))?;
    codec
        .configure(&format, Some(&window), MediaCodecDirection::Decoder)
        .map_err(unavailable("it takes no such pictures"))?;
    codec.start().map_err(unavailable("it does not start"))?;
    Ok(codec)
}

fn unavailable(what: &'static str) -> impl Fn(MediaError) -> DecodeError {
    move |error| DecodeError::Unavailable(format!("{what} ({error})"))
}

fn broken(error: MediaError) -> DecodeError {
    DecodeError::Refused(format!("the decoder broke ({error})"))
}

impl PlatformCodec for Codec {
    fn queue(&mut self, unit: &[u8], stamp: u64, starts: bool) -> Result<bool, DecodeError> {
        let dequeued = self.codec.dequeue_input_buffer(Duration::ZERO);
        let mut buffer = match dequeued.map_err(broken)? {
            DequeuedInputBufferResult::Buffer(buffer) => buffer,
            DequeuedInputBufferResult::TryAgainLater => return Ok(false),
        };
        // A codec that breaks at this very moment has no bytes, and ndk panics.
        let room = catch_unwind(AssertUnwindSafe(|| buffer.buffer_mut().len()))
            .map_err(|_| DecodeError::Refused("the decoder broke".into()))?;
        let length = unit.len();
        if length > room {
            let message = format!("a picture of {length} bytes does not fit into {room}");
            return Err(DecodeError::Refused(message));
        }
        buffer.buffer_mut()[..length].write_copy_of_slice(unit);
        let flags = if starts { KEY_FRAME } else { 0 };
        self.codec
            .queue_input_buffer(buffer, 0, length, stamp * STEP, flags)
            .map_err(broken)?;
        Ok(true)
    }

    fn take(&mut self) -> Result<Option<(u64, DecodedPicture)>, DecodeError> {
        self.forward().map_err(broken)?;
        match self.reader.0.acquire_next_image().map_err(broken)? {
            AcquireResult::Image(image) => self.picture(image).map(Some),
            // Those that are held come back, and the codec waits meanwhile.
            AcquireResult::NoBufferAvailable | AcquireResult::MaxImagesAcquired => Ok(None),
        }
    }

    fn flush(&mut self) -> Result<(), DecodeError> {
        self.codec.flush().map_err(broken)
    }
}
