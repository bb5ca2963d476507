// Records and bindings of all kernels that pack triangles. Host structs: mod.rs.

struct TssParameters {
    patch_count: u32,
    // Of the atlas, texels.
    width: u32,
    height: u32,
    most_class: u32,
    keep_unseen: u32,
    padding_0: u32,
    padding_1: u32,
    padding_2: u32,
}

struct ActiveTriangle {
    patch_id: u32,
    pixels: u32,
    // In eighths of a texel, x | y << 16; the first is NONE where it has no slot.
    corners: array<u32, 3>,
    weights: array<u32, 2>,
}

struct TssState {
    active_count: u32,
    seen: u32,
    steps: u32,
    evict: u32,
    placing: u32,
    status: u32,
    used_texels: u32,
    padding: u32,
}

struct CellPlace {
    start: u32,
    in_shelf: u32,
    first: u32,
    next_y: u32,
}

// Triangles by kind: height class * 32 + width class.
struct Tally {
    seen: array<atomic<u32>, 1024>,
    all: array<atomic<u32>, 1024>,
}

const NONE: u32 = 0xffffffffu;
const CLASSES: u32 = 32u;
const STATUS_OVERFULL: u32 = 1u;
const STATUS_EVICTED: u32 = 2u;

// Consecutive patches or triangles of one thread. Results do not depend on it.
override RUN: u32 = 32u;
alias Sums = vec2<u32>;
// Threads of a group that sums up, at most 256. Results do not depend on it.
override LANES: u32 = 256u;
// Of the two digits of a kind, which one is sorted by: first the width's, then the
// height's.
override SECOND_DIGIT: bool = false;

@group(0) @binding(0) var<uniform> tss: TssParameters;
// By patch.
@group(0) @binding(1) var<storage, read> pixels_of_patch: array<u32>;
// See measure.wgsl.
@group(0) @binding(2) var<storage, read> shapes: array<vec2<u32>>;
// Frames for which a patch has not been visible, or NONE: too many.
@group(0) @binding(3) var<storage, read_write> ages: array<u32>;
// By ascending patch.
@group(0) @binding(4) var<storage, read_write> triangles: array<ActiveTriangle>;
// By run of patches: those that are active, and visible; then what is before them.
@group(0) @binding(5) var<storage, read_write> runs: array<vec2<u32>>;
// Cleared before each frame.
@group(0) @binding(6) var<storage, read_write> tally: Tally;
// By kind.
@group(0) @binding(7) var<storage, read_write> cells: array<CellPlace, 1024>;
// By digit and run of triangles: how many; then what is before them.
@group(0) @binding(8) var<storage, read_write> digits: array<u32>;
// Triangles by the first digit, and behind them by both.
@group(0) @binding(9) var<storage, read_write> order: array<u32>;
@group(0) @binding(10) var<storage, read_write> state: TssState;

// Sides in texels' distances by class. Twin: SPANS in pack.rs.
var<private> spans: array<u32, 32> = array<u32, 32>(
    1u, 1u, 1u, 2u, 2u, 2u, 3u, 3u, 4u, 5u, 6u, 7u, 8u, 10u, 11u, 13u, 16u, 19u, 23u, 27u, 32u, 38u,
    45u, 54u, 64u, 76u, 91u, 108u, 128u, 152u, 181u, 215u,
);

// A triangle is slanted where its longest edge is four times its height, steps.
const SLANTED: u32 = 512u;

fn class_of(steps: u32) -> u32 {
    return min(min((steps + 32u) >> 6u, CLASSES - 1u), tss.most_class);
}

// Height and width class of what a triangle deserves.
fn deserved(shape: vec2<u32>) -> vec2<u32> {
    let width = shape.x & 0xffffu;
    let height = shape.x >> 16u;
    if (width >= height + SLANTED) {
        return vec2<u32>(class_of(height), class_of(width));
    }
    return vec2<u32>(class_of((width + height) >> 1u));
}

fn scaled(class_id: vec2<u32>, steps: u32) -> vec2<u32> {
    return class_id - min(class_id, vec2<u32>(steps));
}

// Width and height of a kind's rectangle, and how many triangles it holds.
fn rectangle_of(height: u32, width: u32) -> vec3<u32> {
    if (height != width) {
        return vec3<u32>(spans[width] + 1u, spans[height] + 1u, 1u);
    }
    // Two right angles and the diagonals that lookups between them need.
    return vec3<u32>(select(spans[width] + 4u, 4u, spans[width] == 1u), spans[height] + 1u, 2u);
}

fn is_placed(i: u32) -> bool {
    return state.evict == 0u || triangles[i].pixels != 0u;
}
