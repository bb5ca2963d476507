// Light paths in waves: `start` kernels make the first vertex of each path and
// its rays, `trace_rays` traces them, `advance` gathers what they found and
// makes the next vertex, until no path has a ray left.
//
// At every vertex the sun has a shadow ray of its own: it outshines all else
// where it shines and is nothing in the shade, which no choice by unshadowed
// contribution can know. All other lights share one, chosen so. The sky is met
// by the rays that leave the scene, and at the last vertex, which sends none,
// by a shadow ray. Where the last vertex has a narrow lobe it does send a ray,
// for what shines only: hardly any light sample falls into such a lobe.

struct PathState {
    // From the first vertex on, where its lobes are kept apart; else from the camera.
    throughput: vec3<f32>,
    // Density of the ray onwards; zero where the emission it meets counts in full.
    pdf: f32,
    // What came in over the ray onwards from the first vertex, or into the camera.
    radiance: vec3<f32>,
    // Vertex in the lower half; NEAR_MOVER, LOBES_APART and SUNLIT.
    progress: u32,
    // What the shadow rays bring if nothing is in their way; where the lobes
    // are kept apart, `light` by the specular one.
    sun: vec3<f32>,
    seed: u32,
    light: vec3<f32>,
    sample_index: u32,
    // Where the lobes are kept apart: direct light of the first vertex by the
    // diffuse lobe, over the diffuse colour.
    direct_diffuse: vec3<f32>,
    // Width of the sample per metre of the ray onwards.
    cone: f32,
    // The same by the specular lobe.
    direct_glossy: vec3<f32>,
    // What `radiance` counts by the diffuse lobe, over the diffuse colour.
    onward_diffuse: f32,
    // What it counts by the specular lobe.
    onward_glossy: vec3<f32>,
    // Where the diffuse light is shared with its surroundings.
    cell: u32,
    // Of the surface that the ray onwards leaves.
    normal: vec3<f32>,
    padding: u32,
}

// The first vertex is a texel's, whose lobes have histories of their own. Its
// sun is only looked for: how bright it makes the texel needs no path.
const LOBES_APART: u32 = 0x40000000u;
// The sun shines on the first vertex.
const SUNLIT: u32 = 0x20000000u;

@group(1) @binding(2) var<storage, read_write> paths: array<PathState>;

const SLOT_SUN: u32 = 0u;
const SLOT_LIGHT: u32 = 1u;
const SLOT_ONWARDS: u32 = 2u;
// Dimension pairs that the start of a path draws.
const PAIRS_AT_START: u32 = 2u;
// Dimension pairs of a vertex, each with a purpose of its own: what a scene leaves
// out does not change what the rest draws.
const PAIRS_PER_VERTEX: u32 = 12u;
const PAIR_SUN: u32 = 0u;
const PAIR_CHOICE: u32 = 1u;
const PAIR_LAMP: u32 = 2u;
const PAIR_SKY: u32 = 3u;
const PAIR_SKY_LOBE: u32 = 4u;
const PAIR_CELL: u32 = 5u;
const PAIR_IN_CELL: u32 = 6u;
const PAIR_FAINT: u32 = 7u;
const PAIR_ROULETTE: u32 = 8u;
const PAIR_ONWARDS: u32 = 9u;
const PAIR_LOBE: u32 = 10u;

// Below this GGX alpha a lobe is narrow. Twin: SceneFacts.
const NARROW: f32 = 0.1;
// First vertex at which a path may end by chance, and the least chance to go on.
const FIRST_ROULETTE: u32 = 3u;
const LEAST_TO_GO_ON: f32 = 0.05;

// Share of the faintest contributions that still get a shadow ray.
const LEAST_SURVIVAL: f32 = 0.1;

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

// The last vertex of a path sends a ray for what shines in a narrow lobe.
fn looks_for_lamps(s: Surface) -> bool {
    return HAS_NARROW_LOBES && s.alpha < NARROW && globals.light_count > globals.punctual_count;
}

// Sends the rays of a vertex: what light it gets, and where the path goes on.
fn leave_vertex(path: u32, s: Surface, wo: vec3<f32>, vertex: u32, step: u32, state_in: PathState) {
    var state = state_in;
    let sends_onwards = vertex < globals.bounces || looks_for_lamps(s);
    let apart = vertex == 0u && (state.progress & LOBES_APART) != 0u;
    let rng = Sampler(state.sample_index, state.seed, PAIRS_AT_START + vertex * PAIRS_PER_VERTEX);
    let origin = offset_origin(s);

    if (HAS_SUN) {
        let sun = sun_sample(s, wo, sample_pair(rng, PAIR_SUN));
        state.sun = state.throughput * both_lobes(s, sun.bsdf) * sun.incoming;
        let shines = select(any(state.sun > vec3<f32>(0.0)), dot(s.ng, sun.direction) > 0.0, apart);
        send(path, SLOT_SUN, origin, sun.direction, select(-1.0, INFINITE, shines), step);
    } else {
        send_nothing(path, SLOT_SUN);
    }

    let light = light_sample(s, wo, sends_onwards, rng);
    // Russian roulette on what would hardly be seen.
    let worth = luminance(state.throughput * both_lobes(s, light.bsdf) * light.incoming) / globals.faint;
    let survival = clamp(worth, LEAST_SURVIVAL, 1.0);
    let goes = worth > 0.0 && (survival >= 1.0 || sample_pair(rng, PAIR_FAINT).x < survival);
    let incoming = state.throughput * light.incoming / survival;
    state.light = incoming * select(both_lobes(s, light.bsdf), light.bsdf.specular, apart);
    state.direct_diffuse = select(state.direct_diffuse,
        select(vec3<f32>(0.0), incoming * light.bsdf.diffuse, goes), apart);
    // Short of the lamp by a few rounding steps.
    send(path, SLOT_LIGHT, origin, light.direction, select(-1.0, light.distance * 0.9999, goes), step);

    if (vertex >= FIRST_ROULETTE) {
        // Chance by what the path still carries: white walls go on for ever, grey ones do not.
        let carried = max(max(state.throughput.x, state.throughput.y), state.throughput.z);
        let goes_on = clamp(carried, LEAST_TO_GO_ON, 1.0);
        if (goes_on < 1.0 && sample_pair(rng, PAIR_ROULETTE).x >= goes_on) {
            send_nothing(path, SLOT_ONWARDS);
            paths[path] = state;
            return;
        }
        state.throughput /= goes_on;
    }
    if (sends_onwards) {
        let wi = sample_bsdf(s, wo, sample_pair(rng, PAIR_ONWARDS), sample_pair(rng, PAIR_LOBE).x);
        let bsdf = evaluate_bsdf(s, wo, wi);
        let onwards = any(wi != vec3<f32>(0.0)) && bsdf.pdf > 0.0;
        let per_density = select(0.0, 1.0 / bsdf.pdf, onwards);
        if (apart) {
            state.onward_diffuse = bsdf.diffuse * per_density;
            state.onward_glossy = bsdf.specular * per_density;
        } else {
            state.throughput *= both_lobes(s, bsdf) * per_density;
        }
        state.pdf = bsdf.pdf;
        state.normal = s.ns;
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

fn end(path: u32, state: PathState) {
    for (var slot = 0u; slot < 3u; slot++) {
        send_nothing(path, slot);
    }
    paths[path] = state;
}

// Gathers what the rays of each path found. One thread per path.
@compute @workgroup_size(64)
fn advance(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let path = id.x + id.y * groups.x * 64u;
    if (path >= wave.path_count) {
        return;
    }
    if (max(max(rays[path].length, rays[wave.path_count + path].length),
        rays[2u * wave.path_count + path].length) < 0.0) {
        return;
    }
    var state = paths[path];
    let apart = (state.progress & (LOBES_APART | 0xffffu)) == (LOBES_APART | 1u);
    if (HAS_SUN && is_unshadowed(path, SLOT_SUN, &state)) {
        state.radiance += select(state.sun, vec3<f32>(0.0), apart);
        state.progress |= select(0u, SUNLIT, apart);
    }
    let lit = is_unshadowed(path, SLOT_LIGHT, &state);
    if (apart) {
        state.direct_glossy = select(vec3<f32>(0.0), state.light, lit);
        state.direct_diffuse = select(vec3<f32>(0.0), state.direct_diffuse, lit);
    } else if (lit) {
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
            state.radiance += state.throughput * sky_by_bsdf(ray.direction, state.pdf);
        }
        end(path, state);
        return;
    }
    let t = bitcast<f32>(hit.x);
    let wo = -ray.direction;
    let s = surface_at(triangle, bitcast<vec2<f32>>(hit.zw), wo, state.cone * t);
    var weight = 1.0;
    if (HAS_LIGHTS && state.pdf > 0.0 && any(s.emissive > vec3<f32>(0.0))) {
        let cosine = max(abs(dot(s.ng, wo)), 1e-6);
        let chosen = lamp_density(triangle, ray.origin, state.normal);
        let other = chosen * t * t / cosine;
        weight = select(select(1.0, 0.0, other > 0.0), shared_weight(state.pdf, other), MULTIPLE_IMPORTANCE);
    }
    state.radiance += state.throughput * s.emissive * weight;
    let vertex = state.progress & 0xffffu;
    if (HAS_NARROW_LOBES && vertex > globals.bounces) {
        end(path, state);
        return;
    }
    state.progress += 1u;
    leave_vertex(path, s, wo, vertex, wave.step + 1u, state);
}

// Nothing where arithmetic failed.
fn sound(light: vec3<f32>) -> vec3<f32> {
    let finite = all(light < vec3<f32>(INFINITE)) && all(light >= vec3<f32>(0.0));
    return select(vec3<f32>(0.0), light, finite);
}
