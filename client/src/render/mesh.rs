//! Vertices, indices and transforms on the GPU, in buffers that grow and stay.

use std::{ops::Range, sync::Arc};

use glam::Mat4;
use shadecast_protocol::{Motion, Pose};

use crate::{ClientFrame, DrawVertex};

/// The triangles of the frame that is drawn.
#[derive(Debug)]
pub(super) struct Mesh {
    vertices: Uploaded<DrawVertex>,
    indices: Uploaded<u32>,
    /// How many of the indices, from the first on, need no mask.
    opaque_indices: u32,
    foreshortened: bool,
    transforms: GrowingBuffer,
    motions: Arc<Vec<Motion>>,
}

impl Mesh {
    pub(super) fn new() -> Self {
        Self {
            vertices: Uploaded::new("vertices", wgpu::BufferUsages::VERTEX),
            indices: Uploaded::new("indices", wgpu::BufferUsages::INDEX),
            opaque_indices: 0,
            foreshortened: false,
            transforms: GrowingBuffer::new("transforms", wgpu::BufferUsages::STORAGE),
            motions: Arc::default(),
        }
    }

    /// Bytes of the largest buffer that `frame` needs.
    pub(super) fn largest_buffer(frame: &ClientFrame) -> u64 {
        [
            size_of_val(frame.vertices.as_slice()),
            size_of_val(frame.indices.as_slice()),
            frame.motions.len() * size_of::<Mat4>(),
        ]
        .into_iter()
        .max()
        .unwrap_or(0) as u64
    }

    /// Takes over the frame's geometry. True when the transforms have moved to
    /// another buffer.
    pub(super) fn upload(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        frame: &ClientFrame,
    ) -> bool {
        self.vertices.upload(device, queue, &frame.vertices);
        self.indices.upload(device, queue, &frame.indices);
        self.opaque_indices = frame.opaque_indices.min(self.indices.count());
        self.foreshortened = frame.foreshortened;
        self.motions = Arc::clone(&frame.motions);
        if !self.moves() {
            return false;
        }
        let matrices = self.matrices_after(0.0);
        self.transforms
            .write(device, queue, bytemuck::cast_slice(&matrices))
    }

    /// Moves the objects to where they are `seconds` after the moment of their
    /// motions, for what is submitted from now on.
    pub(super) fn move_objects(&self, queue: &wgpu::Queue, seconds: f32) {
        if let (true, Some(buffer)) = (self.moves(), self.transforms()) {
            let matrices = self.matrices_after(seconds);
            queue.write_buffer(buffer, 0, bytemuck::cast_slice(&matrices));
        }
    }

    fn matrices_after(&self, seconds: f32) -> Vec<Mat4> {
        let poses = self.motions.iter().map(|motion| motion.after(seconds));
        poses.map(Pose::matrix).collect()
    }

    /// True when there is more than the world that stands still.
    pub(super) fn moves(&self) -> bool {
        self.motions.len() > 1
    }

    /// Whether lookups must divide.
    pub(super) fn is_foreshortened(&self) -> bool {
        self.foreshortened
    }

    pub(super) fn transforms(&self) -> Option<&wgpu::Buffer> {
        self.transforms.buffer.as_ref()
    }

    /// The indices of triangles with or without a mask.
    pub(super) fn range(&self, masked: bool) -> Range<u32> {
        if masked {
            self.opaque_indices..self.indices.count()
        } else {
            0..self.opaque_indices
        }
    }

    /// One draw call.
    pub(super) fn draw(&self, pass: &mut wgpu::RenderPass<'_>, range: Range<u32>) {
        let (Some(vertices), Some(indices)) =
            (&self.vertices.buffer.buffer, &self.indices.buffer.buffer)
        else {
            return;
        };
        pass.set_vertex_buffer(0, vertices.slice(..));
        pass.set_index_buffer(indices.slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(range, 0, 0..1);
    }
}

/// A list that is written again only when it is another list.
#[derive(Debug)]
struct Uploaded<T> {
    buffer: GrowingBuffer,
    content: Option<Arc<Vec<T>>>,
}

impl<T: bytemuck::NoUninit> Uploaded<T> {
    fn new(label: &'static str, usage: wgpu::BufferUsages) -> Self {
        Self {
            buffer: GrowingBuffer::new(label, usage),
            content: None,
        }
    }

    fn upload(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, content: &Arc<Vec<T>>) {
        let same = self
            .content
            .as_ref()
            .is_some_and(|before| Arc::ptr_eq(before, content));
        if !same {
            self.buffer
                .write(device, queue, bytemuck::cast_slice(content));
            self.content = Some(Arc::clone(content));
        }
    }

    fn count(&self) -> u32 {
        self.content
            .as_ref()
            .map_or(0, |content| content.len() as u32)
    }
}

/// A buffer that is made anew, half as large again, when it is too small.
#[derive(Debug)]
struct GrowingBuffer {
    label: &'static str,
    usage: wgpu::BufferUsages,
    buffer: Option<wgpu::Buffer>,
}

impl GrowingBuffer {
    fn new(label: &'static str, usage: wgpu::BufferUsages) -> Self {
        Self {
            label,
            usage,
            buffer: None,
        }
    }

    /// Writes `bytes`, at most the device's largest buffer. True when they are
    /// in a new buffer.
    fn write(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, bytes: &[u8]) -> bool {
        if bytes.is_empty() {
            return false;
        }
        let size = bytes.len() as u64;
        let grows = self
            .buffer
            .as_ref()
            .is_none_or(|buffer| buffer.size() < size);
        if grows {
            let roomy = (size + size / 2).next_multiple_of(256);
            self.buffer = Some(device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(self.label),
                size: roomy.min(device.limits().max_buffer_size & !3),
                usage: self.usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }));
        }
        if let Some(buffer) = &self.buffer {
            queue.write_buffer(buffer, 0, bytes);
        }
        grows
    }
}
