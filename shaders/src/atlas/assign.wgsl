// Blocks go back to the stacks of their levels, and then each patch that wants a
// block gets one: below `required` in the superblocks that provisioning found, else
// from the stack. One thread per run of active patches looks at those that change.
// Twin: `Placer::assign` in place.rs. Source: SAS 2018, section 4.2.

// Counts on in the run's own list: the slot of its next block.
fn draw(kind: u32, level: u32, run: u32) -> u32 {
    let at = slot_at(kind, level, run);
    let slot = slots[at];
    slots[at] = slot + 1u;
    return slot;
}

// Behind the changes of a run; where they begin if it is not wanted.
fn changes_end(run: u32, wanted: bool) -> u32 {
    let begin = run * RUN;
    if (!wanted || begin >= state.active_count) {
        return begin;
    }
    return begin + runs[run].y;
}

@compute @workgroup_size(64)
fn release(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let run = thread_of(id, groups);
    // After a reset there is nothing to give back.
    let anew = (state.status & STATUS_RESET) != 0u;
    let end = changes_end(run, state.verdict == PLACED && !anew);
    for (var change = run * RUN; change < end; change++) {
        let i = listed[change];
        let bits = active_patches[i].bits;
        let idle = (bits & IDLE) != 0u;
        if ((bits & RELEASED) == 0u && !(idle && state.evict != 0u)) {
            continue;
        }
        let old_level = bits >> OLD_SHIFT;
        let level = index_of_level(old_level);
        var at = state.stacked_before[level] + draw(select(RELEASES, IDLES, idle), level, run);
        if (idle) {
            at += state.released[level];
            active_patches[i].bits = bits | RELEASED;
        }
        let sides = vec2<u32>(old_level & 15u, (old_level >> 4u) & 15u);
        if (at < stack_room(max(sides.x, sides.y), min(sides.x, sides.y))) {
            stacks[state.stack_base[level] + at] = active_patches[i].before;
        }
    }
}

@compute @workgroup_size(64)
fn assign(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let run = thread_of(id, groups);
    let end = changes_end(run, state.verdict == PLACED);
    for (var change = run * RUN; change < end; change++) {
        let i = listed[change];
        let bits = active_patches[i].bits;
        var position = select(active_patches[i].before, NONE, (bits & RELEASED) != 0u);
        if ((bits & WANTED) != 0u) {
            let sides = vec2<u32>(bits & 15u, (bits >> 4u) & 15u);
            let level = index_of_level(bits);
            let slot = draw(REQUESTS, level, run);
            let required = state.required[level];
            if (slot < required) {
                position = position_at(max(sides.x, sides.y), (state.offset[level] + slot) << min(sides.x, sides.y));
            } else {
                position = stacks[state.stack_base[level] + state.top[level] - 1u - (slot - required)];
            }
        }
        active_patches[i].after = position;
        let patch_id = active_patches[i].patch_id;
        if (position == NONE) {
            atomicAnd(&held[patch_id / 32u], ~(1u << (patch_id % 32u)));
        } else if (active_patches[i].before == NONE) {
            atomicOr(&held[patch_id / 32u], 1u << (patch_id % 32u));
        }
        blocks[patch_id] = vec2<u32>(position, (bits & LEVEL_BITS) | ((bits >> AGE_SHIFT) << 8u));
    }
}
