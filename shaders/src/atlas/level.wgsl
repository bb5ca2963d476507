// How large a block a patch gets, in whole numbers: 256 steps to an octave.
// Twin: level.rs. Source: SAS 2018, section 4.3, equation 2.

const OCTAVE: i32 = 256;
const LEAST_AREA: i32 = 512;
// Twice the drift of a side within which a block stays.
const HYSTERESIS: i32 = 333;

fn most_area() -> i32 {
    return i32(atlas.log2_side) * 2 * OCTAVE;
}

fn most_bias() -> i32 {
    return most_area() - LEAST_AREA;
}

// Area and aspect of a wish at a bias, within what blocks can be.
fn wish_within(word: u32, bias: i32) -> vec2<i32> {
    let most = most_area();
    let area = clamp(min(i32(word & 0xffffu), most) - bias, LEAST_AREA, most);
    let widest = min(area - LEAST_AREA, most - area);
    return vec2<i32>(area, clamp(bitcast<i32>(word) >> 16u, -widest, widest));
}

// width | height << 4, log2 along the patch's own axes.
fn rounded_level(wish: vec2<i32>) -> u32 {
    let area = (wish.x + OCTAVE / 2) >> 8u;
    let parity = area & 1;
    let most = i32(atlas.log2_side) * 2;
    var aspect = 2 * ((abs(wish.y) - parity * OCTAVE + OCTAVE) >> 9u) + parity;
    aspect = max(min(min(aspect, area - 2), most - area), parity);
    aspect = select(aspect, -aspect, wish.y < 0);
    return u32((area + aspect) >> 1u) | (u32((area - aspect) >> 1u) << 4u);
}

// `current` is the level of the patch's block, or NO_LEVEL.
fn steady_level(current: u32, word: u32, bias: i32) -> u32 {
    let wish = wish_within(word, bias);
    let twice_sides = vec2<i32>(wish.x + wish.y, wish.x - wish.y);
    let sides = vec2<i32>(i32(current & 15u), i32((current >> 4u) & 15u));
    let stays = all(abs(twice_sides - 2 * OCTAVE * sides) <= vec2<i32>(HYSTERESIS));
    return select(rounded_level(wish), current, current != NO_LEVEL && stays);
}

// Of a landscape block: below LEVELS.
fn index_of(width: u32, height: u32) -> u32 {
    return width * (width - 1u) / 2u + height - 1u;
}

fn index_of_level(level: u32) -> u32 {
    let sides = vec2<u32>(level & 15u, (level >> 4u) & 15u);
    return index_of(max(sides.x, sides.y), min(sides.x, sides.y));
}

fn level_count() -> u32 {
    return index_of(atlas.log2_side, atlas.log2_side) + 1u;
}

// log2 of the ideal area in smallest blocks, in steps of 1/32 octave.
fn area_bin(word: u32) -> u32 {
    return u32((clamp(i32(word & 0xffffu), LEAST_AREA, most_area()) - LEAST_AREA + 4) >> 3u);
}
