//! The side data of one picture.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::{
    ClientTime, Epoch, FrameId, Motion, ObjectId, PatchId, Pose, ServerTime, Slot, VertexId,
    ViewSeq,
};

/// A vertex that becomes visible for the first time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Vertex {
    /// Its name.
    pub id: VertexId,
    /// Metres, in the space of the object that uses it.
    pub position: Vec3,
}

/// The three ways of laying triangles into a rectangle (SAS 2018, figure 4).
///
/// Patch coordinates run from (0, 0) in the upper left texel centre of the
/// block to (1, 1) in the lower right one: the half-texel inset of figure 6.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum PatchShape {
    /// One triangle, corners 0 1 2 at (0,0) (1,0) (0,1).
    Solo,
    /// Two triangles, corners 0 1 2 3 at (0,0) (1,0) (1,1) (0,1):
    /// triangles 0 1 3 and 1 2 3.
    Pair,
    /// Three triangles in a strip, corners 0 1 2 3 4 at
    /// (0,0) (0.5,0) (1,0) (1,1) (0,1): triangles 0 1 4, 1 3 4 and 1 2 3.
    Triple,
}

impl PatchShape {
    /// Patch coordinates of the corners.
    #[must_use]
    pub fn corners(self) -> &'static [[f32; 2]] {
        match self {
            Self::Solo => &[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
            Self::Pair => &[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
            Self::Triple => &[[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
        }
    }

    /// Triangles as indices of corners. Their winding is that of the scene:
    /// counter-clockwise seen from the front.
    #[must_use]
    pub fn triangles(self) -> &'static [[usize; 3]] {
        match self {
            Self::Solo => &[[0, 1, 2]],
            Self::Pair => &[[0, 1, 3], [1, 2, 3]],
            Self::Triple => &[[0, 1, 4], [1, 3, 4], [1, 2, 3]],
        }
    }
}

/// The triangles of a patch, sent when it is first placed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PatchGeometry {
    /// Its name.
    pub id: PatchId,
    /// What it moves with.
    pub object: ObjectId,
    /// How its corners lie in a block.
    pub shape: PatchShape,
    /// True when it is seen from both sides.
    pub double_sided: bool,
    /// The corners in the order of [`PatchShape::corners`]; only the first
    /// three or four count for a solo or a pair, the others repeat the last.
    pub corners: [VertexId; 5],
}

/// A patch gets a slot, or another one than it had.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Placement {
    /// The patch.
    pub patch: PatchId,
    /// Its slot. All of a session are of one kind.
    pub slot: Slot,
}

/// Which texels of an alpha-masked patch are there. Sent with its placement;
/// scenes without alpha masks send none.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SlotMask {
    /// The patch, placed by the same update.
    pub patch: PatchId,
    /// One bit a texel of the slot's [bounds](Slot::bounds), row by row, lowest bit
    /// first; those of texels that are not the slot's own say nothing.
    pub bits: Vec<u8>,
}

/// When the server did what for this update, for the latency phases of SAS
/// 2018, figure 2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct UpdateTiming {
    /// The report that the update answers.
    pub view: ViewSeq,
    /// When the client sampled the pose of that report.
    pub view_sampled: ClientTime,
    /// When the report reached the server.
    pub view_received: ServerTime,
    /// When the server began this frame.
    pub started: ServerTime,
    /// When picture and update were handed to the transport.
    pub finished: ServerTime,
}

/// What changes with one picture. Applied whole or not at all.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Update {
    /// Pairs it with its picture.
    pub frame: FrameId,
    /// The placement that it changes. A new epoch starts with no placement at
    /// all; vertices and patches stay known.
    pub epoch: Epoch,
    /// Where the time went.
    pub timing: UpdateTiming,
    /// The pose of the head that it was made for.
    pub world_from_head: Pose,
    /// The scene's own time at `timing.started`, nanoseconds.
    pub scene_time: u64,
    /// How long after that time the objects are where `motions` says, which is
    /// about when the frame will be seen, nanoseconds.
    pub objects_lead: u64,
    /// Vertices that are new to the client, by ascending id.
    pub vertices: Vec<Vertex>,
    /// Patches that are new to the client, by ascending id.
    pub patches: Vec<PatchGeometry>,
    /// Patches that lose their slot, by ascending id; applied before `placements`.
    pub removals: Vec<PatchId>,
    /// Patches that get a slot, by ascending id.
    pub placements: Vec<Placement>,
    /// Masks of alpha-masked patches among `placements`, by ascending id.
    pub masks: Vec<SlotMask>,
    /// Objects that move or have just stopped, by ascending id; never the world.
    pub motions: Vec<(ObjectId, Motion)>,
}
