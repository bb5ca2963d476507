//! Identities and points in time. Each is a number that must not be mistaken
//! for another number.

use serde::{Deserialize, Serialize};

macro_rules! id {
    ($(#[$doc:meta])* $name:ident($inner:ty)) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        pub struct $name(pub $inner);
    };
}

id!(
    /// One turn of the server loop; pairs an [`Update`](crate::Update) with its [`Picture`](crate::Picture).
    FrameId(u32)
);
id!(
    /// Counts atlas resets. Placements of one epoch mean nothing in another.
    Epoch(u32)
);
id!(
    /// A patch: one to three adjacent triangles that are shaded as one rectangle.
    PatchId(u32)
);
id!(
    /// A welded vertex position of the scene.
    VertexId(u32)
);
id!(
    /// A rigidly moving object; zero is the world that stands still.
    ObjectId(u16)
);
id!(
    /// Counts the view reports of one session.
    ViewSeq(u32)
);
id!(
    /// Nanoseconds on the client's own monotonic clock.
    ClientTime(u64)
);
id!(
    /// Nanoseconds on the server's own monotonic clock.
    ServerTime(u64)
);

impl ObjectId {
    /// The world that stands still.
    pub const WORLD: Self = Self(0);
}
