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

// Where a patch has a point of one of its triangles, in texels from the middle of the
// atlas' first.
fn atlas_point(home: Home, triangle: u32, b: vec2<f32>) -> vec2<f32> {
    if ((home.layout_bits & TRIANGLE) != 0u) {
        let slot = atlas_triangle(home.corners, home.weights);
        return vec2<f32>(slot.corner) + texel_at(slot, in_atlas(slot, vec3<f32>(1.0 - b.x - b.y, b)));
    }
    let shape = (home.layout_bits >> 8u) & 3u;
    let along_patch = patch_coordinates(shape, triangle - home.first_triangle, b);
    let along_block = select(along_patch, along_patch.yx, (home.layout_bits & (1u << 14u)) != 0u);
    return vec2<f32>(first_texel(home)) + along_block * vec2<f32>(texels_of(home) - 1u);
}

fn first_texel(home: Home) -> vec2<u32> {
    if ((home.layout_bits & TRIANGLE) != 0u) {
        return atlas_triangle(home.corners, home.weights).corner;
    }
    return vec2<u32>(home.position & 0xffffu, home.position >> 16u);
}

fn texels_of(home: Home) -> vec2<u32> {
    if ((home.layout_bits & TRIANGLE) != 0u) {
        return atlas_triangle(home.corners, home.weights).size;
    }
    return vec2<u32>(1u << (home.layout_bits & 15u), 1u << ((home.layout_bits >> 4u) & 15u));
}

fn texel_light(hit: Hit) -> vec3<f32> {
    let home = homes[patches[hit.triangle]];
    if (home.position == NONE) {
        return vec3<f32>(0.0);
    }
    let first = first_texel(home);
    let last = first + texels_of(home) - 1u;
    let p = clamp(atlas_point(home, hit.triangle, hit.b), vec2<f32>(first), vec2<f32>(last));
    let low = min(vec2<u32>(p), last);
    let f = p - vec2<f32>(low);
    let at = low.y * view.atlas_width + low.x;
    let right = select(1u, 0u, low.x == last.x);
    let down = select(view.atlas_width, 0u, low.y == last.y);
    return mix(mix(shown[at].rgb, shown[at + right].rgb, f.x),
        mix(shown[at + down].rgb, shown[at + down + right].rgb, f.x), f.y);
}

// Where a pixel's ray goes that leaves from `inside` of it, from 0 to 1 on either axis.
fn direction_at(pixel: u32, inside: vec2<f32>) -> vec3<f32> {
    let corner = vec2<f32>(vec2<u32>(pixel % view.size.x, pixel / view.size.x));
    let at = (corner + inside) / vec2<f32>(view.size);
    return normalize(transform_vector(view.world_from_eye, vec3<f32>(
        mix(view.tangents.x, view.tangents.y, at.x), mix(view.tangents.z, view.tangents.w, at.y), -1.0)));
}

@compute @workgroup_size(64)
fn see_atlas(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let pixel = id.x + id.y * groups.x * 64u;
    if (pixel >= view.size.x * view.size.y) {
        return;
    }
    let eye = transform_point(view.world_from_eye, vec3<f32>(0.0));
    var sum = vec3<f32>(0.0);
    var near_mover = false;
    for (var i = 0u; i < RAYS * RAYS; i++) {
        let inside = (vec2<f32>(vec2<u32>(i % RAYS, i / RAYS)) + 0.5) / f32(RAYS);
        let direction = direction_at(pixel, inside);
        let hit = trace_past_holes(Ray(eye, INFINITE, direction, 0.0), false, true, &near_mover);
        if (hit.triangle == NONE) {
            sum += sky_radiance(direction);
        } else {
            sum += texel_light(hit);
        }
    }
    seen[pixel] = vec4<f32>(sum / f32(RAYS * RAYS), 1.0);
}
