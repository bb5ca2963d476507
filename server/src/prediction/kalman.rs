//! A Kalman filter of a head's motion.
//!
//! Place and orientation have a rate and an acceleration each, and the acceleration
//! decays: a head does not go on turning faster and faster (Singer, "Estimating
//! Optimal Tracking Filter Performance for Manned Maneuvering Targets", 1970). The
//! orientation is a quaternion, and what is filtered is the small rotation by which
//! it is off, about axes of the world (Solà, "Quaternion kinematics for the
//! error-state Kalman filter", 2017, sections 5 and 6). A tracker is as good about all
//! axes, so the 3x3 blocks of the covariance are multiples of the identity: a filter
//! of nine states is one of three whose states are vectors ([`Track`]).
//!
//! Reports come over a network. One that is no newer than the last, or that is no
//! pose, is passed over; a gap is predicted across and adds to the doubt; where
//! time or the head jumps, the filter begins anew.

use std::time::Duration;

use glam::{DMat3, DQuat, DVec3, Vec3};
use shadecast_protocol::{ClientTime, Pose, ViewReport};

/// A gap after which the motion before it says nothing, seconds; time that runs
/// backwards by more is another time.
const LONGEST_GAP: f64 = 0.5;
/// A head is not predicted further than this, seconds.
const LONGEST_LEAD: f64 = 1.0;
/// Deviations from where a head is expected beyond which it has jumped: it was moved,
/// or the tracker found it again. Added to [`JUMP`], metres and radians, as deviations
/// are those of heads that go their way.
const JUMP_DEVIATIONS: f64 = 6.0;
const JUMP: [f64; 2] = [0.2, 0.4];
/// A rate that is off by more is a tracker's mistake, m/s and rad/s: heads need many
/// reports to change theirs by so much.
const RATE_JUMP: f64 = 3.0;
/// Faster than any head, m/s and rad/s: a rate beyond it is passed over.
const FASTEST: f64 = 40.0;
/// Deviations that a doubt is of.
const DOUBT_DEVIATIONS: f64 = 1.0;

/// How a head moves, and how well a tracker sees it.
#[derive(Clone, Copy, Debug)]
struct Dynamics {
    /// Deviation of accelerations, in units of the value by s².
    acceleration: f64,
    /// In which an acceleration decays to 1/e, seconds.
    decay: f64,
    /// Deviations of what is reported of the value and of its rate.
    noise: [f64; 2],
}

/// Of someone who walks: steps are accelerations of 3 m/s² that turn round four times
/// a second.
const MOVING: Dynamics = Dynamics {
    acceleration: 2.5,
    decay: 0.12,
    noise: [5e-4, 2e-2],
};

/// Of someone who looks around: gazes jump in a few tenths of a second.
const TURNING: Dynamics = Dynamics {
    acceleration: 8.0,
    decay: 0.12,
    noise: [7e-4, 2e-2],
};

/// How far a head may be from where it is expected.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Doubt {
    /// Of its place, along each axis.
    pub metres: f32,
    /// Of its orientation, about each axis.
    pub radians: f32,
}

impl Doubt {
    /// It is there for sure.
    pub const NONE: Self = Self {
        metres: 0.0,
        radians: 0.0,
    };
}

/// What is known of a head's motion.
#[derive(Clone, Debug)]
pub struct HeadFilter {
    at: ClientTime,
    place: Track,
    /// The value is the rotation vector by which `orientation` is off: zero between
    /// reports.
    turn: Track,
    orientation: DQuat,
}

/// A report that says where a head was.
struct Sighting {
    at: ClientTime,
    position: DVec3,
    orientation: DQuat,
    /// Where the tracker knows them.
    velocity: Option<DVec3>,
    angular_velocity: Option<DVec3>,
}

impl Sighting {
    fn of(view: &ViewReport) -> Option<Self> {
        // A runtime that knows no velocity says zero, and no head is quite at rest.
        let rate = |rate: Vec3| {
            let rate = rate.as_dvec3();
            (rate.is_finite() && rate != DVec3::ZERO && rate.length() < FASTEST).then_some(rate)
        };
        let pose = view.world_from_head;
        pose.is_valid().then(|| Self {
            at: view.display_at,
            position: pose.position.as_dvec3(),
            orientation: pose.orientation.as_dquat().normalize(),
            velocity: rate(view.linear_velocity),
            angular_velocity: rate(view.angular_velocity),
        })
    }
}

impl HeadFilter {
    /// Nothing is known but this report; of one that is no pose, a head at the origin.
    #[must_use]
    pub fn new(view: &ViewReport) -> Self {
        Self::begin(&Sighting::of(view).unwrap_or(Sighting {
            at: view.display_at,
            position: DVec3::ZERO,
            orientation: DQuat::IDENTITY,
            velocity: None,
            angular_velocity: None,
        }))
    }

    fn begin(seen: &Sighting) -> Self {
        Self {
            at: seen.at,
            place: Track::begin(&MOVING, seen.position, seen.velocity),
            turn: Track::begin(&TURNING, DVec3::ZERO, seen.angular_velocity),
            orientation: seen.orientation,
        }
    }

    /// Takes in a report. Its pose is that of its display time.
    pub fn tell(&mut self, view: &ViewReport) {
        let Some(seen) = Sighting::of(view) else {
            return;
        };
        let seconds = (i128::from(seen.at.0) - i128::from(self.at.0)) as f64 * 1e-9;
        if seconds.abs() > LONGEST_GAP {
            *self = Self::begin(&seen);
            return;
        }
        if seconds <= 0.0 {
            return;
        }
        let mut next = self.clone();
        next.at = seen.at;
        next.place.advance(&MOVING, seconds);
        next.turn.advance(&TURNING, seconds);
        next.fold();
        let moved = seen.position - next.place.value;
        let turned = rotation_between(next.orientation, seen.orientation);
        let jumped = |track: &Track, off: DVec3, jump: f64| {
            off.length() > jump + JUMP_DEVIATIONS * track.deviation()
        };
        if jumped(&next.place, moved, JUMP[0]) || jumped(&next.turn, turned, JUMP[1]) {
            *self = Self::begin(&seen);
            return;
        }
        next.place.correct(&MOVING, moved, seen.velocity);
        next.turn.correct(&TURNING, turned, seen.angular_velocity);
        next.fold();
        *self = next;
    }

    /// The head `lead` after the display time of the newest report.
    #[must_use]
    pub fn after(&self, lead: Duration) -> (Pose, Doubt) {
        let seconds = lead.as_secs_f64().min(LONGEST_LEAD);
        let mut then = self.clone();
        then.place.advance(&MOVING, seconds);
        then.turn.advance(&TURNING, seconds);
        then.fold();
        let doubt = |track: &Track| (DOUBT_DEVIATIONS * track.deviation()) as f32;
        let pose = Pose {
            position: then.place.value.as_vec3(),
            orientation: then.orientation.as_quat().normalize(),
        };
        let doubt = Doubt {
            metres: doubt(&then.place),
            radians: doubt(&then.turn),
        };
        (pose, doubt)
    }

    /// Puts what the orientation is off by into the quaternion.
    fn fold(&mut self) {
        let off = DQuat::from_scaled_axis(std::mem::take(&mut self.turn.value));
        self.orientation = (off * self.orientation).normalize();
    }
}

/// The rotation vector about axes of the world from one orientation to another, the
/// short way.
fn rotation_between(from: DQuat, to: DQuat) -> DVec3 {
    let turned = to * from.conjugate();
    let turned = if turned.w < 0.0 { -turned } else { turned };
    turned.normalize().to_scaled_axis()
}

/// A value along three axes alike, its rate and its acceleration.
#[derive(Clone, Debug)]
struct Track {
    value: DVec3,
    rate: DVec3,
    acceleration: DVec3,
    /// Of the three on any one axis.
    covariance: DMat3,
}

impl Track {
    fn begin(dynamics: &Dynamics, value: DVec3, rate: Option<DVec3>) -> Self {
        /// Deviation of a rate that was never reported.
        const ANY_RATE: f64 = 1.0;
        let rate_noise = rate.map_or(ANY_RATE, |_| dynamics.noise[1]);
        let deviations = DVec3::new(dynamics.noise[0], rate_noise, dynamics.acceleration);
        Self {
            value,
            rate: rate.unwrap_or(DVec3::ZERO),
            acceleration: DVec3::ZERO,
            covariance: DMat3::from_diagonal(deviations * deviations),
        }
    }

    /// Standard deviation of the value on one axis.
    fn deviation(&self) -> f64 {
        self.covariance.x_axis.x.max(0.0).sqrt()
    }

    fn advance(&mut self, dynamics: &Dynamics, seconds: f64) {
        /// Of the decay: in a step, acceleration gains variance as white jerk does.
        const LONGEST_STEP: f64 = 0.1;
        let steps = (seconds / (dynamics.decay * LONGEST_STEP)).ceil().max(1.0);
        for _ in 0..steps as u32 {
            self.step(dynamics, seconds / steps);
        }
    }

    fn step(&mut self, dynamics: &Dynamics, t: f64) {
        let decay = dynamics.decay;
        let kept = (-t / decay).exp();
        let to_rate = decay * (1.0 - kept);
        let to_value = decay * (t - to_rate);
        self.value += self.rate * t + self.acceleration * to_value;
        self.rate += self.acceleration * to_rate;
        self.acceleration *= kept;
        let transition = DMat3::from_cols(
            DVec3::new(1.0, 0.0, 0.0),
            DVec3::new(t, 1.0, 0.0),
            DVec3::new(to_value, to_rate, kept),
        );
        let density = 2.0 * dynamics.acceleration.powi(2) / decay;
        let [t2, t3, t4, t5] = [t.powi(2), t.powi(3), t.powi(4), t.powi(5)];
        let noise = DMat3::from_cols(
            DVec3::new(t5 / 20.0, t4 / 8.0, t3 / 6.0),
            DVec3::new(t4 / 8.0, t3 / 3.0, t2 / 2.0),
            DVec3::new(t3 / 6.0, t2 / 2.0, t),
        );
        self.covariance = transition * self.covariance * transition.transpose() + noise * density;
    }

    /// Takes in that the value is `off` from the expected one, and the rate, where it
    /// is known.
    fn correct(&mut self, dynamics: &Dynamics, off: DVec3, rate: Option<DVec3>) {
        self.correct_one(0, off, dynamics.noise[0]);
        let most = RATE_JUMP + JUMP_DEVIATIONS * self.covariance.y_axis.y.max(0.0).sqrt();
        if let Some(rate) = rate.filter(|rate| rate.distance(self.rate) < most) {
            self.correct_one(1, rate - self.rate, dynamics.noise[1]);
        }
    }

    /// The Kalman update by a measurement of the value (0) or the rate (1).
    fn correct_one(&mut self, which: usize, off: DVec3, noise: f64) {
        let column = self.covariance.col(which);
        let gain = column / (column[which] + noise * noise);
        self.value += off * gain.x;
        self.rate += off * gain.y;
        self.acceleration += off * gain.z;
        let known = DMat3::from_cols(gain * column.x, gain * column.y, gain * column.z);
        let left = self.covariance - known;
        // Rounding must not make it lopsided.
        self.covariance = (left + left.transpose()) * 0.5;
    }
}

#[cfg(test)]
mod tests;
