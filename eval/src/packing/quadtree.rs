//! The allocator that SAS compares its own with: one thread, and one block after
//! another from a tree that splits and merges.
//!
//! A superblock is a node. A node is cut into halves, squares into strips and
//! strips into strips or squares, down to a block; two free halves become one
//! node again. So whatever can be merged is, at the price of following the tree
//! for every block that comes or goes.
//!
//! Source: SAS 2018, section 5.3, which names "a quadtree-like layout" and says
//! no more; halves instead of quarters are what blocks that are not square need.

use shadecast_shaders::atlas::{
    Counts, FreeTexels, Full, LEVELS, Level, MIN_LOG2_SIDE, Memory, NONE, Superblocks,
};

/// A rectangle of the atlas, landscape or square.
#[derive(Clone, Copy)]
struct Node {
    x: u32,
    y: u32,
    /// log2 of its sides.
    width: u8,
    height: u8,
    parent: u32,
    /// The other half of the parent.
    sibling: u32,
    /// Where it stands in the list of free nodes of its size, or [`NONE`].
    free_at: u32,
}

/// Memory as a forest, one tree a superblock.
pub(super) struct Quadtree {
    /// How much room levels need is asked here, so that all strategies choose
    /// the same levels.
    yardstick: Superblocks,
    log2_side: u8,
    per_row: u32,
    total: u32,
    nodes: Vec<Node>,
    /// Nodes without a place in any tree.
    unused: Vec<u32>,
    /// By index of level.
    free: Vec<Vec<u32>>,
    free_texels: u64,
    /// The node of a block, by its first texel, halved.
    owners: Vec<u32>,
    columns: u32,
}

impl Quadtree {
    pub(super) fn new(log2_side: u8, per_row: u32, total: u32) -> Self {
        let columns = per_row << (log2_side - 1);
        let rows = total.div_ceil(per_row) << (log2_side - 1);
        let mut tree = Self {
            yardstick: Superblocks::new(log2_side, per_row, total),
            log2_side,
            per_row,
            total,
            nodes: Vec::new(),
            unused: Vec::new(),
            free: vec![Vec::new(); LEVELS],
            free_texels: 0,
            owners: vec![NONE; columns as usize * rows as usize],
            columns,
        };
        tree.clear();
        tree
    }

    fn add(&mut self, node: Node) -> u32 {
        match self.unused.pop() {
            Some(index) => {
                self.nodes[index as usize] = node;
                index
            }
            None => {
                self.nodes.push(node);
                self.nodes.len() as u32 - 1
            }
        }
    }

    fn list(&mut self, index: u32) -> &mut Vec<u32> {
        let Node { width, height, .. } = self.nodes[index as usize];
        &mut self.free[Level { width, height }.index()]
    }

    fn insert(&mut self, index: u32) {
        let list = self.list(index);
        list.push(index);
        let at = list.len() as u32 - 1;
        self.nodes[index as usize].free_at = at;
    }

    fn remove(&mut self, index: u32) {
        let at = self.nodes[index as usize].free_at as usize;
        let list = self.list(index);
        list.swap_remove(at);
        let moved = list.get(at).copied();
        if let Some(moved) = moved {
            self.nodes[moved as usize].free_at = at as u32;
        }
        self.nodes[index as usize].free_at = NONE;
    }

    /// The smallest free node that a block fits into.
    fn best(&self, level: Level) -> Option<u32> {
        for area in level.width + level.height..=2 * self.log2_side {
            let widest = self.log2_side.min(area - MIN_LOG2_SIDE);
            for width in level.width.max(area.div_ceil(2))..=widest {
                let height = area - width;
                if height < level.height || height > width {
                    continue;
                }
                if let Some(&node) = self.free[Level { width, height }.index()].last() {
                    return Some(node);
                }
            }
        }
        None
    }

    fn allocate(&mut self, level: Level) -> Option<u32> {
        let mut index = self.best(level)?;
        self.remove(index);
        loop {
            let node = self.nodes[index as usize];
            if (node.width, node.height) == (level.width, level.height) {
                break;
            }
            let beside = node.width > level.width && node.width > node.height;
            let (width, height) = if beside {
                (node.width - 1, node.height)
            } else {
                (node.width, node.height - 1)
            };
            let half = Node {
                width,
                height,
                parent: index,
                sibling: NONE,
                free_at: NONE,
                ..node
            };
            let first = self.add(half);
            let second = self.add(Node {
                x: node.x + (u32::from(beside) << width),
                y: node.y + (u32::from(!beside) << height),
                sibling: first,
                ..half
            });
            self.nodes[first as usize].sibling = second;
            self.insert(second);
            index = first;
        }
        let Node { x, y, .. } = self.nodes[index as usize];
        let owner = (y / 2 * self.columns + x / 2) as usize;
        self.owners[owner] = index;
        self.free_texels -= 1 << (level.width + level.height);
        Some(x | y << 16)
    }
}

impl Memory for Quadtree {
    /// Positions by index of level.
    type Provision = Vec<Vec<u32>>;

    fn needed(&self, requested: &Counts) -> u64 {
        self.yardstick.needed(requested)
    }

    fn fresh(&self, requested: &Counts) -> u64 {
        let wanted: u64 = levels(self.log2_side)
            .map(|l| u64::from(requested[l.index()]) << (l.width + l.height))
            .sum();
        u64::from(wanted > self.free_texels)
    }

    fn free(&self) -> u32 {
        (self.free_texels >> (2 * self.log2_side)) as u32
    }

    fn release(&mut self, position: u32, level: Level) {
        let (x, y) = (position & 0xffff, position >> 16);
        let owner = (y / 2 * self.columns + x / 2) as usize;
        let mut index = self.owners[owner];
        self.free_texels += 1 << (level.width + level.height);
        loop {
            let Node {
                parent, sibling, ..
            } = self.nodes[index as usize];
            if sibling == NONE || self.nodes[sibling as usize].free_at == NONE {
                break;
            }
            self.remove(sibling);
            self.unused.extend([index, sibling]);
            index = parent;
        }
        self.insert(index);
    }

    fn provision(&mut self, requested: &Counts) -> Result<Self::Provision, Full> {
        let mut positions = vec![Vec::new(); LEVELS];
        let mut by_area: Vec<Level> = levels(self.log2_side).collect();
        by_area.sort_by_key(|level| std::cmp::Reverse((level.width + level.height, level.width)));
        for level in by_area {
            for _ in 0..requested[level.index()] {
                let Some(position) = self.allocate(level) else {
                    for level in levels(self.log2_side) {
                        for position in &positions[level.index()] {
                            self.release(*position, level);
                        }
                    }
                    return Err(Full);
                };
                positions[level.index()].push(position);
            }
        }
        Ok(positions)
    }

    fn assign(&mut self, provision: &Self::Provision, level: Level, slot: u32) -> u32 {
        provision[level.index()][slot as usize]
    }

    fn clear(&mut self) {
        self.nodes.clear();
        self.unused.clear();
        self.free.iter_mut().for_each(Vec::clear);
        self.free_texels = u64::from(self.total) << (2 * self.log2_side);
        for superblock in (0..self.total).rev() {
            let root = self.add(Node {
                x: (superblock % self.per_row) << self.log2_side,
                y: (superblock / self.per_row) << self.log2_side,
                width: self.log2_side,
                height: self.log2_side,
                parent: NONE,
                sibling: NONE,
                free_at: NONE,
            });
            self.insert(root);
        }
    }

    fn free_texels(&self) -> FreeTexels {
        let side = self.log2_side;
        let whole = Level {
            width: side,
            height: side,
        };
        let superblocks = self.free[whole.index()].len() as u32;
        let in_superblocks = u64::from(superblocks) << (2 * side);
        FreeTexels {
            superblocks,
            in_superblocks,
            in_stacks: self.free_texels - in_superblocks,
            ..FreeTexels::default()
        }
    }
}

/// All levels of landscape blocks.
pub(super) fn levels(log2_side: u8) -> impl Iterator<Item = Level> {
    (MIN_LOG2_SIDE..=log2_side)
        .flat_map(|width| (MIN_LOG2_SIDE..=width).map(move |height| Level { width, height }))
}
