//! Ways to choose the viewpoints of an update: the server's own, the same with one
//! choice made otherwise, and those of others.

use std::time::Duration;

use glam::Vec3;
use shadecast_protocol::EyeView;
use shadecast_server::prediction::{
    Horizon, PredictedHead, Prediction, Viewpoint, corners, enlargement,
};

use super::predict::{Known, Predictor};

/// From where patches are looked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Policy {
    pub(super) name: &'static str,
    pub(super) predictor: Predictor,
    heads: Heads,
    margin: Margin,
    corners: Corners,
    /// Whether what had few pixels in the last updates counts as visible.
    pub(super) recalls: bool,
}

/// When heads are sampled.
#[derive(Clone, Copy, Debug)]
enum Heads {
    /// Only the newest reported one.
    Reported,
    /// Each 33 ms from the report on until the next update: SAS 2018, section 5.
    FromReport,
    /// While the update is on display, and so many.
    OnDisplay(u32),
}

/// How much larger image planes are.
#[derive(Clone, Copy, Debug)]
enum Margin {
    Factor(f32),
    /// By so many times what the filter doubts.
    Doubt(f32),
}

/// Viewpoints at the corners about the last head.
#[derive(Clone, Copy, Debug)]
enum Corners {
    None,
    /// Beside its eyes, so many times what the filter doubts aside.
    Beside(f32),
    /// In place of its eyes.
    Instead(f32),
    /// Two at either end of a diagonal in place of each head's eyes, on the other
    /// diagonal for every second head.
    Shared(f32),
}

const fn policy(
    name: &'static str,
    predictor: Predictor,
    heads: Heads,
    margin: Margin,
    corners: Corners,
) -> Policy {
    Policy {
        name,
        predictor,
        heads,
        margin,
        corners,
        recalls: true,
    }
}

/// What the server does.
pub(super) const SERVED: Policy = policy(
    "served",
    Predictor::Kalman,
    Heads::OnDisplay(2),
    Margin::Doubt(1.0),
    Corners::Shared(1.0),
);

/// The same, by what is found in the update itself.
pub(super) const WITHOUT_RECALL: Policy = Policy {
    name: "nothing recalled",
    recalls: false,
    ..SERVED
};

/// What is compared at every gait: the same with other predictors.
pub(super) const PREDICTORS: [Policy; 4] = [
    policy(
        "reported head only, 1.2 times as wide",
        Predictor::None,
        Heads::Reported,
        Margin::Factor(1.2),
        Corners::None,
    ),
    policy(
        "linear, from the report on, 1.2 times as wide (SAS)",
        Predictor::Linear,
        Heads::FromReport,
        Margin::Factor(1.2),
        Corners::None,
    ),
    Policy {
        name: "linear, otherwise as served",
        predictor: Predictor::Linear,
        ..SERVED
    },
    Policy {
        name: "reference, otherwise as served",
        predictor: Predictor::Reference,
        ..SERVED
    },
];

/// The choices of the server one by one.
pub(super) const CHOICES: [Policy; 10] = [
    Policy {
        name: "from the report on",
        heads: Heads::FromReport,
        ..SERVED
    },
    Policy {
        name: "one head",
        heads: Heads::OnDisplay(1),
        ..SERVED
    },
    Policy {
        name: "three heads",
        heads: Heads::OnDisplay(3),
        ..SERVED
    },
    Policy {
        name: "no corners",
        corners: Corners::None,
        ..SERVED
    },
    Policy {
        name: "corners beside the eyes",
        corners: Corners::Beside(1.0),
        ..SERVED
    },
    Policy {
        name: "corners in place of the last eyes",
        corners: Corners::Instead(1.0),
        ..SERVED
    },
    Policy {
        name: "corners twice as far",
        corners: Corners::Shared(2.0),
        ..SERVED
    },
    Policy {
        name: "eyes' own image plane",
        margin: Margin::Factor(1.0),
        ..SERVED
    },
    Policy {
        name: "image plane 1.2 times as wide",
        margin: Margin::Factor(1.2),
        ..SERVED
    },
    Policy {
        name: "half the margin",
        margin: Margin::Doubt(0.5),
        ..SERVED
    },
];

impl Policy {
    /// The viewpoints of an update that is on display over `horizon` after `known`'s
    /// report, in times since then.
    pub(super) fn viewpoints(&self, known: &Known, horizon: Horizon) -> Prepared {
        let (horizon, count) = match self.heads {
            Heads::Reported => (
                Horizon {
                    shown: Duration::ZERO,
                    gone: Duration::ZERO,
                },
                1,
            ),
            Heads::FromReport => {
                let whole = Horizon {
                    shown: Duration::ZERO,
                    ..horizon
                };
                (whole, whole.steps(u32::MAX))
            }
            Heads::OnDisplay(count) => (horizon, count),
        };
        let heads = horizon.samples(count).map(|after| {
            let (world_from_head, doubt) = known.predicted(self.predictor, after);
            PredictedHead {
                after,
                world_from_head,
                doubt,
            }
        });
        let prediction = Prediction {
            heads: heads.collect(),
            view: known.view,
        };
        let mut viewpoints = Vec::new();
        let last = prediction.heads.len() - 1;
        for (index, head) in prediction.heads.iter().enumerate() {
            let eyes = prediction.view.eyes;
            let aside = |factor: f32| corners(eyes, factor * head.doubt.metres);
            let eyes: Vec<EyeView> = match self.corners {
                Corners::Beside(factor) if index == last => {
                    aside(factor).into_iter().chain(eyes).collect()
                }
                Corners::Instead(factor) if index == last => aside(factor).into(),
                Corners::Shared(factor) => {
                    let [a, b, c, d] = aside(factor);
                    if index % 2 == 0 {
                        vec![a, d]
                    } else {
                        vec![c, b]
                    }
                }
                _ => eyes.into(),
            };
            viewpoints.extend(eyes.into_iter().map(|eye| {
                let enlargement = match self.margin {
                    Margin::Factor(factor) => factor,
                    Margin::Doubt(factor) => enlargement(eye.fov, factor * head.doubt.radians),
                };
                Viewpoint::new(
                    head.after,
                    head.world_from_head,
                    eye,
                    &known.view,
                    enlargement,
                )
            }));
        }
        Prepared {
            eye: prediction.eye(),
            pixels_per_radian: prediction.pixels_per_radian(),
            viewpoints,
            recalls: self.recalls,
        }
    }
}

/// What an update is made for.
pub(super) struct Prepared {
    pub(super) eye: Vec3,
    pub(super) pixels_per_radian: f32,
    pub(super) viewpoints: Vec<Viewpoint>,
    pub(super) recalls: bool,
}

#[cfg(test)]
mod tests {
    use shadecast_server::scene::courtyard;

    use super::{
        super::trace::{Head, WALK},
        *,
    };

    #[test]
    fn what_is_called_served_is_what_the_server_does() {
        let head = Head::new(&courtyard(10_000), WALK, 5, 4.0);
        let mut known = Known::first(&head, 64);
        known.hear_until(200);
        let horizon = Horizon {
            shown: Duration::from_millis(60),
            gone: Duration::from_millis(93),
        };
        let prediction =
            Prediction::filtered(&known.view, &known.filter, Duration::ZERO, horizon, 8);
        let found = SERVED.viewpoints(&known, horizon).viewpoints;
        assert_eq!(found, prediction.viewpoints());
    }
}
