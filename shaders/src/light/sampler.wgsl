// Owen-scrambled Sobol points in pairs of dimensions.
// Twin: sampler.rs. Source: Burley, "Practical Hash-based Owen Scrambling", JCGT 2020.

struct Sampler {
    index: u32,
    seed: u32,
    dimension: u32,
}

// Samples after which a pair of dimensions starts over with another scrambling.
const SHUFFLE_BITS: u32 = 12u;

fn laine_karras(x_in: u32, seed: u32) -> u32 {
    var x = x_in + seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    x ^= x * 0x8d22f6e6u;
    return x;
}

fn owen(x: u32, seed: u32) -> u32 {
    return reverseBits(laine_karras(reverseBits(x), seed));
}

fn unit_from_bits(x: u32) -> f32 {
    return f32(x >> 8u) * (1.0 / 16777216.0);
}

// The next pair of dimensions, uniform in [0, 1)².
fn sample_2d(s: ptr<function, Sampler>) -> vec2<f32> {
    let pair = hash((*s).seed ^ ((*s).dimension * 0x9e3779b9u) ^ ((*s).index >> SHUFFLE_BITS) * 0x85ebca6bu);
    (*s).dimension += 1u;
    if (!LOW_DISCREPANCY) {
        let x = hash(pair ^ (*s).index * 0xc2b2ae35u);
        return vec2<f32>(unit_from_bits(x), unit_from_bits(hash(x ^ 0x68bc21ebu)));
    }
    let index = owen((*s).index, pair) & ((1u << SHUFFLE_BITS) - 1u);
    let x = reverseBits(index);
    var y = 0u;
    var direction = 0x80000000u;
    for (var i = index; i != 0u; i >>= 1u) {
        y ^= select(0u, direction, (i & 1u) != 0u);
        direction ^= direction >> 1u;
    }
    return vec2<f32>(
        unit_from_bits(reverseBits(laine_karras(reverseBits(x), hash(pair ^ 0x68bc21ebu)))),
        unit_from_bits(reverseBits(laine_karras(reverseBits(y), hash(pair ^ 0x02e5be93u)))),
    );
}

// The pair of dimensions this far behind the next.
fn sample_pair(s_in: Sampler, pair: u32) -> vec2<f32> {
    var s = s_in;
    s.dimension += pair;
    return sample_2d(&s);
}
