//! An update as columns under zstd.
//!
//! What is alike stands together: all ids of a list, all levels of blocks,
//! all first bytes of coordinates. Ids ascend, so that only the gaps between
//! them are sent; a patch's corners resemble those of the patch before, a block
//! stands beside the one before of its level, and a triangle's slot beside that of
//! the triangle before, so that only differences are sent. Nothing is sent that the reader can tell: repeated corners, the
//! length of a mask.
//!
//! Measured on the built-in courtyard: a patch at first sight, with its
//! vertices and its block, takes 10 to 15 bytes; plain postcard under the same
//! zstd takes 27. Of these a placement takes half a byte.

use std::io::Read;

use glam::Vec3;
use serde::{Deserialize, Serialize};
use zstd::{bulk::Compressor, stream::read::Decoder, zstd_safe::CParameter};

use crate::{
    Block, Epoch, FrameId, Level, Motion, ObjectId, PatchGeometry, PatchId, PatchShape, Placement,
    Pose, Slot, SlotMask, TriangleSlot, Update, UpdateTiming, Vertex, VertexId, WireError, check,
    delta::{from_planes, gaps, ids, planes},
    wire::{MAX_PATCHES, MAX_UPDATE_BYTES, MAX_VERTICES, parse, within},
};

/// zstd's default: higher levels cost the server time for a few per cent.
const LEVEL: i32 = 3;
/// log2 of the bytes that zstd looks back, which is also the most that a
/// reader allocates beyond what it has read.
const WINDOW_LOG: u32 = 21;

const MALFORMED: WireError = WireError::Malformed { what: "update" };

/// Appends the compressed columns of `update` to `bytes`.
pub(crate) fn encode(update: &Update, mut bytes: Vec<u8>) -> Result<Vec<u8>, WireError> {
    check::update(update)?;
    let columns = postcard::to_stdvec(&Columns::from(update))
        .expect("writing plain data to memory does not fail");
    within("update", columns.len(), MAX_UPDATE_BYTES)?;
    let compressed = compress(&columns).expect("zstd takes its own parameters and any bytes");
    bytes.extend_from_slice(&compressed);
    within("update", bytes.len(), MAX_UPDATE_BYTES)?;
    Ok(bytes)
}

fn compress(bytes: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut compressor = Compressor::new(LEVEL)?;
    compressor.set_parameter(CParameter::WindowLog(WINDOW_LOG))?;
    compressor.compress(bytes)
}

/// The update whose compressed columns are `bytes`.
pub(crate) fn decode(bytes: &[u8]) -> Result<Update, WireError> {
    within("update", bytes.len(), MAX_UPDATE_BYTES)?;
    let columns = decompress(bytes).map_err(|_| MALFORMED)?;
    within("update", columns.len(), MAX_UPDATE_BYTES)?;
    let columns: Columns = parse("update", &columns)?;
    let update = columns.update().ok_or(MALFORMED)?;
    check::update(&update)?;
    Ok(update)
}

/// At most one byte more than allowed, growing with what really comes out.
fn decompress(bytes: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut decoder = Decoder::with_buffer(bytes)?.single_frame();
    decoder.window_log_max(WINDOW_LOG)?;
    let mut decompressed = Vec::new();
    let limit = MAX_UPDATE_BYTES as u64 + 1;
    decoder
        .by_ref()
        .take(limit)
        .read_to_end(&mut decompressed)?;
    let complete = decompressed.len() as u64 == limit || decoder.finish().is_empty();
    complete
        .then_some(decompressed)
        .ok_or_else(|| std::io::ErrorKind::InvalidData.into())
}

/// An [`Update`] transposed. Where a column belongs to a list, it has an entry
/// for every element; bytes of several columns follow each other.
#[derive(Serialize, Deserialize)]
struct Columns {
    frame: FrameId,
    epoch: Epoch,
    timing: UpdateTiming,
    world_from_head: Pose,
    scene_time: u64,
    objects_lead: u64,
    motions: Vec<(ObjectId, Motion)>,
    /// Gaps between ids.
    vertices: Vec<u32>,
    /// x, y and z, each as four planes of bytes; see [`planes`](crate::delta::planes).
    positions: Vec<u8>,
    /// Gaps between ids.
    patches: Vec<u32>,
    objects: Vec<u16>,
    /// Shape in the low two bits, then whether it is double-sided.
    shapes: Vec<u8>,
    /// Of each corner to the same corner of the patches before.
    corners: Vec<i32>,
    /// Gaps between ids.
    removals: Vec<u32>,
    /// Gaps between ids.
    placements: Vec<u32>,
    /// Of blocks: log2 of the texels along the patch's u in the high four bits, along v
    /// in the low four. None where slots are triangles.
    levels: Vec<u8>,
    /// Of blocks: half the difference of x to the block before of the same level. Of
    /// triangles: that of their first corner to the triangle's before.
    x: Vec<i16>,
    /// The same of y.
    y: Vec<i16>,
    /// Of triangles: x, y of the second corner less those of the first, then of the
    /// third; each for all triangles.
    edges: Vec<i16>,
    /// Of triangles: those of the first corners, of the second, and of the third.
    weights: Vec<u16>,
    /// Gaps between ids.
    masks: Vec<u32>,
    /// The bits of all masks.
    mask_bits: Vec<u8>,
}

impl From<&Update> for Columns {
    /// The update must have been checked.
    fn from(update: &Update) -> Self {
        let axis = |i: usize| update.vertices.iter().map(move |v| v.position[i]).collect();
        let positions: [Vec<f32>; 3] = [axis(0), axis(1), axis(2)];

        let slots = SlotColumns::from(update.placements.as_slice());

        Self {
            frame: update.frame,
            epoch: update.epoch,
            timing: update.timing,
            world_from_head: update.world_from_head,
            scene_time: update.scene_time,
            objects_lead: update.objects_lead,
            motions: update.motions.clone(),
            vertices: gaps(update.vertices.iter().map(|vertex| vertex.id.0)),
            positions: positions.iter().flat_map(|axis| planes(axis)).collect(),
            patches: gaps(update.patches.iter().map(|patch| patch.id.0)),
            objects: update.patches.iter().map(|patch| patch.object.0).collect(),
            shapes: update.patches.iter().map(shape_byte).collect(),
            corners: corner_differences(&update.patches),
            removals: gaps(update.removals.iter().map(|patch| patch.0)),
            placements: gaps(update.placements.iter().map(|placement| placement.patch.0)),
            levels: slots.levels,
            x: slots.x,
            y: slots.y,
            edges: slots.edges,
            weights: slots.weights,
            masks: gaps(update.masks.iter().map(|mask| mask.patch.0)),
            mask_bits: update
                .masks
                .iter()
                .flat_map(|mask| &mask.bits)
                .copied()
                .collect(),
        }
    }
}

impl Columns {
    /// The update, still to be checked beyond ids that ascend and columns of
    /// one length.
    fn update(self) -> Option<Update> {
        let placements = self.placements()?;
        Some(Update {
            frame: self.frame,
            epoch: self.epoch,
            timing: self.timing,
            world_from_head: self.world_from_head,
            scene_time: self.scene_time,
            objects_lead: self.objects_lead,
            vertices: self.vertices()?,
            patches: self.patches()?,
            removals: ids(&self.removals, MAX_PATCHES)?
                .into_iter()
                .map(PatchId)
                .collect(),
            masks: self.masks(&placements)?,
            placements,
            motions: self.motions,
        })
    }

    fn vertices(&self) -> Option<Vec<Vertex>> {
        let ids = ids(&self.vertices, MAX_VERTICES)?;
        let count = ids.len();
        if self.positions.len() != count * 12 {
            return None;
        }
        let positions: Vec<f32> = self
            .positions
            .chunks(4 * count.max(1))
            .flat_map(from_planes)
            .collect();
        let position = |i| Vec3::from_array([0, 1, 2].map(|axis| positions[axis * count + i]));
        let vertices = ids.into_iter().enumerate().map(|(i, id)| Vertex {
            id: VertexId(id),
            position: position(i),
        });
        Some(vertices.collect())
    }

    fn patches(&self) -> Option<Vec<PatchGeometry>> {
        let ids = ids(&self.patches, MAX_PATCHES)?;
        if self.objects.len() != ids.len() || self.shapes.len() != ids.len() {
            return None;
        }
        let mut differences = self.corners.iter();
        let mut last = [0; 5];
        let patches = ids
            .into_iter()
            .zip(&self.objects)
            .zip(&self.shapes)
            .map(|((id, &object), &byte)| {
                let (shape, double_sided) = shape_from_byte(byte)?;
                let mut patch = PatchGeometry {
                    id: PatchId(id),
                    object: ObjectId(object),
                    shape,
                    double_sided,
                    corners: [VertexId(0); 5],
                };
                let (used, spare) = patch.corners.split_at_mut(shape.corners().len());
                for (corner, last) in used.iter_mut().zip(&mut last) {
                    *last = u32::checked_add_signed(*last, *differences.next()?)?;
                    *corner = VertexId(*last);
                }
                spare.fill(*used.last()?);
                Some(patch)
            })
            .collect::<Option<_>>()?;
        differences.next().is_none().then_some(patches)
    }

    fn placements(&self) -> Option<Vec<Placement>> {
        let ids = ids(&self.placements, MAX_PATCHES)?;
        let count = ids.len();
        if self.x.len() != count || self.y.len() != count {
            return None;
        }
        let slots = if self.edges.is_empty() && self.weights.is_empty() {
            self.blocks(count)?
        } else {
            self.triangles(count)?
        };
        let placements = ids.into_iter().zip(slots).map(|(id, slot)| Placement {
            patch: PatchId(id),
            slot,
        });
        Some(placements.collect())
    }

    fn blocks(&self, count: usize) -> Option<Vec<Slot>> {
        if self.levels.len() != count {
            return None;
        }
        let mut last = [[0_i16; 2]; 256];
        (0..count)
            .map(|i| {
                let byte = self.levels[i];
                let half = &mut last[usize::from(byte)];
                *half = [
                    half[0].checked_add(self.x[i])?,
                    half[1].checked_add(self.y[i])?,
                ];
                Some(Slot::Block(Block {
                    x: u16::try_from(half[0]).ok()? * 2,
                    y: u16::try_from(half[1]).ok()? * 2,
                    level: level_from_byte(byte),
                }))
            })
            .collect()
    }

    fn triangles(&self, count: usize) -> Option<Vec<Slot>> {
        let lengths = (self.levels.len(), self.edges.len(), self.weights.len());
        if lengths != (0, 4 * count, 3 * count) {
            return None;
        }
        let mut last = [0_u16; 2];
        let triangles = (0..count).map(|i| {
            last = [
                last[0].wrapping_add_signed(self.x[i]),
                last[1].wrapping_add_signed(self.y[i]),
            ];
            let corner = |k: usize| {
                let along = |axis: usize| self.edges[(2 * k + axis) * count + i];
                [0, 1].map(|axis| last[axis].wrapping_add_signed(along(axis)))
            };
            Slot::Triangle(TriangleSlot {
                corners: [last, corner(0), corner(1)],
                weights: [0, 1, 2].map(|k| self.weights[k * count + i]),
            })
        });
        Some(triangles.collect())
    }

    /// The masks, cut from the bits by the sizes of the slots that they mask.
    fn masks(&self, placements: &[Placement]) -> Option<Vec<SlotMask>> {
        let mut rest = self.mask_bits.as_slice();
        let masks = ids(&self.masks, MAX_PATCHES)?
            .into_iter()
            .map(|id| {
                let patch = PatchId(id);
                let (bits, after) = rest.split_at_checked(check::mask_bytes(placements, patch)?)?;
                rest = after;
                Some(SlotMask {
                    patch,
                    bits: bits.to_vec(),
                })
            })
            .collect::<Option<_>>()?;
        rest.is_empty().then_some(masks)
    }
}

/// The slots of placements, which are all of one kind.
#[derive(Default)]
struct SlotColumns {
    levels: Vec<u8>,
    x: Vec<i16>,
    y: Vec<i16>,
    edges: Vec<i16>,
    weights: Vec<u16>,
}

impl From<&[Placement]> for SlotColumns {
    fn from(placements: &[Placement]) -> Self {
        let mut columns = Self::default();
        let mut last = [[0_i16; 2]; 256];
        let mut last_corner = [0_u16; 2];
        let mut triangles = Vec::new();
        for placement in placements {
            let [x, y] = match placement.slot {
                Slot::Block(block) => {
                    let byte = level_byte(block.level);
                    columns.levels.push(byte);
                    let half = [(block.x / 2) as i16, (block.y / 2) as i16];
                    let before = std::mem::replace(&mut last[usize::from(byte)], half);
                    [half[0] - before[0], half[1] - before[1]]
                }
                Slot::Triangle(slot) => {
                    triangles.push(slot);
                    let before = std::mem::replace(&mut last_corner, slot.corners[0]);
                    difference(slot.corners[0], before)
                }
            };
            columns.x.push(x);
            columns.y.push(y);
        }
        for (corner, axis) in [(1, 0), (1, 1), (2, 0), (2, 1)] {
            let edge = |slot: &TriangleSlot| difference(slot.corners[corner], slot.corners[0]);
            (columns.edges).extend(triangles.iter().map(|slot| edge(slot)[axis]));
        }
        for corner in 0..3 {
            (columns.weights).extend(triangles.iter().map(|slot| slot.weights[corner]));
        }
        columns
    }
}

/// What is to be added to `b`, wrapping, to get `a`.
fn difference(a: [u16; 2], b: [u16; 2]) -> [i16; 2] {
    [0, 1].map(|axis| a[axis].wrapping_sub(b[axis]) as i16)
}

/// The corners that count, as what each differs by from the same corner of the
/// patches before: neighbours are mostly shifted copies of each other.
fn corner_differences(patches: &[PatchGeometry]) -> Vec<i32> {
    let mut last = [0; 5];
    let mut differences = Vec::new();
    for patch in patches {
        let used = &patch.corners[..patch.shape.corners().len()];
        for (corner, last) in used.iter().zip(&mut last) {
            let VertexId(id) = *corner;
            differences.push(id.wrapping_sub(std::mem::replace(last, id)) as i32);
        }
    }
    differences
}

fn shape_byte(patch: &PatchGeometry) -> u8 {
    let shape = match patch.shape {
        PatchShape::Solo => 0,
        PatchShape::Pair => 1,
        PatchShape::Triple => 2,
    };
    shape | u8::from(patch.double_sided) << 2
}

fn shape_from_byte(byte: u8) -> Option<(PatchShape, bool)> {
    let shape = match byte & 0b11 {
        0 => PatchShape::Solo,
        1 => PatchShape::Pair,
        2 => PatchShape::Triple,
        _ => return None,
    };
    (byte < 0b1000).then_some((shape, byte & 0b100 != 0))
}

/// Both logarithms are below 16 in a checked block.
fn level_byte(level: Level) -> u8 {
    level.width << 4 | level.height
}

fn level_from_byte(byte: u8) -> Level {
    Level {
        width: byte >> 4,
        height: byte & 0xf,
    }
}
