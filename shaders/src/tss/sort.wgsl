// Sorts the triangles that are placed by kind: highest first, then widest, then by
// ascending patch. A stable sort by two digits of five bits, the less important first;
// for each, one thread per run counts, a group sums up, one thread per run moves.

fn placing() -> u32 {
    return select(state.active_count, state.placing, SECOND_DIGIT);
}

fn item(position: u32) -> u32 {
    if (SECOND_DIGIT) {
        return order[position];
    }
    return position;
}

// Or CLASSES for what is not placed.
fn digit_of(i: u32) -> u32 {
    if (!is_placed(i)) {
        return CLASSES;
    }
    let kind = scaled(deserved(shapes[triangles[i].patch_id]), state.steps);
    return CLASSES - 1u - select(kind.y, kind.x, SECOND_DIGIT);
}

@compute @workgroup_size(64)
fn count_digits(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let run = thread_of(id, groups);
    let count = placing();
    let runs_here = runs_of(count);
    if (run >= runs_here) {
        return;
    }
    var found: array<u32, 33>;
    for (var position = run * RUN; position < min((run + 1u) * RUN, count); position++) {
        found[digit_of(item(position))] += 1u;
    }
    for (var digit = 0u; digit < CLASSES; digit++) {
        digits[digit * runs_here + run] = found[digit];
    }
}

// One group.
@compute @workgroup_size(LANES)
fn scan_digits(@builtin(local_invocation_index) lane: u32) {
    let count = CLASSES * runs_of(placing());
    let share = (count + LANES - 1u) / LANES;
    let begin = min(lane * share, count);
    let end = min(begin + share, count);
    var own = 0u;
    for (var at = begin; at < end; at++) {
        own += digits[at];
    }
    var before = sum_before(lane, LANES, vec2<u32>(own, 0u)).x;
    for (var at = begin; at < end; at++) {
        let here = digits[at];
        digits[at] = before;
        before += here;
    }
}

@compute @workgroup_size(64)
fn scatter(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let run = thread_of(id, groups);
    let count = placing();
    let runs_here = runs_of(count);
    if (run >= runs_here) {
        return;
    }
    let target_list = select(0u, tss.patch_count, SECOND_DIGIT);
    for (var position = run * RUN; position < min((run + 1u) * RUN, count); position++) {
        let i = item(position);
        let digit = digit_of(i);
        if (digit == CLASSES) {
            continue;
        }
        // Each list of counts belongs to this thread.
        let at = digits[digit * runs_here + run];
        digits[digit * runs_here + run] = at + 1u;
        order[target_list + at] = i;
    }
}
