// Light from beyond the scene: a sky of three colours, or a picture of all
// directions. A picture is equirectangular: up is its first row, +X its middle
// column, +Z a quarter to the right of it.
//
// Directions are sampled by cells, squares of pixels, each found in constant time
// by what it sends (Walker's alias method), and uniformly within the cell.
// Host structs: environment.rs. Source: Pharr et al., "Physically Based
// Rendering", 4th edition, sections 12.5.2 and A.1.

struct EnvironmentCell {
    // Below it the cell that was drawn is taken, above it the other one.
    threshold: f32,
    otherwise: u32,
    // Probability by solid angle of its directions.
    density: f32,
    padding: u32,
}

// Three floats a pixel, row by row.
@group(0) @binding(12) var<storage, read> environment: array<f32>;
@group(0) @binding(13) var<storage, read> environment_cells: array<EnvironmentCell>;

fn has_picture() -> bool {
    return HAS_ENVIRONMENT && globals.environment_size.x != 0u;
}

// Twin: SkyModel::radiance.
fn gradient_radiance(d: vec3<f32>) -> vec3<f32> {
    if (d.y < 0.0) {
        return mix(globals.sky_horizon, globals.sky_ground, min(-d.y * 8.0, 1.0));
    }
    return mix(globals.sky_horizon, globals.sky_zenith, sqrt(d.y));
}

fn environment_pixel(x: i32, y: i32) -> vec3<f32> {
    let size = vec2<i32>(globals.environment_size);
    let column = select(select(x, x - size.x, x >= size.x), x + size.x, x < 0);
    let at = 3u * u32(clamp(y, 0, size.y - 1) * size.x + column);
    return vec3<f32>(environment[at], environment[at + 1u], environment[at + 2u]);
}

// From 0 to 1 along the picture's sides. Twin: EnvironmentMap::uv.
fn environment_uv(d: vec3<f32>) -> vec2<f32> {
    // Near the poles the arc tangent keeps the digits that an arc cosine loses.
    let across = length(d.xz);
    return vec2<f32>(clamp(atan2(d.z, d.x) / (2.0 * PI) + 0.5, 0.0, 0.99999994),
        clamp(atan2(across, d.y) / PI, 0.0, 0.99999994));
}

// Radiance from beyond the scene.
fn sky_radiance(d: vec3<f32>) -> vec3<f32> {
    if (!has_picture()) {
        return gradient_radiance(d);
    }
    let p = environment_uv(d) * vec2<f32>(globals.environment_size) - 0.5;
    let low = floor(p);
    let f = p - low;
    let i = vec2<i32>(low);
    return mix(
        mix(environment_pixel(i.x, i.y), environment_pixel(i.x + 1, i.y), f.x),
        mix(environment_pixel(i.x, i.y + 1), environment_pixel(i.x + 1, i.y + 1), f.x), f.y);
}

// Density with which `sample_environment` finds a direction; zero where there is no picture.
fn environment_density(d: vec3<f32>) -> f32 {
    if (!has_picture()) {
        return 0.0;
    }
    let pixel = vec2<u32>(environment_uv(d) * vec2<f32>(globals.environment_size));
    let columns = (globals.environment_size.x + globals.environment_cell - 1u) / globals.environment_cell;
    let cell = pixel / globals.environment_cell;
    return environment_cells[cell.y * columns + cell.x].density;
}

struct EnvironmentSample {
    direction: vec3<f32>,
    // By solid angle.
    density: f32,
}

fn sample_environment(u_cell: vec2<f32>, u: vec2<f32>) -> EnvironmentSample {
    let size = globals.environment_size;
    let side = globals.environment_cell;
    let cells = (size + side - 1u) / side;
    let count = cells.x * cells.y;
    let drawn = min(u32(u_cell.x * f32(count)), count - 1u);
    let found = select(environment_cells[drawn].otherwise, drawn, u_cell.y < environment_cells[drawn].threshold);
    let corner = vec2<u32>(found % cells.x, found / cells.x) * side;
    let low = vec2<f32>(corner) / vec2<f32>(size);
    let high = vec2<f32>(min(corner + side, size)) / vec2<f32>(size);
    let phi = 2.0 * PI * (mix(low.x, high.x, u.x) - 0.5);
    // Uniform in the cosine, written as 1 - 2 s so that the upper pole keeps its digits.
    let half = vec2<f32>(sin(0.5 * PI * low.y), sin(0.5 * PI * high.y));
    let s = mix(half.x * half.x, half.y * half.y, u.y);
    let across = 2.0 * sqrt(max(s * (1.0 - s), 0.0));
    return EnvironmentSample(vec3<f32>(cos(phi) * across, 1.0 - 2.0 * s, sin(phi) * across),
        environment_cells[found].density);
}
