//! A view of the atlas from frame to frame.

use std::time::Duration;

use anyhow::{Context, Result};
use shadecast_protocol::{Fov, Pose};
use shadecast_server::{Integrator, encode::Planes, scene::Scene};

use super::scenes::{Picture, View};
use crate::ours::Ours;

/// Of the picture, pixels.
const SIDE: u16 = 32;
/// Of the atlas, texels: room for all that is seen.
const ATLAS: u16 = 256;
/// Of a frame: a path for each pixel, twice over as texels are smaller.
const PATHS: u32 = 2 * SIDE as u32 * SIDE as u32;

/// A scene's atlas, and what is seen of it.
pub(super) struct Watched {
    ours: Ours,
    eye: Pose,
    fov: Fov,
}

impl Watched {
    pub(super) fn new(
        scene: &Scene,
        view: View,
        integrator: Integrator,
        exposure: f32,
    ) -> Result<Self> {
        let fov = Fov::symmetric(view.angle);
        let ours = Ours::exposed(scene, integrator, (fov, SIDE), ATLAS, exposure)?;
        Ok(Self {
            ours,
            eye: view.pose(),
            fov,
        })
    }

    /// Moves the eye.
    pub(super) fn look(&mut self, view: View) {
        self.eye = view.pose();
        self.fov = Fov::symmetric(view.angle);
    }

    /// What is seen of the next frame.
    pub(super) fn shown(&mut self, scene_time: Duration) -> Result<Picture> {
        self.ours.frame(self.eye, scene_time, PATHS)?;
        let view = (self.eye, self.fov.tangents());
        let still = self.ours.see(view, [SIDE.into(); 2])?;
        Ok(Picture(still.radiance))
    }

    /// What the video of the last frame is made of.
    pub(super) fn planes(&self) -> Result<Planes> {
        self.ours.planes().context("no frame was made")
    }
}
