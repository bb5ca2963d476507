use proptest::prelude::*;

use super::{
    super::bins::{SIZES, Template, bin, templates},
    *,
};

const SHEET: Sheet = Sheet {
    width: 256,
    units: 128,
    unit: 2,
    least_width: 32,
};

/// Every unit belongs to one extent at most, and what is counted is what is taken.
fn check(superblocks: &Superblocks, bins: &[(Template, Vec<Extent>)]) {
    let mut owners = vec![vec![false; SHEET.units as usize]; superblocks.blocks().len()];
    for (template, extents) in bins {
        assert!(extents.len() <= MOST_EXTENTS);
        for extent in extents {
            let block = superblocks.blocks()[extent.superblock as usize];
            let per = template.in_row(block.width);
            let rows = extent.capacity / per;
            assert!(extent.capacity > 0 && extent.capacity.is_multiple_of(per));
            assert!(rows * (template.height + 1) <= extent.units * SHEET.unit);
            for unit in extent.first..extent.first + extent.units {
                let owner = &mut owners[extent.superblock as usize][unit as usize];
                assert!(!std::mem::replace(owner, true), "{extent:?} shares a unit");
            }
        }
    }
    let mut x = 0;
    for (block, owners) in superblocks.blocks().iter().zip(owners) {
        assert_eq!(block.x, x);
        x += block.width;
        let taken = owners.iter().filter(|taken| **taken).count();
        assert_eq!(block.used as usize, taken);
    }
    assert!(x <= SHEET.width);
}

fn template(height: u32, length: u32) -> Template {
    templates()[bin(height, length, 1) as usize]
}

#[test]
fn a_bin_grows_below_itself_and_then_elsewhere() {
    let mut superblocks = Superblocks::new(SHEET);
    let (of_one, of_other) = (template(6, 7), template(5, 6));
    let (mut one, mut other) = (Vec::new(), Vec::new());
    assert!(superblocks.extend(&of_one, &mut one, 10));
    let first = one[0];
    assert!(superblocks.extend(&of_one, &mut one, 10) && one.len() == 1);
    assert!(one[0].first == first.first && capacity_of(&one) >= 20);
    assert!(superblocks.extend(&of_other, &mut other, 10));
    assert_eq!(other[0].superblock, one[0].superblock);
    let before = one[0];
    assert!(superblocks.extend(&of_one, &mut one, 10));
    assert_eq!((one[0], one.len()), (before, 2), "what is there stays");
    check(
        &superblocks,
        &[(of_one, one.clone()), (of_other, other.clone())],
    );
    superblocks.shrink(&of_one, &mut one, 1);
    assert_eq!(one.len(), 1);
    superblocks.release(&mut one);
    superblocks.release(&mut other);
    superblocks.columns.drop_last();
    assert!(superblocks.blocks().is_empty());
}

#[test]
fn rows_that_lie_apart_are_enough() {
    let mut superblocks = Superblocks::new(SHEET);
    let small = template(7, 8);
    let rows = || -> Vec<Extent> { Vec::new() };
    // A row each until all is taken, and then every other row is free.
    let mut bins = Vec::new();
    loop {
        let mut extents = rows();
        if !superblocks.extend(&small, &mut extents, 1) {
            break;
        }
        bins.push((small, extents));
    }
    let mut at = 0;
    bins.retain_mut(|(_, extents)| {
        at += 1;
        if at % 2 == 0 {
            superblocks.release(extents);
        }
        at % 2 != 0
    });
    let mut extents = rows();
    let width = superblocks.blocks()[0].width;
    let more = 3 * small.in_row(width);
    assert!(superblocks.extend(&small, &mut extents, more));
    assert!(extents.len() > 1 && capacity_of(&extents) >= more);
    bins.push((small, extents));
    check(&superblocks, &bins);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

    #[test]
    fn any_sequence_of_bins_fits(
        steps in prop::collection::vec((0..12_usize, 0..3_u8, 0..400_u32), 1..120),
    ) {
        let mut superblocks = Superblocks::new(SHEET);
        let templates = templates();
        let mut bins: Vec<(Template, Vec<Extent>)> = (0..12_u32)
            .map(|n| (templates[bin(n, (n + 2).min(SIZES.len() as u32 - 1), 1) as usize], Vec::new()))
            .collect();
        for (which, what, triangles) in steps {
            superblocks.columns.begin();
            let (template, extents) = &mut bins[which];
            let before = capacity_of(extents);
            match what {
                0 => superblocks.release(extents),
                1 => {
                    superblocks.shrink(template, extents, triangles);
                    prop_assert!(capacity_of(extents) >= triangles.min(before));
                }
                _ => {
                    if superblocks.extend(template, extents, triangles + 1) {
                        prop_assert!(capacity_of(extents) > before + triangles);
                    }
                }
            }
            superblocks.columns.drop_last();
            check(&superblocks, &bins);
        }
        for (_, extents) in &mut bins {
            superblocks.release(extents);
        }
        superblocks.columns.drop_last();
        prop_assert!(superblocks.blocks().is_empty());
    }
}
