// How far a step of one pixel goes in the atlas: the derivatives of texel coordinates
// along the picture's rows and columns, which are at right angles and of length 1
// where texels are ideal. Source: SnakeBinning (Hladky et al., 2021), figure 13.
// One thread per pixel; writes `seen`: both derivatives; all zero where there is
// nothing, all below zero where a patch has no slot. Joined with view.wgsl.

// Where a ray meets a triangle's plane: weights of its corners 1 and 2.
fn on_plane(triangle: u32, origin: vec3<f32>, direction: vec3<f32>) -> vec2<f32> {
    var p0 = vertex_position(triangle, 0u);
    var e1 = vertex_position(triangle, 1u) - p0;
    var e2 = vertex_position(triangle, 2u) - p0;
    let instance = triangles[triangle].w >> OBJECT_SHIFT;
    if (HAS_MOVERS && instance != 0u) {
        let m = instances[instance].world_from_object;
        p0 = transform_point(m, p0);
        e1 = transform_vector(m, e1);
        e2 = transform_vector(m, e2);
    }
    let h = cross(direction, e2);
    let s = origin - p0;
    let q = cross(s, e1);
    return vec2<f32>(dot(s, h), dot(direction, q)) / dot(e1, h);
}

@compute @workgroup_size(64)
fn see_density(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let pixel = id.x + id.y * groups.x * 64u;
    if (pixel >= view.size.x * view.size.y) {
        return;
    }
    let eye = transform_point(view.world_from_eye, vec3<f32>(0.0));
    let middle = direction_at(pixel, vec2<f32>(0.5));
    var near_mover = false;
    let hit = trace_past_holes(Ray(eye, INFINITE, middle, 0.0), false, true, &near_mover);
    if (hit.triangle == NONE) {
        seen[pixel] = vec4<f32>(0.0);
        return;
    }
    let home = homes[patches[hit.triangle]];
    if (home.position == NONE) {
        seen[pixel] = vec4<f32>(-1.0);
        return;
    }
    // An eighth of a pixel on either side: wide enough for single precision.
    let step = 0.125;
    var derivatives: array<vec2<f32>, 2>;
    for (var axis = 0u; axis < 2u; axis++) {
        let offset = vec2<f32>(select(0.0, step, axis == 0u), select(0.0, step, axis == 1u));
        let ahead = atlas_point(home, hit.triangle, on_plane(hit.triangle, eye, direction_at(pixel, 0.5 + offset)));
        let behind = atlas_point(home, hit.triangle, on_plane(hit.triangle, eye, direction_at(pixel, 0.5 - offset)));
        derivatives[axis] = (ahead - behind) / (2.0 * step);
    }
    seen[pixel] = vec4<f32>(derivatives[0], derivatives[1]);
}
