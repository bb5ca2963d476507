use std::collections::HashMap;

use proptest::prelude::*;

use super::*;

/// Texels that bilinear lookups in a triangle with these corners may touch: those
/// about whose centre an open square of two texels meets it. Found by cutting the
/// triangle with the square's rows in fine steps, not by the formula of `owned`.
fn touched(corners: [[u32; 2]; 3]) -> Vec<[i32; 2]> {
    let corners = corners.map(|c| c.map(f64::from));
    let (mut found, fine) = (Vec::new(), 64);
    let rows = corners.map(|c| c[1]);
    let (top, bottom) = (
        rows.iter().copied().fold(f64::MAX, f64::min),
        rows.iter().copied().fold(0.0, f64::max),
    );
    for row in top as i32..=bottom as i32 {
        let (mut first, mut last) = (f64::MAX, f64::MIN);
        for step in 1 - fine..fine {
            let y = f64::from(row) + f64::from(step) / f64::from(fine);
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                let ([ax, ay], [bx, by]) = (corners[a], corners[b]);
                let at = if ay == by {
                    f64::NAN
                } else {
                    (y - ay) / (by - ay)
                };
                if (0.0..=1.0).contains(&at) {
                    let x = ax + (bx - ax) * at;
                    (first, last) = (first.min(x), last.max(x));
                }
                for [x, cy] in [[ax, ay], [bx, by]] {
                    if (cy - f64::from(row)).abs() < 1.0 {
                        (first, last) = (first.min(x), last.max(x));
                    }
                }
            }
        }
        let begin = (first - 1.0 + 1e-9).floor() as i32 + 1;
        let end = (last + 1.0 - 1e-9).ceil() as i32 - 1;
        found.extend((begin..=end).map(|column| [column, row]));
    }
    found
}

#[test]
fn borders_lie_between_sizes() {
    for (pair, border) in SIZES.windows(2).zip(BORDERS).skip(1) {
        let between = (f64::from(pair[0]) * f64::from(pair[1])).log2() * 128.0;
        assert!(
            (f64::from(border) - between).abs() < 1.0,
            "{border} for {between}"
        );
    }
    let listed: Vec<String> = BORDERS.iter().map(i32::to_string).collect();
    let kernel: String = include_str!("../bins.wgsl").split_whitespace().collect();
    assert!(
        kernel.contains(&listed.join(",")),
        "the kernel has other borders"
    );
}

#[test]
fn sizes_are_nearest_to_lengths() {
    let log = |x: f64| (x.log2() * 256.0).round() as i32;
    for (x, size) in [
        (0.01, 0),
        (0.8, 1),
        (1.4, 1),
        (1.5, 2),
        (9.6, 11),
        (300.0, 256),
        (1e5, 362),
    ] {
        assert_eq!(SIZES[size_of(log(x)) as usize], size, "{x}");
    }
}

#[test]
fn bins_are_numbered_without_gaps() {
    let templates = templates();
    assert_eq!(templates.len(), BINS);
    for number in 0..BINS as u32 {
        let (height, length, tip) = parts(number);
        assert_eq!(bin(height, length, tip), number);
        let template = templates[number as usize];
        assert_eq!(template.to_odd == 0, length as usize >= SIZES.len());
        let same = templates[template.same as usize];
        assert_eq!(
            (same.height, same.length, same.tip),
            (template.height, template.length, template.tip)
        );
        assert!(template.same <= number && same.same == template.same);
    }
}

/// Over rows of every footprint: no texel is touched from two triangles, and each
/// touched texel is in the rows and columns that the row counts.
#[test]
fn neighbours_share_no_texel() {
    let all = templates();
    let distinct = (0..)
        .zip(&all)
        .filter(|(number, t)| t.same == *number && t.to_odd != 0 && t.length <= 64);
    for (_, template) in distinct {
        let count = 7;
        let columns = template.columns(count);
        assert_eq!(template.in_row(columns), count);
        assert!(template.in_row(columns - 1) < count);
        let mut owner: HashMap<[i32; 2], u32> = HashMap::new();
        for n in 0..count {
            let x = n / 2 * (template.to_odd + template.to_even) + n % 2 * template.to_odd;
            for texel in touched(template.corners([x, 0], n % 2 == 1)) {
                assert!((0..columns as i32).contains(&texel[0]), "{template:?}");
                assert!((0..=template.height as i32).contains(&texel[1]));
                let before = owner.insert(texel, n);
                assert!(
                    before.is_none(),
                    "{before:?} and {n} of {template:?} share {texel:?}"
                );
            }
        }
    }
}

/// The zigzag is no longer than it must be: one column less, and neighbours touch.
#[test]
fn neighbours_stand_as_near_as_they_may() {
    for [h, l, m] in [
        [1, 1, 0],
        [2, 2, 1],
        [3, 5, 2],
        [8, 12, 4],
        [16, 16, 0],
        [8, 64, 21],
    ] {
        let template = Template::new(h, l, m);
        let first = touched(template.corners([0, 0], false));
        let next = touched(template.corners([template.to_odd - 1, 0], true));
        assert!(
            next.iter().any(|texel| first.contains(texel)),
            "{template:?}"
        );
    }
    assert_eq!(Template::new(0, 0, 0).cost, 1);
    assert_eq!(Template::new(0, 9, 3).cost, 10, "a single row");
    assert_eq!(
        Template::new(1, 1, 0).cost,
        4,
        "a triangle of a texel takes two by two"
    );
    // 16 by 16, of which the triangle covers half: 128 texels.
    assert_eq!(Template::new(16, 16, 0).cost, 170);
}

fn wish(height: f32, length: f32, tip: f32) -> Wish {
    let log = |x: f32| (x.log2() * 256.0).round() as u16 + PIXEL as u16;
    Wish {
        height: log(height),
        length: log(length),
        tip: (tip * 512.0) as u8,
        ..Wish::default()
    }
}

#[test]
fn a_bin_is_nearest_to_its_wish() {
    let templates = templates();
    let footprint = |wish, bias| {
        let template = templates[bin_of(&templates, wish, bias, 19) as usize];
        [template.height, template.length, template.tip]
    };
    assert_eq!(footprint(wish(8.2, 15.0, 0.02), 0), [8, 16, 0]);
    assert_eq!(footprint(wish(8.2, 15.0, 0.49), 0), [8, 16, 8]);
    assert_eq!(footprint(wish(8.0, 16.0, 0.28), 512), [4, 8, 2]);
    assert_eq!(footprint(wish(1.0, 1.0, 0.3), 0), [1, 1, 0]);
    assert_eq!(
        footprint(wish(1.0, 300.0, 0.0), 0),
        [7, 256, 0],
        "flat ones are raised"
    );
    assert_eq!(
        footprint(wish(1.0, 10.0, 0.0), 512),
        [0, 5, 0],
        "or lie in a row"
    );
    assert_eq!(footprint(wish(4000.0, 4000.0, 0.0), 0), [362, 362, 0]);
}

#[test]
fn a_bin_stays_until_the_wish_is_well_past_it() {
    let templates = templates();
    let at = bin_of(&templates, wish(8.0, 16.0, 0.02), 0, 19);
    let near = |wish| is_near(&templates, at, wish, 0, 19);
    assert!(near(wish(9.9, 20.0, 0.1)) && near(wish(6.0, 12.0, 0.2)));
    assert!(!near(wish(11.5, 16.0, 0.1)) && !near(wish(2.0, 5.0, 0.1)));
    assert!(near(wish(8.0, 16.0, 0.36)) && !near(wish(8.0, 16.0, 0.49)));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_wish_has_a_bin(
        (height, length, tip) in (any::<u16>(), any::<u16>(), any::<u8>()),
        bias in 0..7000_i32,
        largest in 0..20_u32,
    ) {
        let templates = templates();
        let wish = Wish { height, length, tip, ..Wish::default() };
        let template = templates[bin_of(&templates, wish, bias, largest) as usize];
        prop_assert!(template.to_odd > 0 && template.length <= u32::from(SIZES[largest as usize]));
        prop_assert!(template.height <= template.length && template.tip <= template.length / 2);
    }
}
