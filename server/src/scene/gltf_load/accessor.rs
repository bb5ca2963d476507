//! Numbers out of buffers, with every offset checked before it is used.

use gltf::Accessor;
use gltf::accessor::DataType;

use super::LoadError;

/// Most elements of one accessor: the vertices of a mesh at the limit of
/// triangles, three a triangle. It bounds what an accessor without a buffer
/// (all zeros) can make us allocate.
const MAX_ELEMENTS: usize = 3 * super::MAX_TRIANGLES;

/// The buffers of a file.
pub(super) struct Data<'a> {
    pub(super) buffers: &'a [Vec<u8>],
}

impl Data<'_> {
    /// The bytes of a buffer view.
    pub(super) fn view(&self, view: &gltf::buffer::View<'_>) -> Result<&[u8], LoadError> {
        let range = view.offset()..view.offset().saturating_add(view.length());
        self.buffers[view.buffer().index()]
            .get(range)
            .ok_or_else(|| {
                let place = format!("bufferViews[{}]", view.index());
                LoadError::invalid(place, "reaches beyond its buffer")
            })
    }

    /// Elements of `N` finite numbers; normalised integers become fractions.
    pub(super) fn floats<const N: usize>(
        &self,
        accessor: &Accessor<'_>,
    ) -> Result<Vec<[f32; N]>, LoadError> {
        let components = accessor.dimensions().multiplicity();
        if components != N {
            let fault = format!("has elements of {components} numbers where {N} are needed");
            return Err(LoadError::invalid(place(accessor), fault));
        }
        let bytes = self.elements(accessor)?;
        let kind = accessor.data_type();
        let normalized = accessor.normalized();
        let mut numbers = bytes
            .chunks_exact(kind.size())
            .map(|bytes| number(bytes, kind, normalized));
        let mut elements = Vec::with_capacity(accessor.count());
        for index in 0..accessor.count() {
            let element: [f32; N] = std::array::from_fn(|_| numbers.next().unwrap_or_default());
            if !element.iter().all(|number| number.is_finite()) {
                let fault = format!("element {index} is not finite");
                return Err(LoadError::invalid(place(accessor), fault));
            }
            elements.push(element);
        }
        Ok(elements)
    }

    /// Unsigned integers.
    pub(super) fn indices(&self, accessor: &Accessor<'_>) -> Result<Vec<u32>, LoadError> {
        let kind = accessor.data_type();
        let unsigned = matches!(kind, DataType::U8 | DataType::U16 | DataType::U32);
        if !unsigned || accessor.dimensions().multiplicity() != 1 {
            return Err(LoadError::invalid(place(accessor), "does not hold indices"));
        }
        let bytes = self.elements(accessor)?;
        Ok(bytes
            .chunks_exact(kind.size())
            .map(unsigned_number)
            .collect())
    }

    /// All elements, closely packed.
    fn elements(&self, accessor: &Accessor<'_>) -> Result<Vec<u8>, LoadError> {
        let (count, size) = (accessor.count(), accessor.size());
        if count > MAX_ELEMENTS {
            return Err(LoadError::TooLarge {
                what: format!("the number of elements of {}", place(accessor)),
                size: count as u64,
                limit: MAX_ELEMENTS as u64,
            });
        }
        let mut packed = match accessor.view() {
            Some(view) => self.packed(&view, accessor.offset(), count, size)?,
            None => vec![0; count * size],
        };
        if let Some(sparse) = accessor.sparse() {
            let indices = sparse.indices();
            let kind = match indices.index_type() {
                gltf::accessor::sparse::IndexType::U8 => DataType::U8,
                gltf::accessor::sparse::IndexType::U16 => DataType::U16,
                gltf::accessor::sparse::IndexType::U32 => DataType::U32,
            };
            let values = sparse.values();
            let places = self.packed(
                &indices.view(),
                indices.offset(),
                sparse.count(),
                kind.size(),
            )?;
            let values = self.packed(&values.view(), values.offset(), sparse.count(), size)?;
            for (at, value) in places
                .chunks_exact(kind.size())
                .zip(values.chunks_exact(size))
            {
                let at = unsigned_number(at) as usize;
                packed
                    .chunks_exact_mut(size)
                    .nth(at)
                    .ok_or_else(|| {
                        let fault = format!("its sparse index {at} is out of range");
                        LoadError::invalid(place(accessor), fault)
                    })?
                    .copy_from_slice(value);
            }
        }
        Ok(packed)
    }

    fn packed(
        &self,
        view: &gltf::buffer::View<'_>,
        offset: usize,
        count: usize,
        size: usize,
    ) -> Result<Vec<u8>, LoadError> {
        let bytes = self.view(view)?;
        let stride = view.stride().unwrap_or(size);
        let end = count
            .checked_sub(1)
            .and_then(|last| last.checked_mul(stride))
            .and_then(|last| last.checked_add(size));
        let bytes = match end {
            None => &[],
            Some(end) => offset
                .checked_add(end)
                .and_then(|end| bytes.get(offset..end))
                .ok_or_else(|| {
                    let place = format!("bufferViews[{}]", view.index());
                    LoadError::invalid(place, format!("is too short for {count} elements"))
                })?,
        };
        Ok(bytes
            .chunks(stride)
            .flat_map(|element| &element[..size.min(element.len())])
            .copied()
            .collect())
    }
}

fn place(accessor: &Accessor<'_>) -> String {
    format!("accessors[{}]", accessor.index())
}

fn unsigned_number(bytes: &[u8]) -> u32 {
    bytes
        .iter()
        .rev()
        .fold(0, |number, &byte| (number << 8) | u32::from(byte))
}

/// The glTF specification's section 3.6.2.2 and KHR_mesh_quantization.
fn number(bytes: &[u8], kind: DataType, normalized: bool) -> f32 {
    let bits = unsigned_number(bytes);
    let (value, largest) = match kind {
        DataType::F32 => return f32::from_bits(bits),
        DataType::I8 => (f32::from(bits as u8 as i8), f32::from(i8::MAX)),
        DataType::U8 => (f32::from(bits as u8), f32::from(u8::MAX)),
        DataType::I16 => (f32::from(bits as u16 as i16), f32::from(i16::MAX)),
        DataType::U16 => (f32::from(bits as u16), f32::from(u16::MAX)),
        DataType::U32 => (bits as f32, u32::MAX as f32),
    };
    if normalized {
        (value / largest).max(-1.0)
    } else {
        value
    }
}
