// How often lamps are chosen for a point and normal, and how often they are said to be.

struct Receiver {
    position: vec4<f32>,
    normal: vec4<f32>,
}

struct Choice {
    light: u32,
    probability: f32,
    // The same by way of the light's trail.
    by_trail: f32,
}

@group(2) @binding(0) var<storage, read> receivers: array<Receiver>;
@group(2) @binding(1) var<storage, read_write> choices: array<Choice>;
@group(2) @binding(1) var<storage, read_write> densities: array<f32>;

// A choice for every sample of every receiver.
@compute @workgroup_size(64)
fn choose(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = thread_of(id, groups);
    if (thread >= arrayLength(&choices)) {
        return;
    }
    let receiver = receivers[thread / (arrayLength(&choices) / arrayLength(&receivers))];
    var rng = sampler_of(thread);
    let choice = choose_lamp(receiver.position.xyz, receiver.normal.xyz, sample_2d(&rng).x);
    let by_trail = probability_of(lights[choice.light].trail, receiver.position.xyz, receiver.normal.xyz);
    choices[thread] = Choice(choice.light, choice.probability, by_trail);
}

// For every receiver the probabilities of all lights, then the densities of all triangles.
@compute @workgroup_size(64)
fn tell(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = thread_of(id, groups);
    if (thread >= arrayLength(&densities)) {
        return;
    }
    let per_receiver = arrayLength(&densities) / arrayLength(&receivers);
    let receiver = receivers[thread / per_receiver];
    let p = receiver.position.xyz;
    let n = receiver.normal.xyz;
    let index = thread % per_receiver;
    if (index < globals.light_count) {
        densities[thread] = probability_of(lights[index].trail, p, n);
    } else {
        densities[thread] = lamp_density(index - globals.light_count, p, n);
    }
}
