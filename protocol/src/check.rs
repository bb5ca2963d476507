//! What a message must satisfy beyond being parseable. Both `encode` and
//! `decode` ask here, so that there is one list of rules.

use glam::Vec3;

use crate::{
    Block, ClockReply, Hello, Level, MIN_LOG2_SIDE, ObjectId, PatchGeometry, PatchId, Picture,
    Placement, Pose, SLOT_UNITS, Slot, TriangleSlot, Update, VertexId, ViewReport, Welcome,
    WireError,
    wire::{MAX_MESSAGE_BYTES, MAX_PATCHES, MAX_VERTICES, within},
};

/// log2 of the largest atlas side. 8192 texels are the most that common video
/// decoders take.
const MAX_LOG2_SIDE: u8 = 13;
const MAX_SIDE: u16 = 1 << MAX_LOG2_SIDE;
/// Largest side of a triangle slot's bounds, texels: far beyond what one triangle is
/// shaded with, and kernels square it in 32 bits.
const MAX_TRIANGLE_SIDE: u32 = 2048;
/// Smallest atlas side, texels: room for a few blocks of every level.
const MIN_ATLAS_SIDE: u16 = 64;
/// H.264 codes macroblocks of 16 x 16 texels.
const MACROBLOCK: u16 = 16;
/// Smallest side of an eye's picture, pixels.
const MIN_EYE_SIDE: u16 = 16;
/// Most codecs in a hello; more than there are.
const MAX_CODECS: usize = 16;
/// Sizes of a sky, pixels.
const MAX_SKY: [u16; 2] = [256, 128];
/// Largest coordinate, metres, and speed, m/s or rad/s: far beyond any scene
/// and any head, so that products and squares of them stay finite.
const MAX_MAGNITUDE: f32 = 1e9;

pub(crate) fn hello(hello: &Hello) -> Result<(), WireError> {
    let rules = Rules("hello");
    within("list of codecs", hello.codecs.len(), MAX_CODECS)?;
    rules.demand(hello.max_atlas_side >= MIN_ATLAS_SIDE, "atlas side")
}

pub(crate) fn welcome(welcome: &Welcome) -> Result<(), WireError> {
    let rules = Rules("welcome");
    for side in welcome.atlas_size {
        let fits = (MIN_ATLAS_SIDE..=MAX_SIDE).contains(&side) && side % MACROBLOCK == 0;
        rules.demand(fits, "atlas size")?;
        rules.demand(welcome.superblock <= side, "superblock")?;
    }
    let superblock = welcome.superblock;
    let smallest = 1 << MIN_LOG2_SIDE;
    rules.demand(
        superblock.is_power_of_two() && superblock >= smallest,
        "superblock",
    )?;
    rules.pose(welcome.world_from_play, "play space")?;
    let sky = &welcome.sky;
    let (width, height) = (sky.width, sky.height);
    rules.demand(
        (1..=MAX_SKY[0]).contains(&width) && (1..=MAX_SKY[1]).contains(&height),
        "sky size",
    )?;
    let bytes = 3 * usize::from(width) * usize::from(height);
    rules.demand(sky.rgb.len() == bytes, "length of the sky")
}

pub(crate) fn view(view: &ViewReport) -> Result<(), WireError> {
    let rules = Rules("view report");
    rules.demand(view.sampled_at <= view.display_at, "display time")?;
    rules.pose(view.world_from_head, "head pose")?;
    rules.vector(view.linear_velocity, "linear velocity")?;
    rules.vector(view.angular_velocity, "angular velocity")?;
    for eye in view.eyes {
        rules.pose(eye.head_from_eye, "eye pose")?;
        rules.demand(eye.fov.is_valid(), "field of view")?;
    }
    let sides = MIN_EYE_SIDE..=MAX_SIDE;
    let fits = view.eye_resolution.iter().all(|side| sides.contains(side));
    rules.demand(fits, "eye resolution")?;
    let mut hands = view.hands.iter().flatten();
    hands.try_for_each(|hand| rules.pose(hand.world_from_aim, "aim"))
}

pub(crate) fn clock(reply: &ClockReply) -> Result<(), WireError> {
    Rules("clock reply").demand(reply.server_received <= reply.server_sent, "sending time")
}

pub(crate) fn picture(picture: &Picture) -> Result<(), WireError> {
    within("picture", picture.bytes.len(), MAX_MESSAGE_BYTES)?;
    Rules("picture").demand(!picture.bytes.is_empty(), "empty access unit")
}

pub(crate) fn update(update: &Update) -> Result<(), WireError> {
    let rules = Rules("update");
    rules.pose(update.world_from_head, "head pose")?;

    let vertex_ids = update.vertices.iter().map(|vertex| vertex.id.0);
    rules.ascending(vertex_ids, MAX_VERTICES, "vertex id")?;
    for vertex in &update.vertices {
        rules.vector(vertex.position, "vertex position")?;
    }

    let patch_ids = update.patches.iter().map(|patch| patch.id.0);
    rules.ascending(patch_ids, MAX_PATCHES, "patch id")?;
    for patch in &update.patches {
        rules.corners(patch)?;
    }

    let removals = update.removals.iter().map(|patch| patch.0);
    rules.ascending(removals, MAX_PATCHES, "removal")?;

    let placements = update.placements.iter().map(|placement| placement.patch.0);
    rules.ascending(placements, MAX_PATCHES, "placement")?;
    let kind = |slot| matches!(slot, Slot::Block(_));
    for placement in &update.placements {
        rules.demand(
            kind(placement.slot) == kind(update.placements[0].slot),
            "mixture of slots",
        )?;
        match placement.slot {
            Slot::Block(block) => rules.block(block)?,
            Slot::Triangle(slot) => rules.triangle(slot)?,
        }
    }

    let masks = update.masks.iter().map(|mask| mask.patch.0);
    rules.ascending(masks, MAX_PATCHES, "mask")?;
    for mask in &update.masks {
        let bytes = mask_bytes(&update.placements, mask.patch);
        rules.demand(bytes == Some(mask.bits.len()), "length of a mask")?;
    }

    let objects = update.motions.iter().map(|(object, _)| object.0.into());
    rules.ascending(objects, 1 << 16, "object id")?;
    for (object, motion) in &update.motions {
        rules.demand(*object != ObjectId::WORLD, "motion of the world")?;
        rules.pose(motion.pose, "object pose")?;
        rules.vector(motion.linear_velocity, "object velocity")?;
        rules.vector(motion.angular_velocity, "object velocity")?;
    }
    Ok(())
}

/// Bytes of the mask of a `patch`, if it is among the `placements`, which
/// ascend.
pub(crate) fn mask_bytes(placements: &[Placement], patch: PatchId) -> Option<usize> {
    let index = placements
        .binary_search_by_key(&patch, |placement| placement.patch)
        .ok()?;
    let texels = match placements[index].slot {
        // Its level has not been checked.
        Slot::Block(block) => {
            1_usize.checked_shl((block.level.width + block.level.height).into())?
        }
        Slot::Triangle(slot) => slot.bounds().area() as usize,
    };
    Some(texels.div_ceil(8))
}

/// Rules on the parts of the message of this name.
struct Rules(&'static str);

impl Rules {
    fn demand(&self, holds: bool, what: &'static str) -> Result<(), WireError> {
        if holds {
            return Ok(());
        }
        Err(WireError::Invalid {
            message: self.0,
            what,
        })
    }

    fn vector(&self, vector: Vec3, what: &'static str) -> Result<(), WireError> {
        // False for NaN.
        self.demand(vector.abs().max_element() <= MAX_MAGNITUDE, what)
    }

    fn pose(&self, pose: Pose, what: &'static str) -> Result<(), WireError> {
        self.vector(pose.position, what)?;
        self.demand(pose.is_valid(), what)
    }

    fn ascending(
        &self,
        mut ids: impl Iterator<Item = u32>,
        limit: u32,
        what: &'static str,
    ) -> Result<(), WireError> {
        let mut least = 0;
        self.demand(
            ids.all(|id| {
                let follows = (least..limit).contains(&id);
                least = id.saturating_add(1);
                follows
            }),
            what,
        )
    }

    fn corners(&self, patch: &PatchGeometry) -> Result<(), WireError> {
        let (used, spare) = patch.corners.split_at(patch.shape.corners().len());
        let known = |corner: &VertexId| corner.0 < MAX_VERTICES;
        self.demand(used.iter().all(known), "corner")?;
        let repeated = spare.iter().all(|corner| Some(corner) == used.last());
        self.demand(repeated, "spare corner")
    }

    fn block(&self, block: Block) -> Result<(), WireError> {
        let sides = MIN_LOG2_SIDE..=MAX_LOG2_SIDE;
        let in_range = |side| sides.contains(&side);
        let Level { width, height } = block.level;
        self.demand(in_range(width) && in_range(height), "block size")?;
        let (width, height) = block.level.size();
        let (x, y) = (u32::from(block.x), u32::from(block.y));
        let inside = x + width <= MAX_SIDE.into() && y + height <= MAX_SIDE.into();
        self.demand(x % 2 == 0 && y % 2 == 0 && inside, "block position")
    }

    fn triangle(&self, slot: TriangleSlot) -> Result<(), WireError> {
        let largest = slot.weights.iter().max() == Some(&u16::MAX);
        self.demand(largest && !slot.weights.contains(&0), "weights of a slot")?;
        let bounds = slot.bounds();
        let fits = bounds.width <= MAX_TRIANGLE_SIDE && bounds.height <= MAX_TRIANGLE_SIDE;
        self.demand(fits, "slot size")?;
        // A lookup at a corner reaches half a texel further.
        let middle = (SLOT_UNITS / 2) as u16;
        let inside = slot.corners.iter().flatten().all(|at| *at >= middle)
            && bounds.x + bounds.width <= MAX_SIDE.into()
            && bounds.y + bounds.height <= MAX_SIDE.into();
        self.demand(inside, "slot position")
    }
}
