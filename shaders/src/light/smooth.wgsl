// Makes what is shown of slots that were lit or moved: smooths what few samples
// have lit, and puts it on the surface.
//
// Diffuse light, glossy light and the share of the sun that is seen are each the mean
// over a small window of the slot, each neighbour counting by its samples and by how
// likely the difference is noise; diffuse light besides over the surroundings in the
// world, which reach across the borders of patches. All fades out as the texel's own
// error falls, so that a still scene converges to what was traced. Colour, normal,
// emission and the sun's reflection are those of the texel's middle: they are free of
// noise.
// One workgroup per slot; reads the scene and what texels remember, writes `shown`.
// Source: Schied et al., "Spatiotemporal Variance-Guided Filtering", 2017,
// sections 4.1 and 4.4, with one small window instead of a pyramid.

@group(2) @binding(5) var<storage, read_write> shown: array<vec4<f32>>;

// Texels on either side that are looked at.
const RADIUS: i32 = 3;
// Relative error that smoothing is believed to make: a texel whose own is far
// below it stands for itself.
const SMOOTHING_ERROR: f32 = 0.08;
// Standard deviations of difference that still count as noise: of a few samples, which
// know little of their own variance, and of many. Where many kept as wide a tolerance,
// corners and what lies hidden behind a step counted as noise, and darkened the steps.
const TOLERANCE: f32 = 3.0;
const FIRM_TOLERANCE: f32 = 1.0;
// Samples half way between both: a compromise of the demo, where paths are rare, and
// of `sequence` at six a pixel.
const FIRM_SAMPLES: f32 = 12.0;
// Tolerance for the share of the sun, whose shadows have edges.
const SHARE_TOLERANCE: f32 = 0.7;

// Relative standard deviation that a sample has at least. Reflections of wide lamps
// have hardly any, and shapes that smoothing would take from them.
const LEAST_NOISE: f32 = 0.8;
const LEAST_GLOSSY_NOISE: f32 = 0.5;
// Samples of a texel by which the surroundings count half as much: they know less
// and less that it does not know itself, and are wider than its window.
const SURROUNDED_SAMPLES: f32 = 4.5;

// Turn of the normal, in GGX alphas, that one look at the sun's reflection covers,
// and looks along a texel's side at most.
const LOBE_LOOK: f32 = 0.5;
const MOST_LOOKS: f32 = 4.0;

// Variance of a mean of `samples` samples with this mean square.
fn variance_of(mean: f32, mean_square: f32, samples: f32) -> f32 {
    let measured = max(mean_square - mean * mean, 0.0);
    let assumed = ASSUMED_NOISE * ASSUMED_NOISE * mean * mean;
    return mix(assumed, measured, clamp((samples - 1.0) / 8.0, 0.0, 1.0)) / max(samples, 0.02);
}

// How much a texel stands for itself beside what it is smoothed to. Samples that
// all found nothing do not make it certain that there is nothing to find.
fn own_share(variance: f32, samples: f32, least_noise: f32, smoothed: f32) -> f32 {
    let believed = SMOOTHING_ERROR * SMOOTHING_ERROR * smoothed * smoothed;
    let least = least_noise * least_noise * smoothed * smoothed / max(samples, 0.02);
    return believed / max(believed + max(variance, least), 1e-20);
}

// Variance of a share that so many samples have found. Samples that all found the same
// do not make it certain: it is that after one more of either kind (Laplace's rule).
fn variance_of_share(share: f32, samples: f32) -> f32 {
    let believed = (share * samples + 1.0) / (samples + 2.0);
    return believed * (1.0 - believed) / max(samples, 0.02);
}

// How much a neighbour counts whose mean differs by `difference`, for a texel of
// `samples` samples.
fn likeness(difference: f32, variance: f32, samples: f32) -> f32 {
    let tolerance = mix(FIRM_TOLERANCE, TOLERANCE, FIRM_SAMPLES / (FIRM_SAMPLES + samples));
    return exp(-difference * difference / (tolerance * tolerance * max(variance, 1e-8)));
}

// The interpolated vertex normal of a slot's surface at `p`, in texels from the middle
// of the first one, on the side of `wo`.
fn vertex_normal_at(slot: SlotRecord, at: Laid, p: vec2<f32>, ng: vec3<f32>) -> vec3<f32> {
    let point = surface_point(slot, at, coordinates(at, p));
    let record = triangles[slot.first_triangle + point.triangle];
    var n = corners[record.x * 3u].xyz * (1.0 - point.b.x - point.b.y) + corners[record.y * 3u].xyz * point.b.x
        + corners[record.z * 3u].xyz * point.b.y;
    let instance = slot.layout_bits >> 16u;
    if (HAS_MOVERS && instance != 0u) {
        n = transform_vector(instances[instance].world_from_object, n);
    }
    return select(-n, n, dot(n, ng) >= 0.0);
}

// The sun by both lobes, where all of it is seen, as the mean over the texel at `p`:
// on a bent surface a highlight narrower than a texel would flare or be missed. A
// lobe narrower than the sun shows the sun's disc.
fn sunlight(slot: SlotRecord, at: Laid, seen: Seen, p: vec2<f32>) -> vec3<f32> {
    var s = seen.surface;
    s.alpha = max(s.alpha, sqrt(max(2.0 - 2.0 * globals.sun_cos, 0.0)));
    // What lies beyond the patch is not the texel's.
    let low = inside_bounds(at, p - 0.5);
    let high = inside_bounds(at, p + 0.5);
    let corner = vertex_normal_at(slot, at, low, s.ng);
    let turns = vec2<f32>(
        length(vertex_normal_at(slot, at, vec2<f32>(high.x, low.y), s.ng) - corner),
        length(vertex_normal_at(slot, at, vec2<f32>(low.x, high.y), s.ng) - corner));
    let looks = vec2<i32>(clamp(ceil(turns / (LOBE_LOOK * s.alpha)), vec2<f32>(1.0), vec2<f32>(MOST_LOOKS)));
    if (all(looks == vec2<i32>(1))) {
        return both_lobes(s, evaluate_bsdf(s, seen.wo, globals.sun_direction)) * globals.sun_irradiance;
    }
    // What one look covers widens its lobe: Tokuyoshi and Kaplanyan, "Improved
    // Geometric Specular Antialiasing", 2019, section 3.
    let covered = turns / vec2<f32>(looks);
    s.alpha = min(sqrt(s.alpha * s.alpha + dot(covered, covered) / 6.0), 1.0);
    let middle = vertex_normal_at(slot, at, p, s.ng);
    let mapped = select(s.ns - normalize(middle), vec3<f32>(0.0), dot(middle, seen.wo) < 0.01);
    var sum = vec3<f32>(0.0);
    for (var i = 0; i < looks.x * looks.y; i++) {
        let inside = (vec2<f32>(vec2<i32>(i % looks.x, i / looks.x)) + 0.5) / vec2<f32>(looks);
        s.ns = facing(normalize(vertex_normal_at(slot, at, mix(low, high, inside), s.ng)) + mapped, seen.wo);
        sum += both_lobes(s, evaluate_bsdf(s, seen.wo, globals.sun_direction));
    }
    return sum / f32(looks.x * looks.y) * globals.sun_irradiance;
}

fn inside_bounds(at: Laid, p: vec2<f32>) -> vec2<f32> {
    return clamp(p, vec2<f32>(0.0), vec2<f32>(at.size - 1u));
}

@compute @workgroup_size(64)
fn smooth_slots(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32) {
    let index = group.x + group.y * groups.x;
    if (index >= parameters.slot_count) {
        return;
    }
    let slot = slots[index];
    let laid_here = laid(slot);
    let size = vec2<i32>(laid_here.size);
    let corner = vec2<i32>(laid_here.corner);
    let width = i32(parameters.atlas_width);
    for (var i = i32(lane); i < size.x * size.y; i += 64) {
        let p = vec2<i32>(i % size.x, i / size.x);
        if (HAS_GAPS && !owns(laid_here, p)) {
            continue;
        }
        let at = u32((corner.y + p.y) * width + corner.x + p.x);
        let here = diffuse[at];
        if (here.w <= 0.0) {
            shown[at] = vec4<f32>(0.0);
            continue;
        }
        let seen = seen_surface(slot, laid_here, coordinates(laid_here, vec2<f32>(p)), 1u);
        let s = seen.surface;
        let shiny = glossy[at];
        var diffuse_light = here.rgb;
        var glossy_light = shiny.rgb;
        var sun_share = moments[at].x;
        if (SMOOTHING) {
            let mean = vec2<f32>(luminance(here.rgb), luminance(shiny.rgb));
            let variance = vec2<f32>(variance_of(mean.x, moments[at].y, here.w),
                variance_of(mean.y, moments[at].z, shiny.w));
            var sum = vec3<f32>(0.0);
            var sum_glossy = vec3<f32>(0.0);
            var weights = vec2<f32>(0.0);
            let share_variance = variance_of_share(sun_share, here.w);
            var sum_share = 0.0;
            var weight_of_shares = 0.0;
            let low = max(p - RADIUS, vec2<i32>(0));
            let high = min(p + RADIUS, size - 1);
            for (var y = low.y; y <= high.y; y++) {
                for (var x = low.x; x <= high.x; x++) {
                    if (HAS_GAPS && !owns(laid_here, vec2<i32>(x, y))) {
                        continue;
                    }
                    let near = u32((corner.y + y) * width + corner.x + x);
                    let other = diffuse[near];
                    let other_glossy = glossy[near];
                    let other_mean = vec2<f32>(luminance(other.rgb), luminance(other_glossy.rgb));
                    let other_variance = vec2<f32>(variance_of(other_mean.x, moments[near].y, other.w),
                        variance_of(other_mean.y, moments[near].z, other_glossy.w));
                    let weight = vec2<f32>(
                        other.w * likeness(other_mean.x - mean.x, variance.x + other_variance.x, here.w),
                        other_glossy.w * likeness(other_mean.y - mean.y, variance.y + other_variance.y, shiny.w));
                    sum += other.rgb * weight.x;
                    sum_glossy += other_glossy.rgb * weight.y;
                    weights += weight;
                    if (HAS_SUN) {
                        let variance = share_variance + variance_of_share(moments[near].x, other.w);
                        let difference = (moments[near].x - moments[at].x) / SHARE_TOLERANCE;
                        let weight = other.w * exp(-difference * difference / max(variance, 1e-12));
                        sum_share += moments[near].x * weight;
                        weight_of_shares += weight;
                    }
                }
            }
            let window = luminance(sum) / max(weights.x, 1e-6);
            let around = light_around(s.position, s.ng, window, weights.x);
            let known = here.w / SURROUNDED_SAMPLES;
            let trust = around.w / (1.0 + known * known);
            let smoothed = (sum + around.rgb * trust) / max(weights.x + trust, 1e-6);
            let smoothed_glossy = sum_glossy / max(weights.y, 1e-6);
            diffuse_light = mix(smoothed, here.rgb, own_share(variance.x, here.w, LEAST_NOISE, luminance(smoothed)));
            let believed = SMOOTHING_ERROR * SMOOTHING_ERROR;
            sun_share = mix(sum_share / max(weight_of_shares, 1e-6), sun_share, believed / (believed + share_variance));
            glossy_light = mix(smoothed_glossy, shiny.rgb, own_share(variance.y, shiny.w, LEAST_GLOSSY_NOISE, luminance(smoothed_glossy)));
        }
        var light = s.emissive + diffuse_color(s) * diffuse_light + glossy_light;
        if (HAS_SUN) {
            light += sun_share * sunlight(slot, laid_here, seen, vec2<f32>(p));
        }
        shown[at] = vec4<f32>(sound(light), here.w);
    }
}
