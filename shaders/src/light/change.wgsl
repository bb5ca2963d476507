// How much of what a slot remembers still holds: all of it, unless its new paths
// together found other light by more than noise explains. One texel cannot tell; a
// slot can, and so a light that moves, dims or is hidden is followed at once while
// what stands still keeps its history.
// One workgroup per slot; reads what its paths of this wave found and what its
// texels remember, writes `judgements`. Runs before `accumulate`.
// Related: Schied et al., "Gradient Estimation for Real-Time Adaptive Temporal
// Filtering", 2018, which traces paths again to the same end.

struct Judgement {
    // How much of the slot's diffuse and of its glossy history holds.
    kept: vec2<f32>,
    // Luminance that a diffuse and a glossy path usually bring here.
    usual: vec2<f32>,
    // What one path is short of by `limited`, on average over the wave's paths.
    diffuse_excess: vec3<f32>,
    // Paths that the cells about the slot have heard of, on average.
    around: f32,
    glossy_excess: vec3<f32>,
    padding: u32,
}

@group(2) @binding(8) var<storage, read_write> judgements: array<Judgement>;

// Samples that a texel needs to have an opinion.
const OPINION: f32 = 2.0;
// Relative difference that is no change, whatever its variance.
const NO_CHANGE: f32 = 0.03;
// Square of the difference, in variances, from which on light has changed.
const CHANGED: f32 = 9.0;
// Least of a history that is kept.
const LEAST_KEPT: f32 = 0.02;

// Sums over texels; diffuse light, glossy light, and the sun's visibility.
struct Change {
    difference: vec3<f32>,
    // Of the difference, were it noise alone.
    variance: vec3<f32>,
    remembered: vec3<f32>,
    // Of the differences upwards: a path in a thousand that finds a lamp in a mirror
    // is no change, and is left out.
    largest: vec3<f32>,
    // Without what the sun brings.
    found: vec2<f32>,
    brightest: vec2<f32>,
    paths: f32,
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
    let index = group.x + group.y * groups.x;
    if (index >= parameters.slot_count) {
        return;
    }
    let slot = slots[index];
    var end = wave.first_job + wave.path_count;
    if (index + 1u < parameters.slot_count) {
        end = min(end, slots[index + 1u].first_job);
    }
    let first = max(slot.first_job, wave.first_job) + lane;
    var change: Change;
    for (var i = first; i < end; i += 64u) {
        let job = job_of(index, i);
        if (HAS_GAPS && job.stride == 0u) {
            continue;
        }
        let at = index_of_texel(job.laid, job.first);
        let path = paths[i - wave.first_job];
        let found = found_by(path);
        let samples = vec3<f32>(diffuse[at].w, glossy[at].w * slot.glossy_keep, diffuse[at].w);
        let remembered = vec3<f32>(luminance(diffuse[at].rgb), luminance(glossy[at].rgb), moments[at].x);
        let squares = vec3<f32>(moments[at].yz, moments[at].x);
        let spread = max(squares - remembered * remembered, vec3<f32>(0.0));
        let has_opinion = select(vec3<f32>(0.0), vec3<f32>(1.0), samples >= vec3<f32>(OPINION));
        let brightness = vec2<f32>(luminance(found.diffuse), luminance(found.glossy));
        change.found += brightness;
        change.brightest = max(change.brightest, brightness);
        change.paths += 1.0;
        let around = cell_light(path.cell);
        change.around += vec2<f32>(luminance(around.rgb), around.w);
        let difference = vec3<f32>(brightness, found.sun) - remembered;
        change.difference += difference * has_opinion;
        change.largest = max(change.largest, difference * has_opinion);
        change.variance += spread * (1.0 + 1.0 / max(samples, vec3<f32>(1.0))) * has_opinion;
        change.remembered += remembered * has_opinion;
    }
    changes[lane] = change;
    workgroupBarrier();
    if (lane == 0u) {
        for (var i = 1u; i < 64u; i++) {
            change.difference += changes[i].difference;
            change.variance += changes[i].variance;
            change.remembered += changes[i].remembered;
            change.largest = max(change.largest, changes[i].largest);
            change.found += changes[i].found;
            change.brightest = max(change.brightest, changes[i].brightest);
            change.paths += changes[i].paths;
            change.around += changes[i].around;
        }
        judged = judgement_of(change);
    }
    workgroupBarrier();
    let judgement = judged;
    var excess: Excess;
    for (var i = first; SMOOTHING && i < end; i += 64u) {
        let job = job_of(index, i);
        if (HAS_GAPS && job.stride == 0u) {
            continue;
        }
        let at = index_of_texel(job.laid, job.first);
        let path = paths[i - wave.first_job];
        let found = found_by(path);
        let accepted = accepted_at(at, found, histories_at(at, slot, path, judgement), judgement);
        excess.diffuse += found.diffuse - accepted.diffuse;
        excess.glossy += found.glossy - accepted.glossy;
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
        judgements[index] = judged;
    }
}

fn judgement_of(of_all: Change) -> Judgement {
    let difference = of_all.difference - of_all.largest;
    let least = NO_CHANGE * max(of_all.remembered, abs(difference));
    // Ratios of roots: squares of the brightest light leave the range of f32.
    let surprise = abs(difference) / max(sqrt(of_all.variance) + least, vec3<f32>(1e-18));
    let keep = clamp(CHANGED / max(surprise * surprise, vec3<f32>(1e-6)), vec3<f32>(LEAST_KEPT), vec3<f32>(1.0));
    var judgement: Judgement;
    judgement.kept = vec2<f32>(min(keep.x, keep.z), keep.y);
    // Without the brightest path: it is the one in question.
    judgement.usual = max(of_all.found - of_all.brightest, vec2<f32>(0.0)) / max(of_all.paths - 1.0, 1.0);
    judgement.usual.x = max(judgement.usual.x, of_all.around.x / max(of_all.around.y, 1.0));
    judgement.around = of_all.around.y / max(of_all.paths, 1.0);
    return judgement;
}
