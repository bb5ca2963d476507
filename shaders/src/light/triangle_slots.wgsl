// Slots that are triangles, each of one triangle, beside others in the same bounds.
// The other kind: block_slots.wgsl; kernels are built with one of them.

struct TriangleRecord {
    first_job: u32,
    first_tile: u32,
    // log2 stride << 10 | instance << 16
    layout_bits: u32,
    first_triangle: u32,
    sample_index: u32,
    patch_id: u32,
    // Samples over which means run at most.
    longest_history: f32,
    // What old glossy samples are still worth, seen from where the eye is now.
    glossy_keep: f32,
    // See `atlas_triangle`.
    corners: array<u32, 3>,
    weights: array<u32, 2>,
}

alias SlotRecord = TriangleRecord;

// How a slot lies in the atlas.
alias Laid = AtlasTriangle;

fn laid(slot: SlotRecord) -> Laid {
    return atlas_triangle(slot.corners, slot.weights);
}

fn log2_stride_of(slot: SlotRecord) -> u32 {
    return (slot.layout_bits >> 10u) & 15u;
}

// Texels within the bounds may be another slot's.
const HAS_GAPS: bool = true;

fn owns(at: Laid, texel: vec2<i32>) -> bool {
    return owns_texel(at, texel);
}

// Slot coordinates, here texels from the middle of the first one. A texel beside the
// triangle has the triangle's nearest point.
fn coordinates(at: Laid, p: vec2<f32>) -> vec2<f32> {
    return p;
}

// The same for where a path starts: kept off the very edge, where two walls of a
// corner meet.
fn start_coordinates(at: Laid, p: vec2<f32>) -> vec2<f32> {
    let ab = vec2<f32>(at.b - at.a);
    let bc = vec2<f32>(at.c - at.b);
    let ca = vec2<f32>(at.a - at.c);
    let longest = sqrt(max(dot(ab, ab), max(dot(bc, bc), dot(ca, ca))));
    // Of the way to the middle: a fiftieth of a texel where the triangle is thinnest.
    let inwards = min(0.06 * f32(UNITS) * longest / max(abs(f32(at.doubled)), 1.0), 0.5);
    return texel_at(at, mix(nearest_in(at, p), vec3<f32>(1.0 / 3.0), inwards));
}

fn texels_of_triangle(at: Laid) -> f32 {
    return max(0.5 * abs(f32(at.doubled)) / f32(UNITS * UNITS), 0.5);
}

// The point of a slot's triangle at slot coordinates.
fn surface_point(slot: SlotRecord, at: Laid, p: vec2<f32>) -> PatchPoint {
    return PatchPoint(0u, on_surface(at, nearest_in(at, p)).yz);
}
