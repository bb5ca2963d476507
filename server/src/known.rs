//! What the client already knows, and so what an update must tell it.

use shadecast_protocol::{
    Motion, ObjectId, PatchGeometry, PatchId, Placement, Pose, SlotMask, Vertex, VertexId,
};

use crate::{mask::slot_mask, patches::PatchedScene};

/// The client's copy of the scene, as far as updates have told it.
#[derive(Clone, Debug)]
pub struct Known {
    vertices: Vec<bool>,
    patches: Vec<bool>,
    motions: Vec<Motion>,
}

/// The geometry of an update: see [`Update`](shadecast_protocol::Update).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct News {
    /// New to the client, by ascending id.
    pub vertices: Vec<Vertex>,
    /// New to the client, by ascending id.
    pub patches: Vec<PatchGeometry>,
    /// Of the alpha-masked patches that were placed.
    pub masks: Vec<SlotMask>,
    /// Of the objects that move or have just stopped.
    pub motions: Vec<(ObjectId, Motion)>,
}

impl Known {
    /// A client that knows nothing.
    #[must_use]
    pub fn nothing(scene: &PatchedScene) -> Self {
        Self {
            vertices: vec![false; scene.scene.positions.len()],
            patches: vec![false; scene.patches.len()],
            motions: vec![Motion::still(Pose::IDENTITY); scene.scene.objects.len()],
        }
    }

    /// What the client must be told so that `placements` mean something to it;
    /// `motions[n]` is that of `ObjectId(n + 1)`.
    pub fn news(
        &mut self,
        scene: &PatchedScene,
        placements: &[Placement],
        motions: &[Motion],
    ) -> News {
        let mut news = News::default();
        for placement in placements {
            let PatchId(id) = placement.patch;
            let patch = &scene.patches[id as usize];
            if patch.masked {
                news.masks.push(slot_mask(&scene.scene, patch, *placement));
            }
            if std::mem::replace(&mut self.patches[id as usize], true) {
                continue;
            }
            for corner in patch.corners {
                if !std::mem::replace(&mut self.vertices[corner as usize], true) {
                    let position = scene.scene.positions[corner as usize];
                    news.vertices.push(Vertex {
                        id: VertexId(corner),
                        position,
                    });
                }
            }
            news.patches.push(PatchGeometry {
                id: placement.patch,
                object: patch.object,
                shape: patch.shape,
                double_sided: patch.double_sided,
                corners: patch.corners.map(VertexId),
            });
        }
        news.vertices.sort_by_key(|vertex| vertex.id);
        let known_and_new = self.motions.iter_mut().zip(motions);
        for (object, (known, &motion)) in (1..).map(ObjectId).zip(known_and_new) {
            if std::mem::replace(known, motion) != motion || motion != Motion::still(motion.pose) {
                news.motions.push((object, motion));
            }
        }
        news
    }
}
