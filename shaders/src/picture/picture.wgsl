// Turns linear radiance into the planes of a video picture: exposure, tone
// curve, sRGB, limited-range BT.709, 4:2:0 by the mean of two by two texels.
// One thread per 8 by 2 texels; writes whole words of each plane.
// Where triangles are placed by themselves, texels that were never lit show the mean of
// what is lit about them, so that fewer edges have to be coded.
// Twin: picture.rs. Sources: Khronos PBR Neutral tone mapper; ITU-R BT.709-6;
// SnakeBinning 2021, section 3.8, which clears each bin by the average of its
// triangles; by blocks of the video transform, pictures are smaller.

struct PictureParameters {
    size: vec2<u32>,
    exposure: f32,
    // 1 where what was never lit shows the mean of what is lit about it.
    fills: u32,
}

@group(0) @binding(0) var<uniform> picture: PictureParameters;
@group(0) @binding(1) var<storage, read> radiance: array<vec4<f32>>;
// Y, then U, then V, four samples a word.
@group(0) @binding(2) var<storage, read_write> planes: array<u32>;

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

// What is seen of a texel, and 1; nothing of one that was never lit.
fn shown(at: u32) -> vec4<f32> {
    let r = radiance[at];
    if (r.w <= 0.0) {
        return vec4<f32>(0.0);
    }
    return vec4<f32>(ycbcr(srgb_from_linear(tone_map(r.rgb * picture.exposure))), 1.0);
}

// Sums of what each thread's texels show, of the left and the right half.
var<workgroup> sums: array<vec4<f32>, 128>;

// What a texel of a half of a thread's shows that was never lit: the mean of what is lit
// in its block of 4 by 4 texels, or else of 8 by 8, or in its macroblock, or mid grey.
fn empty_about(half: u32) -> vec3<f32> {
    let column = half & 15u;
    let mean4 = sums[half] + sums[half ^ 16u];
    var mean8 = vec4<f32>(0.0);
    var mean16 = vec4<f32>(0.0);
    for (var row = 0u; row < 8u; row++) {
        let of_thread = sums[row * 16u + column] + sums[row * 16u + (column ^ 1u)];
        mean8 += select(vec4<f32>(0.0), of_thread, row / 4u == half / 64u);
        mean16 += of_thread + sums[row * 16u + (column ^ 2u)] + sums[row * 16u + (column ^ 3u)];
    }
    let mean = select(select(mean16, mean8, mean8.w > 0.0), mean4, mean4.w > 0.0);
    let is_lit = picture.fills != 0u && mean.w > 0.0;
    return select(ycbcr(vec3<f32>(0.5)), mean.xyz / max(mean.w, 1.0), is_lit);
}

@compute @workgroup_size(8, 8)
fn convert(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let corner = id.xy * vec2<u32>(8u, 2u);
    let is_inside = all(corner < picture.size);
    let width = picture.size.x;
    var texels: array<vec4<f32>, 16>;
    var own: array<vec4<f32>, 2>;
    for (var i = 0u; i < 16u && is_inside; i++) {
        texels[i] = shown((corner.y + i / 8u) * width + corner.x + i % 8u);
        own[i / 4u & 1u] += texels[i];
    }
    sums[2u * lane] = own[0];
    sums[2u * lane + 1u] = own[1];
    workgroupBarrier();
    if (!is_inside) {
        return;
    }
    let empty = array<vec3<f32>, 2>(empty_about(2u * lane), empty_about(2u * lane + 1u));
    var u_word = 0u;
    var v_word = 0u;
    var y_words: array<u32, 4>;
    for (var i = 0u; i < 16u; i++) {
        let seen = select(empty[i / 4u & 1u], texels[i].xyz, texels[i].w > 0.0);
        texels[i] = vec4<f32>(seen, 1.0);
        y_words[i / 4u] |= u32(seen.x + 0.5) << (8u * (i & 3u));
    }
    for (var i = 0u; i < 4u; i++) {
        let upper = texels[2u * i].yz + texels[2u * i + 1u].yz;
        let chroma = (upper + texels[2u * i + 8u].yz + texels[2u * i + 9u].yz) * 0.25 + 0.5;
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
