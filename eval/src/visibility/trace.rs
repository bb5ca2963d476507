//! Heads that walk and look around, and what a tracker reports of them.
//!
//! Made up, but after what is known of heads. Someone walks along a circle at a pace
//! that comes and goes; each step lifts the head by some centimetres and sways it, and
//! it nods and turns against both (Hirasaki et al., "Effects of walking velocity on
//! vertical head and body movements during locomotion", 1999). The gaze jumps from
//! target to target, and the head follows along a path of least jerk (Flash and Hogan,
//! 1985) at up to about 200 degrees a second. Reports come 90 times a second, with the
//! noise of a consumer tracker (Niehorster, Li and Lappe, "The accuracy and precision
//! of position and orientation tracking in the HTC Vive", 2017).

use std::f64::consts::TAU;

use glam::{DQuat, DVec3, EulerRot, Quat, Vec3};
use shadecast_protocol::{ClientTime, EyeView, Fov, Motion, Pose, ViewReport, ViewSeq};
use shadecast_server::scene::Scene;

/// Reports, and pictures on the display, a second.
pub(super) const RATE: u32 = 90;
/// Half of what lies between the eyes, metres.
const EYE_OFFSET: f32 = 0.0315;
/// Opening of an eye's picture, radians: SAS 2018, section 5.
const OPENING: f32 = std::f32::consts::FRAC_PI_2;
/// Deviations of what a tracker says of places (m), orientations (rad) and their rates.
const PLACE_NOISE: f64 = 2e-4;
const TURN_NOISE: f64 = 3.5e-4;
const VELOCITY_NOISE: f64 = 1e-2;
const ANGULAR_VELOCITY_NOISE: f64 = 1e-2;
/// The pace comes and goes in so many seconds, by so much of itself.
const PACE_PERIOD: f64 = 7.3;
const PACE_CHANGE: f64 = 0.35;

/// The first gaze, yaw and pitch in radians.
const AHEAD: [f64; 2] = [0.0, -0.05];

/// How someone moves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gait {
    pub(super) name: &'static str,
    /// Mean speed, m/s.
    pub(super) speed: f64,
    /// How fast gazes turn the head, rad/s, at their fastest.
    pub(super) turning: f64,
}

pub(super) const GAITS: [Gait; 4] = [
    Gait {
        name: "stand and look",
        speed: 0.0,
        turning: 1.8,
    },
    Gait {
        name: "stroll",
        speed: 0.6,
        turning: 1.8,
    },
    WALK,
    Gait {
        name: "hurry",
        speed: 2.0,
        turning: 3.5,
    },
];

/// The one that targets are for.
pub(super) const WALK: Gait = Gait {
    name: "walk",
    speed: 1.2,
    turning: 2.4,
};

/// A head's path.
#[derive(Clone, Debug)]
pub(super) struct Head {
    gait: Gait,
    seed: u64,
    start: Pose,
    radius: f64,
    gazes: Vec<Gaze>,
}

/// The head turns from one direction to another: yaw and pitch, radians.
#[derive(Clone, Copy, Debug)]
struct Gaze {
    begins: f64,
    takes: f64,
    from: [f64; 2],
    to: [f64; 2],
}

impl Head {
    /// The path of this seed, for so many seconds; the same on every machine.
    pub(super) fn new(scene: &Scene, gait: Gait, seed: u64, seconds: f64) -> Self {
        /// Of the scene's width, and at most in metres.
        const RADIUS: (f64, f64) = (0.15, 2.4);
        let (low, high) = scene.bounds();
        let width = f64::from((high - low).x.min((high - low).z));
        Self {
            gait,
            seed,
            start: scene.first_eye(),
            radius: (width * RADIUS.0).clamp(0.3, RADIUS.1),
            gazes: gazes(gait, seed, seconds),
        }
    }

    /// Where it is, without noise.
    pub(super) fn pose(&self, seconds: f64) -> Pose {
        let Gait { speed, .. } = self.gait;
        let pace = TAU / PACE_PERIOD;
        let walked = speed * (seconds - PACE_CHANGE / pace * (seconds * pace).sin());
        let along = walked / self.radius;
        // Steps a second rise with speed; so does what they do to the head.
        let steps = (0.9 + 0.75 * speed) * TAU * seconds;
        let effort = (speed / 1.2).min(1.5);
        let sway = DVec3::new(
            0.02 * effort * (steps * 0.5).sin() + 4e-3 * (1.9 * seconds).sin(),
            0.025 * effort * steps.sin() + 1e-3 * (1.3 * seconds).sin(),
            4e-3 * (2.3 * seconds + 1.0).sin(),
        );
        // Against the head's lift and sway, so that the gaze stays on its target.
        let nod = -0.017 * effort * steps.sin();
        let shake = -0.02 * effort * (steps * 0.5).sin();
        let [yaw, pitch] = self.gaze(seconds);
        let place = DVec3::new(along.sin(), 0.0, along.cos() - 1.0) * self.radius;
        let heading = DQuat::from_rotation_y(along - TAU / 4.0);
        let (yaw, pitch) = (yaw + shake, pitch + nod);
        let look = DQuat::from_euler(EulerRot::YXZ, yaw, pitch, 0.2 * shake);
        let turned = if speed > 0.0 {
            heading
        } else {
            DQuat::IDENTITY
        };
        self.start.then(Pose {
            position: (place + turned * sway).as_vec3(),
            orientation: (turned * look).as_quat().normalize(),
        })
    }

    fn gaze(&self, seconds: f64) -> [f64; 2] {
        let next = self.gazes.partition_point(|gaze| gaze.begins <= seconds);
        let Some(gaze) = next.checked_sub(1).map(|index| self.gazes[index]) else {
            return AHEAD;
        };
        let s = ((seconds - gaze.begins) / gaze.takes).clamp(0.0, 1.0);
        let share = s.powi(3) * (10.0 + s * (6.0 * s - 15.0));
        [0, 1].map(|axis| gaze.from[axis] + (gaze.to[axis] - gaze.from[axis]) * share)
    }

    /// What is reported of it at the tick, for eyes of `side` pixels.
    pub(super) fn report(&self, tick: u32, side: u16) -> ViewReport {
        const HALF_SPAN: f64 = 2e-3;
        let seconds = f64::from(tick) / f64::from(RATE);
        let ends = [-HALF_SPAN, HALF_SPAN].map(|off| self.pose(seconds + off));
        let motion = Motion::along(self.pose(seconds), ends, 2.0 * HALF_SPAN as f32);
        let mut draws = 0;
        let mut noise = |deviation: f64| {
            let axes = [0; 3].map(|_| {
                draws += 1;
                normal(self.seed, [u64::from(tick), draws])
            });
            (DVec3::from(axes) * deviation).as_vec3()
        };
        let pose = Pose {
            position: motion.pose.position + noise(PLACE_NOISE),
            orientation: Quat::from_scaled_axis(noise(TURN_NOISE)) * motion.pose.orientation,
        };
        let nanoseconds = u64::from(tick) * 1_000_000_000 / u64::from(RATE);
        ViewReport {
            seq: ViewSeq(tick),
            sampled_at: ClientTime(nanoseconds),
            display_at: ClientTime(nanoseconds),
            world_from_head: pose,
            linear_velocity: motion.linear_velocity + noise(VELOCITY_NOISE),
            angular_velocity: motion.angular_velocity + noise(ANGULAR_VELOCITY_NOISE),
            eyes: [-EYE_OFFSET, EYE_OFFSET].map(|x| EyeView {
                head_from_eye: Pose {
                    position: Vec3::X * x,
                    orientation: Quat::IDENTITY,
                },
                fov: Fov::symmetric(OPENING),
            }),
            eye_resolution: [side; 2],
            hands: [None; 2],
        }
    }
}

/// Targets within 55 degrees aside, mostly level or a little down; each is looked at
/// for a second or so.
fn gazes(gait: Gait, seed: u64, seconds: f64) -> Vec<Gaze> {
    /// The fastest of a path of least jerk, over its mean speed.
    const PEAK: f64 = 1.875;
    let mut gazes: Vec<Gaze> = Vec::new();
    let (mut begins, mut from) = (0.4, AHEAD);
    for index in 0_u64.. {
        if begins > seconds {
            break;
        }
        let draw = |channel| fraction(seed ^ 0x9e37, [index, channel]);
        let to = [(draw(0) - 0.5) * 1.9, -0.35 + 0.5 * draw(1)];
        let angle = (to[0] - from[0]).hypot(to[1] - from[1]);
        let takes = 0.15 + PEAK * angle / gait.turning;
        gazes.push(Gaze {
            begins,
            takes,
            from,
            to,
        });
        begins += takes + 0.3 + 1.2 * draw(2);
        from = to;
    }
    gazes
}

/// A number from 0 to 1 for a seed and two counters. Source: Steele, Lea and Flood,
/// "Fast Splittable Pseudorandom Number Generators", 2014 (SplitMix64).
fn fraction(seed: u64, counters: [u64; 2]) -> f64 {
    let mix = |z: u64| {
        let z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    let mixed = mix(mix(mix(seed) ^ counters[0]) ^ counters[1]);
    (mixed >> 11) as f64 / (1_u64 << 53) as f64
}

/// Normally distributed (Box and Muller, 1958).
fn normal(seed: u64, [a, b]: [u64; 2]) -> f64 {
    let radius = (-2.0 * (1.0 - fraction(seed, [a, 2 * b])).ln()).sqrt();
    radius * (TAU * fraction(seed, [a, 2 * b + 1])).cos()
}

#[cfg(test)]
mod tests {
    use shadecast_server::scene::courtyard;

    use super::*;

    #[test]
    fn heads_move_as_heads_do() {
        let scene = courtyard(10_000);
        for gait in GAITS {
            let head = Head::new(&scene, gait, 3, 20.0);
            let (mut walked, mut fastest_turn) = (0.0_f32, 0.0_f32);
            for tick in 0..20 * RATE {
                let at = |tick: u32| head.pose(f64::from(tick) / f64::from(RATE));
                let (here, next) = (at(tick), at(tick + 1));
                let ways = Motion::along(here, [here, next], 1.0 / RATE as f32);
                let level = ways.linear_velocity.with_y(0.0).length();
                assert!(level < 1.6 * gait.speed as f32 + 0.3, "{level} m/s");
                walked += level / RATE as f32;
                fastest_turn = fastest_turn.max(ways.angular_velocity.length());
                assert!((here.position.y - head.start.position.y).abs() < 0.06);
            }
            assert!(
                (walked / 20.0 - gait.speed as f32).abs() < 0.15,
                "{walked} m"
            );
            assert!((1.0..5.0).contains(&fastest_turn), "{fastest_turn} rad/s");
        }
    }

    #[test]
    fn nobody_walks_through_walls() {
        let scene = courtyard(10_000);
        let head = Head::new(&scene, WALK, 1, 20.0);
        for tick in (0..15 * RATE).step_by(15) {
            let here = head.pose(f64::from(tick) / f64::from(RATE)).position;
            for triangle in &scene.triangles {
                let [a, b, c] = triangle
                    .positions
                    .map(|p| scene.positions[p as usize] - here);
                let reach = a.length().min(b.length()).min(c.length());
                assert!(reach > 0.15, "{here} is in a corner");
                // Where the triangle's plane is near, its foot is outside of the triangle.
                let normal = (b - a).cross(c - a).normalize_or_zero();
                let foot = normal * normal.dot(a);
                let inside = [(a, b), (b, c), (c, a)]
                    .iter()
                    .all(|(p, q)| (*q - *p).cross(foot - *p).dot(normal) > 0.0);
                let off = foot.length();
                assert!(
                    off > 0.15 || !inside || normal == Vec3::ZERO,
                    "{here} is in a wall"
                );
            }
        }
    }

    #[test]
    fn a_report_is_the_pose_with_a_little_noise() {
        let head = Head::new(&courtyard(10_000), WALK, 1, 5.0);
        for tick in 0..200 {
            let told = head.report(tick, 64);
            assert_eq!(told, head.report(tick, 64));
            let truth = head.pose(f64::from(tick) / f64::from(RATE));
            assert!(told.world_from_head.position.distance(truth.position) < 2e-3);
            let off = told
                .world_from_head
                .orientation
                .angle_between(truth.orientation);
            assert!(off < 3e-3, "{off}");
        }
    }
}
