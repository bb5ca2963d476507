// Which units of each superblock are taken, a bit each, while one thread works with them.
// Twin: columns.rs.

const MOST_SUPERBLOCKS: u32 = 32u;
const UNIT_WORDS: u32 = 16u;
const MOST_LOOKS: u32 = 30000u;

// The state's.
var<workgroup> rows: array<u32, 512>;
var<workgroup> columns: array<Superblock, 32>;
var<workgroup> column_count: u32;
var<private> looks: u32;

// Counts a look for room; false where there were too many.
fn may_look() -> bool {
    looks += 1u;
    return looks <= MOST_LOOKS;
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

// The first of so many free units in a row or, where there are not so many, the
// longest run of them; and how many there are.
fn free_run(superblock: u32, units: u32) -> vec2<u32> {
    var at = 0u;
    var run = 0u;
    var best = vec2<u32>(0u);
    while (at < snake.units && may_look()) {
        let inside = at % 32u;
        let word = rows[superblock * UNIT_WORDS + at / 32u] >> inside;
        let left = 32u - inside;
        if ((word & 1u) == 0u) {
            let free = min(min(countTrailingZeros(word), left), snake.units - at);
            run += free;
            at += free;
            if (run > best.y) {
                best = vec2<u32>(at - run, min(run, units));
            }
            if (run >= units) {
                break;
            }
        } else {
            at += min(countTrailingZeros(~word), left);
            run = 0u;
        }
    }
    return best;
}
