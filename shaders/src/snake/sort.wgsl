// Sorts the triangles that ask for a slot by bin, and those of a bin by patch: two
// passes over six bits each, each stable. One thread per run counts by digit, one
// group per digit turns counts into places, one thread per run writes.
// Source: SnakeBinning 2021, section 3.3, reaches that order by fragment shader
// interlock.

const DIGITS: u32 = 64u;

fn digit_at(digit: u32, run: u32) -> u32 {
    return digit * runs_of(snake.patch_count) + run;
}

// Where the number of a digit is.
fn total_at(digit: u32) -> u32 {
    return digit_at(DIGITS, digit);
}

fn clear_digits(run: u32) {
    for (var digit = 0u; digit < DIGITS; digit++) {
        digits[digit_at(digit, run)] = 0u;
    }
}

fn is_request(i: u32) -> bool {
    return (active_triangles[i].bits & WANTED) != 0u;
}

fn low_digit(i: u32) -> u32 {
    return active_triangles[i].shape & 63u;
}

fn high_digit(i: u32) -> u32 {
    return (active_triangles[i].shape & BIN) >> 6u;
}

// Makes of places within a digit places among all.
fn add_totals(run: u32) {
    var before = 0u;
    for (var digit = 0u; digit < DIGITS; digit++) {
        digits[digit_at(digit, run)] += before;
        before += digits[total_at(digit)];
    }
}

fn draw_place(digit: u32, run: u32) -> u32 {
    let at = digits[digit_at(digit, run)];
    digits[digit_at(digit, run)] = at + 1u;
    return at;
}

@compute @workgroup_size(64)
fn count_low(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let run = thread_of(id, groups);
    let end = min((run + 1u) * RUN, state.active_count);
    if (run * RUN >= end) {
        return;
    }
    clear_digits(run);
    for (var i = run * RUN; i < end; i++) {
        if (is_request(i)) {
            digits[digit_at(low_digit(i), run)] += 1u;
        }
    }
}

@compute @workgroup_size(64)
fn scatter_low(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let run = thread_of(id, groups);
    let end = min((run + 1u) * RUN, state.active_count);
    if (run * RUN >= end || state.requests == 0u) {
        return;
    }
    add_totals(run);
    for (var i = run * RUN; i < end; i++) {
        if (is_request(i)) {
            listed[draw_place(low_digit(i), run)] = i;
        }
    }
}

@compute @workgroup_size(64)
fn count_high(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let run = thread_of(id, groups);
    let end = min((run + 1u) * RUN, state.requests);
    if (run * RUN >= end) {
        return;
    }
    clear_digits(run);
    for (var i = run * RUN; i < end; i++) {
        digits[digit_at(high_digit(listed[i]), run)] += 1u;
    }
}

@compute @workgroup_size(64)
fn scatter_high(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let run = thread_of(id, groups);
    let end = min((run + 1u) * RUN, state.requests);
    if (run * RUN >= end) {
        return;
    }
    add_totals(run);
    for (var i = run * RUN; i < end; i++) {
        requests[draw_place(high_digit(listed[i]), run)] = listed[i];
    }
}

fn scan_digit(digit: u32, lane: u32, count: u32) {
    let share = (count + LANES - 1u) / LANES;
    let begin = min(lane * share, count);
    let end = min(begin + share, count);
    var own = 0u;
    for (var run = begin; run < end; run++) {
        own += digits[digit_at(digit, run)];
    }
    var before = sum_before(lane, LANES, vec4<u32>(own, 0u, 0u, 0u)).x;
    for (var run = begin; run < end; run++) {
        let here = digits[digit_at(digit, run)];
        digits[digit_at(digit, run)] = before;
        before += here;
    }
    if (lane == LANES - 1u) {
        digits[total_at(digit)] = before;
    }
}

// One group per digit.
@compute @workgroup_size(LANES)
fn scan_low(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    scan_digit(group.x, lane, select(0u, runs_of(state.active_count), state.requests != 0u));
}

// One group per digit.
@compute @workgroup_size(LANES)
fn scan_high(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    scan_digit(group.x, lane, runs_of(state.requests));
}
