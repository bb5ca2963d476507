// The scene as every light kernel reads it, and what is found at a point of it.
// Host structs: scene.rs. Filled by server/src/gpu_scene.rs.

const NONE: u32 = 0xffffffffu;
const PI: f32 = 3.14159265358979;

// One dispatch's worth of paths.
struct Wave {
    path_count: u32,
    // Index of the wave's first job.
    first_job: u32,
    // 1 where rays onwards do not see single-sided triangles from behind.
    cull: u32,
    // Times that the wave's rays were traced before.
    step: u32,
}

// What the loaded scene uses; what it does not use is compiled away.
override HAS_SUN: bool = true;
override HAS_LIGHTS: bool = true;
override HAS_SKY: bool = true;
override HAS_ENVIRONMENT: bool = true;
override HAS_MASKS: bool = true;
override HAS_TEXTURES: bool = true;
override HAS_NORMAL_MAPS: bool = true;
override HAS_MOVERS: bool = true;
// Lobes too narrow for samples of lamps to fall into, and lamps that rays may meet.
override HAS_NARROW_LOBES: bool = true;

// What can be switched off to measure what it is worth.
override LIGHT_SELECTION: bool = true;
override MULTIPLE_IMPORTANCE: bool = true;
override LOW_DISCREPANCY: bool = true;
override SMOOTHING: bool = true;

struct Globals {
    sky_zenith: vec3<f32>,
    light_count: u32,
    sky_horizon: vec3<f32>,
    // Of those, how many are no triangles; the others ascend by triangle.
    punctual_count: u32,
    sky_ground: vec3<f32>,
    instance_count: u32,
    // Unit vector towards the sun and the cosine of its half angle.
    sun_direction: vec3<f32>,
    sun_cos: f32,
    sun_irradiance: vec3<f32>,
    bounces: u32,
    // Luminance of a contribution too faint to always be worth a shadow ray.
    faint: f32,
    // Side in pixels of a cell of the picture of all directions.
    environment_cell: u32,
    // Of that picture, pixels; zero where the sky is no picture.
    environment_size: vec2<u32>,
}

// Four of the slots of a glTF material: base colour, metallic-roughness, normal, emissive.
struct TextureRecord {
    offset: u32,
    size: u32,
    flags: u32,
    levels: u32,
    matrix: vec4<f32>,
    translation: vec2<f32>,
    padding: vec2<f32>,
}

struct Material {
    base_color: vec4<f32>,
    emissive: vec3<f32>,
    metallic: f32,
    roughness: f32,
    normal_scale: f32,
    // Negative where all of the surface is there, BLENDED where each ray finds
    // as much of it there as alpha says.
    alpha_cutoff: f32,
    // Reflectance of the dielectric at normal incidence.
    f0: f32,
    double_sided: u32,
    spare: f32,
    padding: vec2<f32>,
    textures: array<TextureRecord, 4>,
}

const BLENDED: f32 = 3.0e38;

// A triangle's last word: its material, and above it what it moves with.
const MATERIAL_MASK: u32 = 0xfffffu;
const OBJECT_SHIFT: u32 = 20u;

// kind 0: emissive triangle, 1: point, 2: spot, 3: directional.
struct LightRecord {
    kind: u32,
    triangle: u32,
    instance: u32,
    // Bit n says which child of the node at depth n leads to it.
    trail: u32,
    position: vec3<f32>,
    padding: u32,
    intensity: vec3<f32>,
    range: f32,
    direction: vec3<f32>,
    cos_outer: f32,
    cos_inner: f32,
    area: f32,
    spare: vec2<f32>,
}

// A node of the tree over the lamps: a sphere and a cone of directions about them.
struct LightNode {
    centre: vec3<f32>,
    // Negative where they are infinitely far.
    radius: f32,
    axis: vec3<f32>,
    cos_spread: f32,
    power: f32,
    // The first of two, or LIGHT_LEAF and the light.
    child: u32,
    padding: vec2<u32>,
}

struct Instance {
    world_from_object: mat3x4<f32>,
    object_from_world: mat3x4<f32>,
    root_node: u32,
    first_triangle: u32,
    padding: vec2<u32>,
}

@group(1) @binding(3) var<uniform> wave: Wave;
@group(0) @binding(0) var<uniform> globals: Globals;
@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> bvh_triangles: array<vec4<f32>>;
// Three corner indices, then material and object.
@group(0) @binding(3) var<storage, read> triangles: array<vec4<u32>>;
// Three rows a corner: normal and packed colour, tangent, both texture coordinates.
@group(0) @binding(4) var<storage, read> corners: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> materials: array<Material>;
@group(0) @binding(6) var<storage, read> texels: array<u32>;
@group(0) @binding(7) var<storage, read> lights: array<LightRecord>;
@group(0) @binding(8) var<storage, read> instances: array<Instance>;
// Three floats a vertex and three vertices a triangle.
@group(0) @binding(9) var<storage, read> positions: array<f32>;
@group(0) @binding(10) var<storage, read> vertices: array<u32>;
@group(0) @binding(11) var<storage, read> light_nodes: array<LightNode>;

fn transform_point(m: mat3x4<f32>, p: vec3<f32>) -> vec3<f32> {
    return vec4<f32>(p, 1.0) * m;
}

fn transform_vector(m: mat3x4<f32>, v: vec3<f32>) -> vec3<f32> {
    return vec4<f32>(v, 0.0) * m;
}

fn vertex_position(triangle: u32, corner: u32) -> vec3<f32> {
    let i = vertices[triangle * 3u + corner] * 3u;
    return vec3<f32>(positions[i], positions[i + 1u], positions[i + 2u]);
}

fn hash(x_in: u32) -> u32 {
    var x = x_in;
    x ^= x >> 16u;
    x *= 0x21f0aaadu;
    x ^= x >> 15u;
    x *= 0xd35a2d97u;
    x ^= x >> 15u;
    return x;
}

fn luminance(c: vec3<f32>) -> f32 {
    return dot(c, vec3<f32>(0.2126, 0.7152, 0.0722));
}

// Repeats where the mode is 0, mirrors where it is 1, clamps elsewhere. Divides
// in floats, which software drivers have vectors of: exact, as the half keeps the
// quotient off whole numbers.
fn wrap(i: i32, size: i32, mode: u32) -> i32 {
    let period = select(size, 2 * size, mode == 1u);
    let j = i - i32(floor((f32(i) + 0.5) / f32(period))) * period;
    let repeated = select(j, period - 1 - j, j >= size);
    return select(repeated, clamp(i, 0, size - 1), mode > 1u);
}

fn fetch(record: TextureRecord, base: u32, size: vec2<i32>, at: vec2<i32>) -> vec4<f32> {
    let x = wrap(at.x, size.x, record.flags & 3u);
    let y = wrap(at.y, size.y, (record.flags >> 2u) & 3u);
    let raw = unpack4x8unorm(texels[base + u32(y * size.x + x)]);
    // Colours are stored as square roots: as even to the eye as sRGB, and cheap.
    return vec4<f32>(select(raw.rgb, raw.rgb * raw.rgb, (record.flags & 64u) != 0u), raw.a);
}

// `footprint` is the width of the sample as a fraction of the texture.
fn texture_at(record: TextureRecord, uv0: vec2<f32>, uv1: vec2<f32>, footprint: f32) -> vec4<f32> {
    let source = select(uv0, uv1, (record.flags & 32u) != 0u);
    let uv = record.matrix.xy * source.x + record.matrix.zw * source.y + record.translation;
    var size = vec2<i32>(vec2<u32>(record.size & 0xffffu, record.size >> 16u));
    let stretch = sqrt(abs(record.matrix.x * record.matrix.w - record.matrix.y * record.matrix.z));
    let width = footprint * stretch * sqrt(f32(size.x) * f32(size.y));
    let level = u32(clamp(log2(max(width, 1e-6)) + 0.5, 0.0, f32(record.levels - 1u)));
    var base = record.offset;
    for (var l = 0u; l < level; l++) {
        base += u32(size.x * size.y);
        size = max(size / 2, vec2<i32>(1));
    }
    // Wrapping before scaling keeps huge coordinates exact enough to index.
    let p = select(uv - floor(uv * 0.5) * 2.0, uv, abs(uv) < vec2<f32>(2.0)) * vec2<f32>(size);
    if ((record.flags & 16u) == 0u) {
        return fetch(record, base, size, vec2<i32>(floor(p)));
    }
    let q = p - 0.5;
    let i = vec2<i32>(floor(q));
    let f = q - floor(q);
    let a = fetch(record, base, size, i);
    let b = fetch(record, base, size, i + vec2<i32>(1, 0));
    let c = fetch(record, base, size, i + vec2<i32>(0, 1));
    let d = fetch(record, base, size, i + vec2<i32>(1, 1));
    return mix(mix(a, b, f.x), mix(c, d, f.x), f.y);
}

// What light meets at a point.
struct Surface {
    position: vec3<f32>,
    // Beyond the rounding of the position, metres.
    margin: f32,
    // Geometric and shading normal, both on the side that is looked at.
    ng: vec3<f32>,
    ns: vec3<f32>,
    base: vec3<f32>,
    emissive: vec3<f32>,
    metallic: f32,
    // Roughness squared, kept above zero.
    alpha: f32,
    f0: f32,
}

// Relative rounding of single precision. A point on a triangle is off by about one
// of its coordinates' and one of the triangle's size; where a ray meets the plane,
// by a few of the latter.
const ROUNDING: f32 = 1.1920929e-7;
// Smallest GGX alpha: below it the lobe's peak leaves the range in which f32 keeps its shape.
const MIN_ALPHA: f32 = 0.001;

// A shading normal that faces away from the viewer, bent until it does not.
fn facing(n: vec3<f32>, wo: vec3<f32>) -> vec3<f32> {
    let cos_o = dot(n, wo);
    return normalize(n + wo * max(0.01 - cos_o, 0.0));
}

// `b` are the barycentric weights of corners 1 and 2; `width` is the sample's
// width in metres.
fn surface_at(triangle: u32, b: vec2<f32>, wo: vec3<f32>, width: f32) -> Surface {
    let record = triangles[triangle];
    let instance = record.w >> OBJECT_SHIFT;
    let material = materials[record.w & MATERIAL_MASK];
    let p0 = vertex_position(triangle, 0u);
    let e1 = vertex_position(triangle, 1u) - p0;
    let e2 = vertex_position(triangle, 2u) - p0;
    let w = vec3<f32>(1.0 - b.x - b.y, b.x, b.y);
    let i0 = record.x * 3u;
    let i1 = record.y * 3u;
    let i2 = record.z * 3u;
    let n0 = corners[i0];
    let n1 = corners[i1];
    let n2 = corners[i2];

    var s: Surface;
    s.position = p0 + e1 * b.x + e2 * b.y;
    let doubled = cross(e1, e2);
    var ng = normalize(doubled);
    var ns = n0.xyz * w.x + n1.xyz * w.y + n2.xyz * w.z;
    var color = material.base_color * (unpack4x8unorm(bitcast<u32>(n0.w)) * w.x
        + unpack4x8unorm(bitcast<u32>(n1.w)) * w.y + unpack4x8unorm(bitcast<u32>(n2.w)) * w.z);
    s.metallic = material.metallic;
    var roughness = material.roughness;
    s.emissive = material.emissive;

    if (HAS_TEXTURES) {
        let t0 = corners[i0 + 2u];
        let t1 = corners[i1 + 2u];
        let t2 = corners[i2 + 2u];
        let uv = t0 * w.x + t1 * w.y + t2 * w.z;
        let d1 = t1.xy - t0.xy;
        let d2 = t2.xy - t0.xy;
        let footprint = width * sqrt(abs(d1.x * d2.y - d1.y * d2.x) / max(length(doubled), 1e-20));
        if (material.textures[0].offset != NONE) {
            color *= texture_at(material.textures[0], uv.xy, uv.zw, footprint);
        }
        if (material.textures[1].offset != NONE) {
            let mr = texture_at(material.textures[1], uv.xy, uv.zw, footprint);
            roughness *= mr.g;
            s.metallic *= mr.b;
        }
        if (material.textures[3].offset != NONE) {
            s.emissive *= texture_at(material.textures[3], uv.xy, uv.zw, footprint).rgb;
        }
        if (HAS_NORMAL_MAPS && material.textures[2].offset != NONE) {
            let tangent = corners[i0 + 1u] * w.x + corners[i1 + 1u] * w.y + corners[i2 + 1u] * w.z;
            let m = texture_at(material.textures[2], uv.xy, uv.zw, footprint).rgb * 2.0 - 1.0;
            let bitangent = cross(ns, tangent.xyz) * sign(corners[i0 + 1u].w);
            ns = tangent.xyz * m.x * material.normal_scale + bitangent * m.y * material.normal_scale + ns * m.z;
        }
    }
    if (HAS_MOVERS && instance != 0u) {
        let m = instances[instance].world_from_object;
        s.position = transform_point(m, s.position);
        ng = transform_vector(m, ng);
        ns = transform_vector(m, ns);
    }
    let reach = max(abs(e1), abs(e2));
    let coordinates = abs(s.position);
    s.margin = ROUNDING * (8.0 * max(max(reach.x, reach.y), reach.z)
        + 2.0 * max(max(coordinates.x, coordinates.y), coordinates.z));
    let length_ns = length(ns);
    ns = select(ng, ns / length_ns, length_ns > 1e-12);
    let front = dot(wo, ng) >= 0.0;
    if (!front) {
        ng = -ng;
        ns = -ns;
        if (material.double_sided == 0u) {
            s.emissive = vec3<f32>(0.0);
        }
    }
    s.ng = ng;
    s.ns = facing(ns, wo);
    s.base = color.rgb;
    let alpha = clamp(roughness, 0.0, 1.0);
    s.alpha = max(alpha * alpha, MIN_ALPHA);
    s.metallic = clamp(s.metallic, 0.0, 1.0);
    s.f0 = material.f0;
    return s;
}

// A ray origin that does not meet its own triangle, whatever the scale of the scene:
// what rounding may move the point or the triangle's plane by grows with the
// coordinates and with the triangle.
fn offset_origin(s: Surface) -> vec3<f32> {
    return s.position + s.ng * s.margin;
}
