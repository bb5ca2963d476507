// What each visible triangle deserves, seen from an eye by a camera of its own.
// One thread per patch. Reads the turns of `slots`, writes `wishes`.
// Twin: footprint.rs. Source: SnakeBinning 2021, section 3.1.

struct SnakeFootprintParameters {
    patch_count: u32,
    pixels_per_radian: f32,
    padding: vec2<u32>,
}

@group(1) @binding(0) var<uniform> footprints: SnakeFootprintParameters;
@group(1) @binding(1) var<storage, read> pixels_of_patch: array<u32>;
// First triangle; object << 8.
@group(1) @binding(2) var<storage, read> patches: array<vec2<u32>>;
// The eye in the space of each object, the world's first.
@group(1) @binding(3) var<storage, read> eyes: array<vec4<f32>>;
// Shape or NONE, index | age << 24.
@group(1) @binding(4) var<storage, read> slots: array<vec2<u32>>;
// log2 length | log2 height << 16; tip | turn << 12 | depths << 15.
@group(1) @binding(5) var<storage, read_write> wishes: array<vec2<u32>>;

const NO_TURN: u32 = 7u;
const STEADY: f32 = 1.12;

fn finite(x: f32) -> f32 {
    let is_number = (bitcast<u32>(x) & 0x7fffffffu) <= 0x7f800000u;
    return select(0.0, clamp(x, -1e9, 1e9), is_number);
}

fn is_finite(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

fn is_direction(v: vec3<f32>) -> bool {
    let squared = dot(v, v);
    return squared > 1e-38 && squared < 3e38;
}

fn log_steps(pixels: f32) -> u32 {
    return u32(clamp(round(log2(max(pixels, 0.06)) * 256.0) + 1024.0, 0.0, 4096.0));
}

fn depth_steps(ratio: f32) -> u32 {
    return u32(clamp(round(finite(log2(ratio)) * 8.0), 0.0, 31.0));
}

@compute @workgroup_size(64)
fn measure_snake_footprints(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = id.x + id.y * groups.x * 64u;
    if (index >= footprints.patch_count || pixels_of_patch[index] == 0u) {
        return;
    }
    let first = patches[index].x;
    let eye = eyes[patches[index].y >> 8u].xyz;
    let slot = slots[index].x;
    let turn = select((slot >> 12u) & 7u, NO_TURN, slot == NONE);
    var to = array<vec3<f32>, 3>();
    for (var i = 0u; i < 3u; i++) {
        to[i] = vertex_position(first, i) - eye;
    }
    var ahead = (to[0] + to[1] + to[2]) / 3.0;
    if (!is_direction(ahead)) {
        ahead = cross(to[1] - to[0], to[2] - to[0]);
    }
    ahead = select(vec3<f32>(0.0, 0.0, 1.0), normalize(ahead), is_direction(ahead));
    let right = normalize(cross(ahead, select(vec3<f32>(0.0, 1.0, 0.0), vec3<f32>(1.0, 0.0, 0.0), abs(ahead.x) < 0.7)));
    let up = cross(right, ahead);
    var back = 0.0;
    for (var i = 0u; i < 3u; i++) {
        back = max(back, length(vec2<f32>(dot(to[i], right), dot(to[i], up))) - dot(to[i], ahead));
    }
    var depths = vec3<f32>(0.0);
    var seen = array<vec2<f32>, 3>();
    for (var i = 0u; i < 3u; i++) {
        depths[i] = max(dot(to[i], ahead) + back, 1e-20);
        seen[i] = vec2<f32>(dot(to[i], right), dot(to[i], up)) * (footprints.pixels_per_radian / depths[i]);
    }
    // The sum is finite where all are, and no triangle is so large that it is not.
    let all_of_it = abs(seen[0]) + abs(seen[1]) + abs(seen[2]) + depths.xy + depths.z;
    if (!is_finite(all_of_it.x) || !is_finite(all_of_it.y)) {
        seen = array<vec2<f32>, 3>();
        depths = vec3<f32>(1.0);
    }
    let lengths = vec3<f32>(finite(length(seen[1] - seen[2])), finite(length(seen[2] - seen[0])), finite(length(seen[0] - seen[1])));
    var tip = select(0u, 1u, lengths.y > lengths.x);
    tip = select(tip, 2u, lengths.z > lengths[tip]);
    let kept = min(turn / 2u, 2u);
    if (turn < 6u && lengths[kept] * STEADY >= lengths[tip]) {
        tip = kept;
    }
    let start = seen[(tip + 1u) % 3u];
    let base = seen[(tip + 2u) % 3u] - start;
    let to_tip = seen[tip] - start;
    let unit = max(lengths[tip], 1e-20);
    let height = finite(abs(base.x * to_tip.y - base.y * to_tip.x) / unit);
    var foot = finite(dot(base, to_tip) / unit / unit);
    var before = foot > 0.5;
    if (turn < 6u && tip == kept) {
        let was_before = (turn & 1u) == 1u;
        before = was_before != (select(foot, 1.0 - foot, was_before) > 0.5 * STEADY);
    }
    foot = select(foot, 1.0 - foot, before);
    let least = min(depths.x, min(depths.y, depths.z));
    let form = depth_steps(depths.x / least) | (depth_steps(depths.y / least) << 5u) | (depth_steps(depths.z / least) << 10u);
    wishes[index] = vec2<u32>(log_steps(lengths[tip]) | (log_steps(height) << 16u),
        u32(clamp(round(foot * 512.0), 0.0, 255.0)) | ((2u * tip + u32(before)) << 12u) | (form << 15u));
}
