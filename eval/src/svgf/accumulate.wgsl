// Blends a frame's light with that of the frames before it. One thread per pixel.
//
// The point that is seen is looked up where it was seen before, between four
// pixels; those that saw something else do not count. Where none did, all around
// are asked, which keeps the history of thin things.
// Reads `fresh`, `history` and `moments_before`; writes `blended` and `moments`.
// Source: Schied et al., 2017, section 4.1.

@group(2) @binding(1) var<storage, read> seen: array<Seen>;
@group(2) @binding(2) var<storage, read> seen_before: array<Seen>;
@group(2) @binding(3) var<storage, read> guides: array<Guide>;
@group(2) @binding(4) var<storage, read> fresh: array<Light>;
@group(2) @binding(5) var<storage, read> history: array<Light>;
@group(2) @binding(6) var<storage, read> moments_before: array<Moments>;
@group(2) @binding(7) var<storage, read_write> blended: array<Light>;
@group(2) @binding(8) var<storage, read_write> moments: array<Moments>;

// Least share of the new frame: the paper's. Longer histories, to a share of 0.05,
// have larger errors: what the filter feeds back is blurred once a frame.
const SHARE: f32 = 0.2;
// Beyond, nothing depends on it.
const LONGEST_HISTORY: f32 = 256.0;
// Cosine between normals, and distance from the plane in widths of a pixel, up to
// which two points are of the same surface.
const SAME_NORMAL: f32 = 0.9;
const SAME_PLANE: f32 = 1.0;
// Of the four pixels' weights, below which they do not tell.
const LEAST_WEIGHT: f32 = 0.01;

struct Past {
    light: Light,
    moments: Moments,
    weight: f32,
}

fn recall(past: ptr<function, Past>, here: Seen, width: f32, p: vec2<i32>, weight: f32) {
    if (!is_inside(p)) {
        return;
    }
    let at = index_of(p);
    let there = seen_before[at];
    if (there.instance != here.instance || dot(there.normal, here.normal) < SAME_NORMAL
        || abs(dot(here.normal, there.position - here.position)) > SAME_PLANE * width) {
        return;
    }
    (*past).light[0] += weight * history[at][0];
    (*past).light[1] += weight * history[at][1];
    (*past).moments.first += weight * moments_before[at].first;
    (*past).moments.second += weight * moments_before[at].second;
    (*past).moments.length += weight * moments_before[at].length;
    (*past).weight += weight;
}

@compute @workgroup_size(64)
fn accumulate(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let pixel = id.x + id.y * groups.x * 64u;
    if (pixel >= view.size.x * view.size.y) {
        return;
    }
    let here = seen[pixel];
    if (here.instance == NONE) {
        blended[pixel] = Light();
        moments[pixel] = Moments();
        return;
    }
    let guide = guides[pixel];
    let width = pixel_cone() / guide.inverse_depth;
    var past: Past;
    if (view.age > 0u) {
        let corner = floor(guide.before);
        let f = guide.before - corner;
        for (var i = 0; i < 4; i++) {
            let step = vec2<i32>(i & 1, i >> 1u);
            let shares = select(1.0 - f, f, step == vec2<i32>(1));
            recall(&past, here, width, vec2<i32>(corner) + step, shares.x * shares.y);
        }
        if (past.weight < LEAST_WEIGHT) {
            past = Past();
            for (var i = 0; i < 9; i++) {
                recall(&past, here, width, vec2<i32>(round(guide.before)) + vec2<i32>(i % 3, i / 3) - 1, 1.0);
            }
        }
    }
    let per_weight = select(0.0, 1.0 / past.weight, past.weight > 0.0);
    let length = min(past.moments.length * per_weight + 1.0, LONGEST_HISTORY);
    let share = max(SHARE, 1.0 / length);
    var now = fresh[pixel];
    let bright = vec2<f32>(luminance(now[0].rgb), luminance(now[1].rgb));
    let first = mix(past.moments.first * per_weight, bright, share);
    let second = mix(past.moments.second * per_weight, bright * bright, share);
    let variance = max(second - first * first, vec2<f32>(0.0));
    for (var k = 0; k < 2; k++) {
        now[k] = vec4<f32>(mix(past.light[k].rgb * per_weight, now[k].rgb, share), variance[k]);
    }
    blended[pixel] = now;
    moments[pixel] = Moments(first, second, length);
}
