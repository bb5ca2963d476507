//! The BIN chunk: bytes, and the views and accessors that describe them.

use bytemuck::NoUninit;
use serde_json::{Value, json};

const ARRAY_BUFFER: u32 = 34_962;
const ELEMENT_ARRAY_BUFFER: u32 = 34_963;
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;

/// The buffer under construction. Numbers are little-endian, as the machines are
/// that this runs on.
#[derive(Default)]
pub(super) struct Bin {
    pub(super) bytes: Vec<u8>,
    pub(super) views: Vec<Value>,
    pub(super) accessors: Vec<Value>,
}

impl Bin {
    /// A view of raw bytes.
    pub(super) fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        self.views
            .push(json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }));
        self.views.len() - 1
    }

    fn accessor<T: NoUninit>(&mut self, elements: &[T], component: u32, kind: &str) -> usize {
        let view = self.view(bytemuck::cast_slice(elements));
        self.accessors.push(json!({
            "bufferView": view,
            "componentType": component,
            "count": elements.len(),
            "type": kind,
        }));
        self.accessors.len() - 1
    }

    /// Elements of 2 to 4 floats that are no vertex attributes.
    pub(super) fn values<const N: usize>(&mut self, elements: &[[f32; N]]) -> usize
    where
        [f32; N]: NoUninit,
    {
        self.accessor(elements, FLOAT, &format!("VEC{N}"))
    }

    /// A vertex attribute.
    pub(super) fn vectors<const N: usize>(&mut self, elements: &[[f32; N]]) -> usize
    where
        [f32; N]: NoUninit,
    {
        let accessor = self.values(elements);
        self.target(ARRAY_BUFFER);
        accessor
    }

    /// Positions, with the bounds that glTF asks for.
    pub(super) fn positions(&mut self, positions: &[[f32; 3]]) -> usize {
        let accessor = self.vectors(positions);
        self.bounds(positions);
        accessor
    }

    /// Times of animation keys.
    pub(super) fn times(&mut self, times: &[f32]) -> usize {
        let accessor = self.accessor(times, FLOAT, "SCALAR");
        self.bounds(&times.iter().map(|&time| [time]).collect::<Vec<_>>());
        accessor
    }

    /// Triangles.
    pub(super) fn indices(&mut self, indices: &[u32]) -> usize {
        let accessor = self.accessor(indices, UNSIGNED_INT, "SCALAR");
        self.target(ELEMENT_ARRAY_BUFFER);
        accessor
    }

    fn target(&mut self, target: u32) {
        if let Some(view) = self.views.last_mut() {
            view["target"] = json!(target);
        }
    }

    fn bounds<const N: usize>(&mut self, elements: &[[f32; N]]) {
        let fold = |start: f32, pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..N)
                .map(|i| elements.iter().map(|element| element[i]).fold(start, pick))
                .collect()
        };
        let (low, high) = (
            fold(f32::INFINITY, f32::min),
            fold(f32::NEG_INFINITY, f32::max),
        );
        if let Some(accessor) = self.accessors.last_mut() {
            accessor["min"] = json!(low);
            accessor["max"] = json!(high);
        }
    }
}
