//! Brings a picture back from the GPU: recorded with the drawing, taken when
//! the GPU is done.

use thiserror::Error;

/// A picture in memory, four bytes a pixel, row by row from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pixels {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `4 * width * height` bytes.
    pub rgba: Vec<u8>,
}

/// Why a picture did not come back.
#[derive(Debug, Error)]
pub enum ReadbackError {
    /// The device is lost.
    #[error("the GPU stopped answering: {0}")]
    Poll(#[from] wgpu::PollError),
    /// The memory could not be mapped.
    #[error("the picture could not be read back from the GPU")]
    Map,
}

/// A copy that has been recorded and not yet taken.
#[derive(Debug)]
pub struct Readback {
    buffer: wgpu::Buffer,
    width: u32,
    height: u32,
    row_bytes: u32,
}

impl Readback {
    /// Records the copy of a layer of an RGBA8 texture.
    #[must_use]
    pub fn record(
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        texture: &wgpu::Texture,
        layer: u32,
    ) -> Self {
        let (width, height) = (texture.width(), texture.height());
        let row_bytes = (width * 4).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("readback"),
            size: u64::from(row_bytes) * u64::from(height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        encoder.copy_texture_to_buffer(
            wgpu::TexelCopyTextureInfo {
                texture,
                mip_level: 0,
                origin: wgpu::Origin3d {
                    x: 0,
                    y: 0,
                    z: layer,
                },
                aspect: wgpu::TextureAspect::All,
            },
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row_bytes),
                    rows_per_image: None,
                },
            },
            wgpu::Extent3d {
                width,
                height,
                depth_or_array_layers: 1,
            },
        );
        Self {
            buffer,
            width,
            height,
            row_bytes,
        }
    }

    /// Waits for the GPU, once the copy has been submitted, and takes the picture.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn take(self, device: &wgpu::Device) -> Result<Pixels, ReadbackError> {
        let (sender, receiver) = std::sync::mpsc::channel();
        let slice = self.buffer.slice(..);
        slice.map_async(wgpu::MapMode::Read, move |result| {
            // The receiver waits below, so that only a lost device loses this.
            let _ = sender.send(result);
        });
        device.poll(wgpu::PollType::wait_indefinitely())?;
        match receiver.try_recv() {
            Ok(Ok(())) => {}
            Ok(Err(_)) | Err(_) => return Err(ReadbackError::Map),
        }
        let mapped = slice.get_mapped_range();
        let rgba = mapped
            .chunks_exact(self.row_bytes as usize)
            .flat_map(|row| &row[..self.width as usize * 4])
            .copied()
            .collect();
        Ok(Pixels {
            width: self.width,
            height: self.height,
            rgba,
        })
    }
}
