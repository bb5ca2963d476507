//! Every shader is valid, and its records are laid out as the host writes them.

use std::mem::offset_of;

use wgpu::naga;

use crate::render::lens::LensImmediates;
use crate::render::pipelines::{IMMEDIATE_BYTES, MULTIVIEW_SOURCE, TWO_PASS_SOURCE};

fn validated(source: &str, capabilities: naga::valid::Capabilities) -> naga::Module {
    let module = naga::front::wgsl::parse_str(source)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(source)));
    naga::valid::Validator::new(naga::valid::ValidationFlags::all(), capabilities)
        .validate(&module)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(source)));
    module
}

/// Offsets and size of a struct.
fn layout(module: &naga::Module, name: &str) -> (Vec<u32>, u32) {
    module
        .types
        .iter()
        .find_map(|(_, ty)| match &ty.inner {
            naga::TypeInner::Struct { members, span } if ty.name.as_deref() == Some(name) => {
                Some((members.iter().map(|m| m.offset).collect(), *span))
            }
            _ => None,
        })
        .unwrap_or_else(|| panic!("no struct {name}"))
}

#[test]
fn all_shaders_are_valid() {
    use naga::valid::Capabilities;
    let immediates = Capabilities::IMMEDIATES;
    validated(TWO_PASS_SOURCE, immediates);
    validated(MULTIVIEW_SOURCE, immediates | Capabilities::MULTIVIEW);
    validated(include_str!("../yuv.wgsl"), Capabilities::empty());
    validated(include_str!("../shrink.wgsl"), Capabilities::empty());
    validated(include_str!("../lens.wgsl"), immediates);
}

#[test]
fn immediates_are_laid_out_as_the_host_writes_them() {
    let immediates = naga::valid::Capabilities::IMMEDIATES;
    let lens = validated(include_str!("../lens.wgsl"), immediates);
    let k = offset_of!(LensImmediates, k) as u32;
    let offsets = vec![
        offset_of!(LensImmediates, display) as u32,
        offset_of!(LensImmediates, picture) as u32,
        k,
        k + 8,
        k + 16,
    ];
    let size = size_of::<LensImmediates>() as u32;
    assert_eq!(layout(&lens, "Lens"), (offsets, size));
    let eyes = validated(TWO_PASS_SOURCE, immediates);
    assert_eq!(layout(&eyes, "Eyes"), (vec![0], IMMEDIATE_BYTES));
}
