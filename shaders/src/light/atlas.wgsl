// Begins paths at texels of placed patches, and accumulates what they bring.
// One thread per job; jobs of a block are consecutive, `blocks` is ascending
// in `first_job`. Reads the scene and `blocks`; updates `radiance` (mean and
// weight), `crisp` (the part of it that is free of noise) and `surfaces` (mean
// base colour, and of the squared luminance of the rest).
// Twin of the mapping: patch_point.rs. Source: SAS 2018, section 3.2; figure 6.

struct LightParameters {
    eye: vec3<f32>,
    block_count: u32,
    atlas_width: u32,
    seed: u32,
    padding: vec2<u32>,
}

struct BlockRecord {
    first_job: u32,
    // x | y << 16
    position: u32,
    // log2 width | log2 height << 4 | shape << 8 | log2 stride << 10 | turned << 14 | instance << 16
    layout_bits: u32,
    first_triangle: u32,
    sample_index: u32,
    patch_id: u32,
    // Samples over which the mean runs at most.
    longest_history: f32,
    padding: u32,
}

@group(2) @binding(0) var<uniform> parameters: LightParameters;
@group(2) @binding(1) var<storage, read> blocks: array<BlockRecord>;
@group(2) @binding(2) var<storage, read_write> radiance: array<vec4<f32>>;
@group(2) @binding(3) var<storage, read_write> surfaces: array<vec4<f32>>;

@group(2) @binding(6) var<storage, read_write> crisp: array<vec4<f32>>;

// Samples over which the mean runs where a moving object was met.
const MOVING_HISTORY: f32 = 6.0;

const TURNED: u32 = 1u << 14u;

struct PatchPoint {
    // Which of the patch's triangles.
    triangle: u32,
    // Weights of its corners 1 and 2.
    b: vec2<f32>,
}

// The point of a block's patch at `p`, from 0 to 1 along the block's sides.
fn block_point(layout_bits: u32, p: vec2<f32>) -> PatchPoint {
    return patch_point((layout_bits >> 8u) & 3u, select(p, p.yx, (layout_bits & TURNED) != 0u));
}

// The point of a patch at patch coordinates `p`.
fn patch_point(shape: u32, p_in: vec2<f32>) -> PatchPoint {
    var p = p_in;
    if (shape == 0u) {
        let over = max(p.x + p.y - 1.0, 0.0) * 0.5;
        p = max(p - over, vec2<f32>(0.0));
        return PatchPoint(0u, p);
    }
    if (shape == 1u) {
        if (p.x + p.y <= 1.0) {
            return PatchPoint(0u, p);
        }
        // Corners 1 2 3: weights 1 - v, u + v - 1, 1 - u.
        return PatchPoint(1u, vec2<f32>(p.x + p.y - 1.0, 1.0 - p.x));
    }
    let left = 2.0 * p.x + p.y;
    if (left <= 1.0) {
        // Corners 0 1 4.
        return PatchPoint(0u, vec2<f32>(2.0 * p.x, p.y));
    }
    let right = 2.0 * p.x - p.y;
    if (right >= 1.0) {
        // Corners 1 2 3.
        return PatchPoint(2u, vec2<f32>(right - 1.0, p.y));
    }
    // Corners 1 3 4.
    let b3 = p.x - 0.5 * (1.0 - p.y);
    return PatchPoint(1u, vec2<f32>(b3, p.y - b3));
}

struct Job {
    block: BlockRecord,
    // First of the texels that the path lights, in the block.
    corner: vec2<u32>,
    size: vec2<u32>,
    // Texels that it lights on either axis.
    stride: u32,
}

fn job_at(index: u32) -> Job {
    var low = 0u;
    var high = parameters.block_count - 1u;
    while (low < high) {
        let middle = (low + high + 1u) / 2u;
        if (blocks[middle].first_job <= index) {
            low = middle;
        } else {
            high = middle - 1u;
        }
    }
    var job: Job;
    job.block = blocks[low];
    let log_stride = (job.block.layout_bits >> 10u) & 15u;
    job.size = vec2<u32>(1u << (job.block.layout_bits & 15u), 1u << ((job.block.layout_bits >> 4u) & 15u));
    job.stride = 1u << log_stride;
    let columns = max(job.size.x >> log_stride, 1u);
    let local = index - job.block.first_job;
    job.corner = vec2<u32>(local % columns, local / columns) * job.stride;
    return job;
}

@compute @workgroup_size(64)
fn start_at_texels(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let path = id.x + id.y * groups.x * 64u;
    if (path >= wave.path_count) {
        return;
    }
    let job = job_at(wave.first_job + path);
    let seed = hash(hash(job.block.patch_id * 0x9e3779b9u + parameters.seed) ^ (job.corner.x << 16u | job.corner.y));
    var rng = Sampler(job.block.sample_index, seed, 0u);
    let extent = vec2<f32>(job.size - 1u);
    let middle = vec2<f32>(job.corner) + 0.5 * f32(job.stride - 1u);
    // Jitter inside the texel; what would leave the patch is reflected back in.
    var p = (middle + (sample_2d(&rng) - 0.5) * f32(job.stride)) / extent;
    p = 1.0 - abs(1.0 - abs(p));
    // Kept off the very edge, where two walls of a corner meet.
    p = mix(vec2<f32>(0.02) / extent, 1.0 - vec2<f32>(0.02) / extent, clamp(p, vec2<f32>(0.0), vec2<f32>(1.0)));

    let instance = job.block.layout_bits >> 16u;
    let point = block_point(job.block.layout_bits, p);
    let triangle = job.block.first_triangle + point.triangle;
    let p0 = vertex_position(triangle, 0u);
    let e1 = vertex_position(triangle, 1u) - p0;
    let e2 = vertex_position(triangle, 2u) - p0;
    var position = p0 + e1 * point.b.x + e2 * point.b.y;
    let doubled = cross(e1, e2);
    var n = normalize(doubled);
    if (HAS_MOVERS && instance != 0u) {
        position = transform_point(instances[instance].world_from_object, position);
        n = transform_vector(instances[instance].world_from_object, n);
    }
    let to_eye = parameters.eye - position;
    let distance = length(to_eye);
    var wo = select(vec3<f32>(0.0, 1.0, 0.0), to_eye / distance, distance > 1e-6);
    // A single-sided patch behind whose plane the eye has gone is lit as from its edge.
    if (materials[triangles[triangle].w & MATERIAL_MASK].double_sided == 0u && dot(wo, n) < 0.001) {
        wo = normalize(wo + n * (0.001 - dot(wo, n)));
    }
    let texels_of_triangle = max(extent.x * extent.y, 1.0) * 0.5;
    let width = sqrt(0.5 * length(doubled) / texels_of_triangle) * f32(job.stride);
    let surface = surface_at(triangle, point.b, wo, width);
    var state: PathState;
    state.throughput = vec3<f32>(1.0);
    state.radiance = surface.emissive;
    state.seed = seed;
    state.sample_index = job.block.sample_index;
    state.progress = 1u;
    state.albedo = surface.base;
    state.crisp = surface.emissive;
    state.cell = cell_around(surface.position, surface.ng, sample_2d(&rng) - 0.5);
    leave_vertex(path, surface, wo, 0u, 0u, state);
}

@compute @workgroup_size(64)
fn accumulate(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let path = id.x + id.y * groups.x * 64u;
    if (path >= wave.path_count) {
        return;
    }
    let job = job_at(wave.first_job + path);
    let found = radiance_of(path);
    // A coarse look is one sample, shared by the texels that it lights.
    let weight_of_sample = 1.0 / f32(job.stride * job.stride);
    let sharp = min(paths[path].crisp, found);
    let rest = found - sharp;
    add_to_cell(paths[path].cell, rest / max(paths[path].albedo, vec3<f32>(DARKEST)));
    var longest = job.block.longest_history;
    if ((paths[path].progress & NEAR_MOVER) != 0u) {
        longest = min(longest, MOVING_HISTORY);
    }
    let square = luminance(rest) * luminance(rest);
    for (var y = 0u; y < min(job.stride, job.size.y - job.corner.y); y++) {
        for (var x = 0u; x < min(job.stride, job.size.x - job.corner.x); x++) {
            let at = ((job.block.position >> 16u) + job.corner.y + y) * parameters.atlas_width
                + (job.block.position & 0xffffu) + job.corner.x + x;
            let old = radiance[at];
            let history = min(old.w, longest);
            let share = weight_of_sample / (history + weight_of_sample);
            radiance[at] = vec4<f32>(mix(old.rgb, found, share), history + weight_of_sample);
            crisp[at] = mix(crisp[at], vec4<f32>(sharp, 0.0), share);
            surfaces[at] = mix(surfaces[at], vec4<f32>(paths[path].albedo, square), share);
        }
    }
}
