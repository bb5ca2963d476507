//! The client's copy of the scene: what updates have told so far.
//!
//! An [`Update`] is checked wholly before any of it is taken, so that a bad one
//! changes nothing. Geometry is learnt once and stays known; which patch has
//! which slot is forgotten at every new epoch (SAS 2018, section 4.2). A patch
//! is stored as slots into one array of positions, so that the corners of all
//! placed patches are laid out anew without looking up a single vertex id, and
//! only when something changed.

mod check;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use glam::Vec3;
use shadecast_protocol::{
    Epoch, Method, Motion, ObjectId, PatchGeometry, PatchId, PatchShape, Pose, Slot, Update,
    VertexId,
};

use crate::{ClientFrame, ClientTiming, DecodedPicture, DrawVertex, MaskAtlas};

pub use check::WorldError;

/// Vertices, patches, placements, masks and motions.
#[derive(Debug)]
pub struct World {
    atlas_size: [u16; 2],
    method: Method,
    epoch: Option<Epoch>,
    /// Slot of a vertex in `positions`.
    vertices: HashMap<VertexId, u32>,
    positions: Vec<Vec3>,
    patches: HashMap<PatchId, Patch>,
    /// Ordered, so that equal worlds give equal bytes to draw.
    placed: BTreeMap<PatchId, Placed>,
    motions: Arc<Vec<Motion>>,
    /// Built when first asked for after a change.
    geometry: Option<Geometry>,
    masks: MaskState,
}

/// The triangles of a patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Patch {
    object: ObjectId,
    shape: PatchShape,
    double_sided: bool,
    /// Into [`World::positions`], as many as the shape has corners.
    corners: [u32; 5],
}

/// Where a patch is in the atlas.
#[derive(Debug)]
struct Placed {
    slot: Slot,
    /// One bit a texel of the slot's bounds; none where all of the slot is there.
    mask: Option<Box<[u8]>>,
}

/// What is drawn, ready for a GPU.
#[derive(Clone, Debug)]
struct Geometry {
    vertices: Arc<Vec<DrawVertex>>,
    indices: Arc<Vec<u32>>,
    opaque_indices: u32,
    foreshortened: bool,
}

/// The masks of all placed patches as one picture.
#[derive(Debug)]
enum MaskState {
    Built(Option<Arc<MaskAtlas>>),
    Outdated,
}

impl World {
    /// An empty world with an atlas of this width and height in texels, in which
    /// patches are placed by `method`.
    #[must_use]
    pub fn new(atlas_size: [u16; 2], method: Method) -> Self {
        Self {
            atlas_size,
            method,
            epoch: None,
            vertices: HashMap::new(),
            positions: Vec::new(),
            patches: HashMap::new(),
            placed: BTreeMap::new(),
            motions: Arc::new(vec![Motion::still(Pose::IDENTITY)]),
            geometry: None,
            masks: MaskState::Built(None),
        }
    }

    /// The epoch of the placements, none before the first update.
    #[must_use]
    pub fn epoch(&self) -> Option<Epoch> {
        self.epoch
    }

    /// Takes an update whole, or changes nothing.
    ///
    /// An update of a newer epoch drops all placements and masks first. Slots
    /// may overlap: what is drawn there is then wrong, and nothing else is.
    ///
    /// # Errors
    /// Names the first thing in the update that does not fit this world.
    pub fn apply(&mut self, update: &Update) -> Result<(), WorldError> {
        self.check_geometry(update)?;
        self.check_placement(update)?;
        self.take_geometry(update);
        self.take_placement(update);
        Ok(())
    }

    /// Takes from an update whose picture was lost what outlives its epoch:
    /// geometry and motions. Whole, or nothing of it.
    ///
    /// # Errors
    /// Names the first thing in the geometry that does not fit this world.
    pub fn learn(&mut self, update: &Update) -> Result<(), WorldError> {
        self.check_geometry(update)?;
        self.take_geometry(update);
        Ok(())
    }

    /// What to draw after `update`, the last one that was applied.
    ///
    /// Geometry, motions and masks are shared with the frame before where
    /// they did not change.
    #[must_use]
    pub fn frame(
        &mut self,
        update: &Update,
        picture: DecodedPicture,
        timing: ClientTiming,
    ) -> ClientFrame {
        let geometry = self
            .geometry
            .take()
            .unwrap_or_else(|| self.build_geometry());
        self.geometry = Some(geometry.clone());
        ClientFrame {
            frame: update.frame,
            epoch: update.epoch,
            world_from_head: update.world_from_head,
            scene_time: update.scene_time,
            server_timing: update.timing,
            timing,
            vertices: geometry.vertices,
            indices: geometry.indices,
            opaque_indices: geometry.opaque_indices,
            foreshortened: geometry.foreshortened,
            objects_lead: update.objects_lead,
            motions: Arc::clone(&self.motions),
            picture,
            masks: self.masks(),
            // Placed patches are known patches, which are fewer than `MAX_PATCHES`.
            patches: self.placed.len() as u32,
        }
    }

    fn take_geometry(&mut self, update: &Update) {
        for vertex in &update.vertices {
            let slot = self.positions.len() as u32;
            if *self.vertices.entry(vertex.id).or_insert(slot) == slot {
                self.positions.push(vertex.position);
            }
        }
        for geometry in &update.patches {
            let patch = self.resolve(geometry);
            self.make_room_for(patch.object);
            self.patches.insert(geometry.id, patch);
        }
        for &(object, motion) in &update.motions {
            self.make_room_for(object);
            let slot = usize::from(object.0);
            Arc::make_mut(&mut self.motions)[slot] = motion;
        }
    }

    /// The patch with vertex slots instead of ids. Corners that do not count,
    /// and those of vertices that are not known, are zero; a checked patch has
    /// no unknown ones.
    fn resolve(&self, geometry: &PatchGeometry) -> Patch {
        let mut corners = [0; 5];
        let count = geometry.shape.corners().len();
        for (slot, id) in corners.iter_mut().zip(&geometry.corners[..count]) {
            *slot = self.vertices.get(id).copied().unwrap_or_default();
        }
        Patch {
            object: geometry.object,
            shape: geometry.shape,
            double_sided: geometry.double_sided,
            corners,
        }
    }

    /// Objects that have not moved yet stand at the identity.
    fn make_room_for(&mut self, object: ObjectId) {
        let needed = usize::from(object.0) + 1;
        if self.motions.len() < needed {
            Arc::make_mut(&mut self.motions).resize(needed, Motion::still(Pose::IDENTITY));
        }
    }

    fn take_placement(&mut self, update: &Update) {
        let mut masks_changed = !update.masks.is_empty();
        let starts_epoch = self.epoch != Some(update.epoch);
        if starts_epoch || !update.removals.is_empty() || !update.placements.is_empty() {
            self.geometry = None;
        }
        if starts_epoch {
            self.epoch = Some(update.epoch);
            masks_changed |= self.placed.values().any(|placed| placed.mask.is_some());
            self.placed.clear();
        }
        for patch in &update.removals {
            let removed = self.placed.remove(patch);
            masks_changed |= removed.is_some_and(|placed| placed.mask.is_some());
        }
        for placement in &update.placements {
            let placed = Placed {
                slot: placement.slot,
                mask: None,
            };
            let before = self.placed.insert(placement.patch, placed);
            masks_changed |= before.is_some_and(|placed| placed.mask.is_some());
        }
        for mask in &update.masks {
            if let Some(placed) = self.placed.get_mut(&mask.patch) {
                placed.mask = Some(mask.bits.clone().into_boxed_slice());
            }
        }
        if masks_changed {
            self.masks = MaskState::Outdated;
        }
    }

    /// One vertex per corner of a placed patch: those without a mask first, each
    /// kind by ascending patch.
    fn build_geometry(&self) -> Geometry {
        // Most patches are pairs: four corners and two triangles.
        let mut vertices = Vec::with_capacity(self.placed.len() * 4);
        let mut indices = Vec::with_capacity(self.placed.len() * 6);
        self.build_patches(false, &mut vertices, &mut indices);
        let opaque_indices = indices.len() as u32;
        self.build_patches(true, &mut vertices, &mut indices);
        Geometry {
            foreshortened: vertices.iter().any(|vertex| vertex.texel[2] != 1.0),
            vertices: Arc::new(vertices),
            indices: Arc::new(indices),
            opaque_indices,
        }
    }

    fn build_patches(&self, masked: bool, vertices: &mut Vec<DrawVertex>, indices: &mut Vec<u32>) {
        for (id, Placed { slot, mask }) in &self.placed {
            let Some(patch) = self.patches.get(id).filter(|_| mask.is_some() == masked) else {
                continue;
            };
            let first = vertices.len() as u32;
            let corners = patch.shape.corners().iter().zip(&patch.corners);
            for (corner, (uv, &position)) in corners.enumerate() {
                vertices.push(DrawVertex {
                    position: self.positions[position as usize].to_array(),
                    object: u32::from(patch.object.0),
                    texel: texel_of_corner(*slot, corner, *uv),
                });
            }
            for triangle in patch.shape.triangles() {
                let [a, b, c] = triangle.map(|corner| first + corner as u32);
                indices.extend([a, b, c]);
                if patch.double_sided {
                    indices.extend([a, c, b]);
                }
            }
        }
    }

    fn masks(&mut self) -> Option<Arc<MaskAtlas>> {
        if let MaskState::Built(masks) = &self.masks {
            return masks.clone();
        }
        let masks = self.build_masks();
        self.masks = MaskState::Built(masks.clone());
        masks
    }

    fn build_masks(&self) -> Option<Arc<MaskAtlas>> {
        let [width, height] = self.atlas_size.map(usize::from);
        let mut coverage = Vec::new();
        for Placed { slot, mask } in self.placed.values() {
            let Some(bits) = mask else {
                continue;
            };
            coverage.resize(width * height, 255);
            let bounds = slot.bounds();
            let rows = bounds.y..bounds.y + bounds.height;
            let texels =
                rows.flat_map(|y| (bounds.x..bounds.x + bounds.width).map(move |x| (x, y)));
            for (bit, (x, y)) in texels.enumerate() {
                // Slots of triangles lie in each other's bounds.
                if slot.owns(x, y) {
                    let is_there = bits[bit / 8] >> (bit % 8) & 1 == 1;
                    coverage[y as usize * width + x as usize] = if is_there { 255 } else { 0 };
                }
            }
        }
        (!coverage.is_empty()).then(|| {
            Arc::new(MaskAtlas {
                width: width as u32,
                height: height as u32,
                coverage,
            })
        })
    }
}

/// Homogeneous texel coordinates of a patch's corner with these patch coordinates.
fn texel_of_corner(slot: Slot, corner: usize, uv: [f32; 2]) -> [f32; 3] {
    match slot {
        Slot::Block(block) => {
            let (width, height) = block.level.size();
            let span = [(width - 1) as f32, (height - 1) as f32];
            let origin = [f32::from(block.x) + 0.5, f32::from(block.y) + 0.5];
            let [x, y] = block.level.turn(uv);
            [origin[0] + x * span[0], origin[1] + y * span[1], 1.0]
        }
        // Only patches of one triangle have such slots.
        Slot::Triangle(slot) => slot.homogeneous(corner.min(2)),
    }
}
