//! Still pictures through a pinhole camera, by the same paths as the atlas:
//! what a client's picture is compared with.

use std::{path::Path, time::Duration};

use glam::{Mat3, Quat, Vec3};
use image::{ImageFormat, ImageResult, Rgb, Rgb32FImage, RgbImage};
use shadecast_protocol::{Fov, Pose};
use shadecast_shaders::light::{STILL_SOURCE, StillParameters, rows_of_affine};
use shadecast_shaders::picture::displayed as tone_map;
use wgpu::ShaderStages;

use crate::{
    gpu::{Binding, Gpu, GpuError, GpuScene, Integrator, bind, layout},
    light::{Ends, Paths},
    scene::Scene,
};

/// Indirect bounces of a server's paths unless told otherwise.
pub const DEFAULT_BOUNCES: u32 = 1;
/// Displayed value, linear, that the automatic exposure gives the log-average luminance.
const MIDDLE_GREY: f32 = 0.2;
/// Displayed value that it gives at most to the luminance that a tenth of the
/// pixels exceed: sunlit walls keep their colour.
const BRIGHT: f32 = 0.85;
/// Samples a pixel of the pictures that the exposure is measured in.
const EXPOSURE_SAMPLES: u32 = 16;

/// A pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Where it stands; it looks along -Z.
    pub world_from_eye: Pose,
    /// What it sees.
    pub fov: Fov,
    /// In pixels.
    pub width: u32,
    /// In pixels.
    pub height: u32,
}

/// Linear radiance, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Still {
    /// In pixels.
    pub width: u32,
    /// In pixels.
    pub height: u32,
    /// W/(sr m²), one a pixel.
    pub radiance: Vec<Vec3>,
}

impl Still {
    /// The picture as it is displayed: exposure, tone curve, sRGB.
    #[must_use]
    pub fn displayed(&self, exposure: f32) -> RgbImage {
        let mut picture = RgbImage::new(self.width, self.height);
        for (pixel, radiance) in picture.pixels_mut().zip(&self.radiance) {
            *pixel = Rgb(tone_map(*radiance, exposure));
        }
        picture
    }

    /// Writes it as OpenEXR: linear radiance, 32-bit floats.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn save_exr(&self, path: &Path) -> ImageResult<()> {
        let mut picture = Rgb32FImage::new(self.width, self.height);
        for (pixel, radiance) in picture.pixels_mut().zip(&self.radiance) {
            *pixel = Rgb(radiance.to_array());
        }
        picture.save_with_format(path, ImageFormat::OpenExr)
    }

    /// The exposure that shows it at a middling brightness.
    #[must_use]
    pub fn automatic_exposure(&self) -> f32 {
        exposure_of(&self.radiance)
    }
}

/// A picture in the making: samples can be added and looked at in turn.
#[derive(Debug)]
pub struct Film {
    size: [u32; 2],
    samples: u32,
    parameters: wgpu::Buffer,
    sum: wgpu::Buffer,
    group: wgpu::BindGroup,
}

impl Film {
    /// Samples a pixel so far.
    #[must_use]
    pub fn samples(&self) -> u32 {
        self.samples
    }
}

/// The kernels of still pictures.
#[derive(Debug)]
pub struct StillPass {
    paths: Paths,
    start: wgpu::ComputePipeline,
    add: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
}

impl StillPass {
    /// Compiles the kernels for what the scene needs.
    ///
    /// # Errors
    /// When the device has no room for a wave of paths.
    pub fn new(gpu: &Gpu, gpu_scene: &GpuScene) -> Result<Self, GpuError> {
        let layout = layout(
            gpu,
            ShaderStages::COMPUTE,
            &[Binding::Uniform, Binding::Write],
        );
        let paths = Paths::new(gpu, gpu_scene, u32::MAX)?;
        let layouts = [&gpu_scene.layout, &paths.layout, &layout];
        let pipeline =
            |entry| gpu.compute_pipeline(STILL_SOURCE, entry, &layouts, &gpu_scene.constants);
        Ok(Self {
            start: pipeline("start_at_pixels"),
            add: pipeline("add_to_pixels"),
            paths,
            layout,
        })
    }

    /// An unexposed film.
    ///
    /// # Errors
    /// When the device has no room for it.
    pub fn film(&self, gpu: &Gpu, size: [u32; 2]) -> Result<Film, GpuError> {
        let bytes = u64::from(size[0]) * u64::from(size[1]) * 16;
        let parameters = gpu.uniform("still", size_of::<StillParameters>());
        let sum = gpu.scratch("still pictures", bytes)?;
        Ok(Film {
            size,
            samples: 0,
            group: bind(gpu, &self.layout, &[&parameters, &sum]),
            parameters,
            sum,
        })
    }

    /// Adds `samples` samples a pixel to what is on the film; objects stand
    /// where they were last moved to. Samples of one seed and of films of one
    /// size continue one sequence.
    pub fn expose(
        &self,
        gpu: &Gpu,
        gpu_scene: &GpuScene,
        film: &mut Film,
        view: (Pose, [f32; 4]),
        samples: u32,
        seed: u32,
    ) {
        let (pose, tangents) = view;
        let pixels = film.size[0] * film.size[1];
        // Whole samples, as many as a wave holds.
        let at_once = (self.paths.longest_wave() / pixels).max(1);
        let last = film.samples.saturating_add(samples);
        while film.samples < last {
            let now = at_once.min(last - film.samples);
            let values = StillParameters {
                world_from_eye: rows_of_affine(Mat3::from_quat(pose.orientation), pose.position),
                tangents,
                size: film.size,
                sample_index: film.samples,
                seed,
            };
            gpu.queue
                .write_buffer(&film.parameters, 0, bytemuck::bytes_of(&values));
            let ends = Ends {
                start: &self.start,
                before_finish: None,
                finish: &self.add,
                group: &film.group,
                from_camera: true,
            };
            self.paths.follow(gpu, gpu_scene, ends, pixels * now);
            film.samples += now;
        }
    }

    /// What is on the film; waits for all of it.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn develop(&self, gpu: &Gpu, film: &Film) -> Result<Still, GpuError> {
        let sums = gpu.read(&film.sum, 0..film.sum.size())?.into_iter();
        let [width, height] = film.size;
        Ok(Still {
            width,
            height,
            radiance: sums
                .map(|[r, g, b, count]: [f32; 4]| Vec3::new(r, g, b) / count.max(1.0))
                .collect(),
        })
    }

    /// The exposure that shows what is seen from `eye` at a middling brightness.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn automatic_exposure(
        &self,
        gpu: &Gpu,
        gpu_scene: &GpuScene,
        eye: Pose,
    ) -> Result<f32, GpuError> {
        let mut radiance = Vec::new();
        for turn in 0..4 {
            let turned = Pose {
                position: Vec3::ZERO,
                orientation: Quat::from_rotation_y(turn as f32 * std::f32::consts::FRAC_PI_2),
            };
            let view = (eye.then(turned), [-1.0, 1.0, 1.0, -1.0]);
            let mut film = self.film(gpu, [32; 2])?;
            self.expose(gpu, gpu_scene, &mut film, view, EXPOSURE_SAMPLES, 1);
            radiance.extend(self.develop(gpu, &film)?.radiance);
        }
        Ok(exposure_of(&radiance))
    }

    /// Rays traced so far.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn rays(&self, gpu: &Gpu) -> Result<u64, GpuError> {
        self.paths.rays(gpu)
    }
}

fn exposure_of(radiance: &[Vec3]) -> f32 {
    let weights = Vec3::new(0.2126, 0.7152, 0.0722);
    let mut luminances: Vec<f32> = radiance
        .iter()
        .map(|radiance| radiance.dot(weights))
        .filter(|luminance| *luminance > 0.0)
        .collect();
    if luminances.is_empty() {
        return 1.0;
    }
    luminances.sort_by(f32::total_cmp);
    let sum_of_logs: f64 = luminances.iter().map(|l| f64::from(l.ln())).sum();
    let log_mean = sum_of_logs / luminances.len() as f64;
    let bright = luminances[luminances.len() * 9 / 10];
    (MIDDLE_GREY / log_mean.exp() as f32)
        .min(BRIGHT / bright)
        .clamp(1e-6, 1e6)
}

/// Renders stills of a scene on a device of its own.
#[derive(Debug)]
pub struct StillRenderer {
    gpu: Gpu,
    gpu_scene: GpuScene,
    pass: StillPass,
    scene: Scene,
}

impl StillRenderer {
    /// Opens a device and uploads the scene. `progress` is told the share done.
    ///
    /// # Errors
    /// When there is no device or the scene does not fit it.
    pub fn new(
        scene: &Scene,
        integrator: Integrator,
        progress: &mut dyn FnMut(f32),
    ) -> Result<Self, GpuError> {
        let gpu = Gpu::open()?;
        let gpu_scene = GpuScene::new(&gpu, scene, integrator, progress)?;
        let pass = StillPass::new(&gpu, &gpu_scene)?;
        Ok(Self {
            gpu,
            gpu_scene,
            pass,
            scene: scene.clone(),
        })
    }

    /// The device that it renders on.
    #[must_use]
    pub fn adapter(&self) -> &str {
        &self.gpu.adapter
    }

    /// True where that device is a program on the CPU.
    #[must_use]
    pub fn is_software(&self) -> bool {
        self.gpu.is_software
    }

    /// An unexposed film for pictures of this width and height.
    ///
    /// # Errors
    /// When the device has no room for it.
    pub fn film(&self, size: [u32; 2]) -> Result<Film, GpuError> {
        self.pass.film(&self.gpu, size)
    }

    /// Adds samples to a film that is as large as the camera's picture, with
    /// objects where they are at `scene_time`, and waits for them.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn expose(
        &mut self,
        film: &mut Film,
        camera: &Camera,
        scene_time: Duration,
        samples: u32,
        seed: u32,
    ) -> Result<(), GpuError> {
        let poses: Vec<Pose> = self
            .scene
            .objects
            .iter()
            .map(|object| object.world_from_object(scene_time))
            .collect();
        self.gpu_scene.set_poses(&self.gpu, &poses);
        let view = (camera.world_from_eye, camera.fov.tangents());
        self.pass
            .expose(&self.gpu, &self.gpu_scene, film, view, samples, seed);
        self.gpu.wait()
    }

    /// What is on a film.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn develop(&self, film: &Film) -> Result<Still, GpuError> {
        self.pass.develop(&self.gpu, film)
    }

    /// Rays traced so far.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn rays(&self) -> Result<u64, GpuError> {
        self.pass.rays(&self.gpu)
    }

    /// A picture in one go.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn render(
        &mut self,
        camera: &Camera,
        scene_time: Duration,
        samples: u32,
        seed: u32,
    ) -> Result<Still, GpuError> {
        let mut film = self.film([camera.width, camera.height])?;
        self.expose(&mut film, camera, scene_time, samples, seed)?;
        self.develop(&film)
    }
}
