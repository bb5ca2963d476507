//! The messages of both directions.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::{ClientTime, Epoch, EyeView, FrameId, Method, Pose, ServerTime, Update, ViewSeq};

/// The secret that the server printed; whoever knows it may connect.
#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Secret(pub [u8; 16]);

impl std::fmt::Debug for Secret {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Secret(..)")
    }
}

impl Secret {
    /// Compares without telling by its duration where the two differ.
    #[must_use]
    pub fn matches(&self, other: &Self) -> bool {
        self.0
            .iter()
            .zip(other.0)
            .fold(0, |difference, (a, b)| difference | (a ^ b))
            == 0
    }
}

/// A video codec that a client decodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Codec {
    /// H.264, 4:2:0, 8 bits, limited-range BT.709, annex B byte stream.
    H264,
}

/// The first message of a client.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hello {
    /// Proves that the client was started with the server's line.
    pub secret: Secret,
    /// Largest atlas side that the client's decoder and GPU take, texels.
    pub max_atlas_side: u16,
    /// What the client decodes, best first.
    pub codecs: Vec<Codec>,
}

/// The server's answer to a [`Hello`] that it accepts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Welcome {
    /// What the pictures are encoded with.
    pub codec: Codec,
    /// How patches are placed in the atlas.
    pub method: Method,
    /// Width and height of the atlas, texels.
    pub atlas_size: [u16; 2],
    /// Side of a superblock, texels: no block is larger.
    pub superblock: u16,
    /// Where the middle of the play space stands in the scene: floor level,
    /// facing -Z.
    pub world_from_play: Pose,
    /// What is seen where no geometry is.
    pub sky: Sky,
}

/// The tone-mapped surroundings as a latitude-longitude picture.
///
/// Row 0 is the zenith, the middle column looks along -Z, columns run towards +X.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sky {
    /// Width in pixels, at most 256.
    pub width: u16,
    /// Height in pixels, at most 128.
    pub height: u16,
    /// sRGB, three bytes a pixel, row by row.
    pub rgb: Vec<u8>,
}

/// Why a server refuses a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
pub enum Refusal {
    /// The secret is wrong.
    #[error("the secret is wrong: start the client with the line that the server prints")]
    Secret,
    /// The client speaks another version of the protocol.
    #[error("the server speaks protocol version {0}")]
    Version(u16),
    /// No common codec, or the atlas is too large for the client.
    #[error("the client cannot decode what the server encodes")]
    Capabilities,
    /// The server serves one client at a time.
    #[error("another client is connected")]
    Busy,
}

/// Why a client asks for an atlas reset with an IDR picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ResetReason {
    /// A picture did not decode.
    Decoder,
    /// A picture or an update is missing.
    Gap,
}

/// One controller.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hand {
    /// Where it is in the world of the scene; it points along -Z.
    pub world_from_aim: Pose,
    /// Whether its button is held down.
    pub pressed: bool,
    /// How often the button was pressed so far; wraps. A count, so that a report
    /// that is lost loses no press.
    pub presses: u16,
}

/// Where the client's head is and will be, and what its hands do.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ViewReport {
    /// Counts the reports.
    pub seq: ViewSeq,
    /// When the pose was sampled; also the client's half of a clock sample.
    pub sampled_at: ClientTime,
    /// When the light of this pose is expected to leave the display.
    pub display_at: ClientTime,
    /// The head in the world of the scene.
    pub world_from_head: Pose,
    /// m/s in the world.
    pub linear_velocity: Vec3,
    /// rad/s about world axes.
    pub angular_velocity: Vec3,
    /// Left and right eye.
    pub eyes: [EyeView; 2],
    /// Pixels of one eye's picture, width and height.
    pub eye_resolution: [u16; 2],
    /// Left and right controller; none for one that is not there.
    pub hands: [Option<Hand>; 2],
}

/// The server's half of a clock sample, sent at once for every view report.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClockReply {
    /// `sampled_at` of the report that is answered.
    pub client_sent: ClientTime,
    /// When the report arrived.
    pub server_received: ServerTime,
    /// When this reply left.
    pub server_sent: ServerTime,
}

/// Tells the server what became of an update.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Acknowledgement {
    /// The frame that was first drawn just now.
    pub frame: FrameId,
    /// From the sampling of the pose that the frame answers to the end of
    /// drawing it, nanoseconds.
    pub motion_to_photon: u64,
}

/// One encoded picture of the atlas.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Picture {
    /// Pairs it with its update.
    pub frame: FrameId,
    /// The placement that it shows.
    pub epoch: Epoch,
    /// True when it needs no picture before it.
    pub idr: bool,
    /// One access unit.
    pub bytes: Vec<u8>,
}

/// What a client says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[expect(
    clippy::large_enum_variant,
    reason = "views are most of what is said, and a box each would be an allocation each"
)]
pub enum ToServer {
    /// First message of a session.
    Hello(Hello),
    /// Where the head is.
    View(ViewReport),
    /// What became of an update.
    Acknowledge(Acknowledgement),
    /// Asks for an atlas reset with an IDR picture.
    RequestReset(ResetReason),
    /// The client leaves.
    Bye,
}

/// What a server says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum ToClient {
    /// The session begins.
    Welcome(Welcome),
    /// The session does not begin.
    Refused(Refusal),
    /// Half of a clock sample.
    Clock(ClockReply),
    /// Geometry and placement of a frame.
    Update(Update),
    /// The atlas of a frame.
    Picture(Picture),
    /// The server ends the session.
    Bye,
}
