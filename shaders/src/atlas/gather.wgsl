// Lists the patches that are visible or have a block, by ascending patch, without a look
// at the others: they are told by bits.
// One thread per run of patches counts, a group sums up, one thread per run writes.
// Twin: `Placer::gather` in place.rs.

var<workgroup> area_count: array<atomic<u32>, 1024>;

@compute @workgroup_size(64)
fn count_active(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let run = thread_of(id, groups);
    if (run >= runs_of(atlas.patch_count)) {
        return;
    }
    let begin = run * RUN;
    let end = min(begin + RUN, atlas.patch_count);
    var found = vec2<u32>(0u);
    for (var word = begin / 32u; word * 32u < end; word++) {
        let seen = pixels_of_patch[atlas.patch_count + word];
        // The run may begin and end within a word.
        let first = max(begin, word * 32u) - word * 32u;
        let count = min(end - word * 32u, 32u) - first;
        var left = extractBits(seen | atomicLoad(&held[word]), first, count) << first;
        while (left != 0u) {
            let bit = firstTrailingBit(left);
            listed[begin + found.x] = word * 32u + bit;
            found += vec2<u32>(1u, (seen >> bit) & 1u);
            left &= left - 1u;
        }
    }
    runs[run] = found;
}

// One group.
@compute @workgroup_size(LANES)
fn scan_active(@builtin(local_invocation_index) lane: u32) {
    let count = runs_of(atlas.patch_count);
    let share = (count + LANES - 1u) / LANES;
    let begin = min(lane * share, count);
    let end = min(begin + share, count);
    var own = vec2<u32>(0u);
    for (var run = begin; run < end; run++) {
        own += runs[run];
    }
    var before = sum_before(lane, LANES, own);
    for (var run = begin; run < end; run++) {
        let here = runs[run];
        runs[run] = before;
        before += here;
    }
    if (lane == LANES - 1u) {
        state.active_count = before.x;
        state.visible = before.y;
        state.verdict = ASK;
        state.evict = 0u;
        state.status = select(0u, STATUS_LEFT_OUT, before.y > atlas.most_patches);
    }
}

@compute @workgroup_size(64)
fn gather(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32) {
    for (var bin = lane; bin < 1024u; bin += 64u) {
        atomicStore(&area_count[bin], 0u);
    }
    workgroupBarrier();
    let run = thread_of(id, groups);
    let crowded = state.visible > atlas.most_patches;
    let last = runs_of(atlas.patch_count);
    var at = 0u;
    var count = 0u;
    if (run < last) {
        at = runs[run].x;
        count = state.active_count - at;
        if (run + 1u < last) {
            count = runs[run + 1u].x - at;
        }
    }
    for (var i = 0u; i < count; i++) {
        let patch_id = listed[run * RUN + i];
        let pixels = pixels_of_patch[patch_id];
        let block = blocks[patch_id];
        var bits = 0u;
        if (block.x != NONE) {
            let level = block.y & LEVEL_BITS;
            bits = level | (level << OLD_SHIFT) | (min((block.y >> 8u) + 1u, 255u) << AGE_SHIFT);
        }
        if (pixels != 0u) {
            bits = (bits & 0xffffu) | SEEN;
            if (block.x != NONE && (block.y >> 8u) != 0u) {
                blocks[patch_id].y = block.y & LEVEL_BITS;
            }
            atomicAdd(&area_count[area_bin(wishes[patch_id])], 1u);
            if (crowded) {
                atomicAdd(&tally.classes[importance(pixels)], 1u);
            }
        }
        active_patches[at + i] = ActivePatch(patch_id, pixels, block.x, block.x, bits);
    }
    workgroupBarrier();
    for (var bin = lane; bin < 1024u; bin += 64u) {
        let count = atomicLoad(&area_count[bin]);
        if (count != 0u) {
            atomicAdd(&tally.areas[bin], count);
        }
    }
}
