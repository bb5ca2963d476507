// What the surroundings of a texel have found, whichever patch they belong to:
// a hash of cells in the world, by place, size and direction. A cell is a few
// pixels wide wherever it is, so that it has no scale of its own. Light is added
// at a jittered place, so that cells blend into each other. What a texel takes
// from them is a mean over cells in the plane about it: walls behind, and walls
// at an angle, have cells of their own.
// Sums are integers: adding them commutes, and the order of threads cannot show.
// Source: Binder et al., "Massively Parallel Path Space Filtering", 2019.

struct Cell {
    // Sums of red, green and blue, and their count, in sixteenths.
    sum: array<atomic<u32>, 3>,
    count: atomic<u32>,
    // Greatest fingerprint of what was added, and greatest complement of one.
    // Places that share an entry of the table by chance differ in them; what
    // such an entry holds is not used.
    greatest: atomic<u32>,
    greatest_complement: atomic<u32>,
}

@group(2) @binding(7) var<storage, read_write> cells: array<Cell>;

const LOG2_CELL_COUNT: u32 = 17u;
const CELL_COUNT: u32 = 1u << LOG2_CELL_COUNT;
const MOST_FINGERPRINT: u32 = (1u << (32u - LOG2_CELL_COUNT)) - 1u;
// Most pixels that a cell is wide, and half as many at least.
const CELL_PIXELS: f32 = 8.0;
// Relative standard deviation assumed of one sample, while too few tell.
const ASSUMED_NOISE: f32 = 0.8;
// Standard deviations of difference that still count as noise.
const CELL_TOLERANCE: f32 = 2.5;
// Cells on either side that a texel's surroundings reach to.
const CELL_REACH: i32 = 2;
// Fixed point of the sums, in displayed brightness, and the brightest that one
// path may add.
const CELL_UNIT: f32 = 1024.0;
const BRIGHTEST: f32 = 64.0;
// Each update forgets this share of what the cells hold.
const FORGETTING: u32 = 10u;

fn cell_width(position: vec3<f32>) -> f32 {
    let distance = max(length(position - parameters.eye), 1e-6);
    return exp2(floor(log2(distance * parameters.pixel_angle * CELL_PIXELS)));
}

// The cell's index, and its fingerprint above it.
fn cell_at(position: vec3<f32>, n: vec3<f32>, width: f32) -> u32 {
    let m = abs(n);
    var side = select(select(2u, 1u, m.y >= m.z), 0u, m.x >= m.y && m.x >= m.z);
    side = side * 2u + select(0u, 1u, n[side] < 0.0);
    let key = bitcast<vec3<u32>>(vec3<i32>(floor(position / width)));
    return hash(key.x ^ hash(key.y ^ hash(key.z ^ hash(side ^ (bitcast<u32>(width) >> 20u)))));
}

// The cell that a path's light is added to, `jitter` from -0.5 to 0.5.
fn cell_around(position: vec3<f32>, n: vec3<f32>, jitter: vec2<f32>) -> u32 {
    let width = cell_width(position);
    let f = frame_around(n);
    return cell_at(position + (f.x * jitter.x + f.y * jitter.y) * width, n, width);
}

fn add_to_cell(key: u32, light: vec3<f32>) {
    let cell = key % CELL_COUNT;
    let fingerprint = key >> LOG2_CELL_COUNT;
    let fixed = vec3<u32>(min(light * parameters.exposure, vec3<f32>(BRIGHTEST)) * CELL_UNIT);
    atomicAdd(&cells[cell].sum[0], fixed.x);
    atomicAdd(&cells[cell].sum[1], fixed.y);
    atomicAdd(&cells[cell].sum[2], fixed.z);
    atomicAdd(&cells[cell].count, 16u);
    atomicMax(&cells[cell].greatest, fingerprint);
    atomicMax(&cells[cell].greatest_complement, MOST_FINGERPRINT - fingerprint);
}

// Sum of a cell's light, and how many paths it comes from: none where it is shared.
fn cell_light(key: u32) -> vec4<f32> {
    let cell = key % CELL_COUNT;
    let fingerprint = key >> LOG2_CELL_COUNT;
    let is_own = atomicLoad(&cells[cell].greatest) == fingerprint
        && atomicLoad(&cells[cell].greatest_complement) == MOST_FINGERPRINT - fingerprint;
    let count = select(0.0, f32(atomicLoad(&cells[cell].count)) / 16.0, is_own);
    let sum = vec3<f32>(vec3<u32>(atomicLoad(&cells[cell].sum[0]), atomicLoad(&cells[cell].sum[1]),
        atomicLoad(&cells[cell].sum[2])));
    return vec4<f32>(sum / (CELL_UNIT * parameters.exposure), 1.0) * vec4<f32>(1.0, 1.0, 1.0, count);
}

// Mean light of the surroundings of a point, and how many paths it comes from.
// Cells count by how likely their difference from `mean`, which comes from
// `samples`, is noise: shadows and highlights keep their shape.
fn light_around(position: vec3<f32>, n: vec3<f32>, mean: f32, samples: f32) -> vec4<f32> {
    let width = cell_width(position);
    let f = frame_around(n);
    var sum = vec4<f32>(0.0);
    for (var y = -CELL_REACH; y <= CELL_REACH; y++) {
        for (var x = -CELL_REACH; x <= CELL_REACH; x++) {
            let aside = vec2<f32>(vec2<i32>(x, y));
            let key = cell_at(position + (f.x * aside.x + f.y * aside.y) * width, n, width);
            let found = cell_light(key);
            let difference = luminance(found.rgb) / max(found.w, 1.0) - mean;
            let noise = ASSUMED_NOISE * max(mean, mean + difference);
            let variance = noise * noise * (1.0 / max(samples, 0.02) + 1.0 / max(found.w, 1.0));
            let likely = exp(-difference * difference / max(CELL_TOLERANCE * CELL_TOLERANCE * variance, 1e-20));
            sum += found * exp(-0.5 * dot(aside, aside)) * likely;
        }
    }
    return vec4<f32>(sum.rgb / max(sum.w, 1e-6), sum.w);
}

@compute @workgroup_size(64)
fn fade_cells(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= CELL_COUNT) {
        return;
    }
    let held = atomicLoad(&cells[id.x].count);
    if (held == 0u) {
        return;
    }
    let left = held - (held + FORGETTING - 1u) / FORGETTING;
    atomicStore(&cells[id.x].count, left);
    for (var i = 0u; i < 3u; i++) {
        let sum = atomicLoad(&cells[id.x].sum[i]);
        atomicStore(&cells[id.x].sum[i], select(0u, sum - sum / FORGETTING, left > 0u));
    }
    if (left == 0u) {
        atomicStore(&cells[id.x].greatest, 0u);
        atomicStore(&cells[id.x].greatest_complement, 0u);
    }
}
