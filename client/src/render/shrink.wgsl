// Each pixel of an eye is the mean of two by two of a picture twice as large.
//
// The mean is taken of light. A picture that holds display-encoded colours holds
// about its square root: the sRGB curve within 0.04 of the display range.

override IS_ENCODED: bool = false;

@group(0) @binding(0) var large: texture_2d<f32>;

@vertex
fn cover(@builtin(vertex_index) vertex: u32) -> @builtin(position) vec4f {
    return vec4f(f32(vertex & 1u) * 4.0 - 1.0, f32(vertex >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

fn light(pixel: vec2u) -> vec4f {
    let color = textureLoad(large, pixel, 0);
    return select(color, color * color, IS_ENCODED);
}

@fragment
fn shrink(@builtin(position) pixel: vec4f) -> @location(0) vec4f {
    let corner = 2u * vec2u(pixel.xy);
    let mean = 0.25 * (light(corner) + light(corner + vec2u(1u, 0u))
        + light(corner + vec2u(0u, 1u)) + light(corner + vec2u(1u, 1u)));
    return select(mean, sqrt(mean), IS_ENCODED);
}
