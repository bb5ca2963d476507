// Gives newly placed blocks their first content: the radiance that the patch
// had in its old block, resampled, or nothing.
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
@group(0) @binding(2) var<storage, read> before: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> surfaces_before: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> radiance: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> surfaces: array<vec4<f32>>;

@group(0) @binding(6) var<storage, read> crisp_before: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> crisp: array<vec4<f32>>;

@compute @workgroup_size(64)
fn carry_blocks(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32) {
    let index = group.x + group.y * groups.x;
    if (index >= carry.move_count) {
        return;
    }
    let m = moves[index];
    let size = vec2<u32>(1u << (m.levels & 15u), 1u << ((m.levels >> 4u) & 15u));
    let old_size = vec2<u32>(1u << ((m.levels >> 8u) & 15u), 1u << ((m.levels >> 12u) & 15u));
    for (var i = lane; i < size.x * size.y; i += 64u) {
        let p = vec2<u32>(i % size.x, i / size.x);
        let at = ((m.to >> 16u) + p.y) * carry.atlas_width + (m.to & 0xffffu) + p.x;
        var content = vec4<f32>(0.0);
        var surface = vec4<f32>(0.0);
        var sharp = vec4<f32>(0.0);
        if (m.origin != NO_BLOCK) {
            // Patch coordinates run over texel centres, at both levels.
            let uv = vec2<f32>(p) / vec2<f32>(size - 1u);
            let q = select(uv, uv.yx, (m.levels >> 16u) != 0u) * vec2<f32>(old_size - 1u);
            let low = min(vec2<u32>(q), old_size - 1u);
            let high = min(low + 1u, old_size - 1u);
            let f = q - vec2<f32>(low);
            let corner = vec2<u32>(m.origin & 0xffffu, m.origin >> 16u);
            let r0 = (corner.y + low.y) * carry.atlas_width + corner.x;
            let r1 = (corner.y + high.y) * carry.atlas_width + corner.x;
            content = mix(mix(before[r0 + low.x], before[r0 + high.x], f.x),
                mix(before[r1 + low.x], before[r1 + high.x], f.x), f.y);
            surface = mix(mix(surfaces_before[r0 + low.x], surfaces_before[r0 + high.x], f.x),
                mix(surfaces_before[r1 + low.x], surfaces_before[r1 + high.x], f.x), f.y);
            sharp = mix(mix(crisp_before[r0 + low.x], crisp_before[r0 + high.x], f.x),
                mix(crisp_before[r1 + low.x], crisp_before[r1 + high.x], f.x), f.y);
            if (any(old_size != size) || (m.levels >> 16u) != 0u) {
                content.w = min(content.w, CARRIED_WEIGHT);
            }
        }
        radiance[at] = content;
        surfaces[at] = surface;
        crisp[at] = sharp;
    }
}
