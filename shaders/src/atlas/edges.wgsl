// Lengths and areas as an eye sees them. Twin: footprint.rs.
// Source: SAS 2018, section 4.3, equation 1.

const SMALLEST_LENGTH: f32 = 1e-3;

fn is_number(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7fffffffu) <= 0x7f800000u;
}

// Length of an edge in pixels of a sphere about the eye: equation 1.
fn pixels_of_edge(a: vec3<f32>, b: vec3<f32>, eye: vec3<f32>, pixels_per_radian: f32) -> f32 {
    let to_a = a - eye;
    let to_b = b - eye;
    // Crossing with the edge itself keeps the small angles that crossing two
    // nearly parallel rays would cancel.
    var angle = atan2(length(cross(to_a, b - a)), dot(to_a, to_b));
    if (all(a == b)) {
        angle = 0.0;
    } else if (all(to_a == vec3<f32>(0.0)) || all(to_b == vec3<f32>(0.0))) {
        angle = 1.57079632679;
    }
    let pixels = angle * pixels_per_radian;
    return select(0.0, max(pixels, 0.0), is_number(pixels));
}

// Heron's formula in Kahan's order.
fn triangle_area(p: f32, q: f32, r: f32) -> f32 {
    let a = max(p, max(q, r));
    let c = min(p, min(q, r));
    let b = max(min(p, q), min(max(p, q), r));
    // In units of the longest side, so that no product overflows.
    let s = max(a, 1e-30);
    let product = (1.0 + (b + c) / s) * ((c - (a - b)) / s) * ((c + (a - b)) / s) * (1.0 + (b - c) / s);
    return 0.25 * sqrt(max(product, 0.0)) * s * s;
}

// log2 in 256ths of an octave; 0 for what is no number.
fn steps_of(log2_value: f32) -> i32 {
    return i32(select(0.0, clamp(round(log2_value * 256.0), -65536.0, 65536.0), is_number(log2_value)));
}
