// Gives newly placed blocks their first content: the light that the patch had in
// its old block, resampled, or nothing.
// One workgroup per move; reads `before`, a copy of the atlas before any move.

struct Move {
    // x | y << 16 of the new block.
    to: u32,
    // log2 width | log2 height << 4 of the new, then << 8 and << 12 of the old;
    // 1 << 16 where the patch lies on its side in one of them.
    levels: u32,
    // x | y << 16 of the old block, or NO_BLOCK.
    origin: u32,
    padding: u32,
}

struct CarryParameters {
    move_count: u32,
    atlas_width: u32,
    padding: vec2<u32>,
}

const NO_BLOCK: u32 = 0xffffffffu;
// A resampled texel is worth at most this many samples: it is blurred, and
// must give way to what is traced at the new level.
const CARRIED_WEIGHT: f32 = 12.0;

@group(0) @binding(0) var<uniform> carry: CarryParameters;
@group(0) @binding(1) var<storage, read> moves: array<Move>;
// What texels remember: see atlas.wgsl.
@group(0) @binding(2) var<storage, read> diffuse_before: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> glossy_before: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> moments_before: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> diffuse: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> glossy: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> moments: array<vec4<f32>>;

// Where a texel lies between four old ones.
struct Between {
    upper: vec2<u32>,
    lower: vec2<u32>,
    f: vec2<f32>,
}

fn between(m: Move, q: vec2<f32>, old_size: vec2<u32>) -> Between {
    let low = min(vec2<u32>(q), old_size - 1u);
    let high = min(low + 1u, old_size - 1u);
    let corner = vec2<u32>(m.origin & 0xffffu, m.origin >> 16u);
    let rows = (vec2<u32>(low.y, high.y) + corner.y) * carry.atlas_width + corner.x;
    return Between(rows.x + vec2<u32>(low.x, high.x), rows.y + vec2<u32>(low.x, high.x), q - vec2<f32>(low));
}

@compute @workgroup_size(64)
fn carry_blocks(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32) {
    let index = group.x + group.y * groups.x;
    if (index >= carry.move_count) {
        return;
    }
    let m = moves[index];
    let size = vec2<u32>(1u << (m.levels & 15u), 1u << ((m.levels >> 4u) & 15u));
    let turns = (m.levels >> 16u) != 0u;
    let old_size = vec2<u32>(1u << ((m.levels >> 8u) & 15u), 1u << ((m.levels >> 12u) & 15u));
    for (var i = lane; i < size.x * size.y; i += 64u) {
        let p = vec2<u32>(i % size.x, i / size.x);
        let at = ((m.to >> 16u) + p.y) * carry.atlas_width + (m.to & 0xffffu) + p.x;
        if (m.origin == NO_BLOCK) {
            diffuse[at] = vec4<f32>(0.0);
            glossy[at] = vec4<f32>(0.0);
            moments[at] = vec4<f32>(0.0);
            continue;
        }
        // Patch coordinates run over texel centres, at both levels.
        let uv = vec2<f32>(p) / vec2<f32>(size - 1u);
        let b = between(m, select(uv, uv.yx, turns) * vec2<f32>(old_size - 1u), old_size);
        let most = select(3.0e38, CARRIED_WEIGHT, turns || any(old_size != size));
        let d = mix(mix(diffuse_before[b.upper.x], diffuse_before[b.upper.y], b.f.x),
            mix(diffuse_before[b.lower.x], diffuse_before[b.lower.y], b.f.x), b.f.y);
        let g = mix(mix(glossy_before[b.upper.x], glossy_before[b.upper.y], b.f.x),
            mix(glossy_before[b.lower.x], glossy_before[b.lower.y], b.f.x), b.f.y);
        diffuse[at] = vec4<f32>(d.rgb, min(d.w, most));
        glossy[at] = vec4<f32>(g.rgb, min(g.w, most));
        moments[at] = mix(mix(moments_before[b.upper.x], moments_before[b.upper.y], b.f.x),
            mix(moments_before[b.lower.x], moments_before[b.lower.y], b.f.x), b.f.y);
    }
}
