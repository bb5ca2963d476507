// What the kernels of screen-space filtering hand each other. One record a pixel.

struct View {
    world_from_eye: mat3x4<f32>,
    // Of the frame before, as are its tangents.
    eye_from_world_before: mat3x4<f32>,
    // Tangents of left, right, up and down.
    tangents: vec4<f32>,
    tangents_before: vec4<f32>,
    size: vec2<u32>,
    // Where in its pixel every primary ray of the frame is, 0 to 1.
    jitter: vec2<f32>,
    // Of the frame's first sample.
    sample_index: u32,
    seed: u32,
    // Paths a pixel.
    samples: u32,
    // Frames that were seen before this one and are remembered.
    age: u32,
}

// What the primary ray met, in the space of the object that it belongs to, where
// it stays put however the object moves.
struct Seen {
    // A direction in the world where nothing was met.
    position: vec3<f32>,
    // NONE where nothing was met.
    instance: u32,
    // Geometric, on the side that is looked at.
    normal: vec3<f32>,
    padding: f32,
}

// What guides the filters through this frame.
struct Guide {
    // Shading normal in the world; zero where nothing was met.
    normal: vec3<f32>,
    // One over the distance along the optical axis, which is linear on the screen
    // over a plane; zero where nothing was met.
    inverse_depth: f32,
    // Its change from pixel to pixel over the plane that was met.
    slope: vec2<f32>,
    // The pixel of the frame before in which the same point was seen.
    before: vec2<f32>,
}

// What lies between light and picture.
struct Coat {
    // What light is divided by while it is filtered.
    albedo: vec3<f32>,
    diffuse: vec3<f32>,
    emission: vec3<f32>,
}

// Light over albedo: direct, then indirect. The last component is the variance
// of its luminance.
alias Light = array<vec4<f32>, 2>;

// Means of the luminance of direct and of indirect light, and of its square.
struct Moments {
    first: vec2<f32>,
    second: vec2<f32>,
    // Frames behind them.
    length: f32,
}

@group(2) @binding(0) var<uniform> view: View;

fn is_inside(p: vec2<i32>) -> bool {
    return all(p >= vec2<i32>(0)) && all(p < vec2<i32>(view.size));
}

fn index_of(p: vec2<i32>) -> u32 {
    return u32(p.y) * view.size.x + u32(p.x);
}

fn place_of(pixel: u32) -> vec2<i32> {
    return vec2<i32>(vec2<u32>(pixel % view.size.x, pixel / view.size.x));
}

// Width of a pixel per metre of distance along the optical axis.
fn pixel_cone() -> f32 {
    return (view.tangents.y - view.tangents.x) / f32(view.size.x);
}
