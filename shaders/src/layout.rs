//! Every kernel validates, and every host struct lies in memory as WGSL has it.

use std::mem::{offset_of, size_of};

use naga::valid::{Capabilities, ValidationFlags, Validator};

use crate::{atlas, light, picture, snake, tss, visibility};

fn module(name: &str, source: &str) -> naga::Module {
    let module = naga::front::wgsl::parse_str(source)
        .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(source)));
    Validator::new(ValidationFlags::all(), Capabilities::all())
        .validate(&module)
        .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(source)));
    module
}

/// A constant whole number.
fn number(module: &naga::Module, name: &str) -> u32 {
    let mut constants = module.constants.iter();
    let found = constants.find(|(_, constant)| constant.name.as_deref() == Some(name));
    let init = found.map(|(_, constant)| &module.global_expressions[constant.init]);
    match init {
        Some(naga::Expression::Literal(naga::Literal::U32(number))) => *number,
        other => panic!("{name} is {other:?}"),
    }
}

fn members(module: &naga::Module, name: &str) -> (u32, Vec<(String, u32)>) {
    let found = module
        .types
        .iter()
        .find(|(_, t)| t.name.as_deref() == Some(name));
    let Some((
        _,
        naga::Type {
            inner: naga::TypeInner::Struct { members, span },
            ..
        },
    )) = found
    else {
        panic!("no struct {name}");
    };
    (
        *span,
        members
            .iter()
            .map(|m| (m.name.clone().unwrap_or_default(), m.offset))
            .collect(),
    )
}

macro_rules! same_layout {
    ($module:expr, $host:ty, $($field:ident),+) => {{
        let name = stringify!($host).rsplit(' ').next().unwrap();
        let (size, found) = members($module, name);
        assert_eq!(size as usize, size_of::<$host>(), "size of {name}");
        let expected = vec![$((stringify!($field).to_owned(), offset_of!($host, $field) as u32)),+];
        assert_eq!(found, expected, "layout of {name}");
    }};
}

#[test]
fn kernels_validate() {
    for (name, source) in [
        ("trace", light::TRACE_SOURCE),
        ("advance", light::ADVANCE_SOURCE),
        ("atlas", light::ATLAS_SOURCE),
        ("still", light::STILL_SOURCE),
        ("atlas of triangles", light::ATLAS_OF_TRIANGLES_SOURCE),
        ("carry", light::CARRY_SOURCE),
        ("carry triangles", light::CARRY_TRIANGLES_SOURCE),
        ("picture", picture::SOURCE),
        ("atlas memory", atlas::SOURCE),
        ("footprint", atlas::FOOTPRINT_SOURCE),
        ("snake", snake::SOURCE),
        ("snake footprint", snake::FOOTPRINT_SOURCE),
        ("tss", tss::SOURCE),
        ("measure", tss::MEASURE_SOURCE),
        ("ids", visibility::IDS_SOURCE),
        ("mark", visibility::MARK_SOURCE),
        ("recall", visibility::RECALL_SOURCE),
    ] {
        module(name, source);
    }
}

#[test]
fn layouts_match() {
    use light::*;
    use picture::PictureParameters;
    let atlas = module("atlas", ATLAS_SOURCE);
    same_layout!(
        &atlas,
        Globals,
        sky_zenith,
        light_count,
        sky_horizon,
        punctual_count,
        sky_ground,
        instance_count,
        sun_direction,
        sun_cos,
        sun_irradiance,
        bounces,
        faint,
        environment_cell,
        environment_size
    );
    same_layout!(
        &atlas,
        TextureRecord,
        offset,
        size,
        flags,
        levels,
        matrix,
        translation,
        padding
    );
    same_layout!(
        &atlas,
        Material,
        base_color,
        emissive,
        metallic,
        roughness,
        normal_scale,
        alpha_cutoff,
        f0,
        double_sided,
        spare,
        padding,
        textures
    );
    same_layout!(
        &atlas,
        LightRecord,
        kind,
        triangle,
        instance,
        trail,
        position,
        padding,
        intensity,
        range,
        direction,
        cos_outer,
        cos_inner,
        area,
        spare
    );
    same_layout!(
        &atlas,
        EnvironmentCell,
        threshold,
        otherwise,
        density,
        padding
    );
    same_layout!(
        &atlas, LightNode, centre, radius, axis, cos_spread, power, child, padding
    );
    same_layout!(
        &atlas,
        Instance,
        world_from_object,
        object_from_world,
        root_node,
        first_triangle,
        padding
    );
    same_layout!(
        &atlas,
        LightParameters,
        eye,
        slot_count,
        atlas_width,
        tile_count,
        pixel_angle,
        exposure
    );
    same_layout!(
        &atlas,
        BlockRecord,
        first_job,
        first_tile,
        position,
        layout_bits,
        first_triangle,
        sample_index,
        patch_id,
        longest_history,
        glossy_keep
    );
    let of_triangles = module("atlas of triangles", ATLAS_OF_TRIANGLES_SOURCE);
    same_layout!(
        &of_triangles,
        TriangleRecord,
        first_job,
        first_tile,
        layout_bits,
        first_triangle,
        sample_index,
        patch_id,
        longest_history,
        glossy_keep,
        corners,
        weights
    );
    same_layout!(&atlas, Quality, noise, samples);
    same_layout!(&atlas, Wave, path_count, first_job, cull, step);
    assert_eq!(u64::from(members(&atlas, "PathState").0), STATE_BYTES);
    assert_eq!(u64::from(members(&atlas, "Ray").0) * 3, RAY_BYTES);
    assert_eq!(u64::from(members(&atlas, "Cell").0), CELL_BYTES);
    assert_eq!(u64::from(members(&atlas, "Judgement").0), JUDGEMENT_BYTES);
    assert_eq!(number(&atlas, "TILE_SIDE"), TILE_SIDE);
    let still = module("still", STILL_SOURCE);
    same_layout!(
        &still,
        StillParameters,
        world_from_eye,
        tangents,
        size,
        sample_index,
        seed
    );
    let carry = module("carry", CARRY_SOURCE);
    same_layout!(&carry, Move, to, levels, origin, padding);
    let carry_triangles = module("carry triangles", CARRY_TRIANGLES_SOURCE);
    same_layout!(
        &carry_triangles,
        TriangleMove,
        to,
        to_weights,
        origin,
        origin_weights,
        how,
        offset_x,
        offset_y
    );
    same_layout!(
        &carry_triangles,
        CarryParameters,
        move_count,
        atlas_width,
        padding
    );
    same_layout!(&carry, CarryParameters, move_count, atlas_width, padding);
    let planes = module("picture", crate::picture::SOURCE);
    same_layout!(&planes, PictureParameters, size, exposure, fills);
}

#[test]
fn layouts_of_the_atlas_match() {
    use atlas::{ActivePatch, AtlasParameters, AtlasState, FootprintParameters};
    let memory = module("atlas memory", atlas::SOURCE);
    same_layout!(
        &memory,
        AtlasParameters,
        patch_count,
        log2_side,
        per_row,
        superblocks,
        budget,
        least_free,
        most_patches,
        keep_unseen,
        bias,
        reset,
        padding
    );
    same_layout!(&memory, ActivePatch, patch_id, pixels, before, after, bits);
    same_layout!(
        &memory,
        AtlasState,
        active_count,
        visible,
        bias,
        verdict,
        status,
        evict,
        taken,
        padding,
        tail_superblock,
        tail_filled,
        old_tail,
        first_fresh,
        stack_base,
        stacked,
        stacked_before,
        top,
        requested,
        released,
        idle,
        required,
        offset
    );
    assert_eq!(u64::from(members(&memory, "Tally").0), atlas::TALLY_BYTES);
    let footprint = module("footprint", atlas::FOOTPRINT_SOURCE);
    same_layout!(
        &footprint,
        FootprintParameters,
        patch_count,
        pixels_per_radian,
        padding
    );
}

#[test]
fn layouts_of_tss_match() {
    use tss::{ActiveTriangle, CellPlace, MeasureParameters, TssParameters, TssState};
    let packing = module("tss", tss::SOURCE);
    same_layout!(
        &packing,
        TssParameters,
        patch_count,
        width,
        height,
        most_class,
        keep_unseen,
        padding_0,
        padding_1,
        padding_2
    );
    same_layout!(
        &packing,
        TssState,
        active_count,
        seen,
        steps,
        evict,
        placing,
        status,
        used_texels,
        padding
    );
    same_layout!(&packing, ActiveTriangle, patch_id, pixels, corners, weights);
    same_layout!(&packing, CellPlace, start, in_shelf, first, next_y);
    assert_eq!(u64::from(members(&packing, "Tally").0), tss::TALLY_BYTES);
    let measure = module("measure", tss::MEASURE_SOURCE);
    same_layout!(
        &measure,
        MeasureParameters,
        patch_count,
        pixels_per_radian,
        keep_unseen,
        padding
    );
}

#[test]
fn layouts_of_the_snake_match() {
    use snake::{ActiveTriangle, SnakeFootprintParameters, SnakeParameters, SnakeState, Template};
    let packing = module("snake", snake::SOURCE);
    same_layout!(
        &packing,
        SnakeParameters,
        patch_count,
        width,
        units,
        unit,
        least_width,
        largest,
        budget,
        most_triangles,
        keep_unseen,
        bias,
        reset,
        padding
    );
    same_layout!(
        &packing,
        ActiveTriangle,
        patch_id,
        pixels,
        bits,
        shape,
        index,
        at
    );
    same_layout!(
        &packing, Template, height, length, tip, same, to_odd, to_even, cost, logs
    );
    // The kernels' state goes on behind what is read back.
    let (size, found) = members(&packing, "SnakeState");
    assert_eq!(u64::from(size), SnakeState::BYTES);
    let places = [
        ("bias", offset_of!(SnakeState, bias)),
        ("status", offset_of!(SnakeState, status)),
        ("superblock_count", offset_of!(SnakeState, superblock_count)),
        ("reserved", offset_of!(SnakeState, reserved)),
        ("bins", offset_of!(SnakeState, bins)),
        ("slots", offset_of!(SnakeState, slots)),
        ("raised", offset_of!(SnakeState, raised)),
        ("superblocks", offset_of!(SnakeState, superblocks)),
        ("rows", size_of::<SnakeState>()),
    ];
    for (name, offset) in places {
        assert!(found.contains(&(name.to_owned(), offset as u32)), "{name}");
    }
    let tally = members(&packing, "SnakeTally").0;
    assert_eq!(u64::from(tally), 4 * snake::TALLY_WORDS);
    let footprint = module("snake footprint", snake::FOOTPRINT_SOURCE);
    same_layout!(
        &footprint,
        SnakeFootprintParameters,
        patch_count,
        pixels_per_radian,
        padding
    );
}
