// Smooths light along surfaces, as far as its variance asks for. One thread per
// pixel; both kernels reads `given` and write `made`.
//
// `estimate_variance` measures the variance over the surroundings where the
// history is too short to tell it. `smooth_light` is an iteration of an
// edge-avoiding à-trous wavelet transform, run with steps 1, 2, 4, 8 and 16.
// Source: Schied et al., 2017, sections 4.2 to 4.4; the transform is that of
// Dammertz et al., "Edge-Avoiding À-Trous Wavelet Transform", 2010.

// Pixels between samples.
@group(2) @binding(1) var<uniform> stride: i32;
@group(2) @binding(2) var<storage, read> guides: array<Guide>;
@group(2) @binding(3) var<storage, read> moments: array<Moments>;
@group(2) @binding(4) var<storage, read> given: array<Light>;
@group(2) @binding(5) var<storage, read_write> made: array<Light>;

// Of depth, in what the plane predicts; of normals, an exponent; of luminance, in
// standard deviations. Schied et al., section 4.4.
const SIGMA_DEPTH: f32 = 1.0;
const SIGMA_NORMAL: f32 = 128.0;
const SIGMA_LIGHT: f32 = 4.0;
// Relative difference of depth that is none: curvature within a pixel.
const SAME_DEPTH: f32 = 0.002;
// Frames from which on a history tells the variance.
const TELLING_HISTORY: f32 = 4.0;

// By depths and normals, how much a pixel counts that lies `offset` pixels away.
fn likeness(here: Guide, there: Guide, offset: vec2<i32>) -> f32 {
    let expected = SIGMA_DEPTH * abs(dot(here.slope, vec2<f32>(offset))) + SAME_DEPTH * here.inverse_depth;
    let by_depth = exp(-abs(here.inverse_depth - there.inverse_depth) / expected);
    return by_depth * pow(clamp(dot(here.normal, there.normal), 0.0, 1.0), SIGMA_NORMAL);
}

@compute @workgroup_size(64)
fn estimate_variance(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let pixel = id.x + id.y * groups.x * 64u;
    if (pixel >= view.size.x * view.size.y) {
        return;
    }
    let here = guides[pixel];
    let length = moments[pixel].length;
    if (here.inverse_depth == 0.0 || length >= TELLING_HISTORY) {
        made[pixel] = given[pixel];
        return;
    }
    let p = place_of(pixel);
    var sum = Light();
    var first = vec2<f32>(0.0);
    var second = vec2<f32>(0.0);
    var weights = 0.0;
    for (var y = -3; y <= 3; y++) {
        for (var x = -3; x <= 3; x++) {
            let offset = vec2<i32>(x, y);
            if (is_inside(p + offset)) {
                let at = index_of(p + offset);
                let weight = likeness(here, guides[at], offset);
                sum[0] += weight * given[at][0];
                sum[1] += weight * given[at][1];
                first += weight * moments[at].first;
                second += weight * moments[at].second;
                weights += weight;
            }
        }
    }
    first /= weights;
    second /= weights;
    // More of it while there is less to tell it by.
    let variance = max(second - first * first, vec2<f32>(0.0)) * (TELLING_HISTORY / length);
    made[pixel] = Light(vec4<f32>(sum[0].rgb / weights, variance.x), vec4<f32>(sum[1].rgb / weights, variance.y));
}

// Standard deviations of direct and indirect light, smoothed over 3x3 pixels.
fn deviation_around(p: vec2<i32>) -> vec2<f32> {
    var sum = vec2<f32>(0.0);
    var weights = 0.0;
    for (var y = -1; y <= 1; y++) {
        for (var x = -1; x <= 1; x++) {
            let q = p + vec2<i32>(x, y);
            if (is_inside(q)) {
                let weight = f32((2 - abs(x)) * (2 - abs(y)));
                sum += weight * vec2<f32>(given[index_of(q)][0].w, given[index_of(q)][1].w);
                weights += weight;
            }
        }
    }
    return sqrt(sum / weights);
}

@compute @workgroup_size(64)
fn smooth_light(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let pixel = id.x + id.y * groups.x * 64u;
    if (pixel >= view.size.x * view.size.y) {
        return;
    }
    let here = guides[pixel];
    let light = given[pixel];
    if (here.inverse_depth == 0.0) {
        made[pixel] = light;
        return;
    }
    let p = place_of(pixel);
    let allowed = SIGMA_LIGHT * deviation_around(p) + 1e-10;
    // B3 spline.
    var kernel = array<f32, 3>(3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0);
    var sum = Light();
    var weights = vec2<f32>(0.0);
    for (var y = -2; y <= 2; y++) {
        for (var x = -2; x <= 2; x++) {
            let offset = vec2<i32>(x, y) * stride;
            if (!is_inside(p + offset)) {
                continue;
            }
            let at = index_of(p + offset);
            let near = given[at];
            let weight = kernel[abs(x)] * kernel[abs(y)] * likeness(here, guides[at], offset);
            for (var k = 0; k < 2; k++) {
                let difference = abs(luminance(near[k].rgb) - luminance(light[k].rgb));
                let w = weight * exp(-difference / allowed[k]);
                sum[k] += near[k] * vec4<f32>(w, w, w, w * w);
                weights[k] += w;
            }
        }
    }
    for (var k = 0; k < 2; k++) {
        let w = weights[k];
        sum[k] /= vec4<f32>(w, w, w, w * w);
    }
    made[pixel] = sum;
}
