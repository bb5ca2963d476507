// How many texels each visible patch deserves, seen from an eye.
// One thread per patch. Joined with edges.wgsl. Twin: footprint.rs. Source: SAS 2018, section 4.3, equation 1.

struct FootprintParameters {
    patch_count: u32,
    pixels_per_radian: f32,
    padding: vec2<u32>,
}

@group(1) @binding(0) var<uniform> footprints: FootprintParameters;
@group(1) @binding(1) var<storage, read> pixels_of_patch: array<u32>;
// First triangle; shape | object << 8.
@group(1) @binding(2) var<storage, read> patches: array<vec2<u32>>;
// The eye in the space of each object, the world's first.
@group(1) @binding(3) var<storage, read> eyes: array<vec4<f32>>;
// log2 area | log2 aspect << 16, in 256ths of an octave.
@group(1) @binding(4) var<storage, read_write> wishes: array<u32>;

fn edge_pixels(a: vec3<f32>, b: vec3<f32>, eye: vec3<f32>) -> f32 {
    return pixels_of_edge(a, b, eye, footprints.pixels_per_radian);
}

@compute @workgroup_size(64)
fn measure_footprints(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = id.x + id.y * groups.x * 64u;
    if (index >= footprints.patch_count || pixels_of_patch[index] == 0u) {
        return;
    }
    let first = patches[index].x;
    let shape = patches[index].y & 0xffu;
    let eye = eyes[patches[index].y >> 8u].xyz;
    // Corners in the order of the layout: see `PatchShape::triangles`.
    let c0 = vertex_position(first, 0u);
    let c1 = vertex_position(first, 1u);
    var area: f32;
    var width: f32;
    var height: f32;
    if (shape == 0u) {
        let c2 = vertex_position(first, 2u);
        width = edge_pixels(c0, c1, eye);
        height = edge_pixels(c0, c2, eye);
        area = 2.0 * triangle_area(width, height, edge_pixels(c1, c2, eye));
    } else if (shape == 1u) {
        let c3 = vertex_position(first, 2u);
        let c2 = vertex_position(first + 1u, 1u);
        let top = edge_pixels(c0, c1, eye);
        let right = edge_pixels(c1, c2, eye);
        let bottom = edge_pixels(c2, c3, eye);
        let left = edge_pixels(c3, c0, eye);
        let diagonal = edge_pixels(c1, c3, eye);
        area = triangle_area(top, diagonal, left) + triangle_area(right, bottom, diagonal);
        width = max(top, bottom);
        height = max(left, right);
    } else {
        let c4 = vertex_position(first, 2u);
        let c3 = vertex_position(first + 1u, 1u);
        let c2 = vertex_position(first + 2u, 1u);
        let top_left = edge_pixels(c0, c1, eye);
        let top_right = edge_pixels(c1, c2, eye);
        let right = edge_pixels(c2, c3, eye);
        let bottom = edge_pixels(c3, c4, eye);
        let left = edge_pixels(c4, c0, eye);
        let falling = edge_pixels(c1, c3, eye);
        let rising = edge_pixels(c1, c4, eye);
        area = triangle_area(top_left, rising, left) + triangle_area(falling, bottom, rising)
            + triangle_area(top_right, right, falling);
        width = max(top_left + top_right, bottom);
        height = max(left, right);
    }
    // The outer texels lie on the patch's edges: n of them stand n - 1 apart.
    width = max(width, SMALLEST_LENGTH);
    height = max(height, SMALLEST_LENGTH);
    let texels = max(area, SMALLEST_LENGTH * SMALLEST_LENGTH) * (1.0 + 1.0 / width) * (1.0 + 1.0 / height);
    let log2_area = clamp(steps_of(log2(texels)), 0, 8192);
    let log2_aspect = clamp(steps_of(log2(width + 1.0) - log2(height + 1.0)), -4096, 4096);
    wishes[index] = u32(log2_area) | (u32(log2_aspect & 0xffff) << 16u);
}
