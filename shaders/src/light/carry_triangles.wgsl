// Gives newly placed triangle slots their first content: the light that the triangle
// had in its old slot, as it is where texels lie alike, else resampled; or nothing.
// Where texels lie alike, what is shown of them comes along and need not be made anew.
// One workgroup per move; reads `before`, a copy of the atlas before any move.
// The same for blocks: carry.wgsl.

struct TriangleMove {
    // The new slot; see `atlas_triangle`.
    to: array<u32, 3>,
    to_weights: array<u32, 2>,
    // The old one.
    origin: array<u32, 3>,
    origin_weights: array<u32, 2>,
    // See below.
    how: u32,
    // Where texels lie alike: the old texel is the new one, or its opposite, and this.
    offset_x: i32,
    offset_y: i32,
}

struct CarryParameters {
    move_count: u32,
    atlas_width: u32,
    padding: vec2<u32>,
}

// There was no old slot.
const FROM_NOTHING: u32 = 0u;
const RESAMPLED: u32 = 1u;
// Texels lie alike, the same way up or after a half turn.
const SHIFTED: u32 = 2u;
const TURNED_ROUND: u32 = 3u;

// A resampled texel is worth at most this many samples. Twin: carry.wgsl.
const CARRIED_WEIGHT: f32 = 12.0;

@group(0) @binding(0) var<uniform> carry: CarryParameters;
@group(0) @binding(1) var<storage, read> moves: array<TriangleMove>;
// What texels remember: see atlas.wgsl.
@group(0) @binding(2) var<storage, read> diffuse_before: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> glossy_before: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> moments_before: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> diffuse: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> glossy: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> moments: array<vec4<f32>>;
@group(0) @binding(8) var<storage, read> shown_before: array<vec4<f32>>;
@group(0) @binding(9) var<storage, read_write> shown: array<vec4<f32>>;

struct Remembered {
    diffuse: vec4<f32>,
    glossy: vec4<f32>,
    moments: vec4<f32>,
}

fn index_of(texel: vec2<u32>) -> u32 {
    return texel.y * carry.atlas_width + texel.x;
}

// What the old slot remembers at a point, in texels from the middle of its first.
fn resampled(old: AtlasTriangle, q: vec2<f32>) -> Remembered {
    let low = vec2<i32>(floor(q));
    let f = q - floor(q);
    var sum: Remembered;
    var weights = 0.0;
    for (var i = 0; i < 4; i++) {
        let aside = vec2<i32>(i & 1, i >> 1u);
        let texel = low + aside;
        let near = mix(1.0 - f, f, vec2<f32>(aside));
        let weight = near.x * near.y;
        // Rounding may ask for a little of what lies beside the slot.
        let is_there = all(texel >= vec2<i32>(0)) && all(texel < vec2<i32>(old.size)) && owns_texel(old, texel);
        if (weight > 0.0 && is_there) {
            let at = index_of(old.corner + vec2<u32>(texel));
            sum.diffuse += diffuse_before[at] * weight;
            sum.glossy += glossy_before[at] * weight;
            sum.moments += moments_before[at] * weight;
            weights += weight;
        }
    }
    let share = 1.0 / max(weights, 1e-6);
    return Remembered(sum.diffuse * share, sum.glossy * share, sum.moments * share);
}

@compute @workgroup_size(64)
fn carry_triangles(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32) {
    let index = group.x + group.y * groups.x;
    if (index >= carry.move_count) {
        return;
    }
    let m = moves[index];
    let fresh = atlas_triangle(m.to, m.to_weights);
    let old = atlas_triangle(m.origin, m.origin_weights);
    for (var i = lane; i < fresh.size.x * fresh.size.y; i += 64u) {
        let p = vec2<u32>(i % fresh.size.x, i / fresh.size.x);
        if (!owns_texel(fresh, vec2<i32>(p))) {
            continue;
        }
        let at = index_of(fresh.corner + p);
        var found: Remembered;
        if (m.how == RESAMPLED) {
            let surface = on_surface(fresh, nearest_in(fresh, vec2<f32>(p)));
            found = resampled(old, texel_at(old, in_atlas(old, surface)));
            found.diffuse.w = min(found.diffuse.w, CARRIED_WEIGHT);
            found.glossy.w = min(found.glossy.w, CARRIED_WEIGHT);
        } else if (m.how != FROM_NOTHING) {
            let here = vec2<i32>(fresh.corner + p);
            let there = vec2<u32>(select(here, -here, m.how == TURNED_ROUND) + vec2<i32>(m.offset_x, m.offset_y));
            let source = index_of(there);
            found = Remembered(diffuse_before[source], glossy_before[source], moments_before[source]);
            shown[at] = shown_before[source];
        }
        diffuse[at] = found.diffuse;
        glossy[at] = found.glossy;
        moments[at] = found.moments;
    }
}
