//! A server for tests: every frame places something new, so that a frame that
//! is shown late, early or half shows other triangles than it should.

use std::collections::HashMap;

use glam::{Quat, Vec3};
use shadecast_protocol::{
    Block, Epoch, FrameId, Level, Method, Motion, ObjectId, PatchGeometry, PatchId, PatchShape,
    Picture, Placement, Pose, Slot, ToClient, Update, UpdateTiming, Vertex, VertexId,
};

use super::{YuvPicture, presented};
use crate::session::Output;
use crate::{ClientFrame, ClientTiming, World};

pub(super) const ATLAS: [u16; 2] = [64, 64];

/// Patches that are placed at once; each has a 2x2 block of its own.
const PLACED: u32 = 12;

pub(super) struct Server {
    /// What a client must draw at each frame.
    truth: HashMap<FrameId, ClientFrame>,
    world: World,
    next: u32,
    epoch: u32,
    starts_epoch: bool,
    /// Sends all geometry and motions again at a reset.
    pub(super) repeats: bool,
}

impl Default for Server {
    fn default() -> Self {
        Self {
            truth: HashMap::new(),
            world: World::new(ATLAS, Method::Sas),
            next: 0,
            epoch: 0,
            starts_epoch: true,
            repeats: false,
        }
    }
}

impl Server {
    /// The next frame begins a new epoch with an IDR picture.
    pub(super) fn reset(&mut self) {
        self.epoch += 1;
        self.starts_epoch = true;
    }

    pub(super) fn frames(&self) -> u32 {
        self.next
    }

    /// True when the picture of this frame is an IDR picture.
    pub(super) fn starts_epoch_at(&self, frame: FrameId) -> bool {
        let before = frame.0.checked_sub(1).map(FrameId);
        let epoch = |frame| self.truth[&frame].epoch;
        before.is_none_or(|before| epoch(before) < epoch(frame))
    }

    /// The update and the picture of the next frame, which places the patch of
    /// its own number and removes the one of twelve frames before.
    pub(super) fn frame(&mut self) -> (ToClient, ToClient) {
        let number = self.next;
        self.next += 1;
        let idr = std::mem::take(&mut self.starts_epoch);
        let first_placed = (number + 1).saturating_sub(PLACED);
        let first_new = if idr && self.repeats { 0 } else { number };
        let placed = if idr { first_placed } else { number }..=number;
        let update = Update {
            frame: FrameId(number),
            epoch: Epoch(self.epoch),
            timing: UpdateTiming::default(),
            world_from_head: Pose::IDENTITY,
            scene_time: u64::from(number),
            objects_lead: 0,
            vertices: (first_new..=number).flat_map(vertices).collect(),
            patches: (first_new..=number).map(patch).collect(),
            removals: match number.checked_sub(PLACED) {
                Some(old) if !idr => vec![PatchId(old)],
                _ => vec![],
            },
            placements: placed.map(placement).collect(),
            masks: vec![],
            motions: motions(number, idr && self.repeats),
        };
        let picture = Picture {
            frame: update.frame,
            epoch: update.epoch,
            idr,
            bytes: number.to_le_bytes().to_vec(),
        };
        self.world.apply(&update).unwrap();
        let truth = self.world.frame(
            &update,
            picture_of(&picture.bytes).into(),
            ClientTiming::default(),
        );
        self.truth.insert(update.frame, truth);
        (ToClient::Update(update), ToClient::Picture(picture))
    }

    /// Holds what is presented against what was sent. Returns the frames.
    pub(super) fn check(&self, outputs: &[Output]) -> Vec<u32> {
        for output in outputs {
            let Output::Present(shown) = output else {
                continue;
            };
            let truth = &self.truth[&shown.frame];
            assert_eq!(shown.picture, truth.picture);
            assert_eq!(shown.vertices, truth.vertices);
            assert_eq!(shown.indices, truth.indices);
            assert_eq!(shown.motions, truth.motions);
            assert_eq!(shown.epoch, truth.epoch);
            assert_eq!(shown.scene_time, truth.scene_time);
        }
        presented(outputs)
    }
}

/// What the access unit with these bytes decodes to.
pub(super) fn picture_of(bytes: &[u8]) -> YuvPicture {
    YuvPicture {
        width: ATLAS[0].into(),
        height: ATLAS[1].into(),
        y: bytes.to_vec(),
        u: vec![],
        v: vec![],
    }
}

/// A patch has two vertices of its own and one of the patch before it, which a
/// client must have learnt even if that frame was lost.
fn vertices(number: u32) -> [Vertex; 2] {
    [0, 1].map(|corner| Vertex {
        id: VertexId(2 * number + corner),
        position: Vec3::new(number as f32, corner as f32, 0.0),
    })
}

fn patch(number: u32) -> PatchGeometry {
    let own = 2 * number;
    let shared = own.saturating_sub(1);
    PatchGeometry {
        id: PatchId(number),
        object: ObjectId(1),
        shape: PatchShape::Solo,
        double_sided: false,
        corners: [own, own + 1, shared, shared, shared].map(VertexId),
    }
}

fn placement(number: u32) -> Placement {
    let level = Level {
        width: 1,
        height: 1,
    };
    let place = number % (PLACED + 1);
    Placement {
        patch: PatchId(number),
        slot: Slot::Block(Block {
            x: 4 * place as u16,
            y: 0,
            level,
        }),
    }
}

/// The object moves at every third frame.
fn motions(number: u32, repeat: bool) -> Vec<(ObjectId, Motion)> {
    let last_move = number - number % 3;
    let pose = Pose {
        position: Vec3::splat(last_move as f32),
        orientation: Quat::IDENTITY,
    };
    if repeat || number == last_move {
        vec![(ObjectId(1), Motion::still(pose))]
    } else {
        vec![]
    }
}
