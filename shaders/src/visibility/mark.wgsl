// Counts the pixels of each patch in an id picture; a patch with any is visible, and
// has its bit behind the counts, so that nobody has to look at all of them.
// One thread per four pixels of a row; equal neighbours are counted together.
// Source: SAS 2018, section 3.1. Twin: mod.rs.

@group(0) @binding(0) var ids: texture_2d<u32>;
// By patch; then a bit for each.
@group(0) @binding(1) var<storage, read_write> pixels_of_patch: array<atomic<u32>>;

override PATCHES: u32;

fn count(id: u32, pixels: u32) {
    if (id == 0u || id > PATCHES) {
        return;
    }
    let patch_id = id - 1u;
    if (atomicAdd(&pixels_of_patch[patch_id], pixels) == 0u) {
        atomicOr(&pixels_of_patch[PATCHES + patch_id / 32u], 1u << (patch_id % 32u));
    }
}

@compute @workgroup_size(8, 8)
fn mark(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(ids);
    if (id.y >= size.y || id.x * 4u >= size.x) {
        return;
    }
    var run_id = 0u;
    var run = 0u;
    for (var i = 0u; i < 4u; i++) {
        let x = id.x * 4u + i;
        if (x >= size.x) {
            break;
        }
        let here = textureLoad(ids, vec2<u32>(x, id.y), 0).r;
        if (here == run_id) {
            run += 1u;
        } else {
            count(run_id, run);
            run_id = here;
            run = 1u;
        }
    }
    count(run_id, run);
}
