//! What the drawing thread needs of the world, whole and immutable.
//!
//! The network side builds a new [`ClientFrame`] for every picture that has
//! met its update; the drawing side switches to the newest one between two
//! display frames and never waits for it (SAS 2018, sections 3.5 and 3.6).

use std::any::Any;
use std::fmt;
use std::sync::Arc;

use shadecast_protocol::{ClientTime, Epoch, FrameId, Motion, Pose, UpdateTiming};

/// A corner of a triangle as the vertex shader reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct DrawVertex {
    /// Metres, in the space of its object.
    pub position: [f32; 3],
    /// Index into [`ClientFrame::motions`].
    pub object: u32,
    /// Atlas position in texels, homogeneous; texel centres lie at halves. The last is
    /// 1 but in the slots of foreshortened triangles.
    pub texel: [f32; 3],
}

/// A decoded 4:2:0 picture, limited-range BT.709, planes without padding.
#[derive(Clone, PartialEq, Eq)]
pub struct YuvPicture {
    /// In texels, even.
    pub width: u32,
    /// In texels, even.
    pub height: u32,
    /// `width * height` bytes.
    pub y: Vec<u8>,
    /// `width * height / 4` bytes.
    pub u: Vec<u8>,
    /// `width * height / 4` bytes.
    pub v: Vec<u8>,
}

impl fmt::Debug for YuvPicture {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("YuvPicture")
            .field("width", &self.width)
            .field("height", &self.height)
            .finish_non_exhaustive()
    }
}

/// A decoded picture, wherever the decoder left it.
#[derive(Clone, Debug)]
pub enum DecodedPicture {
    /// In memory, as software decoders do.
    Planes(Arc<YuvPicture>),
    /// In a buffer of the platform, as hardware decoders do.
    Foreign(ForeignPicture),
}

/// A picture that only the platform can reach. What draws knows the type of the
/// image; everything between decoder and GPU passes it on unseen, and the last
/// one to let go of it gives the buffer back to the decoder.
#[derive(Clone, Debug)]
pub struct ForeignPicture {
    /// Width and height, texels.
    pub size: [u32; 2],
    /// The buffer.
    pub image: Arc<dyn Any + Send + Sync>,
}

impl DecodedPicture {
    /// Width and height, texels.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        match self {
            Self::Planes(picture) => [picture.width, picture.height],
            Self::Foreign(picture) => picture.size,
        }
    }

    /// The picture, where it lies in memory.
    #[must_use]
    pub fn planes(&self) -> Option<&YuvPicture> {
        match self {
            Self::Planes(picture) => Some(picture),
            Self::Foreign(_) => None,
        }
    }
}

impl From<YuvPicture> for DecodedPicture {
    fn from(picture: YuvPicture) -> Self {
        Self::Planes(Arc::new(picture))
    }
}

/// Pictures in memory are compared by content, others by identity.
impl PartialEq for DecodedPicture {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Planes(a), Self::Planes(b)) => a == b,
            (Self::Foreign(a), Self::Foreign(b)) => Arc::ptr_eq(&a.image, &b.image),
            (Self::Planes(_), Self::Foreign(_)) | (Self::Foreign(_), Self::Planes(_)) => false,
        }
    }
}

/// Where an alpha-masked patch is there: one byte a texel of the atlas, 255 or
/// 0; 255 wherever no mask says otherwise.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MaskAtlas {
    /// In texels.
    pub width: u32,
    /// In texels.
    pub height: u32,
    /// `width * height` bytes.
    pub coverage: Vec<u8>,
}

/// When this end did what with a frame, nanoseconds on the client's clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClientTiming {
    /// When the later of picture and update arrived.
    pub received: u64,
    /// When the picture was decoded and the update applied.
    pub decoded: u64,
    /// Nanoseconds to add to a server time to get a client time.
    pub client_minus_server: i64,
}

/// A picture and the geometry that it belongs to.
#[derive(Clone, Debug)]
pub struct ClientFrame {
    /// Its name.
    pub frame: FrameId,
    /// The placement it shows.
    pub epoch: Epoch,
    /// The pose of the head that the server made it for.
    pub world_from_head: Pose,
    /// The scene's own time when the server began it, nanoseconds.
    pub scene_time: u64,
    /// The server's share of the latency.
    pub server_timing: UpdateTiming,
    /// This end's share.
    pub timing: ClientTiming,
    /// All corners of all placed patches.
    pub vertices: Arc<Vec<DrawVertex>>,
    /// Counter-clockwise triangles; double-sided ones appear in both windings.
    pub indices: Arc<Vec<u32>>,
    /// How many of the indices, from the first on, need no mask.
    pub opaque_indices: u32,
    /// Whether a triangle's texels are unevenly spaced on it, so that a lookup must divide.
    pub foreshortened: bool,
    /// How long after `scene_time` the objects are where `motions` says, nanoseconds.
    pub objects_lead: u64,
    /// `world_from_object` of every object; index 0 is the identity.
    pub motions: Arc<Vec<Motion>>,
    /// The shading.
    pub picture: DecodedPicture,
    /// Present only where a placed patch is alpha-masked.
    pub masks: Option<Arc<MaskAtlas>>,
    /// Patches placed.
    pub patches: u32,
}

/// Longest time that a motion is believed to go on, seconds: a few updates. An
/// object of which nothing more is heard then stops instead of flying away.
const LONGEST_MOTION: f64 = 0.5;

impl ClientFrame {
    /// The scene's own time at a time of this end, seconds.
    #[must_use]
    pub fn scene_seconds(&self, at: ClientTime) -> f64 {
        self.scene_time as f64 * 1e-9 + self.seconds_since_start(at)
    }

    /// For how long the objects have moved on, at that time, from where
    /// `motions` has them; negative before. Half a second at most.
    #[must_use]
    pub fn seconds_of_motion(&self, at: ClientTime) -> f32 {
        let seconds = self.seconds_since_start(at) - self.objects_lead as f64 * 1e-9;
        seconds.clamp(-LONGEST_MOTION, LONGEST_MOTION) as f32
    }

    /// Since the server began the frame.
    fn seconds_since_start(&self, at: ClientTime) -> f64 {
        let started =
            i128::from(self.server_timing.started.0) + i128::from(self.timing.client_minus_server);
        (i128::from(at.0) - started) as f64 * 1e-9
    }
}
