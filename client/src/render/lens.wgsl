// Bends each eye's picture against its lens, one colour at a time.
//
// A pixel at distance r from the lens' axis shows what the undistorted picture has
// at r (1 + k0 r^2 + k1 r^4); outside of that picture it is black.
// Source: SAS 2018, section 3.6.

struct Lens {
    // Sides of what is shown and of the undistorted picture, from the axis: left,
    // right, up, down.
    display: vec4f,
    picture: vec4f,
    red: vec2f,
    green: vec2f,
    blue: vec2f,
}

var<immediate> lens: Lens;

@group(0) @binding(0) var eye: texture_2d<f32>;
@group(0) @binding(1) var bilinear: sampler;

struct Point {
    @builtin(position) clip: vec4f,
    @location(0) ndc: vec2f,
}

@vertex
fn cover(@builtin(vertex_index) vertex: u32) -> Point {
    let ndc = vec2f(f32(vertex & 1u), f32(vertex >> 1u)) * 4.0 - 1.0;
    return Point(vec4f(ndc, 0.0, 1.0), ndc);
}

fn bent(from_axis: vec2f, k: vec2f) -> vec4f {
    let r2 = dot(from_axis, from_axis);
    let seen = from_axis * (1.0 + r2 * (k.x + r2 * k.y));
    let upper_left = lens.picture.xz;
    let uv = (seen - upper_left) / (lens.picture.yw - upper_left);
    let inside = all(uv >= vec2f(0.0)) && all(uv <= vec2f(1.0));
    return select(vec4f(0.0), textureSampleLevel(eye, bilinear, uv, 0.0), inside);
}

@fragment
fn prewarp(point: Point) -> @location(0) vec4f {
    let from_axis = mix(lens.display.xw, lens.display.yz, point.ndc * 0.5 + 0.5);
    return vec4f(
        bent(from_axis, lens.red).r,
        bent(from_axis, lens.green).g,
        bent(from_axis, lens.blue).b,
        1.0,
    );
}
