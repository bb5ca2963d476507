// The request phase: each patch chooses its level, and says whether it wants a
// block and whether it gives one back. One thread per run of active patches
// counts by level; one group per kind and level turns counts into slots.
// Twin: `choose_levels` and `request` in place.rs. Source: SAS 2018, section 4.2.

const REQUESTS: u32 = 0u;
const RELEASES: u32 = 1u;
const IDLES: u32 = 2u;

var<workgroup> level_tally: array<atomic<u32>, 120>;

fn is_asking() -> bool {
    return state.verdict < PLACED;
}

@compute @workgroup_size(64)
fn request(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32) {
    for (var level = lane; level < LEVELS; level += 64u) {
        atomicStore(&level_tally[level], 0u);
    }
    workgroupBarrier();
    let run = thread_of(id, groups);
    let count = select(0u, state.active_count, is_asking());
    let begin = min(run * RUN, count);
    let end = min(begin + RUN, count);
    let anew = state.verdict == ASK_ANEW;
    if (begin < end) {
        let stride = runs_of(atlas.patch_count);
        let lists = 3u * level_count();
        for (var list = 0u; list < lists; list++) {
            slots[list * stride + run] = 0u;
        }
    }
    let bias = state.bias;
    var changed = begin;
    for (var i = begin; i < end; i++) {
        let bits = active_patches[i].bits;
        let has_block = active_patches[i].before != NONE;
        let old_level = (bits >> OLD_SHIFT) & LEVEL_BITS;
        var level = bits & LEVEL_BITS;
        var flags = 0u;
        if ((bits & SEEN) != 0u) {
            level = steady_level(select(NO_LEVEL, old_level, has_block), wishes[active_patches[i].patch_id], bias);
            atomicAdd(&level_tally[index_of_level(level)], 1u);
            if (anew || !has_block || level != old_level) {
                flags |= WANTED;
                slots[slot_at(REQUESTS, index_of_level(level), run)] += 1u;
            }
            if (!anew && has_block && level != old_level) {
                flags |= RELEASED;
            }
        } else if (has_block) {
            let stale = (bits >> AGE_SHIFT) >= atlas.keep_unseen;
            flags |= select(IDLE, RELEASED, anew || stale);
        }
        if (!anew && (flags & RELEASED) != 0u) {
            slots[slot_at(RELEASES, index_of_level(old_level), run)] += 1u;
        }
        if ((flags & IDLE) != 0u) {
            slots[slot_at(IDLES, index_of_level(old_level), run)] += 1u;
        }
        let cleared = bits & ~(LEVEL_BITS | WANTED | RELEASED | IDLE);
        active_patches[i].bits = cleared | level | flags;
        if (flags != 0u) {
            listed[changed] = i;
            changed += 1u;
        }
    }
    if (begin < end) {
        runs[run].y = changed - begin;
    }
    workgroupBarrier();
    for (var level = lane; level < LEVELS; level += 64u) {
        let found = atomicLoad(&level_tally[level]);
        if (found != 0u) {
            atomicAdd(&tally.levels[level], found);
        }
    }
}

// One group per kind and level.
@compute @workgroup_size(LANES)
fn scan_slots(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let asking = is_asking();
    let count = select(0u, runs_of(state.active_count), asking);
    let kind = group.x / level_count();
    let level = group.x % level_count();
    let share = (count + LANES - 1u) / LANES;
    let begin = min(lane * share, count);
    let end = min(begin + share, count);
    let base = slot_at(kind, level, 0u);
    var own = 0u;
    for (var run = begin; run < end; run++) {
        own += slots[base + run];
    }
    var before = sum_before(lane, LANES, vec2<u32>(own, 0u)).x;
    for (var run = begin; run < end; run++) {
        let here = slots[base + run];
        slots[base + run] = before;
        before += here;
    }
    if (lane == LANES - 1u && asking) {
        if (kind == REQUESTS) {
            state.requested[level] = before;
        } else if (kind == RELEASES) {
            state.released[level] = before;
        } else {
            state.idle[level] = before;
        }
    }
}
