// What the surroundings of a texel have found, whichever patch they belong to:
// a hash of cells in the world, by place, size and direction. A cell is about
// ten pixels wide wherever it is, so that it has no scale of its own. Light is
// added at a jittered place, so that cells blend into each other.
// Sums are integers: adding them commutes, and the order of threads cannot show.
// Source: Binder et al., "Massively Parallel Path Space Filtering", 2019.

// Red, green, blue and count of each cell.
@group(2) @binding(7) var<storage, read_write> cells: array<atomic<u32>>;

const CELL_COUNT: u32 = 65536u;
// Width of a cell per metre of distance.
const CELL_ANGLE: f32 = 0.08;
// Fixed point of the sums, and the brightest that one path may add.
const CELL_UNIT: f32 = 1024.0;
const BRIGHTEST: f32 = 64.0;
// Each update forgets this share of what the cells hold.
const FORGETTING: u32 = 24u;

fn cell_around(position: vec3<f32>, n: vec3<f32>, jitter: vec2<f32>) -> u32 {
    let distance = max(length(position - parameters.eye), 1e-6);
    let level = floor(log2(distance * CELL_ANGLE));
    let width = exp2(level);
    let f = frame_around(n);
    let place = vec3<i32>(floor((position + (f.x * jitter.x + f.y * jitter.y) * width) / width));
    let m = abs(n);
    var side = select(select(2u, 1u, m.y >= m.z), 0u, m.x >= m.y && m.x >= m.z);
    side = side * 2u + select(0u, 1u, n[side] < 0.0);
    let key = bitcast<vec3<u32>>(place);
    return hash(key.x ^ hash(key.y ^ hash(key.z ^ hash(side ^ (bitcast<u32>(i32(level)) << 3u))))) % CELL_COUNT;
}

fn add_to_cell(cell: u32, light: vec3<f32>) {
    let fixed = vec3<u32>(min(light, vec3<f32>(BRIGHTEST)) * CELL_UNIT);
    atomicAdd(&cells[cell * 4u], fixed.x);
    atomicAdd(&cells[cell * 4u + 1u], fixed.y);
    atomicAdd(&cells[cell * 4u + 2u], fixed.z);
    atomicAdd(&cells[cell * 4u + 3u], 16u);
}

// Mean light of a cell, and how many paths it comes from.
fn cell_light(cell: u32) -> vec4<f32> {
    let count = f32(atomicLoad(&cells[cell * 4u + 3u])) / 16.0;
    let sum = vec3<f32>(vec3<u32>(atomicLoad(&cells[cell * 4u]), atomicLoad(&cells[cell * 4u + 1u]),
        atomicLoad(&cells[cell * 4u + 2u])));
    return vec4<f32>(sum / (CELL_UNIT * max(count, 1.0)), count);
}

@compute @workgroup_size(64)
fn fade_cells(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x < CELL_COUNT * 4u) {
        let held = atomicLoad(&cells[id.x]);
        atomicStore(&cells[id.x], held - held / FORGETTING);
    }
}
