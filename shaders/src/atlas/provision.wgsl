// The provisioning phase: finds room for all requests, one thread per column
// width, or says what must be done first. One group.
// Twin: superblocks.rs. Source: SAS 2018, section 4.2, table 1 and figure 8.

// Superblocks of a width: needed in an empty atlas, drawn now, and drawn now if
// patches out of sight give their blocks back.
var<workgroup> draws: array<vec3<u32>, 16>;
var<workgroup> found: u32;
var<workgroup> overflows: atomic<u32>;

// Sums stop at the largest number: what is that long fits nowhere.
fn add_up(a: u32, b: u32) -> u32 {
    return select(a + b, 0xffffffffu, a + b < a);
}

fn length_of(blocks_of_height: u32, height: u32) -> u32 {
    return select(blocks_of_height << height, 0xffffffffu, (blocks_of_height >> (32u - height)) != 0u);
}

// Texels of column length in a superblock; a power of two.
fn log2_capacity(width: u32) -> u32 {
    return 2u * atlas.log2_side - width;
}

fn superblocks_for(length: u32, width: u32) -> u32 {
    let log2 = log2_capacity(width);
    return (length >> log2) + u32((length & ((1u << log2) - 1u)) != 0u);
}

fn superblock_of(width: u32, nth: u32) -> u32 {
    let tail = state.old_tail[width];
    let fresh = state.first_fresh[width] + nth - u32(tail != NONE);
    return select(fresh, tail, tail != NONE && nth == 0u);
}

// Where the block begins that lies `start` texels of column length into the
// superblocks of a width.
fn position_at(width: u32, start: u32) -> u32 {
    let log2 = log2_capacity(width);
    let superblock = superblock_of(width, start >> log2);
    let inside = start & ((1u << log2) - 1u);
    let column = inside >> atlas.log2_side;
    let x = ((superblock % atlas.per_row) << atlas.log2_side) + (column << width);
    let y = ((superblock / atlas.per_row) << atlas.log2_side) + (inside & ((1u << atlas.log2_side) - 1u));
    return x | (y << 16u);
}

fn stack_room(width: u32, height: u32) -> u32 {
    // An atlas of 2^32 texels has no stacks that the device could bind.
    return (atlas.superblocks << (2u * atlas.log2_side - width - height));
}

fn decide() -> u32 {
    var all = vec3<u32>(0u);
    for (var width = atlas.log2_side; width > 0u; width--) {
        all = vec3<u32>(add_up(all.x, draws[width].x), add_up(all.y, draws[width].y), add_up(all.z, draws[width].z));
    }
    let raised = (state.status & STATUS_RAISED) != 0u;
    if (all.x > atlas.budget && !raised && state.bias < most_bias()) {
        return RAISE;
    }
    let free = atlas.superblocks - min(state.taken, atlas.superblocks);
    let evicts = all.y > 0u;
    let drawn = select(all.y, all.z, evicts);
    let anew = (state.status & STATUS_RESET) != 0u;
    if (anew) {
        if (drawn > free) {
            state.status |= STATUS_BROKEN;
            return BROKEN;
        }
    } else {
        if (drawn > free) {
            state.status |= STATUS_FULL;
        } else if (free - drawn < atlas.least_free) {
            state.status |= STATUS_HIGH_WATER;
        }
        if ((state.status & (STATUS_FULL | STATUS_HIGH_WATER)) != 0u || atlas.reset != 0u) {
            state.status |= STATUS_RESET;
            state.taken = 0u;
            return ASK_ANEW;
        }
    }
    state.evict = u32(evicts);
    for (var width = atlas.log2_side; width > 0u; width--) {
        state.first_fresh[width] = state.taken;
        state.taken += select(draws[width].y, draws[width].z, evicts);
    }
    return PLACED;
}

@compute @workgroup_size(16)
fn provision(@builtin(local_invocation_index) width: u32) {
    let asking = is_asking();
    let in_use = asking && width >= 1u && width <= atlas.log2_side;
    if (in_use) {
        var needed = 0u;
        let has_tail = state.tail_superblock[width] != NONE;
        var kept = select(0u, state.tail_filled[width], has_tail);
        var evicted = kept;
        for (var height = 1u; height <= width; height++) {
            let level = index_of(width, height);
            let wanted = state.requested[level];
            let stacked = state.stacked[level] + state.released[level];
            let with_idle = stacked + state.idle[level];
            needed = add_up(needed, length_of(atomicLoad(&tally.levels[level]), height));
            kept = add_up(kept, length_of(wanted - min(wanted, stacked), height));
            evicted = add_up(evicted, length_of(wanted - min(wanted, with_idle), height));
        }
        let drawn = vec2<u32>(superblocks_for(kept, width), superblocks_for(evicted, width)) - u32(has_tail);
        draws[width] = vec3<u32>(superblocks_for(needed, width), drawn);
    }
    workgroupBarrier();
    if (width == 0u) {
        atomicStore(&overflows, 0u);
        if (asking) {
            found = decide();
            state.verdict = found;
        }
    }
    storageBarrier();
    workgroupBarrier();
    if (in_use && found == ASK_ANEW) {
        state.tail_superblock[width] = NONE;
        state.tail_filled[width] = 0u;
        for (var height = 1u; height <= width; height++) {
            let level = index_of(width, height);
            state.stacked[level] = 0u;
            atomicStore(&tally.levels[level], 0u);
        }
    }
    if (in_use && found == PLACED && !provision_width(width)) {
        atomicStore(&overflows, 1u);
    }
    workgroupBarrier();
    if (width == 0u && asking && atomicLoad(&overflows) != 0u) {
        state.status |= STATUS_BROKEN;
        state.verdict = BROKEN;
    }
}

// The stacks come first. What they cannot serve tops up the tail and then fresh
// superblocks, tallest blocks first, so that every block is aligned to its
// height. The end is rounded up to a square, and what lies between goes to the
// stacks (figure 8, e). False where a stack would hold more than an atlas can.
fn provision_width(width: u32) -> bool {
    var fits = true;
    let tail = state.tail_superblock[width];
    state.old_tail[width] = tail;
    var end = select(0u, state.tail_filled[width], tail != NONE);
    for (var height = width; height > 0u; height--) {
        let level = index_of(width, height);
        let before = state.stacked[level];
        let top = before + state.released[level] + select(0u, state.idle[level], state.evict != 0u);
        let wanted = state.requested[level];
        let required = wanted - min(wanted, top);
        state.stacked_before[level] = before;
        state.top[level] = top;
        state.required[level] = required;
        state.offset[level] = end >> height;
        end += required << height;
    }
    for (var height = 1u; height <= width; height++) {
        let level = index_of(width, height);
        if (height < width && ((end >> height) & 1u) == 1u) {
            let top = state.top[level];
            if (top < stack_room(width, height)) {
                stacks[state.stack_base[level] + top] = position_at(width, end);
            }
            state.top[level] = top + 1u;
            end += 1u << height;
        }
        fits &= state.top[level] <= stack_room(width, height);
        let served = state.requested[level] - state.required[level];
        state.stacked[level] = state.top[level] - served;
    }
    let filled = end & ((1u << log2_capacity(width)) - 1u);
    state.tail_filled[width] = filled;
    state.tail_superblock[width] = NONE;
    if (filled != 0u) {
        state.tail_superblock[width] = superblock_of(width, end >> log2_capacity(width));
    }
    return fits;
}
