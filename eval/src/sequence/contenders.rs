//! The methods that are compared, each behind the same door.

use std::time::Duration;

use anyhow::Result;
use shadecast_protocol::Pose;
use shadecast_server::{
    Gpu, GpuScene, Integrator,
    scene::Scene,
    still::{Camera, DEFAULT_BOUNCES, Still, StillRenderer},
};

use crate::{
    ours::Ours,
    report::{Spent, timed},
    svgf::Svgf,
};

/// Side of our atlas, texels: room for all that the view shows.
const ATLAS: u16 = 512;

/// Something that makes update after update of a moving view.
pub(super) trait Contender {
    /// Makes the update for this camera and time, of this much work.
    fn update(&mut self, camera: &Camera, time: Duration, work: u32) -> Result<Spent>;

    /// What is displayed of it.
    fn picture(&mut self, camera: &Camera) -> Result<Still>;
}

/// A method by its name, and how a contender for a scene and camera is made.
pub(super) struct Method {
    pub(super) name: &'static str,
    pub(super) make: fn(&Scene, &Camera) -> Result<Box<dyn Contender>>,
    /// Unit of work: samples for each of so many pixels, or paths.
    pub(super) per_pixel: bool,
}

/// Ours is the last, and the others are what it is measured by.
pub(super) const METHODS: [Method; 3] = [
    Method {
        name: "fresh frames",
        make: |scene, _| Ok(Box::new(Fresh::new(scene)?)),
        per_pixel: true,
    },
    Method {
        name: "screen-space SVGF",
        make: |scene, camera| Ok(Box::new(ScreenSpace::new(scene, camera)?)),
        per_pixel: true,
    },
    Method {
        name: "ours",
        make: |scene, camera| {
            let view = (camera.fov, camera.width as u16);
            Ok(Box::new(Ours::new(scene, integrator(), view, ATLAS)?))
        },
        per_pixel: false,
    },
];

pub(super) fn integrator() -> Integrator {
    Integrator::with_bounces(DEFAULT_BOUNCES)
}

/// As many samples as there is time for, and nothing remembered.
struct Fresh {
    renderer: StillRenderer,
    seed: u32,
    last: Option<Still>,
}

impl Fresh {
    fn new(scene: &Scene) -> Result<Self> {
        Ok(Self {
            renderer: StillRenderer::new(scene, integrator(), &mut |_| ())?,
            seed: 0,
            last: None,
        })
    }
}

impl Contender for Fresh {
    fn update(&mut self, camera: &Camera, time: Duration, samples: u32) -> Result<Spent> {
        self.seed = self.seed.wrapping_add(1);
        let (still, spent) =
            timed(|| Ok(self.renderer.render(camera, time, samples, self.seed)?))?;
        self.last = Some(still);
        Ok(spent)
    }

    fn picture(&mut self, camera: &Camera) -> Result<Still> {
        match self.last.take() {
            Some(still) => Ok(still),
            None => Ok(self.renderer.render(camera, Duration::ZERO, 1, 0)?),
        }
    }
}

/// The baseline of the field.
struct ScreenSpace {
    gpu: Gpu,
    gpu_scene: GpuScene,
    scene: Scene,
    svgf: Svgf,
    seed: u32,
}

impl ScreenSpace {
    fn new(scene: &Scene, camera: &Camera) -> Result<Self> {
        let gpu = Gpu::open()?;
        let gpu_scene = GpuScene::new(&gpu, scene, integrator(), &mut |_| ())?;
        Ok(Self {
            svgf: Svgf::new(&gpu, &gpu_scene, [camera.width, camera.height])?,
            gpu,
            gpu_scene,
            scene: scene.clone(),
            seed: 0,
        })
    }
}

impl Contender for ScreenSpace {
    fn update(&mut self, camera: &Camera, time: Duration, samples: u32) -> Result<Spent> {
        self.seed = self.seed.wrapping_add(1);
        let objects = self.scene.objects.iter();
        let poses: Vec<Pose> = objects
            .map(|object| object.world_from_object(time))
            .collect();
        let view = (camera.world_from_eye, camera.fov.tangents());
        let made = timed(|| {
            self.gpu_scene.set_poses(&self.gpu, &poses);
            self.svgf
                .frame(&self.gpu, &self.gpu_scene, view, samples, self.seed);
            Ok(self.gpu.wait()?)
        });
        Ok(made?.1)
    }

    fn picture(&mut self, _: &Camera) -> Result<Still> {
        Ok(self.svgf.read(&self.gpu)?)
    }
}

impl Contender for Ours {
    fn update(&mut self, camera: &Camera, time: Duration, paths: u32) -> Result<Spent> {
        Ok(self.frame(camera.world_from_eye, time, paths)?.1)
    }

    fn picture(&mut self, camera: &Camera) -> Result<Still> {
        let view = (camera.world_from_eye, camera.fov.tangents());
        self.see(view, [camera.width, camera.height])
    }
}
