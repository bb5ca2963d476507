// A latitude-longitude picture wherever no triangle is: drawn last, at depth
// zero, which only the cleared depth lets through.

@group(0) @binding(2) var sky_picture: texture_2d<f32>;
@group(0) @binding(3) var sky_sampler: sampler;

const PI = 3.14159265358979;

struct Ray {
    @builtin(position) clip: vec4f,
    @location(0) world: vec3f,
}

// One triangle that covers the screen.
fn sky_corner(eye: u32, vertex: u32) -> Ray {
    let ndc = vec2f(f32(vertex & 1u), f32(vertex >> 1u)) * 4.0 - 1.0;
    return Ray(vec4f(ndc, 0.0, 1.0), (eyes.matrix[eye] * vec4f(ndc, 1.0, 0.0)).xyz);
}

// The middle column looks along -Z, columns run towards +X, row 0 is the zenith.
@fragment
fn sky(ray: Ray) -> @location(0) vec4f {
    let direction = normalize(ray.world);
    let u = 0.5 + atan2(direction.x, -direction.z) / (2.0 * PI);
    let v = acos(clamp(direction.y, -1.0, 1.0)) / PI;
    return vec4f(textureSampleLevel(sky_picture, sky_sampler, vec2f(u, v), 0.0).rgb, 1.0);
}
