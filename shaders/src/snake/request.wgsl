// Each triangle chooses a bin, and once bins are mapped says whether it keeps its
// slot or asks for one. One thread per run of active triangles.
// Twin: `Packer::request` and `choose_target` in place.rs. Source: SnakeBinning
// 2021, sections 3.3 and 3.6.

// How many active triangles there are to ask.
fn asked() -> u32 {
    return select(0u, state.active_count, state.verdict < PLACED);
}

fn is_frozen() -> bool {
    return state.verdict == ASK && (state.status & STATUS_FROZEN) != 0u;
}

@compute @workgroup_size(64)
fn choose_bins(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let run = thread_of(id, groups);
    let end = min((run + 1u) * RUN, asked());
    for (var i = run * RUN; i < end; i++) {
        var bits = active_triangles[i].bits & ~(KEPT | WANTED | CHANGED | IDLE);
        if ((bits & SEEN) != 0u) {
            let patch_id = active_triangles[i].patch_id;
            let wish = wishes[patch_id];
            let old = slots[patch_id].x;
            var bin = old & BIN;
            var stays = state.verdict == ASK && (bits & HAD) != 0u;
            if (stays && !is_frozen()) {
                stays = ((old ^ wish.y) & TURN) == 0u && is_near(bin, wish, state.bias);
            }
            if (stays) {
                bits |= KEPT;
            } else {
                bin = bin_of(wish, state.bias);
            }
            atomicAdd(&tally.demand[bin], 1u);
            active_triangles[i].shape = bin;
        }
        active_triangles[i].bits = bits;
    }
}

@compute @workgroup_size(64)
fn choose_targets(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let run = thread_of(id, groups);
    let end = min((run + 1u) * RUN, asked());
    let frozen = is_frozen();
    for (var i = run * RUN; i < end; i++) {
        let triangle = active_triangles[i];
        let old = slots[triangle.patch_id].x;
        let has_slot = state.verdict == ASK && (triangle.bits & HAD) != 0u;
        var bits = triangle.bits;
        var shape = NONE;
        if ((bits & SEEN) == 0u) {
            if (has_slot && (bits >> AGE_SHIFT) < snake.keep_unseen) {
                bits |= IDLE;
                shape = old;
                atomicAdd(&tally.idles[old & BIN], 1u);
                atomicMax(&tally.ends[old & BIN], triangle.index + 1u);
            }
        } else {
            let form = wishes[triangle.patch_id].y & FORM;
            var bin = triangle.shape;
            if ((bits & KEPT) == 0u) {
                bin = plans[bin].target_bin;
            }
            shape = bin | form;
            if (has_slot && bin == (old & BIN)) {
                bits |= KEPT;
                if (frozen || (((old ^ form) & TURN) == 0u && is_foreshortened_alike(old, form))) {
                    shape = old;
                } else {
                    bits |= CHANGED;
                }
                atomicAdd(&tally.stays[bin], 1u);
                atomicMax(&tally.ends[bin], triangle.index + 1u);
            } else {
                bits |= WANTED | CHANGED;
                atomicAdd(&tally.wants[bin], 1u);
            }
        }
        active_triangles[i].bits = bits;
        active_triangles[i].shape = shape;
    }
}
