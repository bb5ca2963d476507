// Samples of a shape, mapped back to the unit square so that equal areas of it
// are as likely: by cosine in the hemisphere, by solid angle in a cone, by area on a lamp.

@group(2) @binding(0) var<storage, read> shapes: array<vec4<f32>>;
@group(2) @binding(1) var<storage, read_write> squared: array<vec2<f32>>;

// About an axis: what share of the directions is nearer to it, and the azimuth in turns.
fn square_of(nearer: f32, v: vec3<f32>) -> vec2<f32> {
    let turn = atan2(v.y, v.x) / (2.0 * PI);
    return vec2<f32>(nearer, turn - floor(turn));
}

@compute @workgroup_size(64)
fn in_hemisphere(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = thread_of(id, groups);
    if (thread >= arrayLength(&squared)) {
        return;
    }
    var rng = sampler_of(thread);
    let v = cosine_hemisphere(sample_2d(&rng));
    squared[thread] = square_of(dot(v.xy, v.xy), v);
}

// A shape is the cone's axis and the cosine of its half angle.
@compute @workgroup_size(64)
fn in_cone(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = thread_of(id, groups);
    if (thread >= arrayLength(&squared)) {
        return;
    }
    let cone = shapes[thread / (arrayLength(&squared) / arrayLength(&shapes))];
    var rng = sampler_of(thread);
    let v = to_local(frame_around(cone.xyz), sample_cone(cone.xyz, cone.w, sample_2d(&rng)));
    // 1 - cos of the sine, which does not cancel.
    squared[thread] = square_of(dot(v.xy, v.xy) / (1.0 + v.z) / (1.0 - cone.w), v);
}

// The shapes are a corner of the scene's only lamp and the edges from there.
@compute @workgroup_size(64)
fn on_lamp(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = thread_of(id, groups);
    if (thread >= arrayLength(&squared)) {
        return;
    }
    var s: Surface;
    s.ns = vec3<f32>(0.0, 1.0, 0.0);
    s.ng = s.ns;
    s.alpha = 1.0;
    var rng = sampler_of(thread);
    let found = lamp_sample(s, s.ns, 0.5, sample_2d(&rng), false);
    let e1 = shapes[1].xyz;
    let e2 = shapes[2].xyz;
    let n = cross(e1, e2);
    let p = found.direction * found.distance - shapes[0].xyz;
    let b = vec2<f32>(dot(cross(p, e2), n), dot(cross(e1, p), n)) / dot(n, n);
    squared[thread] = vec2<f32>((b.x + b.y) * (b.x + b.y), b.y / (b.x + b.y));
}
