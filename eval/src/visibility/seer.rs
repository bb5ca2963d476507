//! What is seen from anywhere, as the server finds it.

use std::time::Duration;

use anyhow::Result;
use glam::Vec3;
use shadecast_protocol::{Pose, ViewReport};
use shadecast_server::{
    Gpu, GpuScene, Integrator, Visibility,
    patches::{self, PatchLimits, PatchedScene},
    prediction::Viewpoint,
    scene::Scene,
};

/// Largest block that patches are cut for, texels.
pub(super) const SUPERBLOCK: u16 = 128;

/// A scene on the GPU, and the pass that draws its patches' ids.
pub(super) struct Seer {
    pub(super) gpu: Gpu,
    pub(super) gpu_scene: GpuScene,
    pub(super) scene: PatchedScene,
    pub(super) visibility: Visibility,
    /// Solid angles are of these: corners of each patch's triangles.
    triangles: Vec<Vec<[Vec3; 3]>>,
}

impl Seer {
    pub(super) fn new(scene: &Scene, pixels_per_radian: f32) -> Result<Self> {
        let gpu = Gpu::open()?;
        let limits = PatchLimits::for_atlas(SUPERBLOCK, pixels_per_radian);
        let scene = patches::cut(scene.clone(), limits);
        let integrator = Integrator::with_bounces(0);
        let gpu_scene = GpuScene::new(&gpu, &scene.scene, integrator, &mut |_| ())?;
        let visibility = Visibility::new(&gpu, &gpu_scene, &scene)?;
        let positions = &scene.scene.positions;
        let triangles = (scene.patches.iter())
            .map(|patch| {
                let corners = patch.corners.map(|corner| positions[corner as usize]);
                (patch.shape.triangles().iter())
                    .map(|triangle| triangle.map(|corner| corners[corner]))
                    .collect()
            })
            .collect();
        Ok(Self {
            gpu,
            gpu_scene,
            scene,
            visibility,
            triangles,
        })
    }

    /// Pixels of each patch in all pictures from these viewpoints; the scene is as at
    /// `time` and so long after as each viewpoint says.
    pub(super) fn seen(&mut self, viewpoints: &[Viewpoint], time: Duration) -> Result<Vec<u32>> {
        let mut encoder = self
            .gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.record(&mut encoder, viewpoints, time);
        self.gpu.queue.submit([encoder.finish()]);
        self.pixels()
    }

    pub(super) fn record(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        viewpoints: &[Viewpoint],
        time: Duration,
    ) {
        let objects_after = |after| self.scene.scene.poses(time + after);
        let (gpu, gpu_scene) = (&self.gpu, &self.gpu_scene);
        self.visibility
            .record(gpu, encoder, gpu_scene, viewpoints, objects_after);
    }

    /// What the last pictures had.
    pub(super) fn pixels(&self) -> Result<Vec<u32>> {
        let bytes = self.scene.patches.len() as u64 * 4;
        Ok(self.gpu.read(self.visibility.pixels(), 0..bytes)?)
    }

    /// Solid angle of the triangles of each of these patches as seen from `eye`,
    /// steradian: their projected area, on a sphere, since a patch may lie beside or
    /// behind the picture. Hidden or turned away, they count alike.
    pub(super) fn areas<'a>(
        &'a self,
        eye: Vec3,
        time: Duration,
        patches: impl Iterator<Item = usize> + 'a,
    ) -> impl Iterator<Item = (usize, f64)> + 'a {
        let from_world: Vec<Pose> = std::iter::once(Pose::IDENTITY)
            .chain(self.scene.scene.poses(time))
            .map(Pose::inverse)
            .collect();
        patches.map(move |index| {
            let object = usize::from(self.scene.patches[index].object.0);
            let eye = from_world[object].transform_point(eye);
            let area = self.triangles[index].iter().map(|t| solid_angle(*t, eye));
            (index, area.sum())
        })
    }
}

/// Both eyes of a head, on image planes so much larger than their own.
pub(super) fn eyes_of(
    view: &ViewReport,
    world_from_head: Pose,
    after: Duration,
    enlargement: f32,
) -> [Viewpoint; 2] {
    view.eyes
        .map(|eye| Viewpoint::new(after, world_from_head, eye, view, enlargement))
}

/// Source: van Oosterom and Strackee, "The Solid Angle of a Plane Triangle", 1983.
fn solid_angle(corners: [Vec3; 3], eye: Vec3) -> f64 {
    let [a, b, c] = corners.map(|corner| (corner - eye).as_dvec3());
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let above = a.dot(b.cross(c)).abs();
    let below = la * lb * lc + a.dot(b) * lc + a.dot(c) * lb + b.dot(c) * la;
    let angle = 2.0 * above.atan2(below);
    if angle.is_finite() { angle } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_octant_is_an_eighth_of_the_sphere() {
        let octant = solid_angle([Vec3::X, Vec3::Y, Vec3::Z], Vec3::ZERO);
        assert!((octant - std::f64::consts::FRAC_PI_2).abs() < 1e-6);
        let turned = solid_angle([Vec3::Y, Vec3::X, Vec3::Z], Vec3::ZERO);
        assert_eq!(octant, turned);
        // Degenerate ones, and an eye in a corner, have none.
        assert_eq!(solid_angle([Vec3::X, Vec3::X, Vec3::Z], Vec3::ZERO), 0.0);
        assert_eq!(solid_angle([Vec3::ZERO, Vec3::X, Vec3::Z], Vec3::ZERO), 0.0);
        assert_eq!(solid_angle([Vec3::NAN, Vec3::X, Vec3::Z], Vec3::ZERO), 0.0);
    }
}
