// A small panel of text that hangs in the world: drawn last, over everything,
// so that nothing hides it.

@group(0) @binding(4) var notice_picture: texture_2d<f32>;
@group(0) @binding(5) var notice_sampler: sampler;

struct OnPanel {
    @builtin(position) clip: vec4f,
    @location(0) uv: vec2f,
}

// The panel is the square from -1 to 1; the matrix has its size and place.
fn notice_corner(eye: u32, vertex: u32) -> OnPanel {
    let corner = vec2f(f32(vertex & 1u), f32(vertex >> 1u)) * 2.0 - 1.0;
    let clip = eyes.matrix[eye] * vec4f(corner, 0.0, 1.0);
    return OnPanel(clip, vec2f(corner.x, -corner.y) * 0.5 + 0.5);
}

@fragment
fn notice(point: OnPanel) -> @location(0) vec4f {
    return textureSampleLevel(notice_picture, notice_sampler, point.uv, 0.0);
}
