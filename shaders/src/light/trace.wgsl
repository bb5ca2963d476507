// Traversal of compressed wide BVHs, one per moving object and one for the world.
// Source: Ylitie et al., "Efficient Incoherent Ray Traversal on GPUs Through
// Compressed Wide BVHs", 2017; node layout as obvhs writes it: minima and
// maxima of the children interleave.

// One ray of a path. Slots: towards the sun, towards another light, onwards.
struct Ray {
    origin: vec3<f32>,
    // Negative where there is no ray.
    length: f32,
    direction: vec3<f32>,
    // Where it begins, for rays that go on behind a hole.
    start: f32,
}

struct Hit {
    t: f32,
    // NONE where nothing was met.
    triangle: u32,
    b: vec2<f32>,
}

@group(1) @binding(0) var<storage, read_write> rays: array<Ray>;
// Length, triangle and NEAR_MOVER, weights of corners 1 and 2.
@group(1) @binding(1) var<storage, read_write> hits: array<vec4<u32>>;

// Rays of this step, in no particular order: what each finds goes to its own
// place, so that the order in which threads arrive cannot show.
@group(1) @binding(4) var<storage, read_write> queue: array<u32>;
// Length of the queue at each step, and at the end the sum over all waves.
@group(1) @binding(5) var<storage, read_write> queued: array<atomic<u32>>;

// Set in a hit's triangle when the ray came near a moving object.
const NEAR_MOVER: u32 = 0x80000000u;
// The triangle of a hit that is none.
const NO_TRIANGLE: u32 = 0x7fffffffu;
// Masked or blended surfaces that a ray may pass.
const MOST_HOLES: u32 = 64u;

// Deepest traversal: a level of an eight-wide tree per entry.
const STACK_SIZE: u32 = 24u;

fn reciprocal(d: vec3<f32>) -> vec3<f32> {
    let tiny = abs(d) < vec3<f32>(1e-20);
    let signed_huge = select(vec3<f32>(1e20), vec3<f32>(-1e20), d < vec3<f32>(0.0));
    return select(1.0 / d, signed_huge, tiny);
}

// How much of a masked or blended surface is there.
fn opacity(triangle: u32, b: vec2<f32>) -> f32 {
    let record = triangles[triangle];
    let material = record.w & MATERIAL_MASK;
    let weights = vec3<f32>(1.0 - b.x - b.y, b.x, b.y);
    let of_corners = vec3<u32>(bitcast<u32>(corners[record.x * 3u].w), bitcast<u32>(corners[record.y * 3u].w),
        bitcast<u32>(corners[record.z * 3u].w)) >> vec3<u32>(24u);
    var alpha = materials[material].base_color.a * dot(vec3<f32>(of_corners), weights) * (1.0 / 255.0);
    if (HAS_TEXTURES && materials[material].textures[0].offset != NONE) {
        let uv = corners[record.x * 3u + 2u] * weights.x
            + corners[record.y * 3u + 2u] * weights.y + corners[record.z * 3u + 2u] * weights.z;
        alpha *= texture_at(materials[material].textures[0], uv.xy, uv.zw, 0.0).a;
    }
    let cutoff = materials[material].alpha_cutoff;
    return select(select(0.0, 1.0, alpha >= cutoff), clamp(alpha, 0.0, 1.0), cutoff == BLENDED);
}

// Which of four children a ray enters, as bits of their nodes or triangles.
fn child_hits(packed: u32, octant: u32, near_x: u32, near_y: u32, near_z: u32, far_x: u32, far_y: u32,
    far_z: u32, scale: vec3<f32>, entry: vec3<f32>, t_min: f32, t_max: f32) -> u32 {
    let inner = (packed & (packed << 1u)) & 0x10101010u;
    let index = (packed ^ (octant & ((inner >> 4u) * 0xffu))) & 0x1f1f1f1fu;
    let bits = (packed >> 5u) & 0x07070707u;
    let t0x = vec4<f32>(unpack4xU8(near_x)) * scale.x + entry.x;
    let t0y = vec4<f32>(unpack4xU8(near_y)) * scale.y + entry.y;
    let t0z = vec4<f32>(unpack4xU8(near_z)) * scale.z + entry.z;
    let t1x = vec4<f32>(unpack4xU8(far_x)) * scale.x + entry.x;
    let t1y = vec4<f32>(unpack4xU8(far_y)) * scale.y + entry.y;
    let t1z = vec4<f32>(unpack4xU8(far_z)) * scale.z + entry.z;
    let t0 = max(max(t0x, t0y), max(t0z, vec4<f32>(t_min)));
    // A few rounding steps of slack, so that no box loses the ray that grazes it.
    let t1 = min(min(t1x, t1y), min(t1z, vec4<f32>(t_max))) * 1.0000004;
    let entered = select(vec4<u32>(0u), vec4<u32>(0xffu), t0 <= t1)
        & (vec4<u32>(bits) >> vec4<u32>(0u, 8u, 16u, 24u));
    let shift = (vec4<u32>(index) >> vec4<u32>(0u, 8u, 16u, 24u)) & vec4<u32>(0xffu);
    let found = entered << shift;
    return found.x | found.y | found.z | found.w;
}

// Nearest hit after `start`, or any opaque hit if `any` is set. With `cull`,
// single-sided triangles are not seen from behind. Masked triangles count as
// there: the caller looks at their texture, outside of this loop.
fn trace(origin: vec3<f32>, direction: vec3<f32>, start: f32, t_max: f32, any: bool, cull: bool,
    near_mover: ptr<function, bool>) -> Hit {
    var hit = Hit(t_max, NONE, vec2<f32>(0.0));
    var stack: array<vec2<u32>, 24>;
    var instance = 0u;
    loop {
        var o = origin;
        var d = direction;
        let root = instances[instance].root_node;
        let first_triangle = instances[instance].first_triangle;
        if (HAS_MOVERS && instance != 0u) {
            o = transform_point(instances[instance].object_from_world, origin);
            d = transform_vector(instances[instance].object_from_world, direction);
        }
        let inv = reciprocal(d);
        let octant = select(0x04040404u, 0u, d.x < 0.0) | select(0x02020202u, 0u, d.y < 0.0)
            | select(0x01010101u, 0u, d.z < 0.0);
        var depth = 0u;
        var node_group = vec2<u32>(0u, select(0x80000000u, 0u, root == NONE));
        var first_node = true;
        loop {
            if (node_group.y <= 0x00ffffffu) {
                if (depth == 0u) {
                    break;
                }
                depth -= 1u;
                node_group = stack[depth];
            }
            let slot_bit = firstLeadingBit(node_group.y);
            node_group.y &= ~(1u << slot_bit);
            if (node_group.y > 0x00ffffffu && depth < STACK_SIZE) {
                stack[depth] = node_group;
                depth += 1u;
            }
            let slot = (slot_bit - 24u) ^ (octant & 0xffu);
            let relative = countOneBits(node_group.y & ~(0xffffffffu << slot));
            let base = (root + select(node_group.x + relative, 0u, first_node)) * 5u;
            first_node = false;

            let n0 = nodes[base];
            let n1 = nodes[base + 1u];
            let nx = nodes[base + 2u];
            let ny = nodes[base + 3u];
            let nz = nodes[base + 4u];
            let exponent = vec3<u32>(n0.w & 0xffu, (n0.w >> 8u) & 0xffu, (n0.w >> 16u) & 0xffu) << vec3<u32>(23u);
            let scale = bitcast<vec3<f32>>(exponent) * inv;
            let entry = (bitcast<vec3<f32>>(n0.xyz) - o) * inv;
            let near_x = select(nx.xy, nx.zw, d.x < 0.0);
            let far_x = select(nx.zw, nx.xy, d.x < 0.0);
            let near_y = select(ny.xy, ny.zw, d.y < 0.0);
            let far_y = select(ny.zw, ny.xy, d.y < 0.0);
            let near_z = select(nz.xy, nz.zw, d.z < 0.0);
            let far_z = select(nz.zw, nz.xy, d.z < 0.0);
            // A shadow ray stops short of its lamp, which may be what moves.
            let reach = select(hit.t, hit.t * 1.0003, HAS_MOVERS && instance != 0u);
            let hits = child_hits(n1.z, octant, near_x.x, near_y.x, near_z.x, far_x.x, far_y.x, far_z.x,
                    scale, entry, start, reach)
                | child_hits(n1.w, octant, near_x.y, near_y.y, near_z.y, far_x.y, far_y.y, far_z.y,
                    scale, entry, start, reach);
            if (HAS_MOVERS && instance != 0u && hits != 0u) {
                *near_mover = true;
            }
            node_group = vec2<u32>(n1.x, (hits & 0xff000000u) | (n0.w >> 24u));
            var primitives = hits & 0x00ffffffu;
            while (primitives != 0u) {
                let bit = firstLeadingBit(primitives);
                primitives &= ~(1u << bit);
                let at = (first_triangle + n1.y + bit) * 3u;
                let v0 = bvh_triangles[at];
                let v1 = bvh_triangles[at + 1u];
                let e2 = bvh_triangles[at + 2u].xyz;
                let e1 = v1.xyz;
                // Moeller and Trumbore, 1997.
                let pv = cross(d, e2);
                let det = dot(e1, pv);
                let tv = o - v0.xyz;
                let qv = cross(tv, e1);
                let inv_det = 1.0 / det;
                let b = vec2<f32>(dot(tv, pv), dot(d, qv)) * inv_det;
                let t = dot(e2, qv) * inv_det;
                let inside = b.x >= 0.0 && b.y >= 0.0 && b.x + b.y <= 1.0 && t > start && t < hit.t;
                let flags = bitcast<u32>(v1.w);
                if (inside && !(cull && det < 0.0 && (flags & 2u) == 0u)) {
                    hit = Hit(t, bitcast<u32>(v0.w), b);
                    if (any && (!HAS_MASKS || (flags & 1u) == 0u)) {
                        return hit;
                    }
                }
            }
        }
        instance += 1u;
        if (!HAS_MOVERS || instance >= globals.instance_count) {
            break;
        }
    }
    return hit;
}

// Adds the lengths of the wave's queues to the sum behind them, 64 bits in two words.
@compute @workgroup_size(1)
fn count_rays() {
    let end = arrayLength(&queued) - 2u;
    for (var step = 0u; step <= wave.step; step++) {
        let rays = atomicLoad(&queued[step]);
        let before = atomicAdd(&queued[end], rays);
        atomicAdd(&queued[end + 1u], select(0u, 1u, before > 0xffffffffu - rays));
    }
}

fn is_masked(triangle: u32) -> bool {
    return materials[triangles[triangle].w & MATERIAL_MASK].alpha_cutoff >= 0.0;
}

// Drawn anew for each ray and surface, from 0 to 1: rays differ in their bits.
fn drawn_for(ray: Ray, triangle: u32) -> f32 {
    let d = bitcast<vec3<u32>>(ray.direction);
    let o = bitcast<vec3<u32>>(ray.origin);
    let bits = hash(hash(hash(d.x ^ o.z) ^ d.y ^ o.x) ^ d.z ^ o.y ^ triangle * 0x9e3779b9u);
    return f32(bits >> 8u) * (1.0 / 16777216.0);
}

// Nearest surface that a ray meets, past masked and blended ones that are not
// there for it.
fn trace_past_holes(ray: Ray, any: bool, cull: bool, near_mover: ptr<function, bool>) -> Hit {
    var hit: Hit;
    var start = ray.start;
    for (var holes = 0u; holes <= MOST_HOLES; holes++) {
        hit = trace(ray.origin, ray.direction, start, ray.length, any, cull, near_mover);
        if (!HAS_MASKS || hit.triangle == NONE || !is_masked(hit.triangle)
            || opacity(hit.triangle, hit.b) > drawn_for(ray, hit.triangle)) {
            break;
        }
        start = hit.t;
    }
    return hit;
}

// Traces the queued rays of a wave: one thread per ray.
// A kernel of its own, because drivers that run threads in lockstep pay for
// every line of a loop whether or not a lane needs it.
@compute @workgroup_size(64)
fn trace_rays(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let place = id.x + id.y * groups.x * 64u;
    if (place >= atomicLoad(&queued[wave.step])) {
        return;
    }
    let index = queue[place];
    let ray = rays[index];
    let slot = index / wave.path_count;
    let onwards = slot == 2u;
    var near_mover = false;
    let hit = trace_past_holes(ray, !onwards, onwards && wave.cull != 0u, &near_mover);
    let triangle = select(hit.triangle, NO_TRIANGLE, hit.triangle == NONE);
    hits[index] = vec4<u32>(bitcast<u32>(hit.t), triangle | select(0u, NEAR_MOVER, near_mover),
        bitcast<vec2<u32>>(hit.b));
}
