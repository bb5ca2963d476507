// Points of the sampler, one by one.

const PATCH: u32 = 5u;

// Index, seed and which pair of dimensions.
@group(2) @binding(0) var<storage, read> draws: array<vec4<u32>>;
@group(2) @binding(1) var<storage, read_write> points: array<vec2<f32>>;

@compute @workgroup_size(64)
fn draw(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = thread_of(id, groups);
    if (thread >= arrayLength(&points)) {
        return;
    }
    var rng = Sampler(draws[thread].x, draws[thread].y, draws[thread].z);
    points[thread] = sample_2d(&rng);
}

// Of a patch's texels, with seeds as `start_at_texels` makes them. Index, x and y
// of the texel, and which pair of dimensions.
@compute @workgroup_size(64)
fn draw_at_texels(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = thread_of(id, groups);
    if (thread >= arrayLength(&points)) {
        return;
    }
    let draw = draws[thread];
    let seed = hash(hash(PATCH * 0x9e3779b9u) ^ (draw.y << 16u | draw.z));
    var rng = Sampler(draw.x, seed, draw.w);
    points[thread] = sample_2d(&rng);
}
