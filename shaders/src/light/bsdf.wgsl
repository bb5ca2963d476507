// glTF's metallic-roughness surface: a dielectric that mixes Lambert and GGX by
// Fresnel, mixed with a metal by metalness.
// Source: glTF 2.0 specification, appendix B; sampling by visible normals after
// Heitz, "Sampling the GGX Distribution of Visible Normals", JCGT 2018.

struct Frame {
    x: vec3<f32>,
    y: vec3<f32>,
    z: vec3<f32>,
}

// Source: Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 2017.
fn frame_around(n: vec3<f32>) -> Frame {
    let s = select(-1.0, 1.0, n.z >= 0.0);
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    return Frame(
        vec3<f32>(1.0 + s * n.x * n.x * a, s * b, -s * n.x),
        vec3<f32>(b, s + n.y * n.y * a, -n.y),
        n,
    );
}

fn to_world(f: Frame, v: vec3<f32>) -> vec3<f32> {
    return f.x * v.x + f.y * v.y + f.z * v.z;
}

fn to_local(f: Frame, v: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot(f.x, v), dot(f.y, v), dot(f.z, v));
}

fn cosine_hemisphere(u: vec2<f32>) -> vec3<f32> {
    let r = sqrt(u.x);
    let phi = 2.0 * PI * u.y;
    return vec3<f32>(r * cos(phi), r * sin(phi), sqrt(max(1.0 - u.x, 0.0)));
}

fn schlick(cosine: f32) -> f32 {
    let m = clamp(1.0 - cosine, 0.0, 1.0);
    let m2 = m * m;
    return m2 * m2 * m;
}

// GGX density of half vectors about a normal. The sine is that of the cross product:
// in a narrow lobe, 1 - cos² would be little but the rounding of the cosine.
fn ggx_d(n: vec3<f32>, h: vec3<f32>, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    let cosine = dot(n, h);
    let across = cross(n, h);
    let d = a2 * cosine * cosine + dot(across, across);
    return a2 / (PI * d * d);
}

// Smith's shadowing of one direction, divided by nothing: G1.
fn ggx_g1(cosine: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    return 2.0 * cosine / (cosine + sqrt(a2 + (1.0 - a2) * cosine * cosine));
}

// Height-correlated visibility: G / (4 cos_o cos_i).
fn ggx_v(cos_o: f32, cos_i: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    let o = cos_i * sqrt(cos_o * cos_o * (1.0 - a2) + a2);
    let i = cos_o * sqrt(cos_i * cos_i * (1.0 - a2) + a2);
    return 0.5 / max(o + i, 1e-12);
}

fn specular_share(s: Surface, cos_o: f32) -> f32 {
    let f = schlick(cos_o);
    let dielectric = s.f0 + (1.0 - s.f0) * f;
    let metal = luminance(s.base) * (1.0 - f) + f;
    let specular = mix(dielectric, metal, s.metallic);
    let diffuse = (1.0 - s.metallic) * luminance(s.base) * (1.0 - dielectric);
    // No lobe that there is goes without samples, and none that is not gets any:
    // wasted samples would multiply the weight of all others at each bounce.
    let least = min(vec2<f32>(specular, diffuse) * 2.5, vec2<f32>(0.1));
    return clamp(specular / max(specular + diffuse, 1e-6), least.x, 1.0 - least.y);
}

// The BSDF times the cosine, lobe by lobe.
struct BsdfValue {
    // To be multiplied by `diffuse_color`.
    diffuse: f32,
    specular: vec3<f32>,
    // Density of `sample_bsdf` in solid angle.
    pdf: f32,
}

fn diffuse_color(s: Surface) -> vec3<f32> {
    return s.base * (1.0 - s.metallic);
}

fn both_lobes(s: Surface, value: BsdfValue) -> vec3<f32> {
    return diffuse_color(s) * value.diffuse + value.specular;
}

fn evaluate_bsdf(s: Surface, wo: vec3<f32>, wi: vec3<f32>) -> BsdfValue {
    let cos_i = dot(s.ns, wi);
    let cos_o = dot(s.ns, wo);
    if (cos_i <= 0.0 || cos_o <= 0.0 || dot(s.ng, wi) <= 0.0) {
        return BsdfValue(0.0, vec3<f32>(0.0), 0.0);
    }
    let h = normalize(wo + wi);
    let fresnel = schlick(dot(wo, h));
    let d = ggx_d(s.ns, h, s.alpha);
    let specular = d * ggx_v(cos_o, cos_i, s.alpha);
    let dielectric_f = s.f0 + (1.0 - s.f0) * fresnel;
    let metal_f = s.base + (1.0 - s.base) * fresnel;
    let share = specular_share(s, cos_o);
    let pdf_specular = d * ggx_g1(cos_o, s.alpha) / (4.0 * cos_o);
    return BsdfValue(
        (1.0 - dielectric_f) * cos_i / PI,
        mix(vec3<f32>(dielectric_f), metal_f, s.metallic) * specular * cos_i,
        mix(cos_i / PI, pdf_specular, share),
    );
}

// A direction for the next segment; `u_lobe` chooses the lobe. Zero where the
// sampled direction leaves through the surface.
fn sample_bsdf(s: Surface, wo: vec3<f32>, u: vec2<f32>, u_lobe: f32) -> vec3<f32> {
    let f = frame_around(s.ns);
    let cos_o = dot(s.ns, wo);
    var wi: vec3<f32>;
    if (u_lobe < specular_share(s, cos_o)) {
        let o = to_local(f, wo);
        let stretched = normalize(vec3<f32>(s.alpha * o.x, s.alpha * o.y, o.z));
        let across = stretched.x * stretched.x + stretched.y * stretched.y;
        let t1 = select(vec3<f32>(1.0, 0.0, 0.0),
            vec3<f32>(-stretched.y, stretched.x, 0.0) * inverseSqrt(max(across, 1e-20)), across > 1e-12);
        let t2 = cross(stretched, t1);
        let r = sqrt(u.x);
        let phi = 2.0 * PI * u.y;
        let a = r * cos(phi);
        let k = 0.5 * (1.0 + stretched.z);
        let b = mix(sqrt(max(1.0 - a * a, 0.0)), r * sin(phi), k);
        let n = t1 * a + t2 * b + stretched * sqrt(max(1.0 - a * a - b * b, 0.0));
        let h = normalize(vec3<f32>(s.alpha * n.x, s.alpha * n.y, max(n.z, 1e-6)));
        wi = to_world(f, reflect(-o, h));
    } else {
        wi = to_world(f, cosine_hemisphere(u));
    }
    if (dot(wi, s.ng) <= 0.0 || dot(wi, s.ns) <= 0.0) {
        return vec3<f32>(0.0);
    }
    return normalize(wi);
}
