// The decoded picture as the atlas: limited-range BT.709 4:2:0 to RGB.
//
// Chroma is taken as it is and not interpolated, because a chroma sample
// belongs to one block and its neighbour may belong to another.

@group(0) @binding(0) var luma: texture_2d<f32>;
@group(0) @binding(1) var blue: texture_2d<f32>;
@group(0) @binding(2) var red: texture_2d<f32>;

@vertex
fn cover(@builtin(vertex_index) vertex: u32) -> @builtin(position) vec4f {
    return vec4f(vec2f(f32(vertex & 1u), f32(vertex >> 1u)) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn rgb_from_yuv(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let texel = vec2u(position.xy);
    let y = (textureLoad(luma, texel, 0).r * 255.0 - 16.0) / 219.0;
    let cb = (textureLoad(blue, texel / 2u, 0).r * 255.0 - 128.0) / 224.0;
    let cr = (textureLoad(red, texel / 2u, 0).r * 255.0 - 128.0) / 224.0;
    // ITU-R BT.709-6, item 3: Kr = 0.2126, Kb = 0.0722.
    let rgb = vec3f(y + 1.5748 * cr, y - 0.187324 * cb - 0.468124 * cr, y + 1.8556 * cb);
    return vec4f(saturate(rgb), 1.0);
}
