// A still picture through a pinhole camera by the same paths as the atlas.
// A job is a sample of a pixel; those of one sample of all pixels follow each
// other. `sum` gathers radiance and the count of samples.

struct StillParameters {
    world_from_eye: mat3x4<f32>,
    // Tangents of left, right, up and down.
    tangents: vec4<f32>,
    size: vec2<u32>,
    // Of the first job.
    sample_index: u32,
    seed: u32,
}

@group(2) @binding(0) var<uniform> still: StillParameters;
@group(2) @binding(1) var<storage, read_write> sum: array<vec4<f32>>;

@compute @workgroup_size(64)
fn start_at_pixels(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let path = id.x + id.y * groups.x * 64u;
    if (path >= wave.path_count) {
        return;
    }
    let pixels = still.size.x * still.size.y;
    let job = wave.first_job + path;
    let pixel = job % pixels;
    let sample_index = still.sample_index + job / pixels;
    let seed = hash(pixel ^ hash(still.seed));
    var rng = Sampler(sample_index, seed, 0u);
    let corner = vec2<f32>(vec2<u32>(pixel % still.size.x, pixel / still.size.x));
    let at = (corner + sample_2d(&rng)) / vec2<f32>(still.size);
    let direction = normalize(transform_vector(still.world_from_eye, vec3<f32>(
        mix(still.tangents.x, still.tangents.y, at.x),
        mix(still.tangents.z, still.tangents.w, at.y),
        -1.0,
    )));
    var state: PathState;
    state.throughput = vec3<f32>(1.0);
    state.seed = seed;
    state.sample_index = sample_index;
    state.cone = (still.tangents.y - still.tangents.x) / f32(still.size.x);
    paths[path] = state;
    send_nothing(path, SLOT_SUN);
    send_nothing(path, SLOT_LIGHT);
    send(path, SLOT_ONWARDS, transform_point(still.world_from_eye, vec3<f32>(0.0)), direction, INFINITE, 0u);
}

// One thread per pixel among the wave's jobs.
@compute @workgroup_size(64)
fn add_to_pixels(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let first = id.x + id.y * groups.x * 64u;
    let pixels = still.size.x * still.size.y;
    if (first >= min(pixels, wave.path_count)) {
        return;
    }
    var found = vec4<f32>(0.0);
    for (var path = first; path < wave.path_count; path += pixels) {
        found += vec4<f32>(sound(paths[path].radiance), 1.0);
    }
    sum[(wave.first_job + first) % pixels] += found;
}
