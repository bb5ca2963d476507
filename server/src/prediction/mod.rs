//! Where the head will be while an update is on display, and from where patches
//! are looked for to cover it.
//!
//! An update made now is first seen one latency later, and then until the next one
//! takes its place. [`Horizon`] is that time, as measured; heads are predicted at
//! steps of it ([`HeadFilter`]), and each is seen from by both eyes. What prediction
//! may miss is covered twice: turning by an enlarged image plane, moving by
//! viewpoints at the corners of a square about the head. Both grow with what the
//! filter doubts, and so with the interval.
//!
//! Sources: Mueller et al., "Shading Atlas Streaming", 2018, section 3.1 and figure
//! 5; Kravec, "Realistic Remote Rendering for VR and Mobile Devices", 2023,
//! section 4.1.1 and algorithm 1. We depart from SAS in that heads are sampled over
//! the time on display rather than from now on: what is seen until then was in
//! updates before, whose patches the atlas keeps for a while. And the image plane is
//! as large as the prediction is doubtful, not always 1.2 times as wide.

mod horizon;
mod kalman;
mod viewpoint;

use std::time::Duration;

use glam::Vec3;
use shadecast_protocol::{Motion, Pose, ViewReport};

pub use horizon::{Horizon, Latency};
pub use kalman::{Doubt, HeadFilter};
use viewpoint::margin;
pub use viewpoint::{Viewpoint, corners, enlargement};

/// A head that may be, some time from now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PredictedHead {
    /// From the beginning of the frame.
    pub after: Duration,
    /// Where it is expected.
    pub world_from_head: Pose,
    /// How far it may be from there.
    pub doubt: Doubt,
}

/// Where the head may be while an update is on display.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// At ascending times; at least one.
    pub heads: Vec<PredictedHead>,
    /// The report that they come from.
    pub view: ViewReport,
}

impl Prediction {
    /// `samples` heads, evenly over `horizon` from the report on, by linear
    /// extrapolation of its velocities; image planes are 1.2 times as wide as the eyes'
    /// own, and nothing stands aside (SAS 2018, section 5).
    #[must_use]
    pub fn linear(view: &ViewReport, horizon: Duration, samples: u32) -> Self {
        let horizon = Horizon {
            shown: Duration::ZERO,
            gone: horizon,
        };
        let motion = Motion {
            pose: view.world_from_head,
            linear_velocity: view.linear_velocity,
            angular_velocity: view.angular_velocity,
        };
        let doubt = Doubt {
            radians: margin(view.eyes[0].fov, 1.2),
            ..Doubt::NONE
        };
        let head = |after: Duration| PredictedHead {
            after,
            world_from_head: motion.after(after.as_secs_f32()),
            doubt,
        };
        Self {
            heads: horizon.samples(samples).map(head).collect(),
            view: *view,
        }
    }

    /// At most `most` heads over `horizon`, which begins `age` after `view`, the
    /// newest report that `filter` was told of.
    #[must_use]
    pub fn filtered(
        view: &ViewReport,
        filter: &HeadFilter,
        age: Duration,
        horizon: Horizon,
        most: u32,
    ) -> Self {
        let head = |after: Duration| {
            let (world_from_head, doubt) = filter.after(after + age);
            PredictedHead {
                after,
                world_from_head,
                doubt,
            }
        };
        Self {
            heads: horizon.samples(horizon.steps(most)).map(head).collect(),
            view: *view,
        }
    }

    /// The head in the middle of the horizon.
    #[must_use]
    pub fn middle(&self) -> Pose {
        let last = self.heads.len() - 1;
        let (a, b) = (
            self.heads[last / 2].world_from_head,
            self.heads[last.div_ceil(2)].world_from_head,
        );
        Pose {
            position: a.position.lerp(b.position, 0.5),
            orientation: a.orientation.slerp(b.orientation, 0.5),
        }
    }

    /// The eye between both eyes, from which patches are measured and glossy
    /// texels are lit.
    #[must_use]
    pub fn eye(&self) -> Vec3 {
        let head = self.middle();
        let eyes = (self.view.eyes).map(|eye| head.then(eye.head_from_eye).position);
        (eyes[0] + eyes[1]) * 0.5
    }

    /// Pixels per radian in the middle of the left eye's picture.
    #[must_use]
    pub fn pixels_per_radian(&self) -> f32 {
        let fov = self.view.eyes[0].fov;
        f32::from(self.view.eye_resolution[0]) / (fov.right - fov.left)
    }

    /// From where patches are looked for: two corners of the square about each head,
    /// at either end of a diagonal, and of the other diagonal for every second head.
    /// They stand in for the eyes, so that corners cost no pictures.
    #[must_use]
    pub fn viewpoints(&self) -> Vec<Viewpoint> {
        let seen_from = |(index, head): (usize, &PredictedHead)| {
            let [a, b, c, d] = corners(self.view.eyes, head.doubt.metres);
            let eyes = if index % 2 == 0 { [a, d] } else { [c, b] };
            eyes.map(|eye| {
                let factor = enlargement(eye.fov, head.doubt.radians);
                Viewpoint::new(head.after, head.world_from_head, eye, &self.view, factor)
            })
        };
        self.heads.iter().enumerate().flat_map(seen_from).collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::{Quat, vec3};
    use shadecast_protocol::{ClientTime, EyeView, Fov, ViewSeq};

    use super::*;

    pub(super) fn view(fov: Fov) -> ViewReport {
        ViewReport {
            seq: ViewSeq(0),
            sampled_at: ClientTime(0),
            display_at: ClientTime(0),
            world_from_head: Pose::IDENTITY,
            linear_velocity: Vec3::X,
            angular_velocity: Vec3::Y,
            eyes: [-0.03, 0.03].map(|x| EyeView {
                head_from_eye: Pose {
                    position: Vec3::X * x,
                    orientation: Quat::IDENTITY,
                },
                fov,
            }),
            eye_resolution: [100, 80],
            hands: [None; 2],
        }
    }

    fn places(prediction: &Prediction) -> Vec<Vec3> {
        let viewpoints = prediction.viewpoints();
        viewpoints
            .iter()
            .map(|v| v.world_from_eye.position)
            .collect()
    }

    #[test]
    fn both_eyes_of_every_head_are_seen_from() {
        let view = view(Fov::symmetric(1.5));
        let prediction = Prediction::linear(&view, Duration::from_millis(100), 3);
        let found = places(&prediction);
        assert_eq!(found.len(), 6);
        for (found, head) in found.chunks(2).zip(&prediction.heads) {
            let eyes = view
                .eyes
                .map(|eye| head.world_from_head.then(eye.head_from_eye));
            assert_eq!(found, eyes.map(|eye| eye.position));
        }
    }

    #[test]
    fn two_heads_have_all_four_corners_about_them() {
        let view = view(Fov::symmetric(1.5));
        let mut prediction = Prediction::linear(&view, Duration::ZERO, 2);
        for head in &mut prediction.heads {
            head.doubt.metres = 0.01;
        }
        let expected = [(-0.04, 0.01), (0.04, -0.01), (-0.04, -0.01), (0.04, 0.01)];
        for (found, (x, y)) in places(&prediction).into_iter().zip(expected) {
            assert!(found.distance(vec3(x, y, 0.0)) < 1e-6, "{found}");
        }
    }
}
