// Triangles of all placed patches, coloured from the atlas.
//
// Reads the matrices of both eyes as immediates. Objects that move and masks
// are bound only for the entry points that name them. Joined with sky.wgsl and
// with two_pass.wgsl or multiview.wgsl, which say which eye it is.
// Source: SAS 2018, section 3.6; SnakeBinning 2021, section 3.9.

// Whether texel coordinates are homogeneous: else their last is 1 everywhere.
override FORESHORTENED: bool = true;

struct Eyes {
    // Clip space from world for patches, world ray from NDC for the sky.
    matrix: array<mat4x4f, 2>,
}

var<immediate> eyes: Eyes;

@group(0) @binding(0) var atlas: texture_2d<f32>;
@group(0) @binding(1) var bilinear: sampler;
@group(1) @binding(0) var<storage, read> world_from_object: array<mat4x4f>;
@group(2) @binding(0) var mask: texture_2d<f32>;

struct Corner {
    @location(0) position: vec3f,
    @location(1) object: u32,
    @location(2) texel: vec3f,
}

struct Point {
    @builtin(position) clip: vec4f,
    @location(0) uv: vec3f,
}

fn uv_of(texel: vec3f) -> vec3f {
    return vec3f(texel.xy / vec2f(textureDimensions(atlas)), texel.z);
}

// Texels lie at least half a texel inside their block, and triangles own all texels
// about them, so that a bilinear lookup never reaches the neighbour.
fn still(eye: u32, corner: Corner) -> Point {
    let clip = eyes.matrix[eye] * vec4f(corner.position, 1.0);
    return Point(clip, uv_of(corner.texel));
}

fn moving(eye: u32, corner: Corner) -> Point {
    let world = world_from_object[corner.object] * vec4f(corner.position, 1.0);
    let clip = eyes.matrix[eye] * world;
    return Point(clip, uv_of(corner.texel));
}

fn looked_up(point: Point) -> vec2f {
    if FORESHORTENED {
        return point.uv.xy / point.uv.z;
    }
    return point.uv.xy;
}

@fragment
fn opaque(point: Point) -> @location(0) vec4f {
    return vec4f(textureSampleLevel(atlas, bilinear, looked_up(point), 0.0).rgb, 1.0);
}

@fragment
fn masked(point: Point) -> @location(0) vec4f {
    let uv = looked_up(point);
    if textureSampleLevel(mask, bilinear, uv, 0.0).r < 0.5 {
        discard;
    }
    return vec4f(textureSampleLevel(atlas, bilinear, uv, 0.0).rgb, 1.0);
}
