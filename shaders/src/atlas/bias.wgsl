// Leaves out the least important patches where the smallest blocks would be too
// many, and solves equation 3. Twin: bias.rs. Source: SAS 2018, section 4.3.

// Steps of the bias to a bin of areas.
const BIN: u32 = 8u;
// The bias of the last frame stays while this much less would do.
const DEAD_BAND: i32 = 64;
// Threads that leave out.
const CUT_LANES: u32 = 256u;

var<workgroup> area_sums: array<vec2<u32>, 256>;
var<workgroup> too_small: atomic<u32>;
var<workgroup> cut_class: u32;
var<workgroup> cut_left: u32;

// Low word first.
fn add64(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2<u32>(low, a.y + b.y + u32(low < a.x));
}

// `b` has at most 16 bits.
fn multiply64(a: u32, b: u32) -> vec2<u32> {
    let high = (a >> 16u) * b;
    return add64(vec2<u32>((a & 0xffffu) * b, 0u), vec2<u32>(high << 16u, high >> 16u));
}

// By less than 32.
fn left64(a: vec2<u32>, by: u32) -> vec2<u32> {
    let carried = select(a.x >> (32u - by), 0u, by == 0u);
    return vec2<u32>(a.x << by, (a.y << by) | carried);
}

fn right64(a: vec2<u32>, by: u32) -> vec2<u32> {
    let carried = select(a.y << (32u - by), 0u, by == 0u);
    return vec2<u32>((a.x >> by) | carried, a.y >> by);
}

fn at_most64(a: vec2<u32>, b: vec2<u32>) -> bool {
    return a.y < b.y || (a.y == b.y && a.x <= b.x);
}

// 256 times the powers of two between 1 and 2, 1/32 octave apart.
var<private> mantissas: array<u32, 32> = array<u32, 32>(
    256u, 262u, 267u, 273u, 279u, 285u, 292u, 298u, 304u, 311u, 318u, 325u, 332u, 339u, 347u, 354u,
    362u, 370u, 378u, 386u, 395u, 403u, 412u, 421u, 431u, 440u, 450u, 459u, 470u, 480u, 490u, 501u,
);

// So many blocks of a bin, in 256ths of the smallest block.
fn area_of(blocks_of_bin: u32, bin: u32) -> vec2<u32> {
    return left64(multiply64(blocks_of_bin, mantissas[bin & 31u]), bin >> 5u);
}

// The logarithm of at least one pixel, in steps of 1/8 octave or less.
fn importance(pixels: u32) -> u32 {
    let octave = firstLeadingBit(pixels);
    let shifted = select(pixels >> (max(octave, 3u) - 3u), pixels << (3u - min(octave, 3u)), octave < 3u);
    return (octave << 3u) | (shifted & 7u);
}

// One group. Each thread has consecutive patches, so that among equally
// important ones the first are kept. Always many threads: Mesa's software driver
// ends all loops of a thread after 65,535 turns.
@compute @workgroup_size(CUT_LANES)
fn leave_out(@builtin(local_invocation_index) lane: u32) {
    let crowded = state.visible > atlas.most_patches;
    let count = select(0u, state.active_count, crowded);
    if (lane == 0u && crowded) {
        var class_id = 255u;
        var left = atlas.most_patches;
        while (class_id > 0u) {
            let found = atomicLoad(&tally.classes[class_id]);
            if (found > left) {
                break;
            }
            left -= found;
            class_id -= 1u;
        }
        cut_class = class_id;
        cut_left = left;
    }
    workgroupBarrier();
    let share = (count + CUT_LANES - 1u) / CUT_LANES;
    let begin = min(lane * share, count);
    let end = min(begin + share, count);
    var own = 0u;
    for (var i = begin; i < end; i++) {
        let pixels = active_patches[i].pixels;
        own += u32(pixels != 0u && importance(pixels) == cut_class);
    }
    var rank = sum_before(lane, CUT_LANES, vec2<u32>(own, 0u)).x;
    for (var i = begin; i < end; i++) {
        let pixels = active_patches[i].pixels;
        if (pixels == 0u) {
            continue;
        }
        let class_id = importance(pixels);
        let in_class = class_id == cut_class;
        if (class_id < cut_class || (in_class && rank >= cut_left)) {
            active_patches[i].bits = (active_patches[i].bits ^ (SEEN | LEFT_OUT)) | (1u << AGE_SHIFT);
            atomicSub(&tally.areas[area_bin(wishes[active_patches[i].patch_id])], 1u);
        }
        rank += u32(in_class);
    }
}

// One group; each thread has as many bins.
@compute @workgroup_size(LANES)
fn choose_bias(@builtin(local_invocation_index) lane: u32) {
    let bins = u32(most_bias()) / BIN + 1u;
    if (lane == 0u) {
        atomicStore(&too_small, 0u);
    }
    // Sums from the top: lane 0 has the uppermost bins.
    let share = (bins + LANES - 1u) / LANES;
    let upper = (LANES - lane) * share - 1u;
    var own = 0u;
    var own_area = vec2<u32>(0u);
    for (var i = 0u; i < share; i++) {
        let bin = upper - i;
        let found = atomicLoad(&tally.areas[bin]);
        own += found;
        own_area = add64(own_area, area_of(found, bin));
    }
    var larger = sum_before(lane, LANES, vec2<u32>(own, 0u)).x;
    let all = sums[LANES - 1u].x;
    area_sums[lane] = own_area;
    for (var step = 1u; step < LANES; step *= 2u) {
        workgroupBarrier();
        var more = vec2<u32>(0u);
        if (lane >= step) {
            more = area_sums[lane - step];
        }
        workgroupBarrier();
        area_sums[lane] = add64(area_sums[lane], more);
    }
    workgroupBarrier();
    var area = vec2<u32>(0u);
    if (lane > 0u) {
        area = area_sums[lane - 1u];
    }
    for (var i = 0u; i < share; i++) {
        let bin = upper - i;
        let smallest = all - larger;
        let room = multiply64(max(atlas.most_patches, smallest) - smallest, mantissas[bin & 31u]);
        let fits = smallest <= atlas.most_patches && at_most64(right64(area, bin >> 5u), room);
        if (bin < bins && !fits) {
            atomicMax(&too_small, bin + 1u);
        }
        let found = atomicLoad(&tally.areas[bin]);
        larger += found;
        area = add64(area, area_of(found, bin));
    }
    workgroupBarrier();
    if (lane == 0u) {
        let needed = i32(min(atomicLoad(&too_small), bins - 1u) * BIN);
        let stays = needed <= atlas.bias && needed >= atlas.bias - DEAD_BAND;
        state.bias = select(needed, atlas.bias, stays);
    }
}
