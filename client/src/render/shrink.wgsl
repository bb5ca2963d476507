// Each pixel of an eye is the mean of two by two of a picture twice as large.

@group(0) @binding(0) var large: texture_2d<f32>;

@vertex
fn cover(@builtin(vertex_index) vertex: u32) -> @builtin(position) vec4f {
    return vec4f(f32(vertex & 1u) * 4.0 - 1.0, f32(vertex >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn shrink(@builtin(position) pixel: vec4f) -> @location(0) vec4f {
    let corner = 2u * vec2u(pixel.xy);
    return 0.25 * (textureLoad(large, corner, 0)
        + textureLoad(large, corner + vec2u(1u, 0u), 0)
        + textureLoad(large, corner + vec2u(0u, 1u), 0)
        + textureLoad(large, corner + vec2u(1u, 1u), 0));
}
