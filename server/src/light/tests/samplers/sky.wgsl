// Directions drawn from the picture of all directions.

struct Drawn {
    direction: vec3<f32>,
    // As drawn, and as `environment_density` has it.
    density: f32,
    told: f32,
}

@group(2) @binding(0) var<storage, read> directions: array<vec4<f32>>;
@group(2) @binding(1) var<storage, read_write> drawn: array<Drawn>;
@group(2) @binding(1) var<storage, read_write> densities: array<f32>;

@compute @workgroup_size(64)
fn draw(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = thread_of(id, groups);
    if (thread >= arrayLength(&drawn)) {
        return;
    }
    var rng = sampler_of(thread);
    let u_cell = sample_2d(&rng);
    let found = sample_environment(u_cell, sample_2d(&rng));
    drawn[thread] = Drawn(found.direction, found.density, environment_density(found.direction));
}

@compute @workgroup_size(64)
fn tell(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = thread_of(id, groups);
    if (thread < arrayLength(&densities)) {
        densities[thread] = environment_density(directions[thread].xyz);
    }
}
