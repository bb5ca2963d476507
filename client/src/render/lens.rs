//! Bends the finished pictures against the lenses of a headset, for every pixel
//! and each colour by itself (SAS 2018, section 3.6).
//!
//! The middle keeps its scale. What is drawn is what a lens with pincushion
//! distortion straightens again, and its colour fringes cancel.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::EyeImages;
use super::cover::{cover_pass, cover_pipeline};

/// Radial distortion of a pair of lenses.
///
/// Lengths are half heights of one eye's picture. A pixel at distance `r` from
/// the axis shows what the undistorted picture has at
/// `r * (1 + k[0] * r² + k[1] * r⁴)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LensProfile {
    /// Where the left eye's axis meets its picture, seen from the middle:
    /// right and up. The right eye has it mirrored.
    pub centre: [f32; 2],
    /// Coefficients of red, green and blue.
    pub k: [[f32; 2]; 3],
}

/// One eye's half of a display, behind its lens.
///
/// Lengths count from the lens's axis, right and up, in one unit, by which `k` goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EyeLens {
    /// Where the half's sides are: left, right, up, down.
    pub display: [f32; 4],
    /// Where those of the undistorted picture are.
    pub picture: [f32; 4],
    /// As [`LensProfile::k`].
    pub k: [[f32; 2]; 3],
}

impl EyeLens {
    /// The same for the other eye.
    #[must_use]
    pub fn mirrored(self) -> Self {
        let mirror = |[left, right, up, down]: [f32; 4]| [-right, -left, up, down];
        Self {
            display: mirror(self.display),
            picture: mirror(self.picture),
            k: self.k,
        }
    }
}

/// Why a lens profile is refused.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum LensError {
    /// NaN or infinite.
    #[error("a number of the lens profile is not finite")]
    NotFinite,
    /// The axis is outside of the picture.
    #[error("the lens centre lies outside of the picture")]
    Centre,
    /// More distortion than any lens has.
    #[error("a lens coefficient lies outside of -2 to 2")]
    Coefficient,
}

impl LensProfile {
    /// No distortion at all; for showing pictures in a window.
    pub const IDENTITY: Self = Self {
        centre: [0.0; 2],
        k: [[0.0; 2]; 3],
    };

    /// A mild default: 10 % at the edge of the picture, with blue bent a little
    /// more than red, as glass does.
    #[must_use]
    pub fn mild() -> Self {
        Self {
            centre: [0.0; 2],
            k: [[0.076, 0.018], [0.080, 0.020], [0.085, 0.022]],
        }
    }

    /// Both lenses before pictures of `aspect` times their height, which fill the
    /// display.
    #[must_use]
    pub fn eyes(self, aspect: f32) -> [EyeLens; 2] {
        let [x, y] = self.centre;
        let sides = [-aspect - x, aspect - x, 1.0 - y, -1.0 - y];
        let left = EyeLens {
            display: sides,
            picture: sides,
            k: self.k,
        };
        [left, left.mirrored()]
    }

    /// The profile, if a lens can be like that.
    ///
    /// # Errors
    /// When a number is not finite or far from any lens.
    pub fn checked(self) -> Result<Self, LensError> {
        let mut numbers = self.centre.iter().chain(self.k.as_flattened());
        if !numbers.all(|number| number.is_finite()) {
            return Err(LensError::NotFinite);
        }
        if self.centre.iter().any(|offset| offset.abs() > 1.0) {
            return Err(LensError::Centre);
        }
        if self.k.as_flattened().iter().any(|k| k.abs() > 2.0) {
            return Err(LensError::Coefficient);
        }
        Ok(self)
    }
}

impl Default for LensProfile {
    fn default() -> Self {
        Self::mild()
    }
}

/// A rectangle of a target, pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Viewport {
    /// Left column.
    pub x: u32,
    /// Upper row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Viewport {
    /// The left and the right half of a target.
    #[must_use]
    pub fn halves([width, height]: [u32; 2]) -> [Self; 2] {
        let half = width / 2;
        [0, half].map(|x| Self {
            x,
            y: 0,
            width: half,
            height,
        })
    }
}

/// As `Lens` in lens.wgsl.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct LensImmediates {
    pub(super) display: [f32; 4],
    pub(super) picture: [f32; 4],
    pub(super) k: [[f32; 2]; 3],
    pub(super) padding: [f32; 2],
}

/// Draws both eyes, bent, side by side.
#[derive(Debug)]
pub struct LensPass {
    pipeline: wgpu::RenderPipeline,
    eyes: [wgpu::BindGroup; 2],
    lenses: [EyeLens; 2],
}

impl LensPass {
    /// Bends what is in `source` into targets of `format`.
    #[must_use]
    pub fn new(
        device: &wgpu::Device,
        source: &EyeImages,
        format: wgpu::TextureFormat,
        lenses: [EyeLens; 2],
    ) -> Self {
        let layout = eye_layout(device);
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("lens"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..wgpu::SamplerDescriptor::default()
        });
        let eyes = source.layers().each_ref().map(|eye| {
            device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("lens"),
                layout: &layout,
                entries: &[
                    wgpu::BindGroupEntry {
                        binding: 0,
                        resource: wgpu::BindingResource::TextureView(eye),
                    },
                    wgpu::BindGroupEntry {
                        binding: 1,
                        resource: wgpu::BindingResource::Sampler(&sampler),
                    },
                ],
            })
        });
        Self {
            pipeline: pipeline(device, &layout, format),
            eyes,
            lenses,
        }
    }

    /// Draws the left and the right eye into their viewports of `target`, and
    /// black elsewhere.
    pub fn draw(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        target: &wgpu::TextureView,
        viewports: [Viewport; 2],
    ) {
        let mut pass = cover_pass(encoder, "lens", target);
        pass.set_pipeline(&self.pipeline);
        for ((eye, lens), view) in self.eyes.iter().zip(self.lenses).zip(viewports) {
            let lens = LensImmediates {
                display: lens.display,
                picture: lens.picture,
                k: lens.k,
                padding: [0.0; 2],
            };
            pass.set_viewport(
                view.x as f32,
                view.y as f32,
                view.width as f32,
                view.height as f32,
                0.0,
                1.0,
            );
            pass.set_immediates(0, bytemuck::bytes_of(&lens));
            pass.set_bind_group(0, eye, &[]);
            pass.draw(0..3, 0..1);
        }
    }
}

fn eye_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("lens"),
        entries: &[
            wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::FRAGMENT,
                ty: wgpu::BindingType::Texture {
                    sample_type: wgpu::TextureSampleType::Float { filterable: true },
                    view_dimension: wgpu::TextureViewDimension::D2,
                    multisampled: false,
                },
                count: None,
            },
            wgpu::BindGroupLayoutEntry {
                binding: 1,
                visibility: wgpu::ShaderStages::FRAGMENT,
                ty: wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
                count: None,
            },
        ],
    })
}

fn pipeline(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    format: wgpu::TextureFormat,
) -> wgpu::RenderPipeline {
    let module = device.create_shader_module(wgpu::include_wgsl!("lens.wgsl"));
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("lens"),
        bind_group_layouts: &[Some(layout)],
        immediate_size: size_of::<LensImmediates>() as u32,
    });
    cover_pipeline(device, &module, "prewarp", Some(&layout), &[], format)
}
