// How each triangle that may be placed looks from an eye. One thread per patch, which
// is a triangle. Joined with scene.wgsl and edges.wgsl. Twin: shape.rs.
// Source: SAS 2018, equation 1; SnakeBinning 2021, section 3.1.

struct MeasureParameters {
    patch_count: u32,
    pixels_per_radian: f32,
    keep_unseen: u32,
    padding: u32,
}

@group(1) @binding(0) var<uniform> measuring: MeasureParameters;
@group(1) @binding(1) var<storage, read> pixels_of_patch: array<u32>;
// Frames for which it has not been visible, or NEVER.
@group(1) @binding(2) var<storage, read> ages: array<u32>;
// Triangle, and its object.
@group(1) @binding(3) var<storage, read> patches: array<vec2<u32>>;
// The eye in the space of each object, the world's first.
@group(1) @binding(4) var<storage, read> eyes: array<vec4<f32>>;
// Lengths: log2 of the longest edge | of the height on it << 16, in 256ths of an octave.
// The rest: foot of the height, eighths | longest edge << 4 | depths << 8, << 16, << 24.
@group(1) @binding(5) var<storage, read_write> shapes: array<vec2<u32>>;

const MOST_STEPS: i32 = 4095;
const NEARNESS_OCTAVE: f32 = 16.0;
const MOST_DEPTH_RATIO: f32 = 16.0;

fn length_steps(length: f32) -> u32 {
    return u32(clamp(steps_of(log2(max(length, SMALLEST_LENGTH))), 0, MOST_STEPS));
}

// In a camera that looks at the middle of the triangle.
fn depth_word(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, eye: vec3<f32>) -> u32 {
    let middle = ((a - eye) + (b - eye) + (c - eye)) / 3.0;
    let forwards = middle / max(length(middle), 1e-30);
    let depths = vec3<f32>(dot(a - eye, forwards), dot(b - eye, forwards), dot(c - eye, forwards));
    let furthest = max(depths.x, max(depths.y, depths.z));
    if (!(furthest > 0.0 && furthest < 1e30)) {
        return 0u;
    }
    let nearest = max(min(depths.x, min(depths.y, depths.z)), furthest / MOST_DEPTH_RATIO);
    let steps = min(vec3<u32>(round(log2(max(depths, vec3<f32>(nearest)) / nearest) * NEARNESS_OCTAVE)), vec3<u32>(64u));
    return (steps.x << 8u) | (steps.y << 16u) | (steps.z << 24u);
}

@compute @workgroup_size(64)
fn measure_triangles(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = id.x + id.y * groups.x * 64u;
    if (index >= measuring.patch_count) {
        return;
    }
    if (pixels_of_patch[index] == 0u && ages[index] >= measuring.keep_unseen) {
        return;
    }
    let triangle = patches[index].x;
    let eye = eyes[patches[index].y].xyz;
    let a = vertex_position(triangle, 0u);
    let b = vertex_position(triangle, 1u);
    let c = vertex_position(triangle, 2u);
    var edges = array<f32, 3>(pixels_of_edge(a, b, eye, measuring.pixels_per_radian),
        pixels_of_edge(b, c, eye, measuring.pixels_per_radian),
        pixels_of_edge(c, a, eye, measuring.pixels_per_radian));
    var longest = 0u;
    for (var i = 1u; i < 3u; i++) {
        if (edges[i] > edges[longest]) {
            longest = i;
        }
    }
    let base = max(edges[longest], SMALLEST_LENGTH);
    let after = edges[(longest + 1u) % 3u];
    let before = edges[(longest + 2u) % 3u];
    let height = 2.0 * triangle_area(edges[0], edges[1], edges[2]) / base;
    // Law of cosines, in units of the base.
    let squares = (before - after) / base * ((before + after) / base);
    // What is no number may be any.
    let foot = min(u32(clamp(round(4.0 * (1.0 + squares)), 0.0, 8.0)), 8u);
    shapes[index] = vec2<u32>(length_steps(base) | (length_steps(height) << 16u),
        foot | (longest << 4u) | depth_word(a, b, c, eye));
}
