// Draws the patch id of the nearest triangle into each pixel.
// Source: SAS 2018, section 3.1. Twin: the same triangles seen by a ray, in the tests.

@group(1) @binding(0) var<storage, read> patch_of_triangle: array<u32>;
// One matrix per view and object: clip_from_object.
@group(1) @binding(1) var<storage, read> matrices: array<mat4x4<f32>>;

struct IdVertex {
    @builtin(position) position: vec4<f32>,
    // Patch id plus one; zero is nothing.
    @location(0) @interpolate(flat) id: u32,
    @location(1) @interpolate(flat) triangle: u32,
    @location(2) b: vec2<f32>,
}

@vertex
fn id_vertex(@builtin(vertex_index) vertex: u32, @builtin(instance_index) view: u32) -> IdVertex {
    let triangle = vertex / 3u;
    let corner = vertex % 3u;
    let position = vertex_position(triangle, corner);
    return IdVertex(
        matrices[view] * vec4<f32>(position, 1.0),
        patch_of_triangle[triangle] + 1u,
        triangle,
        vec2<f32>(select(0.0, 1.0, corner == 1u), select(0.0, 1.0, corner == 2u)),
    );
}

@fragment
fn id_fragment(v: IdVertex) -> @location(0) u32 {
    return v.id;
}

@fragment
fn id_fragment_masked(v: IdVertex) -> @location(0) u32 {
    if (opacity(v.triangle, v.b) <= 0.0) {
        discard;
    }
    return v.id;
}
