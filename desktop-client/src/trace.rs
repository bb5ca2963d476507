//! Where the mock head is at any time: a built-in motion, or one from a file.
//!
//! Poses are in the play space: floor level at zero height, facing -Z.

use std::f64::consts::TAU;

use glam::{EulerRot, Quat, Vec3};
use shadecast_protocol::{Motion, Pose};

use crate::trace_file::TraceFile;

/// Half the span over which velocities are taken, seconds: shorter than any
/// motion of a head, longer than the rounding of positions.
const VELOCITY_HALF_SPAN: f64 = 0.005;

/// A head's path.
#[derive(Clone, Debug)]
pub(crate) enum HeadTrace {
    BuiltIn(Box<Sway>),
    File(TraceFile),
}

impl HeadTrace {
    /// The head at `seconds` since the start.
    pub(crate) fn at(&self, seconds: f64) -> Motion {
        let ends = [-VELOCITY_HALF_SPAN, VELOCITY_HALF_SPAN]
            .map(|offset| self.pose((seconds + offset).max(0.0)));
        let span = (2.0 * VELOCITY_HALF_SPAN) as f32;
        Motion::along(self.pose(seconds), ends, span)
    }

    fn pose(&self, seconds: f64) -> Pose {
        match self {
            Self::BuiltIn(sway) => sway.pose(seconds),
            Self::File(file) => file.pose(seconds),
        }
    }
}

/// Height of the eyes of a standing person, metres.
pub(crate) const EYE_HEIGHT: f32 = 1.6;

/// Someone who stands and looks around: a sway of about a quarter of a metre,
/// and a gaze that sweeps 45 degrees to both sides at up to about 15 degrees a
/// second.
///
/// Each coordinate is a sum of sinusoids whose periods have no common multiple,
/// so that the path does not repeat; the seed chooses their phases.
#[derive(Clone, Debug)]
pub(crate) struct Sway {
    x: [Sinusoid; 2],
    y: [Sinusoid; 2],
    z: [Sinusoid; 2],
    yaw: [Sinusoid; 2],
    pitch: [Sinusoid; 2],
}

#[derive(Clone, Copy, Debug)]
struct Sinusoid {
    amplitude: f64,
    period: f64,
    phase: f64,
}

impl Sway {
    /// The motion of this seed.
    pub(crate) fn new(seed: u64) -> Self {
        let mut state = seed;
        // Amplitudes in metres or degrees, periods in seconds.
        let mut pair = |first: (f64, f64), second: (f64, f64)| {
            [first, second].map(|(amplitude, period)| Sinusoid {
                amplitude,
                period,
                phase: fraction(&mut state),
            })
        };
        Self {
            x: pair((0.16, 7.3), (0.08, 4.1)),
            y: pair((0.03, 5.3), (0.01, 2.9)),
            z: pair((0.14, 8.9), (0.07, 4.7)),
            yaw: pair((34.0, 20.3), (11.0, 17.1)),
            pitch: pair((5.0, 9.7), (2.0, 6.1)),
        }
    }

    fn pose(&self, seconds: f64) -> Pose {
        let sum = |pair: &[Sinusoid; 2]| -> f32 {
            pair.iter()
                .map(|s| s.amplitude * (TAU * (seconds / s.period + s.phase)).sin())
                .sum::<f64>() as f32
        };
        Pose {
            position: Vec3::new(sum(&self.x), EYE_HEIGHT + sum(&self.y), sum(&self.z)),
            orientation: Quat::from_euler(
                EulerRot::YXZ,
                sum(&self.yaw).to_radians(),
                sum(&self.pitch).to_radians(),
                0.0,
            ),
        }
    }
}

/// SplitMix64 (Steele, Lea and Flood, 2014), as a fraction of one.
fn fraction(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^= z >> 31;
    (z >> 11) as f64 / (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_head_stands_and_looks_around_slowly() {
        for seed in 0..20 {
            let trace = HeadTrace::BuiltIn(Box::new(Sway::new(seed)));
            for tick in 0..6_000 {
                let motion = trace.at(f64::from(tick) * 0.05);
                let Pose {
                    position,
                    orientation,
                } = motion.pose;
                assert!(motion.pose.is_valid());
                assert!((position.y - EYE_HEIGHT).abs() < 0.05);
                assert!(position.with_y(0.0).length() < 0.35);
                let forward = orientation * Vec3::NEG_Z;
                assert!(forward.x.atan2(-forward.z).abs() <= 46_f32.to_radians());
                assert!(motion.angular_velocity.length() < 22_f32.to_radians());
                assert!(motion.linear_velocity.length() < 0.6);
            }
        }
    }

    #[test]
    fn velocities_are_those_of_the_path() {
        let trace = HeadTrace::BuiltIn(Box::new(Sway::new(7)));
        for second in 1..60 {
            let now = trace.at(f64::from(second));
            let later = trace.at(f64::from(second) + 0.02);
            let predicted = now.after(0.02);
            assert!((predicted.position - later.pose.position).length() < 1e-3);
            assert!(predicted.orientation.angle_between(later.pose.orientation) < 2e-3);
        }
    }

    #[test]
    fn a_seed_is_a_path() {
        let pose = |seed| Sway::new(seed).pose(3.0);
        assert_eq!(pose(1), pose(1));
        assert_ne!(pose(1), pose(2));
    }
}
