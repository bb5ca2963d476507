// How much of what a tile of a slot remembers still holds: all of it, unless its new
// paths together found other light by more than noise explains. One texel cannot tell;
// a tile can, and so a light that moves, dims or is hidden is followed at once, where
// its shadow falls, while what stands still keeps its history.
// One workgroup per tile, a thread per path; reads what the paths of this wave found
// and what texels remember, writes `judgements`. Runs before `accumulate`.
// Related: Schied et al., "Gradient Estimation for Real-Time Adaptive Temporal
// Filtering", 2018, which traces paths again to the same end.

struct Judgement {
    // How much of the tile's diffuse and of its glossy history holds.
    kept: vec2<f32>,
    // Luminance that a diffuse and a glossy path usually bring here.
    usual: vec2<f32>,
    // What one path is short of by `limited`, on average over the tile's in the wave.
    diffuse_excess: vec3<f32>,
    // Paths that the cells about the tile have heard of, on average.
    around: f32,
    glossy_excess: vec3<f32>,
    padding: u32,
}

@group(2) @binding(8) var<storage, read_write> judgements: array<Judgement>;

// Samples that a texel needs to have an opinion.
const OPINION: f32 = 2.0;
// Relative difference that is no change, whatever its variance.
const NO_CHANGE: f32 = 0.03;
// Square of the difference, in variances, from which on light has changed, where this
// many samples or fewer are remembered. Of more samples as many more would be lost by
// chance: the bound grows as a normal distribution's tail asks for it.
const CHANGED: f32 = 3.0;
const FEW_SAMPLES: f32 = 8.0;
// Least of a history that is kept.
const LEAST_KEPT: f32 = 0.02;

// Sums over texels; diffuse light, glossy light, and the sun's visibility.
struct Change {
    difference: vec3<f32>,
    // Of the difference, were it noise alone.
    variance: vec3<f32>,
    remembered: vec3<f32>,
    // The farthest differences either way, which are left out: a path in a thousand that
    // finds a lamp in a mirror is no change, and neither is one that is shadowed.
    highest: vec3<f32>,
    lowest: vec3<f32>,
    // Without what the sun brings.
    found: vec2<f32>,
    brightest: vec2<f32>,
    paths: f32,
    // That what is remembered is worth, diffuse and glossy.
    samples: vec2<f32>,
    // Light of the cells that the paths add to, and its paths.
    around: vec2<f32>,
}

struct Excess {
    diffuse: vec3<f32>,
    glossy: vec3<f32>,
}

var<workgroup> changes: array<Change, 64>;
var<workgroup> excesses: array<Excess, 64>;
var<workgroup> judged: Judgement;

@compute @workgroup_size(64)
fn measure_change(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32) {
    let tile = group.x + group.y * groups.x;
    if (tile >= parameters.tile_count) {
        return;
    }
    let slot = slot_with(tile, true);
    let across = jobs_across(slot);
    let columns = tiles_across(slot).x;
    let size = tile_size(slot);
    let inside = vec2<u32>(lane % TILE_SIDE, lane / TILE_SIDE);
    let place = vec2<u32>((tile - slot.first_tile) % columns, (tile - slot.first_tile) / columns) * size + inside;
    // Of the wave; of another one it wraps around, and is too large.
    let index = slot.first_job + place.y * across.x + place.x - wave.first_job;
    var is_traced = all(inside < size) && all(place < across) && index < wave.path_count;
    var change: Change;
    var found: Found;
    var at = 0u;
    if (is_traced) {
        let job = job_of(slot, place);
        at = index_of_texel(job.laid, job.first);
        is_traced = job.stride != 0u;
    }
    if (is_traced) {
        found = found_by(paths[index]);
        change = change_by(at, slot, found, cell_light(paths[index].cell));
    }
    changes[lane] = change;
    workgroupBarrier();
    if (lane == 0u) {
        for (var i = 1u; i < 64u; i++) {
            change.difference += changes[i].difference;
            change.variance += changes[i].variance;
            change.remembered += changes[i].remembered;
            change.highest = max(change.highest, changes[i].highest);
            change.lowest = min(change.lowest, changes[i].lowest);
            change.found += changes[i].found;
            change.brightest = max(change.brightest, changes[i].brightest);
            change.paths += changes[i].paths;
            change.samples += changes[i].samples;
            change.around += changes[i].around;
        }
        judged = judgement_of(change);
    }
    workgroupBarrier();
    var excess: Excess;
    if (SMOOTHING && is_traced) {
        let judgement = judged;
        let histories = histories_at(at, slot, paths[index], judgement);
        let accepted = accepted_at(at, found, OUTSHINING, histories, judgement);
        excess = Excess(found.diffuse - accepted.diffuse, found.glossy - accepted.glossy);
    }
    excesses[lane] = excess;
    workgroupBarrier();
    if (lane == 0u) {
        for (var i = 1u; i < 64u; i++) {
            excess.diffuse += excesses[i].diffuse;
            excess.glossy += excesses[i].glossy;
        }
        judged.diffuse_excess = excess.diffuse / max(change.paths, 1.0);
        judged.glossy_excess = excess.glossy / max(change.paths, 1.0);
        judgements[tile] = judged;
    }
}

// What one path says, whose first texel is `at`.
fn change_by(at: u32, slot: SlotRecord, found: Found, around: vec4<f32>) -> Change {
    let samples = vec3<f32>(diffuse[at].w, glossy[at].w * slot.glossy_keep, diffuse[at].w);
    let remembered = vec3<f32>(luminance(diffuse[at].rgb), luminance(glossy[at].rgb), moments[at].x);
    let squares = vec3<f32>(moments[at].yz, moments[at].x);
    // Samples that were all alike do not make it certain that the next one is.
    let doubt = max(remembered * remembered, vec3<f32>(0.0, 0.0, 1.0)) / (samples + 2.0);
    let spread = max(squares - remembered * remembered, doubt);
    let has_opinion = select(vec3<f32>(0.0), vec3<f32>(1.0), samples >= vec3<f32>(OPINION));
    let brightness = vec2<f32>(luminance(found.diffuse), luminance(found.glossy));
    let difference = vec3<f32>(brightness, found.sun) - remembered;
    var change: Change;
    change.found = brightness;
    change.brightest = brightness;
    change.paths = 1.0;
    change.samples = samples.xy;
    change.around = vec2<f32>(luminance(around.rgb), around.w);
    change.difference = difference * has_opinion;
    change.highest = max(change.difference, vec3<f32>(0.0));
    change.lowest = min(change.difference, vec3<f32>(0.0));
    change.variance = spread * (1.0 + 1.0 / max(samples, vec3<f32>(1.0))) * has_opinion;
    change.remembered = remembered * has_opinion;
    return change;
}

fn judgement_of(of_all: Change) -> Judgement {
    let difference = of_all.difference - of_all.highest - of_all.lowest;
    let least = NO_CHANGE * max(of_all.remembered, abs(difference));
    // Ratios of roots: squares of the brightest light leave the range of f32.
    let surprise = abs(difference) / max(sqrt(of_all.variance) + least, vec3<f32>(1e-18));
    let mean_samples = (of_all.samples / max(of_all.paths, 1.0)).xyx;
    let changed = CHANGED + 2.0 * log(max(mean_samples / FEW_SAMPLES, vec3<f32>(1.0)));
    let keep = clamp(changed / max(surprise * surprise, vec3<f32>(1e-6)), vec3<f32>(LEAST_KEPT), vec3<f32>(1.0));
    var judgement: Judgement;
    judgement.kept = vec2<f32>(min(keep.x, keep.z), keep.y);
    // Without the brightest path: it is the one in question.
    judgement.usual = max(of_all.found - of_all.brightest, vec2<f32>(0.0)) / max(of_all.paths - 1.0, 1.0);
    judgement.usual.x = max(judgement.usual.x, of_all.around.x / max(of_all.around.y, 1.0));
    judgement.around = of_all.around.y / max(of_all.paths, 1.0);
    return judgement;
}
