//! A headset, the runtime that it is in, and worlds to show in it.

use std::sync::Arc;

use glam::{Quat, Vec3};
use shadecast_client::openxr::{Headset, HeadsetConfig, HeadsetError, api};
use shadecast_client::render::{
    EyeCamera, EyeImages, FrameSender, Gpu, Pixels, Readback, Renderer, RendererConfig,
    frame_channel,
};
use shadecast_client::worn::{Display, IDLE, Turn};
use shadecast_client::{
    ClientFrame, ClientTiming, DecodedPicture, DrawVertex, HeadView, Input, YuvPicture,
};
use shadecast_protocol::{
    ClientTime, Epoch, Fov, FrameId, Method, Motion, Pose, Sky, UpdateTiming, Welcome,
};
use shadecast_simulated_runtime::sys::{Fovf, Posef};
use shadecast_simulated_runtime::{Controller, Eyes, Image, Runtime, Script, ViewPart};

/// Small pictures, where what is on them matters little.
pub(crate) const SMALL: u32 = 48;

/// A head that stands still and looks ahead.
pub(crate) fn still_head() -> Box<dyn Fn(f64) -> Posef + Send> {
    Box::new(|_| {
        let mut head = Controller::AT_REST.aim;
        head.position.y = 1.6;
        head
    })
}

/// A headset in a runtime of its own.
pub(crate) struct Rig {
    pub(crate) runtime: Runtime,
    pub(crate) headset: Headset,
    pub(crate) sender: FrameSender,
    /// What the server would have been told.
    pub(crate) told: Vec<Input>,
}

impl Rig {
    pub(crate) fn open(script: Script) -> Result<Self, HeadsetError> {
        Self::with(script, HeadsetConfig::default())
    }

    pub(crate) fn with(script: Script, config: HeadsetConfig) -> Result<Self, HeadsetError> {
        let runtime = Runtime::new(script);
        // SAFETY: the simulation answers as OpenXR says.
        let entry = unsafe { api::Entry::from_get_instance_proc_addr(runtime.entry(), &()) };
        let (sender, frames) = frame_channel();
        let headset = Headset::open(entry.expect("its functions"), (), config, frames)?;
        Ok(Self {
            runtime,
            headset,
            sender,
            told: Vec::new(),
        })
    }

    /// A headset with small pictures that shows a wall.
    pub(crate) fn at_the_wall(mut script: Script) -> Self {
        script.headset.eyes.size = [SMALL; 2];
        let mut rig = Self::open(script).expect("the headset opens");
        rig.headset.welcome(&welcome());
        rig.sender.send(wall());
        rig
    }

    pub(crate) fn now(&self) -> ClientTime {
        ClientTime(self.runtime.now() as u64)
    }

    pub(crate) fn turn(&mut self) -> Turn {
        let runtime = self.runtime.clone();
        let told = &mut self.told;
        let turn = self
            .headset
            .turn(&|| ClientTime(runtime.now() as u64), &mut |input| {
                told.push(input)
            })
            .expect("the headset goes on");
        if !matches!(turn, Turn::Frame(_)) {
            self.runtime.pass(IDLE);
        }
        turn
    }

    /// Turns until so many frames have been waited for.
    pub(crate) fn run_to(&mut self, frame: u64) {
        for _ in 0..100_000 {
            if self.runtime.waited() >= frame {
                return;
            }
            self.turn();
        }
        panic!("the headset does not come to frame {frame}");
    }

    /// Turns until the headset says something other than idle and frames.
    pub(crate) fn run_to_end(&mut self) -> Turn {
        for _ in 0..100_000 {
            match self.turn() {
                Turn::Idle | Turn::Frame(_) => {}
                end => return end,
            }
        }
        panic!("the headset does not end");
    }

    /// View reports, in order.
    pub(crate) fn views(&self) -> Vec<HeadView> {
        let view = |input: &Input| match input {
            Input::View(view) => Some(*view),
            _ => None,
        };
        self.told.iter().filter_map(view).collect()
    }
}

pub(crate) fn welcome() -> Welcome {
    Welcome {
        codec: shadecast_protocol::Codec::H264,
        method: Method::Sas,
        atlas_size: [64; 2],
        superblock: 16,
        world_from_play: Pose::IDENTITY,
        sky: Sky {
            width: 2,
            height: 1,
            rgb: [0, 90, 200].repeat(2),
        },
    }
}

/// A red wall two metres ahead, wider and higher than what is seen.
pub(crate) fn wall() -> Arc<ClientFrame> {
    red_square(9.0)
}

/// A square two metres ahead, reaching so far from where a standing head looks.
pub(crate) fn red_square(half: f32) -> Arc<ClientFrame> {
    let (low, high) = (1.6 - half, 1.6 + half);
    let corners = [(-half, low), (half, low), (half, high), (-half, high)];
    let vertices = corners.map(|(x, y)| DrawVertex {
        position: [x, y, -2.0],
        object: 0,
        texel: [8.0, 8.0, 1.0],
    });
    Arc::new(ClientFrame {
        frame: FrameId(1),
        epoch: Epoch(0),
        world_from_head: Pose::IDENTITY,
        scene_time: 0,
        server_timing: UpdateTiming::default(),
        timing: ClientTiming::default(),
        vertices: Arc::new(vertices.to_vec()),
        indices: Arc::new(vec![0, 1, 2, 0, 2, 3]),
        opaque_indices: 6,
        foreshortened: false,
        objects_lead: 0,
        motions: Arc::new(vec![Motion::still(Pose::IDENTITY)]),
        // Red in limited-range BT.709.
        picture: DecodedPicture::from(YuvPicture {
            width: 16,
            height: 16,
            y: vec![63; 256],
            u: vec![102; 64],
            v: vec![240; 64],
        }),
        masks: None,
        patches: 1,
    })
}

pub(crate) fn small_eyes() -> Eyes {
    Eyes {
        size: [SMALL; 2],
        ..shadecast_simulated_runtime::Headset::default().eyes
    }
}

pub(crate) fn pose_of(pose: Posef) -> Pose {
    let (p, q) = (pose.position, pose.orientation);
    Pose {
        position: Vec3::new(p.x, p.y, p.z),
        orientation: Quat::from_xyzw(q.x, q.y, q.z, q.w).normalize(),
    }
}

pub(crate) fn fov_of(fov: Fovf) -> Fov {
    Fov {
        left: fov.angle_left,
        right: fov.angle_right,
        up: fov.angle_up,
        down: fov.angle_down,
    }
}

/// Cameras where the views of a layer say.
pub(crate) fn cameras(world_from_play: Pose, views: &[ViewPart; 2]) -> [EyeCamera; 2] {
    views.map(|view| EyeCamera {
        world_from_eye: world_from_play.then(pose_of(view.pose)),
        fov: fov_of(view.fov),
    })
}

/// What the mock headset draws, on a device of its own.
pub(crate) struct MockHeadset {
    gpu: Gpu,
    renderer: Renderer,
    eyes: EyeImages,
}

impl MockHeadset {
    pub(crate) fn new(side: u32, format: wgpu::TextureFormat, welcome: &Welcome) -> Self {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let gpu = Gpu::open(&instance, None).expect("a device");
        let config = RendererConfig {
            eye_size: [side; 2],
            eye_format: format,
            stereo: gpu.stereo,
            antialias: true,
        };
        let mut renderer = Renderer::new(&gpu.device, &gpu.queue, config);
        renderer.set_sky(Some(&welcome.sky));
        Self {
            eyes: EyeImages::new(&gpu.device, config.eye_size, format),
            renderer,
            gpu,
        }
    }

    pub(crate) fn draw(
        &mut self,
        frame: &ClientFrame,
        cameras: [EyeCamera; 2],
        seconds_of_motion: f32,
    ) -> [Pixels; 2] {
        self.renderer.upload(frame).expect("a sound frame");
        let mut encoder = self
            .gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.renderer
            .draw(&mut encoder, cameras, seconds_of_motion, &self.eyes);
        let copies = [0, 1]
            .map(|eye| Readback::record(&self.gpu.device, &mut encoder, self.eyes.texture(), eye));
        self.gpu.queue.submit([encoder.finish()]);
        copies.map(|copy| copy.take(&self.gpu.device).expect("the device answers"))
    }
}

/// Peak signal-to-noise ratio over red, green and blue, dB.
pub(crate) fn psnr(one: &Image, other: &Pixels) -> f64 {
    assert_eq!([one.width, one.height], [other.width, other.height]);
    let pairs = one.bytes.iter().zip(&other.rgba).enumerate();
    let squares = pairs
        .filter(|(index, _)| index % 4 != 3)
        .map(|(_, (a, b))| f64::from(a.abs_diff(*b)).powi(2));
    let mean = squares.sum::<f64>() / f64::from(one.width * one.height * 3);
    10.0 * (255.0_f64.powi(2) / mean.max(1e-9)).log10()
}

/// Red, green and blue of a pixel.
pub(crate) fn pixel(image: &Image, x: u32, y: u32) -> [u8; 3] {
    let first = ((y * image.width + x) * 4) as usize;
    [0, 1, 2].map(|channel| image.bytes[first + channel])
}
