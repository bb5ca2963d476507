//! Small frames are drawn by whatever Vulkan driver there is, and the pixels
//! are looked at. Without a driver these tests are ignored; that the shaders
//! are valid is always tested.

mod lens;
mod picture;
mod shaders;
mod stereo;
mod view;

use std::sync::Arc;

use glam::{Quat, Vec2, Vec3};
use shadecast_protocol::{Epoch, EyeView, Fov, FrameId, Motion, Pose, UpdateTiming};

use super::{EyeCamera, EyeImages, Gpu, Pixels, Readback, Renderer, RendererConfig, Stereo};
use crate::{ClientFrame, ClientTiming, DrawVertex, YuvPicture};

const SIZE: u32 = 64;
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// Limited-range BT.709 of pure colours.
const RED: [u8; 3] = [63, 102, 240];
const GREEN: [u8; 3] = [173, 42, 26];
const BLUE: [u8; 3] = [32, 240, 118];
const WHITE: [u8; 3] = [235, 128, 128];

/// A device that draws in the given mode.
fn gpu(stereo: Stereo) -> Gpu {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter =
        pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))
            .expect("these tests run where there is a driver");
    Gpu::with_stereo(adapter, stereo).expect("the driver gives a device")
}

/// Draws and keeps what it draws into.
pub(super) struct Bench {
    pub(super) gpu: Gpu,
    pub(super) renderer: Renderer,
    eyes: EyeImages,
    seconds_of_motion: f32,
}

impl Bench {
    pub(super) fn new(stereo: Stereo) -> Self {
        Self::with(RendererConfig {
            eye_size: [SIZE; 2],
            eye_format: FORMAT,
            stereo,
            antialias: false,
        })
    }

    fn with(config: RendererConfig) -> Self {
        Self::on(gpu(config.stereo), config)
    }

    /// On a device that was made otherwise.
    pub(super) fn on_device(gpu: Gpu) -> Self {
        let config = RendererConfig {
            eye_size: [SIZE; 2],
            eye_format: FORMAT,
            stereo: gpu.stereo,
            antialias: false,
        };
        Self::on(gpu, config)
    }

    fn on(gpu: Gpu, config: RendererConfig) -> Self {
        let renderer = Renderer::new(&gpu.device, &gpu.queue, config);
        let eyes = EyeImages::new(&gpu.device, config.eye_size, config.eye_format);
        Self {
            gpu,
            renderer,
            eyes,
            seconds_of_motion: 0.0,
        }
    }

    fn with_frame(frame: &ClientFrame) -> Self {
        let mut bench = Self::new(Stereo::TwoPass);
        bench.renderer.upload(frame).expect("a sound frame");
        bench
    }

    fn draw(&self, cameras: [EyeCamera; 2]) -> [Pixels; 2] {
        let mut encoder = self.encoder();
        self.renderer
            .draw(&mut encoder, cameras, self.seconds_of_motion, &self.eyes);
        let copies = [0, 1]
            .map(|eye| Readback::record(&self.gpu.device, &mut encoder, self.eyes.texture(), eye));
        self.gpu.queue.submit([encoder.finish()]);
        copies.map(|copy| copy.take(&self.gpu.device).expect("the device answers"))
    }

    /// What a single eye sees.
    pub(super) fn look(&self, world_from_eye: Pose) -> Pixels {
        let [left, _] = self.draw([camera(world_from_eye); 2]);
        left
    }

    pub(super) fn encoder(&self) -> wgpu::CommandEncoder {
        self.gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }
}

/// 90 degrees wide and high.
fn camera(world_from_eye: Pose) -> EyeCamera {
    EyeCamera {
        world_from_eye,
        fov: Fov::symmetric(90_f32.to_radians()),
    }
}

/// A head with eyes 64 mm apart.
fn eyes() -> [EyeView; 2] {
    [-0.032, 0.032].map(|x| EyeView {
        head_from_eye: Pose {
            position: Vec3::new(x, 0.0, 0.0),
            orientation: Quat::IDENTITY,
        },
        fov: Fov::symmetric(90_f32.to_radians()),
    })
}

pub(super) fn at(position: Vec3) -> Pose {
    Pose {
        position,
        orientation: Quat::IDENTITY,
    }
}

/// A picture whose 2x2 blocks have the YCbCr values that `color` gives.
pub(super) fn picture(side: u32, color: impl Fn(u32, u32) -> [u8; 3]) -> YuvPicture {
    let blocks = || (0..side / 2).flat_map(|y| (0..side / 2).map(move |x| (x, y)));
    YuvPicture {
        width: side,
        height: side,
        y: (0..side)
            .flat_map(|y| (0..side).map(move |x| (x, y)))
            .map(|(x, y)| color(x / 2, y / 2)[0])
            .collect(),
        u: blocks().map(|(x, y)| color(x, y)[1]).collect(),
        v: blocks().map(|(x, y)| color(x, y)[2]).collect(),
    }
}

/// Red and green above, blue and white below.
fn four_colors() -> YuvPicture {
    picture(16, |x, y| match (x < 4, y < 4) {
        (true, true) => RED,
        (false, true) => GREEN,
        (true, false) => BLUE,
        (false, false) => WHITE,
    })
}

/// Upright rectangles that face +Z.
#[derive(Default)]
pub(super) struct Geometry {
    vertices: Vec<DrawVertex>,
    indices: Vec<u32>,
}

impl Geometry {
    /// A rectangle about `centre` that shows the texels of an atlas rectangle.
    fn quad(mut self, centre: Vec3, half: f32, object: u32, texels: [Vec2; 2]) -> Self {
        let first = self.vertices.len() as u32;
        let [upper_left, lower_right] = texels;
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            let offset = Vec3::new(x * 2.0 - 1.0, 1.0 - y * 2.0, 0.0) * half;
            let texel = upper_left + (lower_right - upper_left) * Vec2::new(x, y);
            self.vertices.push(DrawVertex {
                position: (centre + offset).to_array(),
                object,
                texel: texel.extend(1.0).to_array(),
            });
        }
        // Counter-clockwise seen from +Z: up and down run against rows.
        self.indices
            .extend([0, 3, 1, 1, 3, 2].map(|corner| first + corner));
        self
    }

    /// The whole of a 16x16 atlas.
    pub(super) fn whole_quad(self, centre: Vec3, half: f32) -> Self {
        self.quad(centre, half, 0, [Vec2::splat(0.5), Vec2::splat(15.5)])
    }

    pub(super) fn frame(self, picture: YuvPicture) -> ClientFrame {
        ClientFrame {
            frame: FrameId(1),
            epoch: Epoch(0),
            world_from_head: Pose::IDENTITY,
            scene_time: 0,
            server_timing: UpdateTiming::default(),
            timing: ClientTiming::default(),
            vertices: Arc::new(self.vertices),
            opaque_indices: self.indices.len() as u32,
            foreshortened: false,
            indices: Arc::new(self.indices),
            objects_lead: 0,
            motions: Arc::new(vec![Motion::still(Pose::IDENTITY)]),
            picture: picture.into(),
            masks: None,
            patches: 1,
        }
    }
}

impl Pixels {
    pub(super) fn at(&self, x: u32, y: u32) -> [u8; 3] {
        let first = (y * self.width + x) as usize * 4;
        [self.rgba[first], self.rgba[first + 1], self.rgba[first + 2]]
    }

    /// Columns of the pixels that are not black, first and last.
    fn columns_in_row(&self, y: u32) -> Option<(u32, u32)> {
        let mut lit = (0..self.width).filter(|x| self.at(*x, y) != [0, 0, 0]);
        let first = lit.next()?;
        Some((first, lit.next_back().unwrap_or(first)))
    }
}

#[track_caller]
pub(super) fn assert_close(actual: [u8; 3], expected: [u8; 3], tolerance: u8) {
    let far = actual
        .iter()
        .zip(expected)
        .any(|(a, b)| a.abs_diff(b) > tolerance);
    assert!(!far, "{actual:?} is not {expected:?}");
}
