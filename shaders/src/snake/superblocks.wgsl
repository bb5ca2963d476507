// Gives bins extents, takes them back, and makes superblocks for them.
// Twin: superblocks.rs. Source: SnakeBinning 2021, section 3.5, algorithm 2.

fn extent_at(bin: u32, nth: u32) -> u32 {
    return bin * MOST_EXTENTS + nth;
}

// Units for so many triangles of which `per` stand side by side.
fn units_for(bin: u32, triangles: u32, per: u32) -> u32 {
    let texel_rows = (triangles + per - 1u) / per * (templates[bin].height + 1u);
    return (texel_rows + snake.unit - 1u) / snake.unit;
}

fn capacity_of(bin: u32, units: u32, per: u32) -> u32 {
    return units * snake.unit / (templates[bin].height + 1u) * per;
}

fn release(bin: u32) {
    for (var nth = 0u; nth < state.rooms[bin].extents; nth++) {
        let extent = state.extents[extent_at(bin, nth)];
        mark(extent.superblock, extent.first, extent.units, false);
    }
    state.rooms[bin] = Room(0u, 0u);
}

// Whether the bin, laid anew, would give a third of its texels back.
fn is_sparse(bin: u32, triangles: u32) -> bool {
    var texels = 0u;
    for (var nth = 0u; nth < state.rooms[bin].extents; nth++) {
        let extent = state.extents[extent_at(bin, nth)];
        texels += extent.units * columns[extent.superblock].width;
    }
    let width = columns[state.extents[extent_at(bin, 0u)].superblock].width;
    return units_for(bin, triangles, in_row(bin, width)) * width * 3u < texels * 2u;
}

// Gives back what is beyond room for so many triangles, from the end.
fn shrink(bin: u32, triangles: u32) {
    var room = state.rooms[bin];
    while (room.extents > 0u) {
        let at = extent_at(bin, room.extents - 1u);
        let last = state.extents[at];
        room.capacity -= last.capacity;
        let own = triangles - min(room.capacity, triangles);
        let per = in_row(bin, columns[last.superblock].width);
        let units = min(units_for(bin, own, per), last.units);
        mark(last.superblock, last.first + units, last.units - units, false);
        if (units > 0u) {
            let capacity = capacity_of(bin, units, per);
            state.extents[at] = Extent(last.superblock, last.first, units, capacity);
            room.capacity += capacity;
            break;
        }
        room.extents -= 1u;
    }
    state.rooms[bin] = room;
}

fn grow_last(bin: u32, more: u32) -> bool {
    let room = state.rooms[bin];
    if (room.extents == 0u) {
        return false;
    }
    let at = extent_at(bin, room.extents - 1u);
    let last = state.extents[at];
    let per = in_row(bin, columns[last.superblock].width);
    let units = units_for(bin, last.capacity + more, per);
    let end = last.first + last.units;
    let added = units - last.units;
    if (end + added > snake.units || !is_free(last.superblock, end, added)) {
        return false;
    }
    mark(last.superblock, end, added, true);
    let capacity = capacity_of(bin, units, per);
    state.extents[at] = Extent(last.superblock, last.first, units, capacity);
    state.rooms[bin].capacity = room.capacity - last.capacity + capacity;
    return true;
}

// Adds an extent.
fn take(bin: u32, superblock: u32, first: u32, units: u32, per: u32) {
    mark(superblock, first, units, true);
    let room = state.rooms[bin];
    let capacity = capacity_of(bin, units, per);
    state.extents[extent_at(bin, room.extents)] = Extent(superblock, first, units, capacity);
    state.rooms[bin] = Room(room.extents + 1u, room.capacity + capacity);
}

// Where the rows take the fewest texels.
fn place_in_one(bin: u32, more: u32, is_choosy: bool) -> bool {
    var least = NONE;
    var best = vec4<u32>(NONE);
    for (var superblock = 0u; superblock < column_count; superblock++) {
        let looks_on = may_look();
        let column = columns[superblock];
        let per = in_row(bin, column.width);
        if (!looks_on || per == 0u) {
            continue;
        }
        if (is_choosy && columns_of(bin, per) * 4u < column.width * 3u) {
            continue;
        }
        let units = units_for(bin, more, per);
        if (units > snake.units - column.used || units * column.width >= least) {
            continue;
        }
        let found = free_run(superblock, units);
        if (found.y == units) {
            least = units * column.width;
            best = vec4<u32>(superblock, found.x, units, per);
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
fn place_in_new(bin: u32, more: u32) -> bool {
    var x = 0u;
    if (column_count > 0u) {
        x = columns[column_count - 1u].x + columns[column_count - 1u].width;
    }
    let left = snake.width - x;
    let t = templates[bin];
    let area = more * t.cost;
    let side = square_root(area);
    let height = snake.units * snake.unit;
    let texel_rows = height / max((2u * height + side) / (2u * side), 1u);
    let filling = (area + texel_rows - 1u) / texel_rows + t.length / 2u;
    var width = max(max(filling, snake.least_width), t.to_odd + t.length + 1u);
    width = min((width + 1u) & ~1u, left);
    // What would be left over has to be of use.
    width = select(left, width, has_room(bin, more, width) && left - width >= snake.least_width);
    if (column_count == MOST_SUPERBLOCKS || !has_room(bin, more, width)) {
        return false;
    }
    columns[column_count] = Superblock(x, width, 0u, 0u);
    for (var word = 0u; word < UNIT_WORDS; word++) {
        rows[column_count * UNIT_WORDS + word] = 0u;
    }
    column_count += 1u;
    let per = in_row(bin, width);
    take(bin, column_count - 1u, 0u, units_for(bin, more, per), per);
    return true;
}

// The longest pieces that there are, one after another.
fn place_in_pieces(bin: u32, more: u32) -> bool {
    var missing = more;
    while (missing > 0u && state.rooms[bin].extents < MOST_EXTENTS) {
        var most = 0u;
        var best = vec4<u32>(0u);
        for (var superblock = 0u; superblock < column_count; superblock++) {
            let looks_on = may_look();
            let column = columns[superblock];
            let per = in_row(bin, column.width);
            if (!looks_on || per == 0u || column.used == snake.units) {
                continue;
            }
            let found = free_run(superblock, units_for(bin, missing, per));
            let room = min(capacity_of(bin, found.y, per), missing);
            if (room > most) {
                most = room;
                best = vec4<u32>(superblock, found.x, units_for(bin, room, per), per);
            }
        }
        if (most == 0u) {
            return false;
        }
        take(bin, best.x, best.y, best.z, best.w);
        missing -= most;
    }
    return missing == 0u;
}

// Makes room for so many more triangles; false if there is none, and then there may
// be some of it.
fn extend(bin: u32, more: u32) -> bool {
    if (more > snake.width * snake.units * snake.unit / max(templates[bin].cost, 1u)) {
        return false;
    }
    if (grow_last(bin, more)) {
        return true;
    }
    return state.rooms[bin].extents < MOST_EXTENTS
        && (place_in_one(bin, more, true) || place_in_new(bin, more)
            || place_in_one(bin, more, false) || place_in_pieces(bin, more));
}
