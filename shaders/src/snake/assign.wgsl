// The slots of all bins, a bit each: triangles that keep theirs mark them, and the
// nth triangle that asks for one of a bin gets the nth that is free.
// Twin: assign.rs. Source: SnakeBinning 2021, sections 3.3 and 3.6.

fn requests_of(bin: u32) -> u32 {
    let moved = (plans[bin].flags & MOVED) != 0u;
    return atomicLoad(&tally.wants[bin]) + select(0u, atomicLoad(&tally.stays[bin]), moved);
}

// One group: words and requests of each bin.
@compute @workgroup_size(LANES)
fn scan_slots(@builtin(local_invocation_index) lane: u32) {
    let share = (BINS + LANES - 1u) / LANES;
    let begin = min(lane * share, BINS);
    let end = min(begin + share, BINS);
    var own = vec4<u32>(0u);
    for (var bin = begin; bin < end; bin++) {
        own += vec4<u32>((state.rooms[bin].capacity + 31u) / 32u, requests_of(bin), 0u, 0u);
    }
    var before = sum_before(lane, LANES, own);
    for (var bin = begin; bin < end; bin++) {
        let capacity = state.rooms[bin].capacity;
        plans[bin].first_word = before.x;
        plans[bin].first_request = before.y;
        before += vec4<u32>((capacity + 31u) / 32u, requests_of(bin), 0u, 0u);
        if (capacity % 32u != 0u) {
            // What is behind the last slot is no slot.
            atomicOr(&taken[before.x - 1u], 0xffffffffu << (capacity % 32u));
        }
        for (var nth = 0u; nth < state.rooms[bin].extents; nth++) {
            let extent = state.extents[bin * MOST_EXTENTS + nth];
            atomicAdd(&state.reserved, extent.units * snake.unit * state.superblocks[extent.superblock].width);
        }
        if (capacity != 0u) {
            atomicAdd(&state.bins, 1u);
            atomicAdd(&state.slots, capacity);
        }
    }
    if (lane == LANES - 1u) {
        state.words = before.x;
        state.requests = before.y;
    }
}

// Tells where a slot lies.
fn set_slot(i: u32, index: u32) {
    let shape = active_triangles[i].shape;
    let bin = shape & BIN;
    let t = templates[bin];
    var at = bin * MOST_EXTENTS;
    var here = index;
    for (var nth = 1u; nth < state.rooms[bin].extents && here >= state.extents[at].capacity; nth++) {
        here -= state.extents[at].capacity;
        at += 1u;
    }
    let extent = state.extents[at];
    let column = state.superblocks[extent.superblock];
    let per = max(in_row(bin, column.width), 1u);
    let in_strip = here % per;
    let is_odd = (in_strip & 1u) == 1u;
    let x = column.x + in_strip / 2u * (t.to_odd + t.to_even) + select(0u, t.to_odd, is_odd);
    let y = extent.first * snake.unit + here / per * (t.height + 1u);
    active_triangles[i].index = index;
    active_triangles[i].at = x | (y << 16u);
    active_triangles[i].shape = shape | select(0u, ODD, is_odd);
    let age = active_triangles[i].bits >> AGE_SHIFT;
    slots[active_triangles[i].patch_id] = vec2<u32>(shape, index | (age << AGE_SHIFT));
}

fn drop_slot(i: u32) {
    active_triangles[i].shape = NONE;
    active_triangles[i].bits &= ~CHANGED;
    slots[active_triangles[i].patch_id] = vec2<u32>(NONE, 0u);
}

// One thread per run of active triangles.
@compute @workgroup_size(64)
fn mark_taken(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let run = thread_of(id, groups);
    let end = min((run + 1u) * RUN, state.active_count);
    for (var i = run * RUN; i < end; i++) {
        let bits = active_triangles[i].bits;
        let shape = active_triangles[i].shape;
        if (shape == NONE) {
            drop_slot(i);
            continue;
        }
        let flags = plans[shape & BIN].flags;
        if ((bits & KEPT) != 0u && (flags & MOVED) != 0u) {
            active_triangles[i].bits = (bits & ~KEPT) | WANTED | CHANGED;
        } else if ((bits & IDLE) != 0u && flags != 0u) {
            drop_slot(i);
        } else if ((bits & (IDLE | KEPT)) != 0u) {
            let index = active_triangles[i].index;
            atomicOr(&taken[plans[shape & BIN].first_word + index / 32u], 1u << (index % 32u));
            set_slot(i, index);
        }
    }
}

// One group, always of many threads: see `leave_out`.
@compute @workgroup_size(CUT_LANES)
fn scan_taken(@builtin(local_invocation_index) lane: u32) {
    let count = select(0u, state.words, state.requests != 0u);
    let share = (count + CUT_LANES - 1u) / CUT_LANES;
    let begin = min(lane * share, count);
    let end = min(begin + share, count);
    var own = 0u;
    for (var word = begin; word < end; word++) {
        own += 32u - countOneBits(atomicLoad(&taken[word]));
    }
    var before = sum_before(lane, CUT_LANES, vec4<u32>(own, 0u, 0u, 0u)).x;
    for (var word = begin; word < end; word++) {
        free_before[word] = before;
        before += 32u - countOneBits(atomicLoad(&taken[word]));
    }
}

// Which of a word's free bits is the nth.
fn nth_free(word: u32, nth: u32) -> u32 {
    var bits = ~word;
    var left = nth;
    var at = 0u;
    for (var width = 16u; width > 0u; width >>= 1u) {
        let lower = countOneBits(bits & ((1u << width) - 1u));
        let above = left >= lower;
        left -= select(0u, lower, above);
        at += select(0u, width, above);
        bits = select(bits, bits >> width, above);
    }
    return at;
}

// One thread per run of requests.
@compute @workgroup_size(64)
fn assign(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let run = thread_of(id, groups);
    let end = min((run + 1u) * RUN, state.requests);
    for (var j = run * RUN; j < end; j++) {
        let i = requests[j];
        let bin = active_triangles[i].shape & BIN;
        if (state.rooms[bin].capacity == 0u) {
            drop_slot(i);
            continue;
        }
        let first = plans[bin].first_word;
        let nth = free_before[first] + j - plans[bin].first_request;
        var low = first;
        var high = first + (state.rooms[bin].capacity + 31u) / 32u - 1u;
        while (low < high) {
            let middle = (low + high + 1u) / 2u;
            if (free_before[middle] <= nth) {
                low = middle;
            } else {
                high = middle - 1u;
            }
        }
        set_slot(i, (low - first) * 32u + nth_free(atomicLoad(&taken[low]), nth - free_before[low]));
    }
}
