//! What a way to hand out blocks must offer: ours, and those that it is compared with.

use super::level::{LEVELS, Level};

/// A number of blocks for each level, by [`Level::index`].
pub type Counts = [u32; LEVELS];

/// There is too little free memory for the requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Full;

/// Where the texels without a block are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FreeTexels {
    /// Free superblocks.
    pub superblocks: u32,
    /// Texels in those.
    pub in_superblocks: u64,
    /// Texels at the ends of partly filled superblocks.
    pub in_tails: u64,
    /// Free blocks within superblocks.
    pub stacked: u32,
    /// Texels in those.
    pub in_stacks: u64,
}

/// A way to hand out blocks in three phases: *request* ([`release`](Self::release)),
/// *provisioning* and *assignment*. Ours is [`Superblocks`](super::Superblocks); others are
/// there to be compared with.
pub trait Memory {
    /// What provisioning leaves for the assignment.
    type Provision;

    /// Superblocks that these blocks would need in an empty atlas.
    fn needed(&self, requested: &Counts) -> u64;

    /// Superblocks that provisioning would draw for these requests.
    fn fresh(&self, requested: &Counts) -> u64;

    /// Superblocks that are free.
    fn free(&self) -> u32;

    /// Takes one block back.
    fn release(&mut self, position: u32, level: Level);

    /// Finds room for all requests, or changes nothing.
    ///
    /// # Errors
    /// When there is too little.
    fn provision(&mut self, requested: &Counts) -> Result<Self::Provision, Full>;

    /// Position of the block of the `slot`th request of a level: each slot
    /// once, in ascending order.
    fn assign(&mut self, provision: &Self::Provision, level: Level, slot: u32) -> u32;

    /// Takes every block back (atlas reset).
    fn clear(&mut self);

    /// Counts what no block occupies.
    fn free_texels(&self) -> FreeTexels;
}
