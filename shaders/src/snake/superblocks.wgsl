// Gives bins their rows: those that have some grow, shrink or lose them, superblocks
// that are nearly empty collapse, and then bins without rows look for room. Or says
// what must be done first. One group; its first thread decides, bin by bin from the
// largest down, and the others list the bins that it has to look at.
// Twin: superblocks.rs, `Packer::lay_bins`. Source: SnakeBinning 2021, section 3.5,
// algorithm 2.

const MOST_SUPERBLOCKS: u32 = 32u;
const UNIT_WORDS: u32 = 16u;
const MOST_LOOKS: u32 = 40000u;
const COLLAPSE_SHARE: u32 = 8u;
const NOT_FOUND: u32 = 0xffffffffu;

// The state's, while the first thread works with them.
var<workgroup> rows: array<u32, 512>;
var<workgroup> columns: array<Superblock, 32>;
var<workgroup> column_count: u32;
// A bit for each superblock that collapses.
var<workgroup> collapses: u32;
var<workgroup> is_full: u32;
var<private> looks: u32;

fn need_of(bin: u32) -> u32 {
    return atomicLoad(&tally.stays[bin]) + atomicLoad(&tally.wants[bin]);
}

fn live_of(bin: u32) -> u32 {
    return need_of(bin) + select(atomicLoad(&tally.idles[bin]), 0u, (plans[bin].flags & EVICTS) != 0u);
}

fn with_spare(triangles: u32) -> u32 {
    return triangles + 3u * triangles / 10u;
}

// Texels that a bin asks for, at most all.
fn area_of(bin: u32) -> u32 {
    let all = snake.width * snake.units * snake.unit;
    let triangles = with_spare(need_of(bin));
    let cost = max(templates[bin].cost, 1u);
    return select(triangles * cost, all, triangles > all / cost);
}

// What to list: bins that have rows and may lose, want or spare some; large bins
// that ask for rows; other bins that do.
const REVISED: u32 = 0u;
const LARGE: u32 = 1u;
const SMALL: u32 = 2u;
// Bins that take more than this fraction of the atlas are large; of so many there
// cannot be more.
const MOST_LARGE: u32 = 64u;

fn is_listed(bin: u32, kind: u32) -> bool {
    let place = state.places[bin];
    if (kind != REVISED) {
        let is_large = area_of(bin) > snake.width * snake.units * snake.unit / MOST_LARGE;
        return place.superblock == NONE && need_of(bin) > 0u && is_large == (kind == LARGE);
    }
    let live = live_of(bin);
    return place.superblock != NONE && (live == 0u || need_of(bin) > place.capacity || live * 2u < place.capacity);
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

fn below(word: u32, end: u32) -> u32 {
    let bits = clamp(end, 32u * word, 32u * word + 32u) - 32u * word;
    return select((1u << (bits & 31u)) - 1u, 0xffffffffu, bits == 32u);
}

fn mask_of(word: u32, first: u32, units: u32) -> u32 {
    return below(word, first + units) & ~below(word, first);
}

fn mark(superblock: u32, first: u32, units: u32, is_taken: bool) {
    for (var word = first / 32u; word < (first + units + 31u) / 32u; word++) {
        let mask = mask_of(word, first, units);
        let before = rows[superblock * UNIT_WORDS + word];
        rows[superblock * UNIT_WORDS + word] = select(before & ~mask, before | mask, is_taken);
    }
    let used = columns[superblock].used;
    columns[superblock].used = select(used - units, used + units, is_taken);
    columns[superblock].peak = max(columns[superblock].peak, columns[superblock].used);
}

fn is_free(superblock: u32, first: u32, units: u32) -> bool {
    var met = 0u;
    for (var word = first / 32u; word < (first + units + 31u) / 32u; word++) {
        met |= rows[superblock * UNIT_WORDS + word] & mask_of(word, first, units);
    }
    return met == 0u;
}

fn first_fit(superblock: u32, units: u32) -> u32 {
    var at = 0u;
    var run = 0u;
    while (at < snake.units && looks <= MOST_LOOKS) {
        looks += 1u;
        let inside = at % 32u;
        let word = rows[superblock * UNIT_WORDS + at / 32u] >> inside;
        let left = 32u - inside;
        if ((word & 1u) == 0u) {
            let free = min(min(countTrailingZeros(word), left), snake.units - at);
            run += free;
            at += free;
            if (run >= units) {
                return at - run;
            }
        } else {
            at += min(countTrailingZeros(~word), left);
            run = 0u;
        }
    }
    return NOT_FOUND;
}

// Units for so many triangles of which `per` stand side by side.
fn units_for(bin: u32, triangles: u32, per: u32) -> u32 {
    let texel_rows = (triangles + per - 1u) / per * (templates[bin].height + 1u);
    return (texel_rows + snake.unit - 1u) / snake.unit;
}

fn capacity_of(bin: u32, units: u32, per: u32) -> u32 {
    return units * snake.unit / (templates[bin].height + 1u) * per;
}

fn shrink(bin: u32, triangles: u32) {
    let place = state.places[bin];
    let per = in_row(bin, columns[place.superblock].width);
    let units = units_for(bin, triangles, per);
    if (units < place.units) {
        mark(place.superblock, place.first + units, place.units - units, false);
        state.places[bin] = Place(place.superblock, place.first, units, capacity_of(bin, units, per));
    }
}

// Whether the bin, laid anew, would give a third of its units back.
fn is_sparse(bin: u32, triangles: u32) -> bool {
    let place = state.places[bin];
    return units_for(bin, triangles, in_row(bin, columns[place.superblock].width)) * 3u < place.units * 2u;
}

fn grow(bin: u32, triangles: u32) -> bool {
    let place = state.places[bin];
    let per = in_row(bin, columns[place.superblock].width);
    if (triangles > per * snake.units * snake.unit) {
        return false;
    }
    let units = units_for(bin, triangles, per);
    let end = place.first + place.units;
    let more = units - place.units;
    if (end + more > snake.units || !is_free(place.superblock, end, more)) {
        return false;
    }
    mark(place.superblock, end, more, true);
    state.places[bin] = Place(place.superblock, place.first, units, capacity_of(bin, units, per));
    return true;
}

fn take(bin: u32, superblock: u32, first: u32, units: u32, per: u32) {
    mark(superblock, first, units, true);
    state.places[bin] = Place(superblock, first, units, capacity_of(bin, units, per));
}

// Where the rows take the fewest texels.
fn place_in_one(bin: u32, triangles: u32, is_choosy: bool) -> bool {
    var least = NONE;
    var best = vec4<u32>(NONE);
    for (var superblock = 0u; superblock < column_count; superblock++) {
        looks += 1u;
        let column = columns[superblock];
        let per = in_row(bin, column.width);
        if (looks > MOST_LOOKS || per == 0u) {
            continue;
        }
        if (is_choosy && columns_of(bin, per) * 4u < column.width * 3u) {
            continue;
        }
        let units = units_for(bin, triangles, per);
        if (units > snake.units - column.used || units * column.width >= least) {
            continue;
        }
        let first = first_fit(superblock, units);
        if (first != NOT_FOUND) {
            least = units * column.width;
            best = vec4<u32>(superblock, first, units, per);
        }
    }
    if (least != NONE) {
        take(bin, best.x, best.y, best.z, best.w);
    }
    return least != NONE;
}

// The least number whose square is no less.
fn square_root(area: u32) -> u32 {
    var root = 0u;
    for (var bit = 0x8000u; bit > 0u; bit >>= 1u) {
        let larger = root | bit;
        root = select(root, larger, larger * larger <= area);
    }
    return root + u32(root * root < area);
}

fn has_room(bin: u32, triangles: u32, width: u32) -> bool {
    let per = in_row(bin, width);
    return per > 0u && units_for(bin, triangles, max(per, 1u)) <= snake.units;
}

// About as wide as the bin in a square, but so that bins of this size fill the height.
fn place_in_new(bin: u32, triangles: u32) -> bool {
    var x = 0u;
    if (column_count > 0u) {
        x = columns[column_count - 1u].x + columns[column_count - 1u].width;
    }
    let left = snake.width - x;
    let t = templates[bin];
    let area = triangles * t.cost;
    let side = square_root(area);
    let height = snake.units * snake.unit;
    let texel_rows = height / max((2u * height + side) / (2u * side), 1u);
    let filling = (area + texel_rows - 1u) / texel_rows + t.length / 2u;
    var width = max(max(filling, snake.least_width), t.to_odd + t.length + 1u);
    width = min((width + 1u) & ~1u, left);
    // What would be left over has to be of use.
    width = select(left, width, has_room(bin, triangles, width) && left - width >= snake.least_width);
    if (column_count == MOST_SUPERBLOCKS || !has_room(bin, triangles, width)) {
        return false;
    }
    columns[column_count] = Superblock(x, width, 0u, 0u);
    for (var word = 0u; word < UNIT_WORDS; word++) {
        rows[column_count * UNIT_WORDS + word] = 0u;
    }
    column_count += 1u;
    let per = in_row(bin, width);
    take(bin, column_count - 1u, 0u, units_for(bin, triangles, per), per);
    return true;
}

fn place_bin(bin: u32, triangles: u32) -> bool {
    if (triangles > snake.width * snake.units * snake.unit / max(templates[bin].cost, 1u)) {
        return false;
    }
    return place_in_one(bin, triangles, true) || place_in_new(bin, triangles) || place_in_one(bin, triangles, false);
}

// A bin that has rows.
fn revise(bin: u32) {
    let place = state.places[bin];
    let need = need_of(bin);
    let live = live_of(bin);
    var gone = live == 0u || (need > place.capacity && !grow(bin, with_spare(need)));
    if (!gone && !is_frozen() && live * 2u < state.places[bin].capacity) {
        let least = with_spare(live);
        if (atomicLoad(&tally.ends[bin]) <= least) {
            shrink(bin, least);
        } else {
            gone = is_sparse(bin, least);
        }
    }
    if (gone) {
        mark(place.superblock, place.first, place.units, false);
        state.places[bin].superblock = NONE;
        plans[bin].flags |= MOVED;
    }
}

fn find_collapses() {
    collapses = 0u;
    for (var superblock = 0u; superblock < column_count && !is_frozen(); superblock++) {
        let column = columns[superblock];
        let falls = column.used * COLLAPSE_SHARE < snake.units && column.peak * COLLAPSE_SHARE >= 2u * snake.units;
        if (falls) {
            collapses |= 1u << superblock;
            columns[superblock].used = 0u;
            columns[superblock].peak = 0u;
            for (var word = 0u; word < UNIT_WORDS; word++) {
                rows[superblock * UNIT_WORDS + word] = 0u;
            }
        }
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
        if (!place_bin(bin, with_spare(need_of(bin)))) {
            is_full = 1u;
        }
        plans[bin].flags |= MOVED;
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
            let over = need_of(bin) + atomicLoad(&tally.idles[bin]) > state.places[bin].capacity;
            plans[bin].flags = select(0u, EVICTS, over && state.places[bin].superblock != NONE);
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
        find_collapses();
    }
    storageBarrier();
    workgroupBarrier();
    for (var bin = lane; bin < BINS; bin += LANES) {
        let superblock = state.places[bin].superblock;
        if (asking && superblock != NONE && ((collapses >> (superblock & 31u)) & 1u) != 0u) {
            state.places[bin].superblock = NONE;
            plans[bin].flags |= MOVED;
        }
    }
    storageBarrier();
    workgroupBarrier();
    let large = list_bins(lane, LARGE);
    if (lane == 0u && asking) {
        while (column_count > 0u && columns[column_count - 1u].used == 0u) {
            column_count -= 1u;
        }
        sort_list(large);
        place_list(large);
    }
    storageBarrier();
    workgroupBarrier();
    let small = list_bins(lane, SMALL);
    if (lane == 0u && asking) {
        place_list(small);
        next_verdict();
        state.looks = looks;
        let again = state.verdict < PLACED;
        state.superblock_count = select(column_count, 0u, again);
        state.looks = select(looks, 0u, again);
    }
    storageBarrier();
    workgroupBarrier();
    let again = asking && is_full != 0u && state.verdict < PLACED;
    for (var bin = lane; bin < BINS; bin += LANES) {
        if (again) {
            state.places[bin].superblock = NONE;
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
