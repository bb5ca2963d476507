// Lists the triangles that are visible or just were, by ascending patch, and counts
// them by kind. One thread per run of patches counts, a group sums up, one thread per
// run writes. Twin: `Packer::place` in pack.rs.

@compute @workgroup_size(64)
fn count_active(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let run = thread_of(id, groups);
    if (run >= runs_of(tss.patch_count)) {
        return;
    }
    let begin = run * RUN;
    let end = min(begin + RUN, tss.patch_count);
    var found = vec2<u32>(0u);
    for (var patch_id = begin; patch_id < end; patch_id++) {
        let visible = pixels_of_patch[patch_id] != 0u;
        let before = ages[patch_id];
        var age = select(before + 1u, 0u, visible);
        if (!visible && (before == NONE || age > tss.keep_unseen)) {
            age = NONE;
        }
        if (age != before) {
            ages[patch_id] = age;
        }
        found += vec2<u32>(u32(age != NONE), u32(visible));
    }
    runs[run] = found;
}

// One group.
@compute @workgroup_size(LANES)
fn scan_active(@builtin(local_invocation_index) lane: u32) {
    let count = runs_of(tss.patch_count);
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
        state.seen = before.y;
    }
}

@compute @workgroup_size(64)
fn gather(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let run = thread_of(id, groups);
    if (run >= runs_of(tss.patch_count)) {
        return;
    }
    var at = runs[run].x;
    let begin = run * RUN;
    let end = min(begin + RUN, tss.patch_count);
    for (var patch_id = begin; patch_id < end; patch_id++) {
        if (ages[patch_id] == NONE) {
            continue;
        }
        let pixels = pixels_of_patch[patch_id];
        triangles[at].patch_id = patch_id;
        triangles[at].pixels = pixels;
        triangles[at].corners[0] = NONE;
        let kind = deserved(shapes[patch_id]);
        let cell = kind.x * CLASSES + kind.y;
        atomicAdd(&tally.all[cell], 1u);
        if (pixels != 0u) {
            atomicAdd(&tally.seen[cell], 1u);
        }
        at++;
    }
}
