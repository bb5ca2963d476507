// Smooths what few samples have lit: the mean over a small window of the block
// of the radiance divided by the base colour, each neighbour counting by its
// samples and by how likely the difference is noise; and where even the window
// holds few samples, the mean of the surroundings in the world. Both fade out as
// samples come in, so that a still scene converges to what was traced. The sun
// and emission are free of noise and are left as they are.
// One workgroup per block; reads `radiance`, `crisp`, `surfaces` and `cells`,
// writes `shown`.
// Source: Schied et al., "Spatiotemporal Variance-Guided Filtering", 2017,
// sections 4.1 and 4.4, with one small window instead of a pyramid.

@group(2) @binding(5) var<storage, read_write> shown: array<vec4<f32>>;

// Texels on either side that are looked at.
const RADIUS: i32 = 3;
// Samples after which a texel stands for itself.
const ENOUGH_SAMPLES: f32 = 48.0;
// Standard deviations of difference that still count as noise.
const TOLERANCE: f32 = 3.0;
// Relative standard deviation assumed of one sample, while too few tell.
const ASSUMED_NOISE: f32 = 0.8;
// Samples that the surroundings count for.
const CELL_WEIGHT: f32 = 6.0;

// Light over base colour, and its variance.
fn demodulated(at: u32) -> vec4<f32> {
    let albedo = max(surfaces[at].rgb, vec3<f32>(DARKEST));
    let samples = radiance[at].w;
    let rest = max(radiance[at].rgb - crisp[at].rgb, vec3<f32>(0.0));
    let mean = luminance(rest);
    let measured = max(surfaces[at].w - mean * mean, 0.0);
    let assumed = ASSUMED_NOISE * ASSUMED_NOISE * mean * mean;
    let of_one = mix(assumed, measured, clamp((samples - 1.0) / 8.0, 0.0, 1.0));
    let scale = luminance(albedo);
    return vec4<f32>(rest / albedo, of_one / max(samples, 0.02) / (scale * scale));
}

// Light around a texel of a block, and how many paths it comes from.
fn surroundings(block: BlockRecord, p: vec2<i32>, size: vec2<i32>) -> vec4<f32> {
    let point = block_point(block.layout_bits, vec2<f32>(p) / vec2<f32>(size - 1));
    let triangle = block.first_triangle + point.triangle;
    let p0 = vertex_position(triangle, 0u);
    let e1 = vertex_position(triangle, 1u) - p0;
    let e2 = vertex_position(triangle, 2u) - p0;
    var position = p0 + e1 * point.b.x + e2 * point.b.y;
    var n = normalize(cross(e1, e2));
    let instance = block.layout_bits >> 16u;
    if (HAS_MOVERS && instance != 0u) {
        position = transform_point(instances[instance].world_from_object, position);
        n = transform_vector(instances[instance].world_from_object, n);
    }
    n = select(-n, n, dot(n, parameters.eye - position) >= 0.0);
    return cell_light(cell_around(position, n, vec2<f32>(0.0)));
}

@compute @workgroup_size(64)
fn smooth_blocks(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32) {
    let index = group.x + group.y * groups.x;
    if (index >= parameters.block_count) {
        return;
    }
    let block = blocks[index];
    let size = vec2<i32>(vec2<u32>(1u << (block.layout_bits & 15u), 1u << ((block.layout_bits >> 4u) & 15u)));
    let corner = vec2<i32>(vec2<u32>(block.position & 0xffffu, block.position >> 16u));
    let width = i32(parameters.atlas_width);
    for (var i = i32(lane); i < size.x * size.y; i += 64) {
        let p = vec2<i32>(i % size.x, i / size.x);
        let at = u32((corner.y + p.y) * width + corner.x + p.x);
        let here = radiance[at];
        if (here.w >= ENOUGH_SAMPLES || here.w <= 0.0) {
            shown[at] = here;
            continue;
        }
        let centre = demodulated(at);
        var sum = vec3<f32>(0.0);
        var weights = 0.0;
        let low = max(p - RADIUS, vec2<i32>(0));
        let high = min(p + RADIUS, size - 1);
        for (var y = low.y; y <= high.y; y++) {
            for (var x = low.x; x <= high.x; x++) {
                let near = u32((corner.y + y) * width + corner.x + x);
                let other = demodulated(near);
                let difference = luminance(other.rgb) - luminance(centre.rgb);
                let noise = max(centre.w + other.w, 1e-8);
                let weight = radiance[near].w * exp(-difference * difference / (TOLERANCE * TOLERANCE * noise));
                sum += other.rgb * weight;
                weights += weight;
            }
        }
        let around = surroundings(block, p, size);
        let trust = CELL_WEIGHT * clamp(around.w / 16.0, 0.0, 1.0);
        let albedo = max(surfaces[at].rgb, vec3<f32>(DARKEST));
        let light = (sum + around.rgb * trust) / max(weights + trust, 1e-6);
        let smoothed = crisp[at].rgb + light * albedo;
        shown[at] = vec4<f32>(mix(smoothed, here.rgb, here.w / ENOUGH_SAMPLES), here.w);
    }
}
