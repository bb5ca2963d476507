// The scene in even light: from everywhere, onto everything, so that a surface shows
// its own colour. It has no noise: what differs from a look at an atlas in the same
// light is the atlas's doing alone.
// One thread per pixel; writes `seen`. Joined with view.wgsl.

// Rays of a pixel on either axis.
const FINE_RAYS: u32 = 6u;

@compute @workgroup_size(64)
fn see_even(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let pixel = id.x + id.y * groups.x * 64u;
    if (pixel >= view.size.x * view.size.y) {
        return;
    }
    let eye = transform_point(view.world_from_eye, vec3<f32>(0.0));
    let pixel_angle = (view.tangents.y - view.tangents.x) / f32(view.size.x);
    var sum = vec3<f32>(0.0);
    var near_mover = false;
    for (var i = 0u; i < FINE_RAYS * FINE_RAYS; i++) {
        let inside = (vec2<f32>(vec2<u32>(i % FINE_RAYS, i / FINE_RAYS)) + 0.5) / f32(FINE_RAYS);
        let direction = direction_at(pixel, inside);
        let hit = trace_past_holes(Ray(eye, INFINITE, direction, 0.0), false, true, &near_mover);
        if (hit.triangle == NONE) {
            sum += sky_radiance(direction);
        } else {
            let s = surface_at(hit.triangle, hit.b, -direction, hit.t * pixel_angle / f32(FINE_RAYS));
            sum += s.emissive + diffuse_color(s);
        }
    }
    seen[pixel] = vec4<f32>(sum / f32(FINE_RAYS * FINE_RAYS), 1.0);
}
