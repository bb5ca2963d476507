//! One GPU device, and the few things that every pass does with it.

mod scene;

use thiserror::Error;
use wgpu::util::DeviceExt;

pub use scene::{GpuScene, Integrator};

/// Storage buffers that the light kernels bind at once.
const STORAGE_BUFFERS: u32 = 26;

/// Why there is no usable GPU.
#[derive(Debug, Error)]
pub enum GpuError {
    /// No driver, or none that computes.
    #[error(
        "no Vulkan, Metal or Direct3D 12 device was found ({0}); on Debian install mesa-vulkan-drivers"
    )]
    NoAdapter(String),
    /// The device is too small for the kernels.
    #[error("the GPU {adapter} does not offer {what}")]
    Unsupported {
        /// Its name.
        adapter: String,
        /// What is missing.
        what: String,
    },
    /// A scene's buffer is larger than the device binds.
    #[error("the scene's {what} take {bytes} bytes, the GPU binds at most {limit}")]
    TooLarge {
        /// Which buffer.
        what: &'static str,
        /// Its size.
        bytes: u64,
        /// The largest that the device binds.
        limit: u64,
    },
    /// The driver failed while reading results back.
    #[error("the GPU did not finish: {0}")]
    Lost(String),
}

/// A device and its queue.
#[derive(Debug)]
pub struct Gpu {
    /// Creates everything.
    pub device: wgpu::Device,
    /// Runs everything.
    pub queue: wgpu::Queue,
    /// Name and driver, for reports.
    pub adapter: String,
    /// True where the "GPU" is a program on the CPU.
    pub is_software: bool,
}

impl Gpu {
    /// Opens the fastest device there is; a software driver only where there is no other.
    ///
    /// # Errors
    /// When no device is found or it lacks what the kernels need.
    pub fn open() -> Result<Self, GpuError> {
        let instance =
            wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
        let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..Default::default()
        }))
        .map_err(|error| GpuError::NoAdapter(error.to_string()))?;
        let info = adapter.get_info();
        let name = format!("{} ({})", info.name, info.driver_info);
        let offered = adapter.limits();
        if offered.max_storage_buffers_per_shader_stage < STORAGE_BUFFERS {
            return Err(GpuError::Unsupported {
                adapter: name,
                what: format!("{STORAGE_BUFFERS} storage buffers a stage"),
            });
        }
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("shadecast server"),
            // For measurements; nothing else needs it.
            required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
            required_limits: wgpu::Limits {
                max_storage_buffers_per_shader_stage: STORAGE_BUFFERS,
                max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
                max_buffer_size: offered.max_buffer_size,
                max_texture_dimension_2d: offered.max_texture_dimension_2d,
                ..Default::default()
            },
            ..Default::default()
        }))
        .map_err(|error| GpuError::Unsupported {
            adapter: name.clone(),
            what: error.to_string(),
        })?;
        Ok(Self {
            device,
            queue,
            adapter: name,
            is_software: info.device_type == wgpu::DeviceType::Cpu,
        })
    }

    /// A storage buffer with this content; never empty, since empty buffers cannot be bound.
    ///
    /// # Errors
    /// When it is larger than the device binds.
    pub fn storage(&self, what: &'static str, bytes: &[u8]) -> Result<wgpu::Buffer, GpuError> {
        let limit = self.device.limits().max_storage_buffer_binding_size;
        if bytes.len() as u64 > limit {
            return Err(GpuError::TooLarge {
                what,
                bytes: bytes.len() as u64,
                limit,
            });
        }
        let contents = if bytes.is_empty() { &[0; 256] } else { bytes };
        Ok(self
            .device
            .create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some(what),
                contents,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
            }))
    }

    /// A zeroed storage buffer that can be copied from and to.
    ///
    /// # Errors
    /// When it is larger than the device binds.
    pub fn scratch(&self, what: &'static str, bytes: u64) -> Result<wgpu::Buffer, GpuError> {
        let limit = self.device.limits().max_storage_buffer_binding_size;
        if bytes > limit {
            return Err(GpuError::TooLarge { what, bytes, limit });
        }
        Ok(self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            size: bytes.max(16),
            usage: wgpu::BufferUsages::STORAGE
                | wgpu::BufferUsages::COPY_DST
                | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        }))
    }

    /// A uniform buffer for one host struct.
    #[must_use]
    pub fn uniform(&self, what: &'static str, bytes: usize) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            size: bytes as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    /// A buffer that the CPU reads.
    #[must_use]
    pub fn readback(&self, what: &'static str, bytes: u64) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            size: bytes,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    /// Waits until all that was submitted is done.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn wait(&self) -> Result<(), GpuError> {
        self.device
            .poll(wgpu::PollType::wait_indefinitely())
            .map(|_| ())
            .map_err(|error| GpuError::Lost(error.to_string()))
    }

    /// Submits the encoder's work, waits for it, and hands the first `bytes`
    /// of `buffer` to `read`.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn submit_and_read<T>(
        &self,
        encoder: wgpu::CommandEncoder,
        buffer: &wgpu::Buffer,
        bytes: u64,
        read: impl FnOnce(&[u8]) -> T,
    ) -> Result<T, GpuError> {
        self.queue.submit([encoder.finish()]);
        let slice = buffer.slice(..bytes);
        let (sender, receiver) = std::sync::mpsc::channel();
        slice.map_async(wgpu::MapMode::Read, move |result| {
            // The receiver lives until the result is in.
            let _ = sender.send(result);
        });
        self.wait()?;
        receiver
            .recv()
            .map_err(|error| GpuError::Lost(error.to_string()))?
            .map_err(|error| GpuError::Lost(error.to_string()))?;
        let result = read(&slice.get_mapped_range());
        buffer.unmap();
        Ok(result)
    }

    /// What these bytes of a buffer hold; waits for all that was submitted.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn read<T: bytemuck::Pod>(
        &self,
        buffer: &wgpu::Buffer,
        bytes: std::ops::Range<u64>,
    ) -> Result<Vec<T>, GpuError> {
        let size = bytes.end - bytes.start;
        let readback = self.readback("readback", size);
        let mut encoder = self
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(buffer, bytes.start, &readback, 0, size);
        self.submit_and_read(encoder, &readback, size, bytemuck::pod_collect_to_vec)
    }

    /// A compute pipeline of `source` with `constants` for its overrides.
    #[must_use]
    pub fn compute_pipeline(
        &self,
        source: &str,
        entry: &str,
        layouts: &[&wgpu::BindGroupLayout],
        constants: &[(&str, f64)],
    ) -> wgpu::ComputePipeline {
        let module = self
            .device
            .create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(entry),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            });
        let layouts: Vec<_> = layouts.iter().map(|layout| Some(*layout)).collect();
        let layout = self
            .device
            .create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(entry),
                bind_group_layouts: &layouts,
                immediate_size: 0,
            });
        self.device
            .create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: Some(&layout),
                module: &module,
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants,
                    ..Default::default()
                },
                cache: None,
            })
    }
}

/// What a binding holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Binding {
    /// One host struct.
    Uniform,
    /// A list that kernels read.
    Read,
    /// A list that kernels change.
    Write,
    /// A picture of patch ids.
    Ids,
}

/// A layout with these bindings, numbered from zero.
#[must_use]
pub fn layout(
    gpu: &Gpu,
    visibility: wgpu::ShaderStages,
    bindings: &[Binding],
) -> wgpu::BindGroupLayout {
    let buffer = |ty| wgpu::BindingType::Buffer {
        ty,
        has_dynamic_offset: false,
        min_binding_size: None,
    };
    let entries: Vec<_> = (0..)
        .zip(bindings)
        .map(|(binding, kind)| wgpu::BindGroupLayoutEntry {
            binding,
            visibility,
            ty: match kind {
                Binding::Uniform => buffer(wgpu::BufferBindingType::Uniform),
                Binding::Read => buffer(wgpu::BufferBindingType::Storage { read_only: true }),
                Binding::Write => buffer(wgpu::BufferBindingType::Storage { read_only: false }),
                Binding::Ids => wgpu::BindingType::Texture {
                    sample_type: wgpu::TextureSampleType::Uint,
                    view_dimension: wgpu::TextureViewDimension::D2,
                    multisampled: false,
                },
            },
            count: None,
        })
        .collect();
    gpu.device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: None,
            entries: &entries,
        })
}

/// A bind group of whole buffers, numbered from zero.
#[must_use]
pub fn bind(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    buffers: &[&wgpu::Buffer],
) -> wgpu::BindGroup {
    let entries: Vec<_> = (0..)
        .zip(buffers)
        .map(|(binding, buffer)| wgpu::BindGroupEntry {
            binding,
            resource: buffer.as_entire_binding(),
        })
        .collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout,
        entries: &entries,
    })
}

/// Workgroups for `count` threads in groups of `size`, folded into two
/// dimensions where one is not long enough.
#[must_use]
pub fn workgroups(count: u32, size: u32) -> (u32, u32) {
    const LONGEST: u32 = 32_768;
    let groups = count.div_ceil(size).max(1);
    (groups.min(LONGEST), groups.div_ceil(LONGEST))
}
