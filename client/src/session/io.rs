//! What goes into a session and what comes out.

use std::sync::Arc;
use std::time::Duration;

use glam::Vec3;
use shadecast_protocol::{
    ClientTime, EyeView, Hand, Pose, Refusal, ResetReason, ToClient, ToServer, Welcome, WireError,
};
use thiserror::Error;

use crate::{AccessUnit, ClientFrame, DecodeError, Decoded, Drawn};

/// What happened.
#[derive(Clone, Debug)]
pub enum Input {
    /// The connection that was asked for stands.
    Connected,
    /// The server said something.
    Message(ToClient),
    /// The decoder is done with an access unit.
    Decoded(Decoded),
    /// The display loop sampled the head.
    View(HeadView),
    /// The display loop drew a frame for the first time.
    Drawn(Drawn),
    /// The connection was lost, or could not be made.
    Disconnected(Disconnection),
    /// The user looks away: the server is left until [`Input::Wake`]. What is
    /// shown stays.
    Rest,
    /// The user is back.
    Wake,
    /// The user leaves.
    Leave,
    /// Time passed.
    Tick,
}

/// Where the head is and will be, and what the hands do; a view report without its number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadView {
    /// When the pose was sampled.
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

/// Why a connection ended or was not made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Disconnection {
    /// The network, or the server went away. Tried again.
    Lost(String),
    /// The server sent bytes that are no message. Tried again, unless the
    /// server is of another version or no shadecast server at all.
    Invalid(WireError),
    /// The server is not the one whose line the client was started with.
    /// Final.
    Untrusted(String),
}

/// What is to be done.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "an output is done at once; only a few ever wait"
)]
pub enum Output {
    /// Make a connection; any earlier one is gone.
    Connect,
    /// Close the connection, for this reason, after what was sent.
    Disconnect(String),
    /// A session begins: where the play space stands, and the sky.
    Welcomed(Box<Welcome>),
    /// Send this to the server.
    Send(ToServer),
    /// Give this to the decoder.
    Decode(AccessUnit),
    /// Draw this from now on.
    Present(Arc<ClientFrame>),
    /// Tell the user.
    Status(Status),
    /// The session is over and will not come back.
    Failed(Failure),
}

/// What the session is doing, for people.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Status {
    /// Reaching for the server.
    Connecting,
    /// Welcomed; no picture yet.
    Filling,
    /// Pictures arrive and are shown; said anew at every epoch.
    Streaming,
    /// Pictures were lost; the last one stays until the server starts anew.
    Recovering(ResetReason),
    /// The user looks away and the server was left; the last picture stays.
    Resting,
    /// The connection ended; the last picture stays.
    Reconnecting {
        /// Why it ended.
        reason: String,
        /// When it is tried again.
        after: Duration,
    },
}

/// Why a session cannot go on.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum Failure {
    /// The server does not want this client.
    #[error("the server refuses: {0}")]
    Refused(Refusal),
    /// The two ends do not speak the same protocol.
    #[error("{0}")]
    Protocol(WireError),
    /// The server is not the one that the user named.
    #[error("{0}")]
    Untrusted(String),
    /// There is no decoder for what the server sends, or none that works, however
    /// often one is opened.
    #[error("{0}")]
    Decoder(DecodeError),
}

impl Failure {
    /// What trying again cannot mend.
    pub(super) fn from_wire(error: &WireError) -> Option<Self> {
        match error {
            WireError::NotShadecast | WireError::Version { .. } => {
                Some(Self::Protocol(error.clone()))
            }
            WireError::TooLarge { .. }
            | WireError::Malformed { .. }
            | WireError::Invalid { .. } => None,
        }
    }
}
