// Light paths in waves: `start` kernels make the first vertex of each path and
// its rays, `trace_rays` traces them, `advance` gathers what they found and
// makes the next vertex, until no path has a ray left.
//
// At every vertex the sun has a shadow ray of its own: it outshines all else
// where it shines and is nothing in the shade, which no choice by unshadowed
// contribution can know. All other lights share one, chosen so. The sky is met
// by the rays that leave the scene, and at the last vertex, which sends none,
// by a shadow ray.

struct PathState {
    throughput: vec3<f32>,
    // Density of the ray onwards; zero where the emission it meets counts in full.
    pdf: f32,
    radiance: vec3<f32>,
    // Vertex in the lower half; NEAR_MOVER.
    progress: u32,
    // What the shadow rays bring if nothing is in their way.
    sun: vec3<f32>,
    seed: u32,
    light: vec3<f32>,
    sample_index: u32,
    // Width of the sample per metre of the ray onwards.
    cone: f32,
    // Of the first vertex.
    albedo: vec3<f32>,
    // Where its light is shared with its surroundings.
    cell: u32,
    // What needs no smoothing: emission, and the sun at the first vertex.
    crisp: vec3<f32>,
    padding: u32,
}

@group(1) @binding(2) var<storage, read_write> paths: array<PathState>;

const SLOT_SUN: u32 = 0u;
const SLOT_LIGHT: u32 = 1u;
const SLOT_ONWARDS: u32 = 2u;
// Dimension pairs that the start of a path draws.
const PAIRS_AT_START: u32 = 2u;
// Dimension pairs that one vertex may draw.
const PAIRS_PER_VERTEX: u32 = 8u;

// Candidates drawn from the lamps by power, before one light is chosen.
const LAMP_CANDIDATES: u32 = 2u;
const INFINITE: f32 = 3.0e38;
// Share of the faintest contributions that still get a shadow ray.
const LEAST_SURVIVAL: f32 = 0.1;

struct LightSample {
    direction: vec3<f32>,
    distance: f32,
    // Unshadowed contribution, divided by its density.
    value: vec3<f32>,
}

fn sample_cone(axis: vec3<f32>, cos_max: f32, u: vec2<f32>) -> vec3<f32> {
    let cosine = 1.0 - u.x * (1.0 - cos_max);
    let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    let phi = 2.0 * PI * u.y;
    return normalize(to_world(frame_around(axis), vec3<f32>(cos(phi) * sine, sin(phi) * sine, cosine)));
}

fn sun_sample(s: Surface, wo: vec3<f32>, u: vec2<f32>) -> LightSample {
    let wi = sample_cone(globals.sun_direction, globals.sun_cos, u);
    return LightSample(wi, INFINITE, evaluate_bsdf(s, wo, wi).f * globals.sun_irradiance);
}

// glTF's recommended windowing of the inverse square.
fn attenuation(distance: f32, range: f32) -> f32 {
    let q = distance / range;
    let window = clamp(1.0 - q * q * q * q, 0.0, 1.0);
    return window / max(distance * distance, 1e-8);
}

// One of the lamps, by power. With `with_bsdf_rays`, emissive triangles are
// also met by BSDF samples and the two share by the balance heuristic.
fn lamp_sample(s: Surface, wo: vec3<f32>, u_choice: f32, u: vec2<f32>, with_bsdf_rays: bool) -> LightSample {
    var low = 0u;
    var high = globals.light_count - 1u;
    while (low < high) {
        let middle = (low + high) / 2u;
        if (lights[middle].cumulative > u_choice) {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    let light = lights[low];
    var none = LightSample(vec3<f32>(0.0), 0.0, vec3<f32>(0.0));
    if (light.kind == 3u) {
        return LightSample(-light.direction, INFINITE,
            evaluate_bsdf(s, wo, -light.direction).f * light.intensity / light.probability);
    }
    if (light.kind != 0u) {
        let to_light = light.position - s.position;
        let distance = length(to_light);
        if (distance < 1e-6) {
            return none;
        }
        let wi = to_light / distance;
        var strength = attenuation(distance, light.range) / light.probability;
        if (light.kind == 2u) {
            let t = clamp((dot(-wi, light.direction) - light.cos_outer)
                / max(light.cos_inner - light.cos_outer, 1e-4), 0.0, 1.0);
            strength *= t * t;
        }
        return LightSample(wi, distance, evaluate_bsdf(s, wo, wi).f * light.intensity * strength);
    }
    // A point on the triangle, uniform by area.
    let root = sqrt(u.x);
    let b = vec2<f32>(root * (1.0 - u.y), root * u.y);
    let p0 = vertex_position(light.triangle, 0u);
    let e1 = vertex_position(light.triangle, 1u) - p0;
    let e2 = vertex_position(light.triangle, 2u) - p0;
    var p = p0 + e1 * b.x + e2 * b.y;
    var n = normalize(cross(e1, e2));
    if (HAS_MOVERS && light.instance != 0u) {
        p = transform_point(instances[light.instance].world_from_object, p);
        n = transform_vector(instances[light.instance].world_from_object, n);
    }
    let to_light = p - s.position;
    let distance = length(to_light);
    if (distance < 1e-6) {
        return none;
    }
    let wi = to_light / distance;
    let record = triangles[light.triangle];
    let material = materials[record.w & MATERIAL_MASK];
    var cosine = -dot(n, wi);
    cosine = select(cosine, abs(cosine), material.double_sided != 0u);
    if (cosine <= 1e-6) {
        return none;
    }
    var emission = material.emissive;
    if (HAS_TEXTURES && material.textures[3].offset != NONE) {
        let uv = corners[record.x * 3u + 2u] * (1.0 - b.x - b.y)
            + corners[record.y * 3u + 2u] * b.x + corners[record.z * 3u + 2u] * b.y;
        emission *= texture_at(material.textures[3], uv.xy, uv.zw, 0.0).rgb;
    }
    let pdf = light.probability / light.area * distance * distance / cosine;
    let bsdf = evaluate_bsdf(s, wo, wi);
    var value = bsdf.f * emission / pdf;
    if (with_bsdf_rays) {
        value *= pdf / (pdf + bsdf.pdf);
    }
    return LightSample(wi, distance, value);
}

// Adds a candidate to a reservoir of one.
fn consider(chosen: ptr<function, LightSample>, total: ptr<function, f32>, u: ptr<function, f32>, next: LightSample) {
    let weight = luminance(next.value);
    if (weight <= 0.0) {
        return;
    }
    *total += weight;
    let p = weight / *total;
    if (*u < p) {
        *chosen = next;
        *u = *u / p;
    } else {
        *u = (*u - p) / (1.0 - p);
    }
    *u = clamp(*u, 0.0, 0.99999994);
}

fn light_sample(s: Surface, wo: vec3<f32>, last: bool, rng: ptr<function, Sampler>) -> LightSample {
    var chosen = LightSample(vec3<f32>(0.0), 0.0, vec3<f32>(0.0));
    var total = 0.0;
    let choice = sample_2d(rng);
    var u = choice.x;
    if (HAS_SKY && last) {
        let wi = to_world(frame_around(s.ns), cosine_hemisphere(sample_2d(rng)));
        let cosine = max(dot(s.ns, wi), 1e-6);
        let value = evaluate_bsdf(s, wo, wi).f * sky_radiance(wi) * (PI / cosine);
        consider(&chosen, &total, &u, LightSample(wi, INFINITE, value));
    }
    if (HAS_LIGHTS) {
        let point = sample_2d(rng);
        for (var i = 0u; i < LAMP_CANDIDATES; i++) {
            let stratum = (f32(i) + choice.y) / f32(LAMP_CANDIDATES);
            let shifted = fract(point + vec2<f32>(0.7548777, 0.5698403) * f32(i));
            var lamp = lamp_sample(s, wo, stratum, shifted, !last);
            lamp.value /= f32(LAMP_CANDIDATES);
            consider(&chosen, &total, &u, lamp);
        }
    }
    let weight = luminance(chosen.value);
    if (weight > 0.0) {
        chosen.value *= total / weight;
    }
    return chosen;
}

// Queues a ray to be traced at `step`; a negative length is none.
fn send(path: u32, slot: u32, origin: vec3<f32>, direction: vec3<f32>, length: f32, step: u32) {
    let index = slot * wave.path_count + path;
    rays[index] = Ray(origin, length, direction, 0.0);
    if (length >= 0.0) {
        queue[atomicAdd(&queued[step], 1u)] = index;
    }
}

fn send_nothing(path: u32, slot: u32) {
    rays[slot * wave.path_count + path].length = -1.0;
}

// Sends the rays of a vertex: what light it gets, and where the path goes on.
fn leave_vertex(path: u32, s: Surface, wo: vec3<f32>, vertex: u32, step: u32, state_in: PathState) {
    var state = state_in;
    let last = vertex >= globals.bounces;
    var rng = Sampler(state.sample_index, state.seed, PAIRS_AT_START + vertex * PAIRS_PER_VERTEX);
    let origin = offset_origin(s.position, s.ng);

    state.sun = vec3<f32>(0.0);
    if (HAS_SUN) {
        let sun = sun_sample(s, wo, sample_2d(&rng));
        state.sun = state.throughput * sun.value;
        send(path, SLOT_SUN, origin, sun.direction, select(-1.0, INFINITE, any(state.sun > vec3<f32>(0.0))), step);
    } else {
        send_nothing(path, SLOT_SUN);
    }

    let light = light_sample(s, wo, last, &rng);
    state.light = state.throughput * light.value;
    // Russian roulette on what would hardly be seen.
    let worth = luminance(state.light) / globals.faint;
    if (worth < 1.0) {
        let survival = max(worth, LEAST_SURVIVAL);
        state.light = select(vec3<f32>(0.0), state.light / survival, sample_2d(&rng).x < survival);
    }
    // Short of the lamp by a few rounding steps.
    send(path, SLOT_LIGHT, origin, light.direction,
        select(-1.0, light.distance * 0.9999, any(state.light > vec3<f32>(0.0))), step);

    var onwards = false;
    if (!last) {
        let u = sample_2d(&rng);
        let wi = sample_bsdf(s, wo, u, sample_2d(&rng).x);
        let bsdf = evaluate_bsdf(s, wo, wi);
        onwards = any(wi != vec3<f32>(0.0)) && bsdf.pdf > 0.0;
        state.throughput *= select(vec3<f32>(0.0), bsdf.f / bsdf.pdf, onwards);
        state.pdf = bsdf.pdf;
        // The next hit is looked at as widely as this lobe spreads.
        state.cone = max(state.cone, s.alpha);
        send(path, SLOT_ONWARDS, origin, wi, select(-1.0, INFINITE, onwards), step);
    } else {
        send_nothing(path, SLOT_ONWARDS);
    }
    paths[path] = state;
}

fn is_unshadowed(path: u32, slot: u32, state: ptr<function, PathState>) -> bool {
    let index = slot * wave.path_count + path;
    if (rays[index].length < 0.0) {
        return false;
    }
    let found = hits[index].y;
    (*state).progress |= found & NEAR_MOVER;
    return (found & ~NEAR_MOVER) == NO_TRIANGLE;
}

// Gathers what the rays of each path found. One thread per path.
@compute @workgroup_size(64)
fn advance(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let path = id.x + id.y * groups.x * 64u;
    if (path >= wave.path_count) {
        return;
    }
    var state = paths[path];
    if (HAS_SUN && is_unshadowed(path, SLOT_SUN, &state)) {
        state.radiance += state.sun;
        if ((state.progress & 0xffffu) == 1u) {
            state.crisp += state.sun;
        }
    }
    if (is_unshadowed(path, SLOT_LIGHT, &state)) {
        state.radiance += state.light;
    }
    let index = SLOT_ONWARDS * wave.path_count + path;
    let ray = rays[index];
    let hit = hits[index];
    let triangle = hit.y & ~NEAR_MOVER;
    let is_sent = ray.length >= 0.0;
    state.progress |= select(0u, hit.y & NEAR_MOVER, is_sent);
    if (!is_sent || triangle == NO_TRIANGLE) {
        if (HAS_SKY && is_sent) {
            state.radiance += state.throughput * sky_radiance(ray.direction);
        }
        for (var slot = 0u; slot < 3u; slot++) {
            send_nothing(path, slot);
        }
        paths[path] = state;
        return;
    }
    let t = bitcast<f32>(hit.x);
    let wo = -ray.direction;
    let s = surface_at(triangle, bitcast<vec2<f32>>(hit.zw), wo, state.cone * t);
    var weight = 1.0;
    if (HAS_LIGHTS && state.pdf > 0.0 && s.emission_weight > 0.0) {
        let cosine = max(abs(dot(s.ng, wo)), 1e-6);
        let light_pdf = s.emission_weight / globals.light_weight * t * t / cosine;
        weight = state.pdf / (state.pdf + light_pdf);
    }
    state.radiance += state.throughput * s.emissive * weight;
    let vertex = state.progress & 0xffffu;
    state.progress += 1u;
    leave_vertex(path, s, wo, vertex, wave.step + 1u, state);
}

// What a finished path brings; nothing where arithmetic failed.
fn radiance_of(path: u32) -> vec3<f32> {
    let result = paths[path].radiance;
    let finite = all(result < vec3<f32>(INFINITE)) && all(result >= vec3<f32>(0.0));
    return select(vec3<f32>(0.0), result, finite);
}
