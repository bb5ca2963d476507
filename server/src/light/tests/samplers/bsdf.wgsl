// `sample_bsdf` and `evaluate_bsdf`, counted and summed in cells of directions.
//
// A direction's cell is that of its half vector: a ring about the shading normal
// and a sector of it. There a lobe is smooth at any roughness and any view.

struct Probe {
    wo: vec3<f32>,
    roughness: f32,
    wi: vec3<f32>,
    metallic: f32,
    ns: vec3<f32>,
    f0: f32,
    ng: vec3<f32>,
    spare: f32,
    base: vec3<f32>,
    spare_too: f32,
}

struct Value {
    specular: vec3<f32>,
    diffuse: f32,
    pdf: f32,
    share: f32,
    alpha: f32,
    spare: f32,
}

@group(2) @binding(0) var<storage, read> probes: array<Probe>;
@group(2) @binding(1) var<storage, read_write> values: array<Value>;
@group(2) @binding(1) var<storage, read_write> cells: array<u32>;
@group(2) @binding(1) var<storage, read_write> integrals: array<vec4<f32>>;

const RINGS: u32 = 24u;
const SECTORS: u32 = 32u;
// Points along either side of a cell at which it is integrated.
const FINENESS: u32 = 32u;

fn surface_of(probe: Probe) -> Surface {
    var s: Surface;
    s.ng = probe.ng;
    s.ns = probe.ns;
    s.base = probe.base;
    s.metallic = probe.metallic;
    s.alpha = max(probe.roughness * probe.roughness, MIN_ALPHA);
    s.f0 = probe.f0;
    return s;
}

@compute @workgroup_size(64)
fn evaluate(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = thread_of(id, groups);
    if (thread >= arrayLength(&values)) {
        return;
    }
    let probe = probes[thread];
    let s = surface_of(probe);
    let value = evaluate_bsdf(s, probe.wo, probe.wi);
    values[thread] = Value(value.specular, value.diffuse, value.pdf,
        specular_share(s, dot(s.ns, probe.wo)), s.alpha, 0.0);
}

// From 0 to 1 as the half vector sinks by `drop`, one less its cosine, from the
// normal to the horizon: the mean of the share of GGX's normals and of the share
// of solid angle that lie above it.
fn ring_of(drop: f32, alpha: f32) -> f32 {
    let sine_squared = drop * (2.0 - drop);
    let stretched = alpha * (1.0 - drop);
    return 0.5 * (sine_squared / (sine_squared + stretched * stretched) + drop);
}

// The inverse, by halving until what is left is small against the narrowest lobe's alpha².
fn drop_at(ring: f32, alpha: f32) -> f32 {
    var low = 0.0;
    var high = 1.0;
    for (var i = 0u; i < 40u; i++) {
        let middle = 0.5 * (low + high);
        let is_above = ring_of(middle, alpha) < ring;
        low = select(low, middle, is_above);
        high = select(middle, high, is_above);
    }
    return high;
}

// Density, diffuse and specular lobe over one cell; the specular one is the red one.
@compute @workgroup_size(64)
fn integrate(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = thread_of(id, groups);
    if (thread >= arrayLength(&integrals)) {
        return;
    }
    let probe = probes[thread / (RINGS * SECTORS)];
    let s = surface_of(probe);
    let f = frame_around(s.ns);
    let ring = f32(thread / SECTORS % RINGS);
    let sector = f32(thread % SECTORS);
    var sum = vec3<f32>(0.0);
    var above = drop_at(ring / f32(RINGS), s.alpha);
    for (var i = 1u; i <= FINENESS; i++) {
        let below = drop_at((ring + f32(i) / f32(FINENESS)) / f32(RINGS), s.alpha);
        // A mean with which a lobe, near 1 / (drop + half)², is integrated exactly.
        let half = 0.5 * s.alpha * s.alpha;
        let drop = sqrt((above + half) * (below + half)) - half;
        let sine = sqrt(max(drop * (2.0 - drop), 0.0));
        for (var j = 0u; j < FINENESS; j++) {
            let phi = 2.0 * PI * (sector + (f32(j) + 0.5) / f32(FINENESS)) / f32(SECTORS);
            let h = to_world(f, vec3<f32>(sine * cos(phi), sine * sin(phi), 1.0 - drop));
            let value = evaluate_bsdf(s, probe.wo, reflect(-probe.wo, h));
            // A solid angle of half vectors is 4 wo·h of directions.
            let solid_angle = (below - above) * 4.0 * max(dot(probe.wo, h), 0.0);
            sum += vec3<f32>(value.pdf, value.diffuse, value.specular.r) * solid_angle;
        }
        above = below;
    }
    integrals[thread] = vec4<f32>(sum * (2.0 * PI / f32(SECTORS * FINENESS)), 0.0);
}

// The cell of a sample; behind the last one what leaves through the surface.
@compute @workgroup_size(64)
fn sample(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = thread_of(id, groups);
    if (thread >= arrayLength(&cells)) {
        return;
    }
    let probe = probes[thread / (arrayLength(&cells) / arrayLength(&probes))];
    let s = surface_of(probe);
    var rng = sampler_of(thread);
    let u = sample_2d(&rng);
    let wi = sample_bsdf(s, probe.wo, u, sample_2d(&rng).x);
    cells[thread] = RINGS * SECTORS;
    if (any(wi != vec3<f32>(0.0))) {
        let h = to_local(frame_around(s.ns), normalize(probe.wo + wi));
        let drop = dot(h.xy, h.xy) / (1.0 + h.z);
        let turn = atan2(h.y, h.x) / (2.0 * PI);
        let ring = min(u32(ring_of(drop, s.alpha) * f32(RINGS)), RINGS - 1u);
        let sector = min(u32((turn - floor(turn)) * f32(SECTORS)), SECTORS - 1u);
        cells[thread] = ring * SECTORS + sector;
    }
}
