//! The ways to draw a view whose error is measured.

use std::time::Duration;

use anyhow::Result;
use shadecast_server::{
    Integrator,
    scene::Scene,
    still::{Camera, DEFAULT_BOUNCES, Still, StillRenderer},
};

use crate::{
    ours::Ours,
    report::{Spent, timed},
};

/// Side of the atlas, texels: room for all that the view shows.
const ATLAS: u16 = 512;
/// Most pictures of a number of samples.
const MOST_RUNS: u32 = 16;

/// Pictures of as many samples each, and what one of them took.
pub(super) struct Sample {
    pub(super) method: &'static str,
    pub(super) stills: Vec<Still>,
    pub(super) spent: Spent,
    /// Paths for a pixel of the view.
    pub(super) spp: f64,
}

pub(super) struct Method {
    pub(super) name: &'static str,
    integrator: fn(&mut Integrator),
    in_atlas: bool,
}

const fn method(name: &'static str, integrator: fn(&mut Integrator), in_atlas: bool) -> Method {
    Method {
        name,
        integrator,
        in_atlas,
    }
}

/// The first is what the others are compared with.
pub(super) const METHODS: &[Method] = &[
    method("path tracing", |_| (), false),
    method("no light selection", |i| i.light_selection = false, false),
    method(
        "no multiple importance",
        |i| i.multiple_importance = false,
        false,
    ),
    method("no low discrepancy", |i| i.low_discrepancy = false, false),
    method("accumulated in the atlas", |i| i.smoothing = false, true),
    method("accumulated and smoothed", |_| (), true),
];

impl Method {
    /// Pictures of twice as many samples each, up to `spp`. `driver` gets the
    /// device's name.
    pub(super) fn measure(
        &self,
        scene: &Scene,
        camera: &Camera,
        spp: u32,
        seed: u32,
        driver: &mut String,
    ) -> Result<Vec<Sample>> {
        let mut integrator = Integrator::with_bounces(DEFAULT_BOUNCES);
        (self.integrator)(&mut integrator);
        if self.in_atlas {
            return self.in_atlas(scene, integrator, camera, spp);
        }
        let mut renderer = StillRenderer::new(scene, integrator, &mut |_| ())?;
        renderer.adapter().clone_into(driver);
        self.in_pixels(&mut renderer, camera, spp, seed)
    }

    fn in_pixels(
        &self,
        renderer: &mut StillRenderer,
        camera: &Camera,
        spp: u32,
        mut seed: u32,
    ) -> Result<Vec<Sample>> {
        // Drivers compile at the first use.
        renderer.render(camera, Duration::ZERO, 1, seed)?;
        let mut samples = Vec::new();
        let mut each = 1;
        while each <= spp {
            let runs = (spp / each).min(MOST_RUNS);
            let mut stills = Vec::new();
            let mut spent = Spent::default();
            for _ in 0..runs {
                seed = seed.wrapping_add(1);
                let drawn = timed(|| Ok(renderer.render(camera, Duration::ZERO, each, seed)?))?;
                stills.push(drawn.0);
                spent += drawn.1;
            }
            samples.push(Sample {
                method: self.name,
                stills,
                spent: spent / runs,
                spp: f64::from(each),
            });
            each *= 2;
        }
        Ok(samples)
    }

    /// One picture after the other of the same atlas.
    fn in_atlas(
        &self,
        scene: &Scene,
        integrator: Integrator,
        camera: &Camera,
        spp: u32,
    ) -> Result<Vec<Sample>> {
        let pixels = camera.width * camera.height;
        let new = || Ours::new(scene, integrator, (camera.fov, camera.width as u16), ATLAS);
        // Drivers compile at the first use.
        new()?.frame(camera.world_from_eye, Duration::ZERO, pixels)?;
        let mut ours = new()?;
        let mut spent = Spent::default();
        let mut paths = 0.0;
        let mut samples = Vec::new();
        let mut until = 1;
        while until <= spp {
            while paths < f64::from(until) * f64::from(pixels) {
                let (stats, frame) = ours.frame(camera.world_from_eye, Duration::ZERO, pixels)?;
                paths += f64::from(stats.paths);
                spent += frame;
            }
            let view = (camera.world_from_eye, camera.fov.tangents());
            samples.push(Sample {
                method: self.name,
                stills: vec![ours.see(view, [camera.width, camera.height])?],
                spent,
                spp: paths / f64::from(pixels),
            });
            until *= 2;
        }
        Ok(samples)
    }
}
