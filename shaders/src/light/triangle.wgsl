// A triangle in the atlas: which texels are its own, and where on its surface they
// lie. Twin: triangle.rs, and `TriangleSlot` of the protocol, which says what the
// numbers mean. Source: SnakeBinning (Hladky et al., 2021), section 3.7.

struct AtlasTriangle {
    // First of the texels in its bounds, and how many there are on either axis.
    corner: vec2<u32>,
    size: vec2<u32>,
    // Corners in eighths of a texel from the middle of the first texel.
    a: vec2<i32>,
    b: vec2<i32>,
    c: vec2<i32>,
    // Twice the area, in squares of those; positive where the corners turn from x to y.
    doubled: i32,
    weights: vec3<f32>,
}

// Units of corners in a texel.
const UNITS: i32 = 8;

fn unpacked(corner: u32) -> vec2<i32> {
    return vec2<i32>(vec2<u32>(corner & 0xffffu, corner >> 16u));
}

// By its corners, x | y << 16, and its weights, first | second << 16 and third.
fn atlas_triangle(corners: array<u32, 3>, weights: array<u32, 2>) -> AtlasTriangle {
    let a = unpacked(corners[0]);
    let b = unpacked(corners[1]);
    let c = unpacked(corners[2]);
    let low = min(a, min(b, c));
    let high = max(a, max(b, c));
    let first = max(low - UNITS / 2, vec2<i32>(0)) / UNITS;
    let last = (high + UNITS / 2 - 1) / UNITS;
    let middle = first * UNITS + UNITS / 2;
    var t: AtlasTriangle;
    t.corner = vec2<u32>(first);
    t.size = vec2<u32>(max(last - first + 1, vec2<i32>(1)));
    t.a = a - middle;
    t.b = b - middle;
    t.c = c - middle;
    t.doubled = turn_of(t.a, t.b, t.c);
    t.weights = vec3<f32>(vec3<u32>(weights[0] & 0xffffu, weights[0] >> 16u, weights[1] & 0xffffu));
    return t;
}

fn turn_of(a: vec2<i32>, b: vec2<i32>, p: vec2<i32>) -> i32 {
    return (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x);
}

// Whether no point of the triangle is less than a texel, along either axis, from `p`
// for lying beyond this edge.
fn is_beyond(a: vec2<i32>, b: vec2<i32>, p: vec2<i32>, turn: i32) -> bool {
    let side = turn_of(a, b, p);
    let reach = abs(b.x - a.x) + abs(b.y - a.y);
    return reach != 0 && select(-side * turn, abs(side), turn == 0) >= UNITS * reach;
}

// Whether a texel within the bounds, counted from their first, is the triangle's own.
fn owns_texel(t: AtlasTriangle, texel: vec2<i32>) -> bool {
    let p = texel * UNITS;
    let turn = sign(t.doubled);
    return !(is_beyond(t.a, t.b, p, turn) || is_beyond(t.b, t.c, p, turn) || is_beyond(t.c, t.a, p, turn));
}

// Affine barycentrics of the triangle's point that is nearest to `p`, in texels from
// the middle of the first.
fn nearest_in(t: AtlasTriangle, p: vec2<f32>) -> vec3<f32> {
    var corners = array<vec2<f32>, 3>(vec2<f32>(t.a) / f32(UNITS), vec2<f32>(t.b) / f32(UNITS), vec2<f32>(t.c) / f32(UNITS));
    if (t.doubled != 0) {
        let ab = corners[1] - corners[0];
        let ac = corners[2] - corners[0];
        let ap = p - corners[0];
        let doubled = ab.x * ac.y - ab.y * ac.x;
        let v = (ap.x * ac.y - ap.y * ac.x) / doubled;
        let w = (ab.x * ap.y - ab.y * ap.x) / doubled;
        let inside = vec3<f32>(1.0 - v - w, v, w);
        if (all(inside >= vec3<f32>(0.0))) {
            return inside;
        }
    }
    var least = 3.0e38;
    var nearest = vec3<f32>(1.0, 0.0, 0.0);
    for (var i = 0u; i < 3u; i++) {
        let j = (i + 1u) % 3u;
        let edge = corners[j] - corners[i];
        let along = clamp(dot(p - corners[i], edge) / max(dot(edge, edge), 1e-12), 0.0, 1.0);
        let off = p - corners[i] - edge * along;
        if (dot(off, off) < least) {
            least = dot(off, off);
            nearest = vec3<f32>(0.0);
            nearest[i] = 1.0 - along;
            nearest[j] += along;
        }
    }
    return nearest;
}

// Barycentrics on the surface of what lies at affine ones in the atlas.
fn on_surface(t: AtlasTriangle, affine: vec3<f32>) -> vec3<f32> {
    let weighted = affine * t.weights;
    return weighted / (weighted.x + weighted.y + weighted.z);
}

// The inverse.
fn in_atlas(t: AtlasTriangle, surface: vec3<f32>) -> vec3<f32> {
    let weighted = surface / t.weights;
    return weighted / (weighted.x + weighted.y + weighted.z);
}

// In texels from the middle of the first.
fn texel_at(t: AtlasTriangle, affine: vec3<f32>) -> vec2<f32> {
    return (vec2<f32>(t.a) * affine.x + vec2<f32>(t.b) * affine.y + vec2<f32>(t.c) * affine.z) / f32(UNITS);
}
