// Records and bindings of all kernels of the snake. Host structs: mod.rs, bins.rs.

struct SnakeParameters {
    patch_count: u32,
    width: u32,
    // Units of the height, and rows of texels in a unit.
    units: u32,
    unit: u32,
    // Columns of the narrowest superblock.
    least_width: u32,
    // Index of the largest size that has room.
    largest: u32,
    // Texels that the visible set may cost.
    budget: u32,
    most_triangles: u32,
    keep_unseen: u32,
    bias: i32,
    // 1 where the atlas is to be reset in any case.
    reset: u32,
    padding: u32,
}

struct Template {
    height: u32,
    length: u32,
    tip: u32,
    // The first bin with this very footprint.
    same: u32,
    to_odd: u32,
    to_even: u32,
    // Texels of a triangle in a long row.
    cost: u32,
    // log2 height | log2 length << 16, steps.
    logs: u32,
}

struct ActiveTriangle {
    patch_id: u32,
    pixels: u32,
    bits: u32,
    // Bin | turn << 12 | depths << 15 | ODD, or NONE. Until bins are mapped, the bin
    // that the triangle would choose.
    shape: u32,
    index: u32,
    // x | y << 16 of the first texel.
    at: u32,
}

// Rows of a superblock that a bin has: first unit, units, triangles that have room.
struct Extent {
    superblock: u32,
    first: u32,
    units: u32,
    capacity: u32,
}

// How many extents a bin has, and triangles that have room in all of them.
struct Room {
    extents: u32,
    capacity: u32,
}

struct Superblock {
    x: u32,
    width: u32,
    // Units in use, and the most that were.
    used: u32,
    peak: u32,
}

struct SnakeState {
    active_count: u32,
    visible: u32,
    changed: u32,
    bias: i32,
    verdict: u32,
    status: u32,
    frozen_for: u32,
    superblock_count: u32,
    requests: u32,
    words: u32,
    looks: u32,
    reserved: atomic<u32>,
    bins: atomic<u32>,
    slots: atomic<u32>,
    // What of the bias the empty atlas asked for.
    raised: i32,
    padding: u32,
    superblocks: array<Superblock, 32>,
    // Units of each superblock that are taken.
    rows: array<u32, 512>,
    rooms: array<Room, 720>,
    // Of each bin, one after another.
    extents: array<Extent, 5760>,
    list: array<u32, 720>,
}

// What becomes of a bin in this frame.
struct Plan {
    // Where its triangles go.
    target_bin: u32,
    flags: u32,
    // First of the words of its slots.
    first_word: u32,
    // First of its requests.
    first_request: u32,
}

// What threads add up; cleared before each frame.
struct SnakeTally {
    // By bin: triangles that would choose it.
    demand: array<atomic<u32>, 720>,
    // That ask for a slot there, keep one, keep one out of sight.
    wants: array<atomic<u32>, 720>,
    stays: array<atomic<u32>, 720>,
    idles: array<atomic<u32>, 720>,
    // Behind the last slot in use.
    ends: array<atomic<u32>, 720>,
    // Seen triangles by height and stretch.
    cells: array<atomic<u32>, 1280>,
    // Visible triangles by importance.
    classes: array<atomic<u32>, 256>,
}

const NONE: u32 = 0xffffffffu;
const BINS: u32 = 720u;
const MOST_EXTENTS: u32 = 8u;
const CELLS: u32 = 1280u;

// Bits of ActiveTriangle.bits.
const SEEN: u32 = 1u;
const LEFT_OUT: u32 = 2u;
const HAD: u32 = 4u;
const KEPT: u32 = 8u;
const WANTED: u32 = 16u;
const CHANGED: u32 = 32u;
const IDLE: u32 = 64u;
const AGE_SHIFT: u32 = 24u;
const ODD: u32 = 0x40000000u;

// Bits of SnakeState.status.
const STATUS_RAISED: u32 = 1u;
const STATUS_LEFT_OUT: u32 = 2u;
const STATUS_FULL: u32 = 4u;
const STATUS_FROZEN: u32 = 8u;
const STATUS_RESET: u32 = 16u;

// Bits of Plan.flags: was given rows in this frame or lost them; triangles out of
// sight give their slots back.
const MOVED: u32 = 1u;
const EVICTS: u32 = 2u;

// What is to be done, in SnakeState.verdict: ask for the first time; ask in an
// empty atlas, and so on while the bias rises; nothing more.
const ASK: u32 = 0u;
const ASK_ANEW: u32 = 1u;
const ASK_LAST: u32 = 5u;
const PLACED: u32 = 6u;

// Consecutive triangles of one thread. Results do not depend on it.
override RUN: u32 = 32u;
alias Sums = vec4<u32>;
// Threads of a group that sums up, at most 256. Results do not depend on it.
override LANES: u32 = 256u;

@group(0) @binding(0) var<uniform> snake: SnakeParameters;
// By patch.
@group(0) @binding(1) var<storage, read> pixels_of_patch: array<u32>;
// log2 length | log2 height << 16; tip | turn << 12 | depths << 15.
@group(0) @binding(2) var<storage, read> wishes: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> templates: array<Template>;
// Shape without ODD or NONE; index | frames without being seen << 24.
@group(0) @binding(4) var<storage, read_write> slots: array<vec2<u32>>;
// By ascending patch.
@group(0) @binding(5) var<storage, read_write> active_triangles: array<ActiveTriangle>;
// By run of patches: those that are active, visible, new or just gone; then the
// first of them.
@group(0) @binding(6) var<storage, read_write> runs: array<vec4<u32>>;
// By digit of a bin and run: how many, then where they go; behind all, by digit.
@group(0) @binding(7) var<storage, read_write> digits: array<u32>;
@group(0) @binding(8) var<storage, read_write> tally: SnakeTally;
@group(0) @binding(9) var<storage, read_write> state: SnakeState;
@group(0) @binding(10) var<storage, read_write> plans: array<Plan>;
// From the beginning of each run of patches on, those that are active; then the
// requests, half sorted.
@group(0) @binding(11) var<storage, read_write> listed: array<u32>;
// The requests by bin and patch.
@group(0) @binding(12) var<storage, read_write> requests: array<u32>;
// Slots that are taken, a bit each, from a new word on for each bin.
@group(0) @binding(13) var<storage, read_write> taken: array<atomic<u32>>;
// Free slots before each of those words.
@group(0) @binding(14) var<storage, read_write> free_before: array<u32>;
