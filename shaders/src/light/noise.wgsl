// How noisy each block just lit still is, as it will be seen.
// One thread per block; reads `radiance`, `crisp` and `surfaces`, writes `noise`: the
// mean over the block of the standard error relative to the tone curve's scale.

@group(2) @binding(4) var<storage, read_write> noise: array<f32>;

// Texels looked at per block and axis.
const NOISE_SIDE: u32 = 8u;

@compute @workgroup_size(64)
fn measure_noise(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= parameters.block_count) {
        return;
    }
    let block = blocks[id.x];
    let size = vec2<u32>(1u << (block.layout_bits & 15u), 1u << ((block.layout_bits >> 4u) & 15u));
    let step = max(size / NOISE_SIDE, vec2<u32>(1u));
    var sum = 0.0;
    var count = 0.0;
    for (var y = 0u; y < size.y; y += step.y) {
        for (var x = 0u; x < size.x; x += step.x) {
            let at = ((block.position >> 16u) + y) * parameters.atlas_width + (block.position & 0xffffu) + x;
            let mean = luminance(radiance[at].rgb);
            let rest = mean - luminance(crisp[at].rgb);
            let variance = max(surfaces[at].w - rest * rest, 0.0) / max(radiance[at].w, 1.0);
            sum += sqrt(variance) / (mean + 0.2);
            count += 1.0;
        }
    }
    noise[id.x] = sum / count;
}
