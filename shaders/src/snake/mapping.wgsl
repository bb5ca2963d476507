// Maps sparse bins to fuller ones, and clears the counts that follow.
// One thread per bin. Twin: mapping.rs. Source: SnakeBinning 2021, section 3.4,
// algorithm 1.

// Bins that a source looks up in height and in length.
const RANGE: u32 = 2u;
// The first size whose sparse bins gather.
const FIRST_COARSE: u32 = 4u;

fn is_sink(bin: u32) -> bool {
    return state.rooms[bin].capacity != 0u || atomicLoad(&tally.demand[bin]) > in_row(bin, snake.least_width);
}

fn mapped(source: u32) -> u32 {
    if (is_sink(source)) {
        return source;
    }
    let parts = parts_of(source);
    let most = 2u * templates[source].cost;
    var nearest = NONE;
    var found = source;
    for (var step = 0u; step < (RANGE + 1u) * (RANGE + 1u) * TIPS; step++) {
        let height = parts.x + step / TIPS / (RANGE + 1u);
        let length = parts.y + step / TIPS % (RANGE + 1u);
        if (length > snake.largest || length < height || length - height >= STRETCHES) {
            continue;
        }
        let tip = step % TIPS;
        let candidate = bin_at(height, length, tip);
        let cost = templates[candidate].cost;
        let aside = max(tip, parts.z) - min(tip, parts.z);
        let distance = cost * TIPS + aside;
        let is_new = templates[candidate].same == candidate && aside <= ASIDE && cost <= most;
        if (is_new && distance < nearest && is_sink(candidate)) {
            nearest = distance;
            found = candidate;
        }
    }
    if (nearest == NONE && parts.x >= FIRST_COARSE) {
        let length = min(parts.y | 1u, snake.largest);
        let height = max(min(parts.x | 1u, length), max(length, STRETCHES - 1u) - (STRETCHES - 1u));
        return templates[bin_at(height, length, TIPS / 2u)].same;
    }
    return found;
}

@compute @workgroup_size(64)
fn map_bins(@builtin(global_invocation_id) id: vec3<u32>) {
    let bin = id.x;
    if (bin >= BINS || state.verdict >= PLACED) {
        return;
    }
    atomicStore(&tally.wants[bin], 0u);
    atomicStore(&tally.stays[bin], 0u);
    atomicStore(&tally.idles[bin], 0u);
    atomicStore(&tally.ends[bin], 0u);
    if (atomicLoad(&tally.demand[bin]) != 0u) {
        plans[bin].target_bin = mapped(bin);
    }
}
