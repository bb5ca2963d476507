// What a client shows of an atlas, before tone curve and video: each pixel's
// rays meet the geometry and read the slot of the patch that they meet.
// One thread per pixel; reads `shown` by way of `homes`, writes `seen`.
// The inverse of `surface_point` in block_slots.wgsl and triangle_slots.wgsl.
// Joined with triangle.wgsl.

struct ViewParameters {
    world_from_eye: mat3x4<f32>,
    // Tangents of left, right, up and down.
    tangents: vec4<f32>,
    size: vec2<u32>,
    atlas_width: u32,
    padding: u32,
}

// Where a patch's texels are.
struct Home {
    // x | y << 16 of the block, or NONE.
    position: u32,
    // log2 width | log2 height << 4 | shape << 8 | turned << 14, or TRIANGLE.
    layout_bits: u32,
    first_triangle: u32,
    // Of a triangle: see `atlas_triangle`.
    corners: array<u32, 3>,
    weights: array<u32, 2>,
}

const TRIANGLE: u32 = 1u << 15u;

@group(2) @binding(0) var<uniform> view: ViewParameters;
@group(2) @binding(1) var<storage, read> homes: array<Home>;
@group(2) @binding(2) var<storage, read> patches: array<u32>;
@group(2) @binding(3) var<storage, read> shown: array<vec4<f32>>;
@group(2) @binding(4) var<storage, read_write> seen: array<vec4<f32>>;

// Rays of a pixel on either axis.
const RAYS: u32 = 3u;

fn patch_coordinates(shape: u32, triangle: u32, b: vec2<f32>) -> vec2<f32> {
    if (shape == 1u && triangle == 1u) {
        return vec2<f32>(1.0 - b.y, b.x + b.y);
    }
    if (shape == 2u) {
        let v = select(b.y, b.x + b.y, triangle == 1u);
        let u = select(select(0.5 * (b.x + 1.0 + v), b.x + 0.5 * (1.0 - v), triangle == 1u), 0.5 * b.x, triangle == 0u);
        return vec2<f32>(u, v);
    }
    return b;
}

// Between four texels, the first of them at `corner`.
fn between(corner: vec2<u32>, f: vec2<f32>, right: u32, down: u32) -> vec3<f32> {
    let at = corner.y * view.atlas_width + corner.x;
    return mix(mix(shown[at].rgb, shown[at + right].rgb, f.x),
        mix(shown[at + down].rgb, shown[at + down + right].rgb, f.x), f.y);
}

fn triangle_light(home: Home, b: vec2<f32>) -> vec3<f32> {
    let slot = atlas_triangle(home.corners, home.weights);
    let q = max(texel_at(slot, in_atlas(slot, vec3<f32>(1.0 - b.x - b.y, b))), vec2<f32>(0.0));
    let low = min(vec2<u32>(q), slot.size - 1u);
    let last = low == slot.size - 1u;
    return between(slot.corner + low, min(q - vec2<f32>(low), vec2<f32>(1.0)),
        select(1u, 0u, last.x), select(view.atlas_width, 0u, last.y));
}

fn texel_light(hit: Hit) -> vec3<f32> {
    let home = homes[patches[hit.triangle]];
    if (home.position == NONE) {
        return vec3<f32>(0.0);
    }
    if ((home.layout_bits & TRIANGLE) != 0u) {
        return triangle_light(home, hit.b);
    }
    let shape = (home.layout_bits >> 8u) & 3u;
    let along_patch = patch_coordinates(shape, hit.triangle - home.first_triangle, hit.b);
    let along_block = select(along_patch, along_patch.yx, (home.layout_bits & (1u << 14u)) != 0u);
    let size = vec2<u32>(1u << (home.layout_bits & 15u), 1u << ((home.layout_bits >> 4u) & 15u));
    let p = clamp(along_block, vec2<f32>(0.0), vec2<f32>(1.0)) * vec2<f32>(size - 1u);
    let low = min(vec2<u32>(p), max(size, vec2<u32>(2u)) - 2u);
    let f = p - vec2<f32>(low);
    let corner = vec2<u32>(home.position & 0xffffu, home.position >> 16u) + low;
    return between(corner, f, select(0u, 1u, size.x > 1u), select(0u, view.atlas_width, size.y > 1u));
}

@compute @workgroup_size(64)
fn see_atlas(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let pixel = id.x + id.y * groups.x * 64u;
    if (pixel >= view.size.x * view.size.y) {
        return;
    }
    let corner = vec2<f32>(vec2<u32>(pixel % view.size.x, pixel / view.size.x));
    let eye = transform_point(view.world_from_eye, vec3<f32>(0.0));
    var sum = vec3<f32>(0.0);
    var near_mover = false;
    for (var i = 0u; i < RAYS * RAYS; i++) {
        let inside = (vec2<f32>(vec2<u32>(i % RAYS, i / RAYS)) + 0.5) / f32(RAYS);
        let at = (corner + inside) / vec2<f32>(view.size);
        let direction = normalize(transform_vector(view.world_from_eye, vec3<f32>(
            mix(view.tangents.x, view.tangents.y, at.x), mix(view.tangents.z, view.tangents.w, at.y), -1.0)));
        let hit = trace_past_holes(Ray(eye, INFINITE, direction, 0.0), false, true, &near_mover);
        if (hit.triangle == NONE) {
            sum += sky_radiance(direction);
        } else {
            sum += texel_light(hit);
        }
    }
    seen[pixel] = vec4<f32>(sum / f32(RAYS * RAYS), 1.0);
}
