// Puts light back on surfaces, and blends the picture with that of the frames
// before, which antialiases it. One thread per pixel.
//
// The old picture is looked up where the nearest of the surroundings was, so that
// edges keep theirs, and confined to the colours that the surroundings have now.
// It is linear light that is blended: a picture here is compared with means of
// light before the tone curve.
// Source: Schied et al., 2017, section 3, with Karis, "High-Quality Temporal
// Supersampling", 2014, and Salvi, "An Excursion in Temporal Supersampling", 2016.

@group(2) @binding(1) var<storage, read> guides: array<Guide>;
@group(2) @binding(2) var<storage, read> coats: array<Coat>;
@group(2) @binding(3) var<storage, read> light: array<Light>;
@group(2) @binding(4) var<storage, read> picture_before: array<vec4<f32>>;
@group(2) @binding(5) var<storage, read_write> picture: array<vec4<f32>>;

// Least share of the new frame. Half of it, as is usual, has larger errors while
// the camera moves.
const SHARE: f32 = 0.2;
// Standard deviations from their mean that colours of the surroundings may be.
const SPREAD: f32 = 1.0;

fn inside(p: vec2<i32>) -> vec2<i32> {
    return clamp(p, vec2<i32>(0), vec2<i32>(view.size) - 1);
}

// Brightness, orange and green: neighbours differ in the first most.
fn ycocg(c: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot(c, vec3<f32>(0.25, 0.5, 0.25)), 0.5 * (c.r - c.b), dot(c, vec3<f32>(-0.25, 0.5, -0.25)));
}

fn rgb(c: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(c.x + c.y - c.z, c.x + c.z, c.x - c.y - c.z);
}

fn fresh(p: vec2<i32>) -> vec3<f32> {
    let at = index_of(p);
    return (light[at][0].rgb + light[at][1].rgb) * coats[at].albedo + coats[at].emission;
}

// Weights of four pixels about a point, `f` behind the second: Catmull and Rom's.
fn cubic(f: f32) -> vec4<f32> {
    let f2 = f * f;
    let f3 = f2 * f;
    return 0.5 * vec4<f32>(2.0 * f2 - f - f3, 2.0 - 5.0 * f2 + 3.0 * f3, f + 4.0 * f2 - 3.0 * f3, f3 - f2);
}

fn old(at: vec2<f32>) -> vec3<f32> {
    let corner = floor(at);
    let across = cubic(at.x - corner.x);
    let down = cubic(at.y - corner.y);
    var sum = vec3<f32>(0.0);
    for (var y = 0; y < 4; y++) {
        for (var x = 0; x < 4; x++) {
            let there = inside(vec2<i32>(corner) + vec2<i32>(x, y) - 1);
            sum += across[x] * down[y] * picture_before[index_of(there)].rgb;
        }
    }
    return max(sum, vec3<f32>(0.0));
}

@compute @workgroup_size(64)
fn resolve(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let pixel = id.x + id.y * groups.x * 64u;
    if (pixel >= view.size.x * view.size.y) {
        return;
    }
    let p = place_of(pixel);
    let now = fresh(p);
    var mean = vec3<f32>(0.0);
    var mean_square = vec3<f32>(0.0);
    var nearest = 0.0;
    var nearest_at = p;
    for (var y = -1; y <= 1; y++) {
        for (var x = -1; x <= 1; x++) {
            let q = inside(p + vec2<i32>(x, y));
            let color = ycocg(fresh(q));
            mean += color / 9.0;
            mean_square += color * color / 9.0;
            if (guides[index_of(q)].inverse_depth > nearest) {
                nearest = guides[index_of(q)].inverse_depth;
                nearest_at = q;
            }
        }
    }
    let before = guides[index_of(nearest_at)].before + vec2<f32>(p - nearest_at);
    let was_seen = all(before > vec2<f32>(-0.5)) && all(before < vec2<f32>(view.size) - 0.5);
    if (view.age == 0u || !was_seen) {
        picture[pixel] = vec4<f32>(now, 1.0);
        return;
    }
    let spread = SPREAD * sqrt(max(mean_square - mean * mean, vec3<f32>(0.0)));
    let confined = rgb(clamp(ycocg(old(before)), mean - spread, mean + spread));
    let share = max(SHARE, 1.0 / f32(view.age + 1u));
    picture[pixel] = vec4<f32>(max(mix(confined, now, share), vec3<f32>(0.0)), 1.0);
}
