// Turns linear radiance into the planes of a video picture: exposure, tone
// curve, sRGB, limited-range BT.709, 4:2:0 by the mean of two by two texels.
// One thread per 8 by 2 texels; writes whole words of each plane.
// Twin: picture.rs. Sources: Khronos PBR Neutral tone mapper; ITU-R BT.709-6.

struct PictureParameters {
    size: vec2<u32>,
    exposure: f32,
    padding: u32,
}

@group(0) @binding(0) var<uniform> picture: PictureParameters;
@group(0) @binding(1) var<storage, read> radiance: array<vec4<f32>>;
// Y, then U, then V, four samples a word.
@group(0) @binding(2) var<storage, read_write> planes: array<u32>;

// What is seen where nothing was ever lit: mid grey costs the fewest bits.
const EMPTY: f32 = 0.5;

// Radiance times exposure that is as white as any: infinity would be no number
// on the curve.
const BRIGHTEST: f32 = 1e30;

fn tone_map(radiance_in: vec3<f32>) -> vec3<f32> {
    var c = clamp(radiance_in, vec3<f32>(0.0), vec3<f32>(BRIGHTEST));
    let start = 0.8 - 0.04;
    let x = min(c.r, min(c.g, c.b));
    let offset = select(0.04, x - 6.25 * x * x, x < 0.08);
    c -= offset;
    let peak = max(c.r, max(c.g, c.b));
    if (peak < start) {
        return c;
    }
    let d = 1.0 - start;
    let new_peak = 1.0 - d * d / (peak + d - start);
    c *= new_peak / peak;
    let g = 1.0 - 1.0 / (0.15 * (peak - new_peak) + 1.0);
    return mix(c, vec3<f32>(new_peak), g);
}

fn srgb_from_linear(c: vec3<f32>) -> vec3<f32> {
    let low = c * 12.92;
    let high = 1.055 * pow(max(c, vec3<f32>(0.0)), vec3<f32>(1.0 / 2.4)) - 0.055;
    return clamp(select(high, low, c <= vec3<f32>(0.0031308)), vec3<f32>(0.0), vec3<f32>(1.0));
}

// Rows of Y, Cb, Cr; R, G, B in [0, 1] to 8-bit code values.
fn ycbcr(rgb: vec3<f32>) -> vec3<f32> {
    let y = dot(rgb, vec3<f32>(0.2126, 0.7152, 0.0722));
    return vec3<f32>(
        16.0 + 219.0 * y,
        128.0 + 224.0 * (rgb.b - y) / 1.8556,
        128.0 + 224.0 * (rgb.r - y) / 1.5748,
    );
}

fn shown(at: u32) -> vec3<f32> {
    let r = radiance[at];
    if (r.w <= 0.0) {
        return ycbcr(vec3<f32>(EMPTY));
    }
    return ycbcr(srgb_from_linear(tone_map(r.rgb * picture.exposure)));
}

@compute @workgroup_size(8, 8)
fn convert(@builtin(global_invocation_id) id: vec3<u32>) {
    let corner = id.xy * vec2<u32>(8u, 2u);
    if (any(corner >= picture.size)) {
        return;
    }
    let width = picture.size.x;
    var u_word = 0u;
    var v_word = 0u;
    var y_words: array<u32, 4>;
    for (var i = 0u; i < 4u; i++) {
        let x = corner.x + 2u * i;
        let a = shown(corner.y * width + x);
        let b = shown(corner.y * width + x + 1u);
        let c = shown((corner.y + 1u) * width + x);
        let d = shown((corner.y + 1u) * width + x + 1u);
        let shift = 16u * (i & 1u);
        let upper = u32(a.x + 0.5) | (u32(b.x + 0.5) << 8u);
        let lower = u32(c.x + 0.5) | (u32(d.x + 0.5) << 8u);
        y_words[i / 2u] |= upper << shift;
        y_words[2u + i / 2u] |= lower << shift;
        let chroma = (a.yz + b.yz + c.yz + d.yz) * 0.25 + 0.5;
        u_word |= u32(chroma.x) << (8u * i);
        v_word |= u32(chroma.y) << (8u * i);
    }
    let row = (corner.y * width + corner.x) / 4u;
    planes[row] = y_words[0];
    planes[row + 1u] = y_words[1];
    planes[row + width / 4u] = y_words[2];
    planes[row + width / 4u + 1u] = y_words[3];
    let luma_words = picture.size.x * picture.size.y / 4u;
    let chroma_at = (id.y * (width / 2u)) / 4u + id.x;
    planes[luma_words + chroma_at] = u_word;
    planes[luma_words + luma_words / 4u + chroma_at] = v_word;
}
