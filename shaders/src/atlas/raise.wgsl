// Raises the bias, in steps, until the rounded levels fit into an empty atlas.
// Runs where equation 3 was not enough. One thread per run of active patches
// tells at which step each patch changes its level; one group adds up.
// Twin: the loop in `Placer::place`, place.rs. Source: SAS 2018, section 4.3.

const BIAS_STEP: i32 = 32;

var<workgroup> first_fit: atomic<u32>;

fn walk_steps() -> u32 {
    return u32((most_bias() - state.bias + BIAS_STEP - 1) / BIAS_STEP) + 1u;
}

@compute @workgroup_size(64)
fn walk(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let run = thread_of(id, groups);
    let count = select(0u, state.active_count, state.verdict == RAISE);
    let end = min((run + 1u) * RUN, count);
    let steps = walk_steps();
    for (var i = min(run * RUN, count); i < end; i++) {
        let active_patch = active_patches[i];
        if ((active_patch.bits & SEEN) == 0u) {
            continue;
        }
        let current = select(NO_LEVEL, (active_patch.bits >> OLD_SHIFT) & LEVEL_BITS, active_patch.before != NONE);
        let wish = wishes[active_patch.patch_id];
        var before = NO_LEVEL;
        for (var step = 0u; step < steps; step++) {
            let bias = min(state.bias + i32(step) * BIAS_STEP, most_bias());
            let level = index_of_level(steady_level(current, wish, bias));
            if (level == before) {
                continue;
            }
            if (before != NO_LEVEL) {
                atomicSub(&tally.walk[step * LEVELS + before], 1);
            }
            atomicAdd(&tally.walk[step * LEVELS + level], 1);
            before = level;
            // Nothing is smaller.
            if (level == 0u) {
                break;
            }
        }
    }
}

// One group.
@compute @workgroup_size(LANES)
fn raise(@builtin(local_invocation_index) lane: u32) {
    let raising = state.verdict == RAISE;
    let steps = select(0u, walk_steps(), raising);
    if (lane == 0u) {
        atomicStore(&first_fit, max(steps, 1u) - 1u);
    }
    for (var level = lane; level < level_count(); level += LANES) {
        var count = 0;
        for (var step = 0u; step < steps; step++) {
            count += atomicLoad(&tally.walk[step * LEVELS + level]);
            atomicStore(&tally.walk[step * LEVELS + level], count);
        }
        if (raising) {
            atomicStore(&tally.levels[level], 0u);
        }
    }
    storageBarrier();
    workgroupBarrier();
    // The step that did not fit is the first.
    for (var step = 1u + lane; step < steps; step += LANES) {
        var needed = 0u;
        for (var width = 1u; width <= atlas.log2_side; width++) {
            var length = 0u;
            for (var height = 1u; height <= width; height++) {
                let count = atomicLoad(&tally.walk[step * LEVELS + index_of(width, height)]);
                length = add_up(length, length_of(u32(count), height));
            }
            needed = add_up(needed, superblocks_for(length, width));
        }
        if (needed <= atlas.budget) {
            atomicMin(&first_fit, step);
        }
    }
    workgroupBarrier();
    if (lane == 0u && raising) {
        state.bias = min(state.bias + i32(atomicLoad(&first_fit)) * BIAS_STEP, most_bias());
        state.status |= STATUS_RAISED;
    }
}
