// How much of what a block remembers still holds: all of it, unless its new paths
// together found other light by more than noise explains. One texel cannot tell; a
// block can, and so a light that moves, dims or is hidden is followed at once while
// what stands still keeps its history.
// One workgroup per block; reads what its paths of this wave found and what its
// texels remember, writes `kept`. Runs before `accumulate`.
// Related: Schied et al., "Gradient Estimation for Real-Time Adaptive Temporal
// Filtering", 2018, which traces paths again to the same end.

// Of each block: how much of its diffuse and of its glossy history holds.
@group(2) @binding(8) var<storage, read_write> kept: array<vec2<f32>>;

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
}

var<workgroup> changes: array<Change, 64>;

@compute @workgroup_size(64)
fn measure_change(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32) {
    let index = group.x + group.y * groups.x;
    if (index >= parameters.block_count) {
        return;
    }
    let block = blocks[index];
    var end = wave.first_job + wave.path_count;
    if (index + 1u < parameters.block_count) {
        end = min(end, blocks[index + 1u].first_job);
    }
    var change = Change(vec3<f32>(0.0), vec3<f32>(0.0), vec3<f32>(0.0), vec3<f32>(0.0));
    for (var i = max(block.first_job, wave.first_job) + lane; i < end; i += 64u) {
        let job = job_of(index, i);
        let at = ((block.position >> 16u) + job.corner.y) * parameters.atlas_width
            + (block.position & 0xffffu) + job.corner.x;
        let found = found_by(paths[i - wave.first_job]);
        let samples = vec3<f32>(diffuse[at].w, glossy[at].w * block.glossy_keep, diffuse[at].w);
        let remembered = vec3<f32>(luminance(diffuse[at].rgb), luminance(glossy[at].rgb), moments[at].x);
        let squares = vec3<f32>(moments[at].yz, moments[at].x);
        let spread = max(squares - remembered * remembered, vec3<f32>(0.0));
        let has_opinion = select(vec3<f32>(0.0), vec3<f32>(1.0), samples >= vec3<f32>(OPINION));
        let difference = vec3<f32>(luminance(found.diffuse), luminance(found.glossy), found.sun) - remembered;
        change.difference += difference * has_opinion;
        change.largest = max(change.largest, difference * has_opinion);
        change.variance += spread * (1.0 + 1.0 / max(samples, vec3<f32>(1.0))) * has_opinion;
        change.remembered += remembered * has_opinion;
    }
    changes[lane] = change;
    workgroupBarrier();
    if (lane != 0u) {
        return;
    }
    for (var i = 1u; i < 64u; i++) {
        change.difference += changes[i].difference;
        change.variance += changes[i].variance;
        change.remembered += changes[i].remembered;
        change.largest = max(change.largest, changes[i].largest);
    }
    change.difference -= change.largest;
    let least = NO_CHANGE * max(change.remembered, abs(change.difference));
    // Ratios of roots: squares of the brightest light leave the range of f32.
    let surprise = abs(change.difference) / max(sqrt(change.variance) + least, vec3<f32>(1e-18));
    let keep = clamp(CHANGED / max(surprise * surprise, vec3<f32>(1e-6)), vec3<f32>(LEAST_KEPT), vec3<f32>(1.0));
    kept[index] = vec2<f32>(min(keep.x, keep.z), keep.y);
}
