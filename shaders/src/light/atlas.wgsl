// Begins paths at texels of placed patches, and accumulates what they bring.
// One thread per job; jobs of a slot are consecutive, `slots` is ascending
// in `first_job`. Reads the scene and `slots`; updates what a texel remembers:
// - `diffuse`: mean light by the diffuse lobe over the diffuse colour, without
//   the sun's, and its samples. It does not depend on the eye.
// - `glossy`: mean light by the specular lobe, without the sun's, and its
//   samples, which lose their worth as the eye moves.
// - `moments`: share of the sun that is seen; mean squared luminance of diffuse
//   and of glossy samples.
// Textures, normal maps, emission and the sun's reflection are not in there:
// `smooth_slots` adds them exactly, however few paths have come.
// What a slot is says block_slots.wgsl or triangle_slots.wgsl.
// Source: SAS 2018, section 3.2; figure 6.

struct LightParameters {
    eye: vec3<f32>,
    slot_count: u32,
    atlas_width: u32,
    tile_count: u32,
    // Width of a pixel a metre away.
    pixel_angle: f32,
    // Factor from radiance to displayed brightness.
    exposure: f32,
}

@group(2) @binding(0) var<uniform> parameters: LightParameters;
@group(2) @binding(1) var<storage, read> slots: array<SlotRecord>;
@group(2) @binding(2) var<storage, read_write> diffuse: array<vec4<f32>>;
@group(2) @binding(3) var<storage, read_write> glossy: array<vec4<f32>>;
@group(2) @binding(6) var<storage, read_write> moments: array<vec4<f32>>;

// Jobs on a side of a tile at most: what was found is judged tile by tile, so that a
// shadow that falls on a small part of a large slot is noticed there. A slot's tiles are
// of about one size: of a sliver's few paths nothing could be told.
const TILE_SIDE: u32 = 8u;

// Samples over which means run where a moving object was met.
const MOVING_HISTORY: f32 = 8.0;

// Light of a path at most: its square fits single precision, and is white however
// it is exposed.
const BRIGHTEST_PATH: f32 = 1e18;

// Brightness of a path, in that usual about it, which one sample may have.
const OUTSHINING: f32 = 8.0;
// The same of what a tile's paths are short of: a whole tile would show it as a spot.
const OUTSHINING_TOGETHER: f32 = 1.0;
// Displayed brightness that is usual everywhere.
const FAINT: f32 = 0.05;

// A point of a patch by one of its triangles.
struct PatchPoint {
    // Which of the patch's triangles.
    triangle: u32,
    // Weights of its corners 1 and 2.
    b: vec2<f32>,
}

struct Job {
    slot: SlotRecord,
    // Among those of all slots.
    tile: u32,
    laid: Laid,
    // First of the texels that the path lights, in the slot's bounds.
    corner: vec2<u32>,
    // The first of those that are the slot's own.
    first: vec2<u32>,
    // Texels that it lights on either axis; none where none is the slot's own.
    stride: u32,
}

// The slot that a job is of, or a tile.
fn slot_with(index: u32, is_tile: bool) -> SlotRecord {
    var low = 0u;
    var high = parameters.slot_count - 1u;
    while (low < high) {
        let middle = (low + high + 1u) / 2u;
        if (select(slots[middle].first_job, slots[middle].first_tile, is_tile) <= index) {
            low = middle;
        } else {
            high = middle - 1u;
        }
    }
    return slots[low];
}

fn job_at(index: u32) -> Job {
    let slot = slot_with(index, false);
    let local = index - slot.first_job;
    let columns = jobs_across(slot).x;
    return job_of(slot, vec2<u32>(local % columns, local / columns));
}

fn job_of(slot: SlotRecord, place: vec2<u32>) -> Job {
    var job: Job;
    job.slot = slot;
    let tile = place / tile_size(slot);
    job.tile = slot.first_tile + tile.x + tile.y * tiles_across(slot).x;
    job.laid = laid(slot);
    job.stride = 1u << log2_stride_of(slot);
    job.corner = place * job.stride;
    job.first = job.corner;
    if (HAS_GAPS) {
        let owned = first_owned(job.laid, job.corner, job.stride);
        job.first = owned.xy;
        job.stride = select(0u, job.stride, owned.z != 0u);
    }
    return job;
}

// Paths side by side, on either axis.
fn jobs_across(slot: SlotRecord) -> vec2<u32> {
    let stride = 1u << log2_stride_of(slot);
    return (laid(slot).size + stride - 1u) / stride;
}

fn tiles_across(slot: SlotRecord) -> vec2<u32> {
    return (jobs_across(slot) + TILE_SIDE - 1u) / TILE_SIDE;
}

// Jobs of a tile on either axis; the last ones have fewer.
fn tile_size(slot: SlotRecord) -> vec2<u32> {
    let tiles = tiles_across(slot);
    return (jobs_across(slot) + tiles - 1u) / tiles;
}

// The first of a square of texels that is the slot's own, and whether there is any.
fn first_owned(at: Laid, corner: vec2<u32>, side: u32) -> vec3<u32> {
    for (var y = corner.y; y < min(corner.y + side, at.size.y); y++) {
        for (var x = corner.x; x < min(corner.x + side, at.size.x); x++) {
            if (owns(at, vec2<i32>(vec2<u32>(x, y)))) {
                return vec3<u32>(x, y, 1u);
            }
        }
    }
    return vec3<u32>(corner, 0u);
}

// Where in the lists of what texels remember.
fn index_of_texel(at: Laid, texel: vec2<u32>) -> u32 {
    return (at.corner.y + texel.y) * parameters.atlas_width + at.corner.x + texel.x;
}

// A slot's surface as the eye sees it.
struct Seen {
    surface: Surface,
    wo: vec3<f32>,
}

// At slot coordinates `p`, looked at as widely as `stride` texels.
fn seen_surface(slot: SlotRecord, at: Laid, p: vec2<f32>, stride: u32) -> Seen {
    let instance = slot.layout_bits >> 16u;
    let point = surface_point(slot, at, p);
    let triangle = slot.first_triangle + point.triangle;
    let p0 = vertex_position(triangle, 0u);
    let e1 = vertex_position(triangle, 1u) - p0;
    let e2 = vertex_position(triangle, 2u) - p0;
    var position = p0 + e1 * point.b.x + e2 * point.b.y;
    let doubled = cross(e1, e2);
    var n = normalize(doubled);
    if (HAS_MOVERS && instance != 0u) {
        position = transform_point(instances[instance].world_from_object, position);
        n = transform_vector(instances[instance].world_from_object, n);
    }
    let to_eye = parameters.eye - position;
    let distance = length(to_eye);
    var wo = select(vec3<f32>(0.0, 1.0, 0.0), to_eye / distance, distance > 1e-6);
    // A single-sided patch behind whose plane the eye has gone is lit as from its edge.
    if (materials[triangles[triangle].w & MATERIAL_MASK].double_sided == 0u && dot(wo, n) < 0.001) {
        wo = normalize(wo + n * (0.001 - dot(wo, n)));
    }
    let width = sqrt(0.5 * length(doubled) / texels_of_triangle(at)) * f32(stride);
    return Seen(surface_at(triangle, point.b, wo, width), wo);
}

@compute @workgroup_size(64)
fn start_at_texels(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let path = id.x + id.y * groups.x * 64u;
    if (path >= wave.path_count) {
        return;
    }
    let job = job_at(wave.first_job + path);
    if (HAS_GAPS && job.stride == 0u) {
        for (var ray = 0u; ray < 3u; ray++) {
            send_nothing(path, ray);
        }
        return;
    }
    let seed = hash(hash(job.slot.patch_id * 0x9e3779b9u) ^ (job.corner.x << 16u | job.corner.y));
    var rng = Sampler(job.slot.sample_index, seed, 0u);
    // Jitter inside the texel.
    let middle = vec2<f32>(job.corner) + 0.5 * f32(job.stride - 1u);
    let p = start_coordinates(job.laid, middle + (sample_2d(&rng) - 0.5) * f32(job.stride));
    let seen = seen_surface(job.slot, job.laid, p, job.stride);
    var state: PathState;
    state.throughput = vec3<f32>(1.0);
    state.seed = seed;
    state.sample_index = job.slot.sample_index;
    state.progress = 1u | LOBES_APART;
    state.cell = cell_around(seen.surface.position, seen.surface.ng, sample_2d(&rng) - 0.5);
    leave_vertex(path, seen.surface, seen.wo, 0u, 0u, state);
}

// What a path has brought its texels.
struct Found {
    diffuse: vec3<f32>,
    glossy: vec3<f32>,
    // Share of the sun that was seen.
    sun: f32,
}

fn found_by(state: PathState) -> Found {
    let indirect = sound(state.radiance);
    let brightest = vec3<f32>(BRIGHTEST_PATH);
    return Found(min(sound(state.direct_diffuse + state.onward_diffuse * indirect), brightest),
        min(sound(state.direct_glossy + state.onward_glossy * indirect), brightest),
        select(0.0, 1.0, (state.progress & SUNLIT) != 0u));
}

// Samples that a texel's diffuse and glossy means run over when a path is added.
fn histories_at(at: u32, slot: SlotRecord, path: PathState, judgement: Judgement) -> vec2<f32> {
    let moves = (path.progress & NEAR_MOVER) != 0u;
    let longest = select(slot.longest_history, min(slot.longest_history, MOVING_HISTORY), moves);
    return min(vec2<f32>(diffuse[at].w, glossy[at].w * slot.glossy_keep), vec2<f32>(longest)) * judgement.kept;
}

// Of a path's light, what a mean of `samples` takes: no more than `outshining` times
// what is usual there for each of its samples. A rare path that carries much light
// comes in slowly, as others like it come, and not as a spot that stays; as samples
// grow the limit does.
// Related: Zirr et al., "Re-weighting Firefly Samples for Improved Finite-Sample
// Monte Carlo Estimates", 2018.
fn limited(light: vec3<f32>, outshining: f32, usual: f32, samples: f32) -> vec3<f32> {
    let most = outshining * (samples + 1.0) * max(usual, FAINT / max(parameters.exposure, 1e-30));
    return light * select(1.0, min(most / max(luminance(light), 1e-30), 1.0), SMOOTHING);
}

// What a texel takes of what a path found. The tile's texels share the excess, as far
// as that is not seen as a spot in its turn.
fn accepted_at(at: u32, found: Found, outshining: f32, histories: vec2<f32>, judgement: Judgement) -> Found {
    let usual = max(judgement.usual, vec2<f32>(luminance(diffuse[at].rgb), luminance(glossy[at].rgb)));
    return Found(limited(found.diffuse, outshining, usual.x, histories.x),
        limited(found.glossy, outshining, usual.y, histories.y), found.sun);
}

@compute @workgroup_size(64)
fn accumulate(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let path = id.x + id.y * groups.x * 64u;
    if (path >= wave.path_count) {
        return;
    }
    let job = job_at(wave.first_job + path);
    if (HAS_GAPS && job.stride == 0u) {
        return;
    }
    let state = paths[path];
    // A coarse look is one sample, shared by the texels that it lights.
    let weight_of_sample = 1.0 / f32(job.stride * job.stride);
    let found = found_by(state);
    let judgement = judgements[job.tile];
    let shared_out = Found(judgement.diffuse_excess, judgement.glossy_excess, 0.0);
    add_to_cell(state.cell, limited(found.diffuse, OUTSHINING, judgement.usual.x, judgement.around));
    for (var y = 0u; y < min(job.stride, job.laid.size.y - job.corner.y); y++) {
        for (var x = 0u; x < min(job.stride, job.laid.size.x - job.corner.x); x++) {
            let texel = job.corner + vec2<u32>(x, y);
            if (HAS_GAPS && !owns(job.laid, vec2<i32>(texel))) {
                continue;
            }
            let at = index_of_texel(job.laid, texel);
            let histories = histories_at(at, job.slot, state, judgement);
            let own = accepted_at(at, found, OUTSHINING, histories, judgement);
            let others = accepted_at(at, shared_out, OUTSHINING_TOGETHER, histories, judgement);
            let light = own.diffuse + others.diffuse;
            let glossy_light = own.glossy + others.glossy;
            let shares = weight_of_sample / (histories + weight_of_sample);
            diffuse[at] = vec4<f32>(mix(diffuse[at].rgb, light, shares.x), histories.x + weight_of_sample);
            glossy[at] = vec4<f32>(mix(glossy[at].rgb, glossy_light, shares.y), histories.y + weight_of_sample);
            let of_diffuse = luminance(light);
            let of_glossy = luminance(glossy_light);
            let found_moments = vec4<f32>(found.sun, of_diffuse * of_diffuse, of_glossy * of_glossy, 0.0);
            moments[at] = mix(moments[at], found_moments, vec4<f32>(shares.xxy, 0.0));
        }
    }
}
