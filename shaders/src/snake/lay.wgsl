// Gives bins their rows: those that have some shrink or lose them, superblocks that
// are nearly empty collapse, and then bins that have too few look for room. Or says
// what must be done first. One group; its first thread decides, bin by bin from the
// largest down, and the others list the bins that it has to look at.
// Twin: lay.rs. Source: SnakeBinning 2021, section 3.5,
// algorithm 2.

const COLLAPSE_SHARE: u32 = 8u;

var<workgroup> is_full: u32;

fn need_of(bin: u32) -> u32 {
    return atomicLoad(&tally.stays[bin]) + atomicLoad(&tally.wants[bin]);
}

fn live_of(bin: u32) -> u32 {
    return need_of(bin) + select(atomicLoad(&tally.idles[bin]), 0u, (plans[bin].flags & EVICTS) != 0u);
}

fn with_spare(triangles: u32) -> u32 {
    return triangles + triangles / 16u;
}

// Triangles that a bin is to have more room for, where it has too little.
fn missing_in(bin: u32) -> u32 {
    return with_spare(need_of(bin)) - state.rooms[bin].capacity;
}

// Texels that a bin asks for, at most all.
fn area_of(bin: u32) -> u32 {
    let all = snake.width * snake.units * snake.unit;
    let triangles = missing_in(bin);
    let cost = max(templates[bin].cost, 1u);
    return select(triangles * cost, all, triangles > all / cost);
}

// What to list: bins that may lose or spare rows; bins that ask for many; other bins
// that ask for some.
const REVISED: u32 = 0u;
const LARGE: u32 = 1u;
const SMALL: u32 = 2u;
// Bins that ask for more than this fraction of the atlas are large; of so many there
// cannot be more.
const MOST_LARGE: u32 = 64u;

fn is_listed(bin: u32, kind: u32) -> bool {
    let capacity = state.rooms[bin].capacity;
    if (kind != REVISED) {
        if (need_of(bin) <= capacity) {
            return false;
        }
        let is_large = area_of(bin) > snake.width * snake.units * snake.unit / MOST_LARGE;
        return is_large == (kind == LARGE);
    }
    let live = live_of(bin);
    return capacity != 0u && (live == 0u || (!is_frozen() && with_spare(live) < capacity));
}

// Lists bins from the largest down; returns how many.
fn list_bins(lane: u32, kind: u32) -> u32 {
    let share = (BINS + LANES - 1u) / LANES;
    let begin = min(lane * share, BINS);
    let end = min(begin + share, BINS);
    var own = 0u;
    for (var i = begin; i < end; i++) {
        own += u32(is_listed(BINS - 1u - i, kind));
    }
    var at = sum_before(lane, LANES, vec4<u32>(own, 0u, 0u, 0u)).x;
    for (var i = begin; i < end; i++) {
        if (is_listed(BINS - 1u - i, kind)) {
            state.list[at] = BINS - 1u - i;
            at += 1u;
        }
    }
    storageBarrier();
    workgroupBarrier();
    return sums[LANES - 1u].x;
}

// A bin that has rows.
fn revise(bin: u32) {
    let live = live_of(bin);
    let least = with_spare(live);
    let end = atomicLoad(&tally.ends[bin]);
    if (live == 0u || (!is_frozen() && end > 2u * least && is_sparse(bin, least))) {
        release(bin);
        plans[bin].flags |= MOVED;
    } else if (!is_frozen()) {
        shrink(bin, max(least, end));
    }
}

// Empties superblocks that have become nearly empty: bins with rows there lose all.
fn collapse() {
    var falls = 0u;
    for (var superblock = 0u; superblock < column_count && !is_frozen(); superblock++) {
        let column = columns[superblock];
        if (column.used * COLLAPSE_SHARE < snake.units && column.peak * COLLAPSE_SHARE >= 2u * snake.units) {
            falls |= 1u << superblock;
        }
    }
    for (var bin = 0u; bin < BINS && falls != 0u; bin++) {
        var meets = false;
        for (var nth = 0u; nth < state.rooms[bin].extents; nth++) {
            meets = meets || ((falls >> state.extents[extent_at(bin, nth)].superblock) & 1u) != 0u;
        }
        if (meets) {
            release(bin);
            plans[bin].flags |= MOVED;
        }
    }
    for (; falls != 0u; falls &= falls - 1u) {
        columns[countTrailingZeros(falls)].peak = 0u;
    }
}

// The largest first, and among equals the first; too many cannot all have room.
fn sort_list(count: u32) {
    for (var i = 1u; i < count && count <= MOST_LARGE; i++) {
        let bin = state.list[i];
        let area = area_of(bin);
        var at = i;
        while (at > 0u && area_of(state.list[at - 1u]) < area) {
            state.list[at] = state.list[at - 1u];
            at -= 1u;
        }
        state.list[at] = bin;
    }
}

fn place_list(count: u32) {
    for (var i = 0u; i < count; i++) {
        let bin = state.list[i];
        if (state.rooms[bin].extents == 0u) {
            plans[bin].flags |= MOVED;
        }
        if (!extend(bin, missing_in(bin))) {
            release(bin);
            plans[bin].flags |= MOVED;
            if (!extend(bin, missing_in(bin))) {
                release(bin);
                is_full = 1u;
            }
        }
    }
}

fn next_verdict() {
    let verdict = state.verdict;
    if (is_full == 0u || verdict == ASK_LAST) {
        state.verdict = PLACED;
        return;
    }
    state.verdict = verdict + 1u;
    if (verdict == ASK) {
        state.status = (state.status & ~STATUS_FROZEN) | STATUS_FULL | STATUS_RESET;
        state.frozen_for = 0u;
    } else {
        let raise = select(128 << (verdict - ASK_ANEW), MOST_BIAS, verdict + 1u == ASK_LAST);
        let before = state.bias;
        state.bias = min(before + raise, MOST_BIAS);
        state.raised += state.bias - before;
        state.status |= STATUS_RAISED;
    }
}

@compute @workgroup_size(LANES)
fn superblocks(@builtin(local_invocation_index) lane: u32) {
    let asking = state.verdict < PLACED;
    for (var bin = lane; bin < BINS; bin += LANES) {
        if (asking) {
            let capacity = state.rooms[bin].capacity;
            let over = need_of(bin) + atomicLoad(&tally.idles[bin]) > capacity;
            plans[bin].flags = select(0u, EVICTS, over && capacity != 0u);
        }
    }
    for (var word = lane; word < 512u; word += LANES) {
        rows[word] = state.rows[word];
    }
    for (var superblock = lane; superblock < MOST_SUPERBLOCKS; superblock += LANES) {
        columns[superblock] = state.superblocks[superblock];
    }
    if (lane == 0u) {
        column_count = state.superblock_count;
        is_full = 0u;
    }
    storageBarrier();
    let revised = list_bins(lane, REVISED);
    if (lane == 0u && asking) {
        looks = state.looks;
        for (var i = 0u; i < revised; i++) {
            revise(state.list[i]);
        }
        collapse();
        while (column_count > 0u && columns[column_count - 1u].used == 0u) {
            column_count -= 1u;
        }
    }
    storageBarrier();
    workgroupBarrier();
    let large = list_bins(lane, LARGE);
    if (lane == 0u && asking) {
        sort_list(large);
        place_list(large);
    }
    storageBarrier();
    workgroupBarrier();
    let small = list_bins(lane, SMALL);
    if (lane == 0u && asking) {
        place_list(small);
        next_verdict();
        let again = state.verdict < PLACED;
        state.superblock_count = select(column_count, 0u, again);
        state.looks = select(looks, 0u, again);
    }
    storageBarrier();
    workgroupBarrier();
    let again = asking && is_full != 0u && state.verdict < PLACED;
    for (var bin = lane; bin < BINS; bin += LANES) {
        if (again) {
            state.rooms[bin] = Room(0u, 0u);
            atomicStore(&tally.demand[bin], 0u);
        }
    }
    for (var word = lane; word < 512u; word += LANES) {
        state.rows[word] = rows[word];
    }
    for (var superblock = lane; superblock < MOST_SUPERBLOCKS; superblock += LANES) {
        state.superblocks[superblock] = columns[superblock];
    }
}
