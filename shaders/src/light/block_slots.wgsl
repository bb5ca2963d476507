// Slots that are rectangles, each of one to three triangles. The other kind:
// triangle_slots.wgsl; kernels are built with one of them.
// Twin of the mapping: atlas.rs. Source: SAS 2018, section 4.1; figure 6.

struct BlockRecord {
    first_job: u32,
    first_tile: u32,
    // x | y << 16
    position: u32,
    // log2 width | log2 height << 4 | shape << 8 | log2 stride << 10 | turned << 14 | instance << 16
    layout_bits: u32,
    first_triangle: u32,
    sample_index: u32,
    patch_id: u32,
    // Samples over which means run at most.
    longest_history: f32,
    // What old glossy samples are still worth, seen from where the eye is now.
    glossy_keep: f32,
}

alias SlotRecord = BlockRecord;

const TURNED: u32 = 1u << 14u;

// How a slot lies in the atlas.
struct Laid {
    // First of its texels.
    corner: vec2<u32>,
    size: vec2<u32>,
}

fn laid(slot: SlotRecord) -> Laid {
    return Laid(vec2<u32>(slot.position & 0xffffu, slot.position >> 16u),
        vec2<u32>(1u << (slot.layout_bits & 15u), 1u << ((slot.layout_bits >> 4u) & 15u)));
}

fn log2_stride_of(slot: SlotRecord) -> u32 {
    return (slot.layout_bits >> 10u) & 15u;
}

// All texels within the bounds are the slot's own.
const HAS_GAPS: bool = false;

fn owns(at: Laid, texel: vec2<i32>) -> bool {
    return true;
}

// Slot coordinates, here from 0 to 1 along the block's sides, of what lies `p` texels
// from the middle of the first one. What lies beyond the patch is not the slot's.
fn coordinates(at: Laid, p: vec2<f32>) -> vec2<f32> {
    let extent = vec2<f32>(at.size - 1u);
    return clamp(p, vec2<f32>(0.0), extent) / extent;
}

// The same for where a path starts: what would leave the patch is reflected back in,
// and kept off the very edge, where two walls of a corner meet.
fn start_coordinates(at: Laid, start: vec2<f32>) -> vec2<f32> {
    let extent = vec2<f32>(at.size - 1u);
    var p = start / extent;
    p = 1.0 - abs(1.0 - abs(p));
    return mix(vec2<f32>(0.02) / extent, 1.0 - vec2<f32>(0.02) / extent, clamp(p, vec2<f32>(0.0), vec2<f32>(1.0)));
}

fn texels_of_triangle(at: Laid) -> f32 {
    return max(f32(at.size.x - 1u) * f32(at.size.y - 1u), 1.0) * 0.5;
}

// The point of a slot's patch at slot coordinates.
fn surface_point(slot: SlotRecord, at: Laid, p: vec2<f32>) -> PatchPoint {
    return patch_point((slot.layout_bits >> 8u) & 3u, select(p, p.yx, (slot.layout_bits & TURNED) != 0u));
}

// The point of a patch at patch coordinates `p`.
fn patch_point(shape: u32, p_in: vec2<f32>) -> PatchPoint {
    var p = p_in;
    if (shape == 0u) {
        let over = max(p.x + p.y - 1.0, 0.0) * 0.5;
        p = max(p - over, vec2<f32>(0.0));
        return PatchPoint(0u, p);
    }
    if (shape == 1u) {
        if (p.x + p.y <= 1.0) {
            return PatchPoint(0u, p);
        }
        // Corners 1 2 3: weights 1 - v, u + v - 1, 1 - u.
        return PatchPoint(1u, vec2<f32>(p.x + p.y - 1.0, 1.0 - p.x));
    }
    let left = 2.0 * p.x + p.y;
    if (left <= 1.0) {
        // Corners 0 1 4.
        return PatchPoint(0u, vec2<f32>(2.0 * p.x, p.y));
    }
    let right = 2.0 * p.x - p.y;
    if (right >= 1.0) {
        // Corners 1 2 3.
        return PatchPoint(2u, vec2<f32>(right - 1.0, p.y));
    }
    // Corners 1 3 4.
    let b3 = p.x - 0.5 * (1.0 - p.y);
    return PatchPoint(1u, vec2<f32>(b3, p.y - b3));
}
