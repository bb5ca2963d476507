// Records and bindings of all kernels of the atlas. Host structs: mod.rs.

struct AtlasParameters {
    patch_count: u32,
    log2_side: u32,
    per_row: u32,
    superblocks: u32,
    // Superblocks that the visible set may need in an empty atlas.
    budget: u32,
    // With fewer free superblocks the atlas is reset.
    least_free: u32,
    // Smallest blocks in the budget.
    most_patches: u32,
    keep_unseen: u32,
    bias: i32,
    // 1 where the atlas is to be reset in any case.
    reset: u32,
    padding: vec2<u32>,
}

struct ActivePatch {
    patch_id: u32,
    pixels: u32,
    // x | y << 16 of the block before and after the frame, or NONE.
    before: u32,
    after: u32,
    bits: u32,
}

struct AtlasState {
    active_count: u32,
    visible: u32,
    bias: i32,
    verdict: u32,
    status: u32,
    evict: u32,
    taken: u32,
    padding: u32,
    // By log2 width.
    tail_superblock: array<u32, 16>,
    tail_filled: array<u32, 16>,
    old_tail: array<u32, 16>,
    first_fresh: array<u32, 16>,
    // By index of level.
    stack_base: array<u32, 120>,
    stacked: array<u32, 120>,
    stacked_before: array<u32, 120>,
    top: array<u32, 120>,
    requested: array<u32, 120>,
    released: array<u32, 120>,
    idle: array<u32, 120>,
    required: array<u32, 120>,
    offset: array<u32, 120>,
}

// What threads add up; cleared before each frame.
struct Tally {
    // Seen patches by ideal area: bins of 1/32 octave.
    areas: array<atomic<u32>, 1024>,
    // Visible patches by importance.
    classes: array<atomic<u32>, 256>,
    // Seen patches by level at the bias.
    levels: array<atomic<u32>, 120>,
    // By how many more have a level at each further step of the bias.
    walk: array<atomic<i32>, 27000>,
}

const NONE: u32 = 0xffffffffu;
const NO_LEVEL: u32 = 0xffffffffu;
const LEVELS: u32 = 120u;

// Bits of ActivePatch.bits.
const LEVEL_BITS: u32 = 0xffu;
const OLD_SHIFT: u32 = 8u;
const SEEN: u32 = 0x10000u;
const LEFT_OUT: u32 = 0x20000u;
const WANTED: u32 = 0x40000u;
const RELEASED: u32 = 0x80000u;
const IDLE: u32 = 0x100000u;
const AGE_SHIFT: u32 = 24u;

// Bits of AtlasState.status.
const STATUS_RAISED: u32 = 1u;
const STATUS_LEFT_OUT: u32 = 2u;
const STATUS_FULL: u32 = 4u;
const STATUS_HIGH_WATER: u32 = 8u;
const STATUS_RESET: u32 = 16u;
const STATUS_BROKEN: u32 = 32u;

// What is to be done, in AtlasState.verdict: ask for the first time; find a
// larger bias and ask again; ask again in an empty atlas; nothing more; stop.
const ASK: u32 = 0u;
const RAISE: u32 = 1u;
const ASK_ANEW: u32 = 2u;
const PLACED: u32 = 3u;
const BROKEN: u32 = 4u;

// Consecutive patches of one thread. Results do not depend on it.
override RUN: u32 = 32u;
alias Sums = vec2<u32>;
// Threads of a group that sums up, at most 256. Results do not depend on it.
override LANES: u32 = 256u;

@group(0) @binding(0) var<uniform> atlas: AtlasParameters;
// By patch; then a bit for each that has any.
@group(0) @binding(1) var<storage, read> pixels_of_patch: array<u32>;
@group(0) @binding(2) var<storage, read> wishes: array<u32>;
// Position, or NONE; level | frames without being seen << 8.
@group(0) @binding(3) var<storage, read_write> blocks: array<vec2<u32>>;
// By ascending patch.
@group(0) @binding(4) var<storage, read_write> active_patches: array<ActivePatch>;
// By run of patches: those that are active, and visible; then where they go. By
// run of active patches: how many change.
@group(0) @binding(5) var<storage, read_write> runs: array<vec2<u32>>;
// Counts, then slots, of each run of active patches: requests by level, released
// blocks by level, idle blocks by level; each a list by run.
@group(0) @binding(6) var<storage, read_write> slots: array<u32>;
@group(0) @binding(7) var<storage, read_write> tally: Tally;
@group(0) @binding(8) var<storage, read_write> state: AtlasState;
// Positions of free blocks, level by level.
@group(0) @binding(9) var<storage, read_write> stacks: array<u32>;
// From the beginning of each run of patches on, those that are active; then from
// the beginning of each run of active patches on, which of them change.
@group(0) @binding(10) var<storage, read_write> listed: array<u32>;
// A bit for each patch that has a block.
@group(0) @binding(11) var<storage, read_write> held: array<atomic<u32>>;

// Where in `slots` the run counts blocks of a kind (0 requests, 1 released, 2
// idle) and level.
fn slot_at(kind: u32, level: u32, run: u32) -> u32 {
    return (kind * level_count() + level) * runs_of(atlas.patch_count) + run;
}
