// Finds the least scaling down at which all fit, and where the triangles of each kind
// lie. One group: each thread tries a scale, for what is visible or for all that was.
// Twin: `Shelves::walk` and `Packer::place` in pack.rs.

// Threads: a scale each for either of the two sets.
const TRIES: u32 = 64u;

var<workgroup> fits: array<u32, 64>;

fn counted(all: bool, height: u32, width: u32) -> u32 {
    let cell = height * CLASSES + width;
    if (all) {
        return atomicLoad(&tally.all[cell]);
    }
    return atomicLoad(&tally.seen[cell]);
}

// Triangles that are of a kind after all became smaller by `steps` classes.
fn count_of(all: bool, height: u32, width: u32, steps: u32) -> u32 {
    if (max(height, width) + steps >= CLASSES) {
        return 0u;
    }
    if (height > 0u) {
        return counted(all, height + steps, width + steps);
    }
    // All that became as low as can be, and where they are as narrow, those, too.
    var sum = 0u;
    for (var h = 0u; h <= steps; h++) {
        let narrowest = select(width + steps, h, width == 0u);
        for (var w = narrowest; w <= width + steps; w++) {
            sum += counted(all, h, w);
        }
    }
    return sum;
}

// Fills shelves with rectangles, highest first: next fit, decreasing height. Gives
// whether all fit, how many triangles there are, and the texels that they take;
// notes the places if it is to.
fn walk(all: bool, steps: u32, notes: bool) -> vec3<u32> {
    var x = tss.width;
    var y = 0u;
    var shelf_height = 0u;
    var start = 0u;
    var used = 0u;
    for (var down = 1u; down <= CLASSES; down++) {
        let height = CLASSES - down;
        for (var left = 1u; left <= CLASSES - height; left++) {
            let width = CLASSES - left;
            let count = count_of(all, height, width, steps);
            if (count == 0u) {
                continue;
            }
            let rectangle = rectangle_of(height, width);
            let rectangles = (count + rectangle.z - 1u) / rectangle.z;
            let in_shelf = min(rectangles, (tss.width - x) / rectangle.x);
            var place = CellPlace(start, in_shelf, x | (y << 16u), 0u);
            start += count;
            x += in_shelf * rectangle.x;
            let rest = rectangles - in_shelf;
            if (rest > 0u) {
                y += shelf_height;
                shelf_height = rectangle.y;
                place.next_y = y;
                let per_shelf = tss.width / rectangle.x;
                let more = (rest - 1u) / per_shelf;
                y += more * rectangle.y;
                x = (rest - more * per_shelf) * rectangle.x;
            }
            used += rectangles * rectangle.x * rectangle.y;
            if (notes) {
                cells[height * CLASSES + width] = place;
            }
        }
    }
    return vec3<u32>(u32(y + shelf_height <= tss.height), start, used);
}

@compute @workgroup_size(TRIES)
fn choose_scale(@builtin(local_invocation_index) lane: u32) {
    fits[lane] = walk(lane >= CLASSES, lane % CLASSES, false).x;
    workgroupBarrier();
    if (lane != 0u) {
        return;
    }
    var of_seen = 0u;
    while (of_seen < CLASSES && fits[of_seen] == 0u) {
        of_seen++;
    }
    var of_all = 0u;
    while (of_all < CLASSES && fits[CLASSES + of_all] == 0u) {
        of_all++;
    }
    let steps = min(of_seen, CLASSES - 1u);
    // Also where not even the smallest of all fit.
    let evict = of_all > steps;
    let placed = walk(!evict, steps, true);
    state.steps = steps;
    state.evict = u32(evict);
    state.placing = placed.y;
    state.used_texels = placed.z;
    state.status = select(STATUS_OVERFULL, 0u, placed.x != 0u)
        | select(0u, STATUS_EVICTED, evict && state.seen < state.active_count);
}
