// Which bin a triangle belongs to, in whole numbers: 256 steps to an octave.
// Twin: bins.rs. Source: SnakeBinning 2021, sections 3.2 and 3.6.

const STRETCHES: u32 = 12u;
const TIPS: u32 = 3u;
const NEVER: i32 = 0x7fffffff;
const LONGEST: i32 = 4096;
// The logarithm of one pixel in a wish.
const PIXEL: i32 = 1024;
// How much shorter than wished a footprint may be, steps; how many halves of the
// cost it may have; how many tips further the tip may be.
const TOO_SMALL: i32 = 110;
const TOO_LARGE: u32 = 6u;
const ASIDE: u32 = 1u;

const BIN: u32 = 0xfffu;
const FORM: u32 = 0x3ffff000u;
const TURN: u32 = 0x7000u;

// Lengths between two sizes.
var<private> borders: array<i32, 31> = array<i32, 31>(
    -128, 128, 331, 459, 553, 628, 690, 743, 827, 955, 1091, 1219, 1343, 1471, 1599, 1727, 1856, 1984, 2112,
    // None beyond.
    NEVER, NEVER, NEVER, NEVER, NEVER, NEVER, NEVER, NEVER, NEVER, NEVER, NEVER, NEVER,
);

fn size_of(log: i32) -> u32 {
    var i = 0u;
    i += select(0u, 16u, borders[15u] <= log);
    i += select(0u, 8u, borders[i + 7u] <= log);
    i += select(0u, 4u, borders[i + 3u] <= log);
    i += select(0u, 2u, borders[i + 1u] <= log);
    return i + select(0u, 1u, borders[i] <= log);
}

fn bin_at(height: u32, length: u32, tip: u32) -> u32 {
    return (height * STRETCHES + length - height) * TIPS + tip;
}

// Height, length and tip of a bin.
fn parts_of(bin: u32) -> vec3<u32> {
    let height = bin / (STRETCHES * TIPS);
    return vec3<u32>(height, height + bin / TIPS % STRETCHES, bin % TIPS);
}

fn bin_of_logs(height_log: i32, length_log: i32, tip: u32) -> u32 {
    var height = size_of(height_log);
    var length = min(size_of(length_log), snake.largest);
    length = max(length, min(height, snake.largest));
    height = max(min(height, length), max(length, STRETCHES - 1u) - (STRETCHES - 1u));
    return templates[bin_at(height, length, tip)].same;
}

fn bin_of(wish: vec2<u32>, bias: i32) -> u32 {
    let shrink = bias / 2 + PIXEL;
    let height = min(i32(wish.x >> 16u), LONGEST) - shrink;
    let length = min(i32(wish.x & 0xffffu), LONGEST) - shrink;
    return bin_of_logs(height, length, ((wish.y & 0xffu) + 64u) >> 7u);
}

fn is_near(old: u32, wish: vec2<u32>, bias: i32) -> bool {
    let own = bin_of(wish, bias);
    let most = i32(templates[bin_at(snake.largest, snake.largest, 0u)].logs >> 16u);
    let wished = min(min(vec2<i32>(vec2<u32>(wish.x & 0xffffu, wish.x >> 16u)), vec2<i32>(LONGEST)) - bias / 2, vec2<i32>(most));
    let logs = templates[old].logs;
    let tips = vec2<u32>(parts_of(old).z, parts_of(own).z);
    return all(wished - vec2<i32>(vec2<u32>(logs >> 16u, logs & 0xffffu)) <= vec2<i32>(TOO_SMALL))
        && templates[old].cost * 2u <= templates[own].cost * TOO_LARGE
        && max(tips.x, tips.y) - min(tips.x, tips.y) <= ASIDE;
}

fn is_foreshortened_alike(shape: u32, form: u32) -> bool {
    let a = vec3<i32>((vec3<u32>(shape) >> vec3<u32>(15u, 20u, 25u)) & vec3<u32>(31u));
    let b = vec3<i32>((vec3<u32>(form) >> vec3<u32>(15u, 20u, 25u)) & vec3<u32>(31u));
    return all(abs(a - b) <= vec3<i32>(2));
}

// Triangles side by side in so many columns.
fn in_row(bin: u32, columns: u32) -> u32 {
    let t = templates[bin];
    let first = t.length + 1u;
    let pair = max(t.to_odd + t.to_even, 1u);
    if (columns < first) {
        return 0u;
    }
    let odd = 1u + 2u * ((columns - first) / pair);
    if (columns < first + t.to_odd) {
        return odd;
    }
    return max(odd, 2u + 2u * ((columns - first - t.to_odd) / pair));
}

// Columns that so many triangles take, at least one.
fn columns_of(bin: u32, triangles: u32) -> u32 {
    let t = templates[bin];
    let before = triangles - 1u;
    return before / 2u * (t.to_odd + t.to_even) + before % 2u * t.to_odd + t.length + 1u;
}
