// Counts as visible too what had few pixels in one of the last updates and has none
// now, with one pixel each: nothing that is seen has less. One thread per 32 patches.
// Twin: recall.rs.

// By patch; then a bit for each that has any.
@group(0) @binding(0) var<storage, read_write> pixels_of_patch: array<u32>;
// For each of the last updates, the newest first, a bit for each patch that had few.
@group(0) @binding(1) var<storage, read_write> had_few: array<u32>;

override PATCHES: u32;
override LIFETIME: u32;
override FEW: u32;

@compute @workgroup_size(64)
fn recall(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let word = id.x + id.y * groups.x * 64u;
    let words = (PATCHES + 31u) / 32u;
    if (word >= words) {
        return;
    }
    let seen = pixels_of_patch[PATCHES + word];
    var newer = 0u;
    for (var left = seen; left != 0u; left &= left - 1u) {
        let bit = firstTrailingBit(left);
        newer |= u32(pixels_of_patch[word * 32u + bit] <= FEW) << bit;
    }
    var recent = 0u;
    for (var update = 0u; update < LIFETIME; update++) {
        let at = update * words + word;
        let older = had_few[at];
        had_few[at] = newer;
        recent |= older;
        newer = older;
    }
    recent &= ~seen;
    pixels_of_patch[PATCHES + word] = seen | recent;
    for (var left = recent; left != 0u; left &= left - 1u) {
        pixels_of_patch[word * 32u + firstTrailingBit(left)] = 1u;
    }
}
