// Finds the least bias at which what is seen fits, and whether triangles stay in
// their bins. One group; each thread tries biases of its own.
// Twin: scale.rs. Source: ours; SnakeBinning 2021, section 3.6 for freezing.

const BIAS_STEP: i32 = 64;
const MOST_BIAS: i32 = 6400;
const DEAD_BAND: i32 = 128;
const FREEZE_FRAMES: u32 = 6u;
const SMALL_CHANGE: u32 = 20u;

var<workgroup> least_fit: atomic<u32>;

// Stops at the largest number: what costs that much does not fit.
fn add_cost(sum: u32, count: u32, cost: u32) -> u32 {
    if (cost != 0u && count > 0xffffffffu / cost) {
        return 0xffffffffu;
    }
    let all = sum + count * cost;
    return select(all, 0xffffffffu, all < sum);
}

@compute @workgroup_size(LANES)
fn choose_scale(@builtin(local_invocation_index) lane: u32) {
    if (lane == 0u) {
        atomicStore(&least_fit, u32(MOST_BIAS / BIAS_STEP));
    }
    workgroupBarrier();
    for (var step = i32(lane); step < MOST_BIAS / BIAS_STEP; step += i32(LANES)) {
        if (u32(step) > atomicLoad(&least_fit)) {
            break;
        }
        var texels = 0u;
        for (var cell = 0u; cell < CELLS; cell++) {
            let count = atomicLoad(&tally.cells[cell]);
            if (count != 0u) {
                let height = i32(cell / 20u) * 64 + 32 - PIXEL - step * BIAS_STEP / 2;
                let bin = bin_of_cell(height, height + i32(cell % 20u) * 64);
                texels = add_cost(texels, count, templates[bin].cost);
            }
        }
        if (texels <= snake.budget) {
            atomicMin(&least_fit, u32(step));
        }
    }
    workgroupBarrier();
    if (lane == 0u) {
        let needed = i32(atomicLoad(&least_fit)) * BIAS_STEP;
        let stays = needed <= snake.bias && needed >= snake.bias - DEAD_BAND;
        state.bias = select(needed, snake.bias, stays);
        let is_small = state.changed < (state.visible + SMALL_CHANGE - 1u) / SMALL_CHANGE;
        let freezes = is_small && state.frozen_for < FREEZE_FRAMES && state.bias == snake.bias && snake.reset == 0u;
        state.frozen_for = select(0u, state.frozen_for + 1u, freezes);
        state.status |= select(0u, STATUS_FROZEN, freezes);
    }
}

fn bin_of_cell(height_log: i32, length_log: i32) -> u32 {
    var height = size_of(height_log);
    var length = min(size_of(length_log), snake.largest);
    length = max(length, min(height, snake.largest));
    height = max(min(height, length), max(length, STRETCHES - 1u) - (STRETCHES - 1u));
    return bin_at(height, length, TIPS / 2u);
}
