// Each pixel of an eye is the mean of two by two of a picture twice as large.
//
// The mean is taken of light as it was before the server's tone curve (Khronos
// PBR Neutral), because that is what a pixel sees: where a white wall in the sun
// meets a dark one, means of what is displayed would be too dark.

// The picture holds display-encoded colours: about the square roots of light,
// the sRGB curve within 0.04 of the display range.
override IS_ENCODED: bool = false;

@group(0) @binding(0) var large: texture_2d<f32>;

@vertex
fn cover(@builtin(vertex_index) vertex: u32) -> @builtin(position) vec4f {
    return vec4f(f32(vertex & 1u) * 4.0 - 1.0, f32(vertex >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

// The curve compresses what is brighter than this into what is left up to one.
const START: f32 = 0.76;
const ROOM: f32 = 0.24;
// Displayed brightness beyond which eight bits do not tell how bright it was.
const BRIGHTEST: f32 = 0.998;

// The curve's darkening of the darkest by up to 0.04, and its paling of the
// brightest, are left as they are.
fn light(pixel: vec2u) -> vec3f {
    let color = textureLoad(large, pixel, 0).rgb;
    let displayed = select(color, color * color, IS_ENCODED);
    let peak = min(max(displayed.r, max(displayed.g, displayed.b)), BRIGHTEST);
    let uncompressed = ROOM * ROOM / (1.0 - peak) - ROOM + START;
    return displayed * select(1.0, uncompressed / peak, peak > START);
}

@fragment
fn shrink(@builtin(position) pixel: vec4f) -> @location(0) vec4f {
    let corner = 2u * vec2u(pixel.xy);
    let mean = 0.25 * (light(corner) + light(corner + vec2u(1u, 0u))
        + light(corner + vec2u(0u, 1u)) + light(corner + vec2u(1u, 1u)));
    let peak = max(mean.r, max(mean.g, mean.b));
    let compressed = 1.0 - ROOM * ROOM / (peak + ROOM - START);
    let displayed = mean * select(1.0, compressed / peak, peak > START);
    return vec4f(select(displayed, sqrt(displayed), IS_ENCODED), 1.0);
}
