//! Whether an update fits the world, asked before any of it is taken.

use shadecast_protocol::{
    Epoch, MAX_PATCHES, MAX_VERTICES, Method, ObjectId, PatchId, PatchShape, Placement, Slot,
    Update, VertexId,
};
use thiserror::Error;

use super::World;

/// Why an update was not applied. The world is as it was before; the session
/// that sent such an update cannot be continued.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum WorldError {
    /// The update belongs to placements that are gone.
    #[error("the update is of epoch {}, the world already of {}", update.0, current.0)]
    OldEpoch {
        /// What the update names.
        update: Epoch,
        /// What the world is at.
        current: Epoch,
    },
    /// Ids of a list are not strictly ascending.
    #[error("the update's {list} are not in ascending order")]
    Order {
        /// Which list.
        list: &'static str,
    },
    /// More than a session may know.
    #[error("the update brings more {what} than the limit of {limit}")]
    TooMany {
        /// Vertices or patches.
        what: &'static str,
        /// The limit.
        limit: u32,
    },
    /// A vertex is sent again with another position.
    #[error("vertex {} changed its position", .0.0)]
    VertexChanged(VertexId),
    /// A patch is sent again with other triangles.
    #[error("patch {} changed its triangles", .0.0)]
    PatchChanged(PatchId),
    /// A patch uses a vertex that was never sent.
    #[error("patch {} uses the unknown vertex {}", patch.0, vertex.0)]
    UnknownVertex {
        /// The patch.
        patch: PatchId,
        /// Its corner.
        vertex: VertexId,
    },
    /// A patch is placed that was never sent.
    #[error("the unknown patch {} is placed", .0.0)]
    UnknownPatch(PatchId),
    /// A patch is removed that has no slot.
    #[error("patch {} is removed but has no slot", .0.0)]
    NotPlaced(PatchId),
    /// A slot does not lie in the atlas.
    #[error("the slot of patch {} lies outside the atlas", .0.0)]
    SlotOutside(PatchId),
    /// A slot is not of the kind that the session's method has.
    #[error("patch {} has a slot that {} does not give", patch.0, method.name())]
    SlotKind {
        /// The patch.
        patch: PatchId,
        /// The session's.
        method: Method,
    },
    /// A patch of several triangles has the slot of one.
    #[error("patch {} has several triangles and the slot of one", .0.0)]
    SlotOfOneTriangle(PatchId),
    /// A mask belongs to a patch that the update does not place.
    #[error("the update has a mask for patch {}, which it does not place", .0.0)]
    MaskWithoutPlacement(PatchId),
    /// A mask is not as large as its slot.
    #[error("the mask of patch {} has {bytes} bytes instead of {expected}", patch.0)]
    MaskSize {
        /// The patch.
        patch: PatchId,
        /// Its mask's bytes.
        bytes: usize,
        /// What its slot asks for.
        expected: usize,
    },
    /// Something moves the world that stands still.
    #[error("the update moves the world that stands still")]
    WorldMoved,
}

impl World {
    /// Vertices, patches and motions.
    ///
    /// Sending known geometry again unchanged is allowed: a server may do so
    /// after a reset instead of remembering what arrived.
    pub(super) fn check_geometry(&self, update: &Update) -> Result<(), WorldError> {
        ascending("vertices", update.vertices.iter().map(|vertex| vertex.id))?;
        ascending("patches", update.patches.iter().map(|patch| patch.id))?;

        let mut new_vertices = 0;
        for vertex in &update.vertices {
            match self.vertices.get(&vertex.id) {
                None => new_vertices += 1,
                Some(&slot) if self.positions[slot as usize] == vertex.position => {}
                Some(_) => return Err(WorldError::VertexChanged(vertex.id)),
            }
        }
        within_limit("vertices", self.vertices.len() + new_vertices, MAX_VERTICES)?;

        let mut new_patches = 0;
        for patch in &update.patches {
            let corners = &patch.corners[..patch.shape.corners().len()];
            for &vertex in corners {
                let is_new = || update.vertices.binary_search_by_key(&vertex, |new| new.id);
                if !self.vertices.contains_key(&vertex) && is_new().is_err() {
                    return Err(WorldError::UnknownVertex {
                        patch: patch.id,
                        vertex,
                    });
                }
            }
            match self.patches.get(&patch.id) {
                None => new_patches += 1,
                Some(known) if *known == self.resolve(patch) => {}
                Some(_) => return Err(WorldError::PatchChanged(patch.id)),
            }
        }
        within_limit("patches", self.patches.len() + new_patches, MAX_PATCHES)?;

        let moves_world = |(object, _): &(ObjectId, _)| *object == ObjectId::WORLD;
        if update.motions.iter().any(moves_world) {
            return Err(WorldError::WorldMoved);
        }
        Ok(())
    }

    /// Epoch, removals, placements and masks.
    pub(super) fn check_placement(&self, update: &Update) -> Result<(), WorldError> {
        if let Some(current) = self.epoch.filter(|&current| update.epoch < current) {
            return Err(WorldError::OldEpoch {
                update: update.epoch,
                current,
            });
        }
        ascending("removals", update.removals.iter().copied())?;
        ascending("placements", update.placements.iter().map(|p| p.patch))?;
        ascending("masks", update.masks.iter().map(|mask| mask.patch))?;

        let starts_epoch = self.epoch != Some(update.epoch);
        for &patch in &update.removals {
            if starts_epoch || !self.placed.contains_key(&patch) {
                return Err(WorldError::NotPlaced(patch));
            }
        }
        for &Placement { patch, slot } in &update.placements {
            let known = self.patches.get(&patch).map(|patch| patch.shape);
            let new = || {
                let index = update.patches.binary_search_by_key(&patch, |new| new.id);
                index.ok().map(|index| update.patches[index].shape)
            };
            let Some(shape) = known.or_else(new) else {
                return Err(WorldError::UnknownPatch(patch));
            };
            if !self.method.places(slot) {
                let method = self.method;
                return Err(WorldError::SlotKind { patch, method });
            }
            if matches!(slot, Slot::Triangle(_)) && shape != PatchShape::Solo {
                return Err(WorldError::SlotOfOneTriangle(patch));
            }
            if !lies_in(slot, self.atlas_size) {
                return Err(WorldError::SlotOutside(patch));
            }
        }
        for mask in &update.masks {
            let Ok(index) = update
                .placements
                .binary_search_by_key(&mask.patch, |placement| placement.patch)
            else {
                return Err(WorldError::MaskWithoutPlacement(mask.patch));
            };
            let area = update.placements[index].slot.bounds().area() as usize;
            let expected = area.div_ceil(8);
            if mask.bits.len() != expected {
                return Err(WorldError::MaskSize {
                    patch: mask.patch,
                    bytes: mask.bits.len(),
                    expected,
                });
            }
        }
        Ok(())
    }
}

fn ascending<T: Ord>(
    list: &'static str,
    ids: impl Iterator<Item = T> + Clone,
) -> Result<(), WorldError> {
    let is_ascending = ids.clone().zip(ids.skip(1)).all(|(a, b)| a < b);
    is_ascending.then_some(()).ok_or(WorldError::Order { list })
}

fn within_limit(what: &'static str, count: usize, limit: u32) -> Result<(), WorldError> {
    let fits = count <= limit as usize;
    fits.then_some(())
        .ok_or(WorldError::TooMany { what, limit })
}

fn lies_in(slot: Slot, atlas_size: [u16; 2]) -> bool {
    // A level that nobody checked may stand for any number of texels.
    let is_small = match slot {
        Slot::Block(block) => block.level.width < 16 && block.level.height < 16,
        Slot::Triangle(_) => true,
    };
    is_small && {
        let bounds = slot.bounds();
        let [width, height] = atlas_size.map(u32::from);
        bounds.x + bounds.width <= width && bounds.y + bounds.height <= height
    }
}
