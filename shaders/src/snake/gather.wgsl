// Lists the triangles that are visible or have a slot, by ascending patch, and
// leaves out the least important where the smallest slots would be too many.
// One thread per run of patches counts, a group sums up, one thread per run writes.
// Twin: `Packer::gather` and `leave_out` in place.rs.

var<workgroup> cell_count: array<atomic<u32>, 1280>;
var<workgroup> cut: vec2<u32>;

// Threads that leave out: always many, since Mesa's software driver ends all loops
// of a thread after 65,535 turns.
const CUT_LANES: u32 = 256u;

@compute @workgroup_size(64)
fn count_active(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let run = thread_of(id, groups);
    if (run >= runs_of(snake.patch_count)) {
        return;
    }
    let begin = run * RUN;
    let end = min(begin + RUN, snake.patch_count);
    var found = vec4<u32>(0u);
    for (var patch_id = begin; patch_id < end; patch_id++) {
        let visible = pixels_of_patch[patch_id] != 0u;
        let slot = slots[patch_id];
        let has_slot = slot.x != NONE;
        if (visible || has_slot) {
            listed[begin + found.x] = patch_id;
            let changed = select((slot.y >> AGE_SHIFT) == 0u, !has_slot, visible);
            found += vec4<u32>(1u, u32(visible), u32(changed), 0u);
        }
    }
    runs[run] = found;
}

// One group.
@compute @workgroup_size(LANES)
fn scan_active(@builtin(local_invocation_index) lane: u32) {
    let count = runs_of(snake.patch_count);
    let share = (count + LANES - 1u) / LANES;
    let begin = min(lane * share, count);
    let end = min(begin + share, count);
    var own = vec4<u32>(0u);
    for (var run = begin; run < end; run++) {
        own += runs[run];
    }
    var before = sum_before(lane, LANES, own);
    for (var run = begin; run < end; run++) {
        let here = runs[run];
        runs[run] = before;
        before += here;
    }
    for (var bin = lane; bin < BINS; bin += LANES) {
        if (snake.reset != 0u) {
            state.rooms[bin] = Room(0u, 0u);
        }
    }
    if (lane == LANES - 1u) {
        if (snake.reset != 0u) {
            state.superblock_count = 0u;
        }
        state.active_count = before.x;
        state.visible = before.y;
        state.changed = before.z;
        state.verdict = select(ASK, ASK_ANEW, snake.reset != 0u);
        state.status = select(0u, STATUS_LEFT_OUT, before.y > snake.most_triangles);
        state.status |= select(0u, STATUS_RESET, snake.reset != 0u);
        state.looks = 0u;
        state.raised = 0;
        atomicStore(&state.reserved, 0u);
        atomicStore(&state.bins, 0u);
        atomicStore(&state.slots, 0u);
    }
}

// The logarithm of at least one pixel, in steps of 1/8 octave or less.
fn importance(pixels: u32) -> u32 {
    let octave = firstLeadingBit(pixels);
    let shifted = select(pixels >> (max(octave, 3u) - 3u), pixels << (3u - min(octave, 3u)), octave < 3u);
    return (octave << 3u) | (shifted & 7u);
}

fn cell_of(wish: vec2<u32>) -> u32 {
    let height = min(wish.x >> 16u, 4096u);
    let length = max(min(wish.x & 0xffffu, 4096u), height);
    return min(height / 64u, 63u) * 20u + min((length - height) / 64u, 19u);
}

@compute @workgroup_size(64)
fn gather(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32) {
    for (var cell = lane; cell < CELLS; cell += 64u) {
        atomicStore(&cell_count[cell], 0u);
    }
    workgroupBarrier();
    let run = thread_of(id, groups);
    let crowded = state.visible > snake.most_triangles;
    let last = runs_of(snake.patch_count);
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
        let slot = slots[patch_id];
        var bits = 0u;
        if (slot.x != NONE) {
            bits = HAD | (min((slot.y >> AGE_SHIFT) + 1u, 255u) << AGE_SHIFT);
        }
        if (pixels != 0u) {
            bits = (bits & HAD) | SEEN;
            atomicAdd(&cell_count[cell_of(wishes[patch_id])], 1u);
            if (crowded) {
                atomicAdd(&tally.classes[importance(pixels)], 1u);
            }
        }
        let index = select(0u, slot.y & 0xffffffu, slot.x != NONE);
        active_triangles[at + i] = ActiveTriangle(patch_id, pixels, bits, NONE, index, NONE);
    }
    workgroupBarrier();
    for (var cell = lane; cell < CELLS; cell += 64u) {
        let count = atomicLoad(&cell_count[cell]);
        if (count != 0u) {
            atomicAdd(&tally.cells[cell], count);
        }
    }
}

// One group. Each thread has consecutive triangles, so that among equally important
// ones the first are kept.
@compute @workgroup_size(CUT_LANES)
fn leave_out(@builtin(local_invocation_index) lane: u32) {
    let crowded = state.visible > snake.most_triangles;
    let count = select(0u, state.active_count, crowded);
    if (lane == 0u && crowded) {
        var class_id = 255u;
        var left = snake.most_triangles;
        while (class_id > 0u) {
            let found = atomicLoad(&tally.classes[class_id]);
            if (found > left) {
                break;
            }
            left -= found;
            class_id -= 1u;
        }
        cut = vec2<u32>(class_id, left);
    }
    workgroupBarrier();
    let share = (count + CUT_LANES - 1u) / CUT_LANES;
    let begin = min(lane * share, count);
    let end = min(begin + share, count);
    var own = 0u;
    for (var i = begin; i < end; i++) {
        let pixels = active_triangles[i].pixels;
        own += u32(pixels != 0u && importance(pixels) == cut.x);
    }
    var rank = sum_before(lane, CUT_LANES, vec4<u32>(own, 0u, 0u, 0u)).x;
    for (var i = begin; i < end; i++) {
        let pixels = active_triangles[i].pixels;
        if (pixels == 0u) {
            continue;
        }
        let class_id = importance(pixels);
        let in_class = class_id == cut.x;
        if (class_id < cut.x || (in_class && rank >= cut.y)) {
            active_triangles[i].bits = (active_triangles[i].bits ^ (SEEN | LEFT_OUT)) | (1u << AGE_SHIFT);
            atomicSub(&tally.cells[cell_of(wishes[active_triangles[i].patch_id])], 1u);
        }
        rank += u32(in_class);
    }
}
