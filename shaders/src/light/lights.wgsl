// Light that reaches a surface without another bounce: the sun, one of the lamps
// by what it can send there, the sky at the last vertex.

const INFINITE: f32 = 3.0e38;

struct LightSample {
    direction: vec3<f32>,
    distance: f32,
    // Unshadowed radiance, divided by its density.
    incoming: vec3<f32>,
    bsdf: BsdfValue,
}

const NO_LIGHT = LightSample(vec3<f32>(0.0), 0.0, vec3<f32>(0.0), BsdfValue(0.0, vec3<f32>(0.0), 0.0));

fn sample_cone(axis: vec3<f32>, cos_max: f32, u: vec2<f32>) -> vec3<f32> {
    // One less the cosine, of which the sine keeps its digits in a narrow cone.
    let drop = u.x * (1.0 - cos_max);
    let sine = sqrt(drop * (2.0 - drop));
    let phi = 2.0 * PI * u.y;
    return normalize(to_world(frame_around(axis), vec3<f32>(cos(phi) * sine, sin(phi) * sine, 1.0 - drop)));
}

fn sun_sample(s: Surface, wo: vec3<f32>, u: vec2<f32>) -> LightSample {
    let wi = sample_cone(globals.sun_direction, globals.sun_cos, u);
    return LightSample(wi, INFINITE, globals.sun_irradiance, evaluate_bsdf(s, wo, wi));
}

// glTF's recommended windowing of the inverse square.
fn attenuation(distance: f32, range: f32) -> f32 {
    let q = distance / range;
    let window = clamp(1.0 - q * q * q * q, 0.0, 1.0);
    return window / max(distance * distance, 1e-8);
}

// What the lamps below a node can send to a point at most, but for shadows: zero
// only where none of them can send anything.
fn importance(node: LightNode, p: vec3<f32>, n: vec3<f32>) -> f32 {
    if (node.radius < 0.0) {
        return node.power;
    }
    let to_centre = node.centre - p;
    let distance = length(to_centre);
    let nearest = max(distance, max(node.radius, 1e-6));
    // No point of the sphere is higher above the surface.
    let received = clamp((dot(n, to_centre) + node.radius) / nearest, 0.0, 1.0);
    // The angle between the axis and the way here, less the spread of the axes
    // and the angle that the sphere subtends.
    let sin_sphere = min(node.radius / nearest, 1.0);
    let cos_sphere = sqrt(1.0 - sin_sphere * sin_sphere);
    let sin_spread = sqrt(max(1.0 - node.cos_spread * node.cos_spread, 0.0));
    let sin_both = sin_spread * cos_sphere + node.cos_spread * sin_sphere;
    let cos_both = node.cos_spread * cos_sphere - sin_spread * sin_sphere;
    let cosine = -dot(node.axis, to_centre) / nearest;
    let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    let aside = select(cosine * cos_both + sine * sin_both, 1.0, cosine >= cos_both);
    let sent = select(clamp(aside, 0.0, 1.0), 1.0, cos_both <= 0.0 || sin_both < 0.0);
    return node.power * received * sent / (nearest * nearest);
}

const LIGHT_LEAF: u32 = 0x80000000u;

struct LampChoice {
    light: u32,
    // Zero where no lamp reaches the point.
    probability: f32,
}

// One of the lamps, by what it can send to a point.
fn choose_lamp(p: vec3<f32>, n: vec3<f32>, u_in: f32) -> LampChoice {
    if (!LIGHT_SELECTION) {
        let count = f32(globals.light_count);
        return LampChoice(min(u32(u_in * count), globals.light_count - 1u), 1.0 / count);
    }
    var u = u_in;
    var probability = 1.0;
    var child = light_nodes[0].child;
    while ((child & LIGHT_LEAF) == 0u) {
        let a = importance(light_nodes[child], p, n);
        let b = importance(light_nodes[child + 1u], p, n);
        if (a + b <= 0.0) {
            return LampChoice(0u, 0.0);
        }
        let share = a / (a + b);
        let second = u >= share;
        u = clamp(select(u / max(share, 1e-20), (u - share) / max(1.0 - share, 1e-20), second), 0.0, 0.99999994);
        probability *= select(share, 1.0 - share, second);
        child = light_nodes[child + select(0u, 1u, second)].child;
    }
    return LampChoice(child & ~LIGHT_LEAF, probability);
}

// Probability with which `choose_lamp` finds the light at the end of a trail.
fn probability_of(trail: u32, p: vec3<f32>, n: vec3<f32>) -> f32 {
    if (!LIGHT_SELECTION) {
        return 1.0 / f32(globals.light_count);
    }
    var probability = 1.0;
    var rest = trail;
    var child = light_nodes[0].child;
    while ((child & LIGHT_LEAF) == 0u) {
        let a = importance(light_nodes[child], p, n);
        let b = importance(light_nodes[child + 1u], p, n);
        let taken = select(a, b, (rest & 1u) != 0u);
        probability *= select(0.0, taken / (a + b), taken > 0.0);
        child = light_nodes[child + (rest & 1u)].child;
        rest >>= 1u;
    }
    return probability;
}

// Density by area with which `lamp_sample` finds points of a triangle; zero
// where it is no lamp.
fn lamp_density(triangle: u32, p: vec3<f32>, n: vec3<f32>) -> f32 {
    var low = globals.punctual_count;
    var high = globals.light_count;
    while (low < high) {
        let middle = (low + high) / 2u;
        if (lights[middle].triangle < triangle) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    if (low >= globals.light_count || lights[low].triangle != triangle) {
        return 0.0;
    }
    return probability_of(lights[low].trail, p, n) / lights[low].area;
}

// What a sample of density `pdf` counts where another technique finds the same
// light with density `other`: the balance heuristic.
fn shared_weight(pdf: f32, other: f32) -> f32 {
    return pdf / (pdf + other);
}

// Light from one of the lamps. With `with_bsdf_rays`, emissive triangles are
// also met by BSDF samples.
fn lamp_sample(s: Surface, wo: vec3<f32>, u_choice: f32, u: vec2<f32>, with_bsdf_rays: bool) -> LightSample {
    let origin = offset_origin(s);
    let choice = choose_lamp(origin, s.ns, u_choice);
    if (choice.probability <= 0.0) {
        return NO_LIGHT;
    }
    let light = lights[choice.light];
    if (light.kind == 3u) {
        return LightSample(-light.direction, INFINITE, light.intensity / choice.probability,
            evaluate_bsdf(s, wo, -light.direction));
    }
    if (light.kind != 0u) {
        let to_light = light.position - origin;
        let distance = length(to_light);
        if (distance < 1e-6) {
            return NO_LIGHT;
        }
        let wi = to_light / distance;
        var strength = attenuation(distance, light.range) / choice.probability;
        if (light.kind == 2u) {
            let t = clamp((dot(-wi, light.direction) - light.cos_outer)
                / max(light.cos_inner - light.cos_outer, 1e-4), 0.0, 1.0);
            strength *= t * t;
        }
        return LightSample(wi, distance, light.intensity * strength, evaluate_bsdf(s, wo, wi));
    }
    // A point on the triangle, uniform by area.
    let root = sqrt(u.x);
    let b = vec2<f32>(root * (1.0 - u.y), root * u.y);
    let p0 = vertex_position(light.triangle, 0u);
    let e1 = vertex_position(light.triangle, 1u) - p0;
    let e2 = vertex_position(light.triangle, 2u) - p0;
    var p = p0 + e1 * b.x + e2 * b.y;
    var n = normalize(cross(e1, e2));
    if (HAS_MOVERS && light.instance != 0u) {
        p = transform_point(instances[light.instance].world_from_object, p);
        n = transform_vector(instances[light.instance].world_from_object, n);
    }
    let to_light = p - origin;
    let distance = length(to_light);
    if (distance < 1e-6) {
        return NO_LIGHT;
    }
    let wi = to_light / distance;
    let record = triangles[light.triangle];
    let material = materials[record.w & MATERIAL_MASK];
    var cosine = -dot(n, wi);
    cosine = select(cosine, abs(cosine), material.double_sided != 0u);
    if (cosine <= 1e-6) {
        return NO_LIGHT;
    }
    var emission = material.emissive;
    if (HAS_TEXTURES && material.textures[3].offset != NONE) {
        let uv = corners[record.x * 3u + 2u] * (1.0 - b.x - b.y)
            + corners[record.y * 3u + 2u] * b.x + corners[record.z * 3u + 2u] * b.y;
        emission *= texture_at(material.textures[3], uv.xy, uv.zw, 0.0).rgb;
    }
    if (HAS_MASKS && material.alpha_cutoff >= 0.0) {
        emission *= opacity(light.triangle, b);
    }
    let pdf = choice.probability / light.area * distance * distance / cosine;
    let bsdf = evaluate_bsdf(s, wo, wi);
    let weight = select(1.0, shared_weight(pdf, bsdf.pdf), with_bsdf_rays && MULTIPLE_IMPORTANCE);
    return LightSample(wi, distance, emission * (weight / pdf), bsdf);
}

// Light from the picture of all directions. With `with_bsdf_rays` as above.
fn environment_sample(s: Surface, wo: vec3<f32>, u_cell: vec2<f32>, u: vec2<f32>, with_bsdf_rays: bool) -> LightSample {
    let found = sample_environment(u_cell, u);
    let bsdf = evaluate_bsdf(s, wo, found.direction);
    let weight = select(1.0, shared_weight(found.density, bsdf.pdf), with_bsdf_rays && MULTIPLE_IMPORTANCE);
    return LightSample(found.direction, INFINITE, sky_radiance(found.direction) * (weight / found.density), bsdf);
}

// What the sky sends along a ray that the BSDF chose.
fn sky_by_bsdf(direction: vec3<f32>, pdf: f32) -> vec3<f32> {
    let other = environment_density(direction);
    let share = select(select(1.0, 0.0, other > 0.0), shared_weight(pdf, other), MULTIPLE_IMPORTANCE);
    // A camera's ray has no density: nothing else finds what it finds.
    return sky_radiance(direction) * select(1.0, share, pdf > 0.0);
}

// The same by a shadow ray, at a vertex that sends no other.
fn sky_sample(s: Surface, wo: vec3<f32>, u: vec2<f32>, u_lobe: f32) -> LightSample {
    let wi = sample_bsdf(s, wo, u, u_lobe);
    let bsdf = evaluate_bsdf(s, wo, wi);
    if (bsdf.pdf <= 0.0) {
        return NO_LIGHT;
    }
    return LightSample(wi, INFINITE, sky_by_bsdf(wi, bsdf.pdf) / bsdf.pdf, bsdf);
}

// Adds a candidate to a reservoir of one.
fn consider(s: Surface, chosen: ptr<function, LightSample>, total: ptr<function, f32>, u: ptr<function, f32>,
    next: LightSample) {
    let weight = luminance(both_lobes(s, next.bsdf) * next.incoming);
    if (weight <= 0.0) {
        return;
    }
    *total += weight;
    let p = weight / *total;
    if (*u < p) {
        *chosen = next;
        *u = *u / p;
    } else {
        *u = (*u - p) / (1.0 - p);
    }
    *u = clamp(*u, 0.0, 0.99999994);
}

// Direct light but for the sun's: one candidate of each kind, and one of them by
// what it would bring. With `with_bsdf_rays` a ray onwards follows.
fn light_sample(s: Surface, wo: vec3<f32>, with_bsdf_rays: bool, rng: Sampler) -> LightSample {
    var chosen = NO_LIGHT;
    var total = 0.0;
    let choice = sample_pair(rng, PAIR_CHOICE);
    var u = choice.x;
    if (HAS_SKY && !with_bsdf_rays) {
        consider(s, &chosen, &total, &u,
            sky_sample(s, wo, sample_pair(rng, PAIR_SKY), sample_pair(rng, PAIR_SKY_LOBE).x));
    }
    if (has_picture()) {
        consider(s, &chosen, &total, &u,
            environment_sample(s, wo, sample_pair(rng, PAIR_CELL), sample_pair(rng, PAIR_IN_CELL), true));
    }
    if (HAS_LIGHTS) {
        consider(s, &chosen, &total, &u,
            lamp_sample(s, wo, choice.y, sample_pair(rng, PAIR_LAMP), with_bsdf_rays));
    }
    let weight = luminance(both_lobes(s, chosen.bsdf) * chosen.incoming);
    if (weight > 0.0) {
        chosen.incoming *= total / weight;
    }
    return chosen;
}
