// How well each slot is known, as it is seen.
// One thread per slot; reads what its texels remember and what is shown of them,
// writes `qualities`.

struct Quality {
    // Mean over the slot of the standard error relative to the tone curve's scale.
    noise: f32,
    // Samples of a texel's diffuse light: their harmonic mean.
    samples: f32,
}

@group(2) @binding(4) var<storage, read_write> qualities: array<Quality>;

// Texels looked at per slot and axis.
const NOISE_SIDE: u32 = 8u;
// Samples that a texel counts as at least.
const LEAST_SAMPLES: f32 = 0.01;

@compute @workgroup_size(64)
fn measure_noise(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= parameters.slot_count) {
        return;
    }
    let here = laid(slots[id.x]);
    let size = here.size;
    let step = max(size / NOISE_SIDE, vec2<u32>(1u));
    var sum = 0.0;
    var of_samples = 0.0;
    var count = 0.0;
    for (var y = 0u; y < size.y; y += step.y) {
        for (var x = 0u; x < size.x; x += step.x) {
            if (HAS_GAPS && !owns(here, vec2<i32>(vec2<u32>(x, y)))) {
                continue;
            }
            let at = index_of_texel(here, vec2<u32>(x, y));
            let mean = vec2<f32>(luminance(diffuse[at].rgb), luminance(glossy[at].rgb));
            let samples = max(vec2<f32>(diffuse[at].w, glossy[at].w), vec2<f32>(1.0));
            let error = sqrt(max(moments[at].yz - mean * mean, vec2<f32>(0.0)) / samples);
            // What is shown of the diffuse light tells the colour that it falls on.
            let seen = luminance(shown[at].rgb);
            let color = min(seen / max(mean.x + mean.y, 1e-6), 1.0);
            sum += parameters.exposure * (error.x * color + error.y) / (parameters.exposure * seen + 0.2);
            of_samples += 1.0 / max(diffuse[at].w, LEAST_SAMPLES);
            count += 1.0;
        }
    }
    // A slot without a texel of its own lacks nothing.
    qualities[id.x] = Quality(sum / max(count, 1.0), select(1e6, count / of_samples, count > 0.0));
}
