// What is seen through each pixel, and the light that paths bring there.
//
// `see` traces one primary ray a pixel, all at the same place in their pixels,
// writes `seen`, `guides` and `coats` and clears `light`. All paths of a pixel
// start where its ray arrived, and `gather` adds up in `light` what they bring:
// direct light is what shadow rays let through, indirect light what comes over
// the ray onwards. Emission that is seen directly is no light but part of the coat.
// Source: Schied et al., "Spatiotemporal Variance-Guided Filtering", 2017, section 3.

@group(2) @binding(1) var<storage, read_write> primary: array<Hit>;
@group(2) @binding(2) var<storage, read_write> seen: array<Seen>;
@group(2) @binding(3) var<storage, read_write> guides: array<Guide>;
@group(2) @binding(4) var<storage, read_write> coats: array<Coat>;
@group(2) @binding(5) var<storage, read_write> light: array<Light>;
// What the sun brings a path's first vertex if nothing is in its way.
@group(2) @binding(6) var<storage, read_write> suns: array<vec3<f32>>;
// `world_from_object` of every instance in the frame before.
@group(2) @binding(7) var<storage, read_write> poses_before: array<mat3x4<f32>>;

// Keeps light over albedo within range on surfaces that reflect next to nothing.
const LEAST_ALBEDO: f32 = 0.001;
// Its square, summed over a window of the filter, still is a number.
const MOST_LIGHT: f32 = 1e18;

fn direction_through(pixel: u32) -> vec3<f32> {
    let at = (vec2<f32>(place_of(pixel)) + view.jitter) / vec2<f32>(view.size);
    return transform_vector(view.world_from_eye, vec3<f32>(
        mix(view.tangents.x, view.tangents.y, at.x),
        mix(view.tangents.z, view.tangents.w, at.y),
        -1.0,
    ));
}

fn eye() -> vec3<f32> {
    return transform_point(view.world_from_eye, vec3<f32>(0.0));
}

fn surface_of(hit: Hit, direction: vec3<f32>) -> Surface {
    return surface_at(hit.triangle, hit.b, -direction, pixel_cone() * hit.t);
}

// Share of even light that both lobes reflect towards the eye.
// Source: Karis, "Physically Based Shading on Mobile", 2014, for the specular one.
fn albedo_of(s: Surface, wo: vec3<f32>) -> vec3<f32> {
    let facing = clamp(dot(s.ns, wo), 0.0, 1.0);
    let r = sqrt(s.alpha) * vec4<f32>(-1.0, -0.0275, -0.572, 0.022) + vec4<f32>(1.0, 0.0425, 1.04, -0.04);
    let a = min(r.x * r.x, exp2(-9.28 * facing)) * r.x + r.y;
    let f0 = mix(vec3<f32>(s.f0), s.base, s.metallic);
    let specular = f0 * (r.z - 1.04 * a) + max(r.w + 1.04 * a, 0.0);
    return max(diffuse_color(s) * (1.0 - s.f0) + specular, vec3<f32>(LEAST_ALBEDO));
}

// The pixel of the frame before in which a point of `point.w` 1, or a direction of
// 0, was seen; far outside where there is none.
fn pixel_before(point: vec4<f32>) -> vec2<f32> {
    let p = point * view.eye_from_world_before;
    let tangents = view.tangents_before;
    let at = (p.xy / -p.z - tangents.xz) / (tangents.yw - tangents.xz);
    let pixel = at * vec2<f32>(view.size) - view.jitter;
    return select(vec2<f32>(-1e6), pixel, p.z < 0.0 && all(abs(pixel) < vec2<f32>(1e6)));
}

@compute @workgroup_size(64)
fn see(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let pixel = id.x + id.y * groups.x * 64u;
    if (pixel >= view.size.x * view.size.y) {
        return;
    }
    let along = direction_through(pixel);
    let direction = normalize(along);
    // A camera's ray does not see single-sided triangles from behind.
    var near_mover = false;
    let hit = trace_past_holes(Ray(eye(), INFINITE, direction, 0.0), false, true, &near_mover);
    primary[pixel] = hit;
    light[pixel] = Light();
    if (hit.triangle == NONE) {
        var sky = vec3<f32>(0.0);
        if (HAS_SKY) {
            sky = min(sound(sky_radiance(direction)), vec3<f32>(MOST_LIGHT));
        }
        seen[pixel] = Seen(direction, NONE, vec3<f32>(0.0), 0.0);
        guides[pixel] = Guide(vec3<f32>(0.0), 0.0, vec2<f32>(0.0), pixel_before(vec4<f32>(direction, 0.0)));
        coats[pixel] = Coat(vec3<f32>(0.0), vec3<f32>(0.0), sky);
        return;
    }
    let s = surface_of(hit, direction);
    let from_eye = direction * hit.t;
    var position = eye() + from_eye;
    var normal = s.ng;
    var position_before = position;
    let instance = triangles[hit.triangle].w >> OBJECT_SHIFT;
    if (HAS_MOVERS && instance != 0u) {
        let object_from_world = instances[instance].object_from_world;
        position = transform_point(object_from_world, position);
        normal = transform_vector(object_from_world, normal);
        position_before = transform_point(poses_before[instance], position);
    }
    seen[pixel] = Seen(position, instance, normal, 0.0);

    // Over a plane, one over depth is dot(normal, ray) / dot(normal, from_eye).
    let pixel_in_eye = (view.tangents.yw - view.tangents.xz) / vec2<f32>(view.size);
    let right = transform_vector(view.world_from_eye, vec3<f32>(pixel_in_eye.x, 0.0, 0.0));
    let down = transform_vector(view.world_from_eye, vec3<f32>(0.0, pixel_in_eye.y, 0.0));
    let slope = vec2<f32>(dot(s.ng, right), dot(s.ng, down)) / min(dot(s.ng, from_eye), -1e-9 * hit.t);
    guides[pixel] = Guide(s.ns, length(along) / hit.t, slope, pixel_before(vec4<f32>(position_before, 1.0)));

    coats[pixel] = Coat(max(sound(albedo_of(s, -direction)), vec3<f32>(LEAST_ALBEDO)), sound(diffuse_color(s)),
        min(sound(s.emissive), vec3<f32>(MOST_LIGHT)));
}

// One thread per path; the paths of one sample of all pixels follow each other.
@compute @workgroup_size(64)
fn start_at_seen(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let path = id.x + id.y * groups.x * 64u;
    if (path >= wave.path_count) {
        return;
    }
    let pixels = view.size.x * view.size.y;
    let job = wave.first_job + path;
    let pixel = job % pixels;
    var state: PathState;
    let hit = primary[pixel];
    if (hit.triangle == NONE) {
        paths[path] = state;
        send_nothing(path, SLOT_SUN);
        send_nothing(path, SLOT_LIGHT);
        send_nothing(path, SLOT_ONWARDS);
        return;
    }
    let direction = normalize(direction_through(pixel));
    state.throughput = vec3<f32>(1.0);
    state.seed = hash(pixel ^ hash(view.seed));
    state.sample_index = view.sample_index + job / pixels;
    state.cone = pixel_cone();
    state.progress = 1u | LOBES_APART;
    leave_vertex(path, surface_of(hit, direction), -direction, 0u, 0u, state);
    // The path forgets it at its next vertex.
    suns[path] = paths[path].sun;
}

fn add(sum: vec4<f32>, found: vec3<f32>, albedo: vec3<f32>) -> vec4<f32> {
    let light_of_sample = min(sound(found) / albedo, vec3<f32>(MOST_LIGHT)) / f32(view.samples);
    return sum + vec4<f32>(light_of_sample, 0.0);
}

// One thread per pixel among the wave's jobs.
@compute @workgroup_size(64)
fn gather(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let first = id.x + id.y * groups.x * 64u;
    let pixels = view.size.x * view.size.y;
    if (first >= min(pixels, wave.path_count)) {
        return;
    }
    let pixel = (wave.first_job + first) % pixels;
    if (primary[pixel].triangle == NONE) {
        return;
    }
    let coat = coats[pixel];
    var sum = light[pixel];
    for (var path = first; path < wave.path_count; path += pixels) {
        let state = paths[path];
        var direct = coat.diffuse * state.direct_diffuse + state.direct_glossy;
        if ((state.progress & SUNLIT) != 0u) {
            direct += suns[path];
        }
        let indirect = (coat.diffuse * state.onward_diffuse + state.onward_glossy) * state.radiance;
        sum[0] = add(sum[0], direct, coat.albedo);
        sum[1] = add(sum[1], indirect, coat.albedo);
    }
    light[pixel] = sum;
}

// One thread per instance.
@compute @workgroup_size(64)
fn remember_poses(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x < min(arrayLength(&instances), arrayLength(&poses_before))) {
        poses_before[id.x] = instances[id.x].world_from_object;
    }
}
