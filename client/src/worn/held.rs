//! What a display holds of the world, whatever becomes of the device that it draws
//! with and of the network: both come back, and the world is still there.

use std::sync::Arc;
use std::time::Duration;

use shadecast_protocol::{ClientTime, Pose, Sky, Welcome};

use super::{Frame, since};
use crate::render::{FrameReceiver, Renderer, UploadError};
use crate::{ClientFrame, Status};

/// A network that brings nothing for this long has stalled, and the user is told.
const STALL: Duration = Duration::from_millis(500);

/// The newest frame and what belongs to it.
#[derive(Debug)]
pub struct Held {
    frames: FrameReceiver,
    pub(crate) shown: Option<Arc<ClientFrame>>,
    sky: Option<Sky>,
    /// The sky has not been drawn yet.
    sky_is_new: bool,
    /// Where the server put the play space.
    home: Option<Pose>,
    /// Where it is by now.
    pub(crate) world_from_play: Pose,
    /// When something last came, or was first waited for.
    heard_at: Option<ClientTime>,
    /// When it was last asked for something new.
    asked_at: Option<ClientTime>,
    status: &'static str,
    /// Said by whoever runs the display, and shown until it is taken back.
    said: Option<String>,
    /// Why the newest frame is not shown.
    unshown: Option<String>,
}

impl Held {
    pub(crate) fn new(frames: FrameReceiver) -> Self {
        Self {
            frames,
            shown: None,
            sky: None,
            sky_is_new: false,
            home: None,
            world_from_play: Pose::IDENTITY,
            heard_at: None,
            asked_at: None,
            status: "Connecting to the server",
            said: None,
            unshown: None,
        }
    }

    /// A session with the server begins. A user who walked away from where the
    /// server puts the play space stays there when the server comes back.
    pub(crate) fn welcome(&mut self, welcome: &Welcome) {
        if self.home != Some(welcome.world_from_play) {
            self.home = Some(welcome.world_from_play);
            self.world_from_play = welcome.world_from_play;
        }
        self.sky = Some(welcome.sky.clone());
        self.sky_is_new = true;
    }

    pub(crate) fn say(&mut self, sentence: Option<String>) {
        self.said = sentence;
    }

    /// The newest frame was taken over, or could not be; the log hears of it once.
    fn tell_upload(&mut self, uploaded: Result<(), UploadError>) {
        let why = uploaded.err().map(|error| error.to_string());
        if let Some(why) = &why
            && self.unshown.as_ref() != Some(why)
        {
            tracing::warn!("a frame is not shown: {why}");
        }
        self.unshown = why;
    }

    pub(crate) fn take_status(&mut self, status: &Status) {
        self.status = match status {
            Status::Connecting | Status::Resting => "Connecting to the server",
            Status::Filling | Status::Recovering(_) | Status::Streaming => {
                "Waiting for pictures from the server"
            }
            Status::Reconnecting { .. } => "The connection is lost; trying again",
        };
    }

    /// What is to be shown instead of `shown`, if something came.
    fn take_newest(&mut self, now: ClientTime) -> Option<Arc<ClientFrame>> {
        // Nobody looked for a while, and so nothing has stalled.
        let looked_away = self
            .asked_at
            .replace(now)
            .is_none_or(|before| is_stall(before, now));
        if looked_away {
            self.heard_at = Some(now);
        }
        let frame = self.frames.take_newest()?;
        self.heard_at = Some(now);
        Some(frame)
    }

    /// Gives the renderer what has come since the last frame; all of what is held, if
    /// the renderer is new and `is_current` is false.
    pub(crate) fn bring_up_to_date(
        &mut self,
        renderer: &mut Renderer,
        is_current: &mut bool,
        frame: &mut Frame,
        now: &dyn Fn() -> ClientTime,
    ) {
        let newest = self.take_newest(frame.began);
        let has_newest = newest.is_some();
        let lacking = || self.shown.clone().filter(|_| !*is_current);
        if let Some(world) = newest.or_else(lacking) {
            let began = now();
            let uploaded = renderer.upload(&world);
            if uploaded.is_ok() {
                self.shown = Some(world);
                frame.fresh = has_newest;
            }
            self.tell_upload(uploaded);
            frame.uploading = since(began, now());
        }
        if std::mem::take(&mut self.sky_is_new) || !*is_current {
            renderer.set_sky(self.sky.as_ref());
        }
        *is_current = true;
        renderer.set_notice(self.notice(frame.began));
    }

    /// For how long the objects have moved on at a time.
    pub(crate) fn seconds_of_motion(&self, at: ClientTime) -> f32 {
        let shown = self.shown.as_ref();
        shown.map_or(0.0, |shown| shown.seconds_of_motion(at))
    }

    /// What the user is told at this time, if anything.
    pub(crate) fn notice(&self, now: ClientTime) -> Option<&str> {
        if let Some(said) = &self.said {
            return Some(said);
        }
        if let Some(why) = &self.unshown {
            return Some(why);
        }
        is_stall(self.heard_at?, now).then_some(self.status)
    }
}

fn is_stall(since: ClientTime, now: ClientTime) -> bool {
    now.0.saturating_sub(since.0) > STALL.as_nanos() as u64
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use shadecast_protocol::{Codec, Method};

    use super::*;
    use crate::render::frame_channel;

    fn welcome(x: f32) -> Welcome {
        Welcome {
            codec: Codec::H264,
            method: Method::Sas,
            atlas_size: [64; 2],
            superblock: 8,
            world_from_play: Pose {
                position: Vec3::X * x,
                ..Pose::IDENTITY
            },
            sky: Sky {
                width: 1,
                height: 1,
                rgb: vec![9; 3],
            },
        }
    }

    #[test]
    fn whoever_walked_stays_there_when_the_same_server_comes_back() {
        let (_sender, receiver) = frame_channel();
        let mut held = Held::new(receiver);
        held.welcome(&welcome(2.0));
        held.world_from_play.position.z = -3.0;
        held.welcome(&welcome(2.0));
        assert_eq!(held.world_from_play.position, Vec3::new(2.0, 0.0, -3.0));
        held.welcome(&welcome(5.0));
        assert_eq!(
            held.world_from_play.position,
            Vec3::X * 5.0,
            "another scene"
        );
    }

    #[test]
    fn a_stall_is_told_after_half_a_second() {
        let (_sender, receiver) = frame_channel();
        let mut held = Held::new(receiver);
        let at = |ms: u64| ClientTime(7_000_000_000 + ms * 1_000_000);
        assert_eq!(held.notice(at(0)), None, "nothing was waited for yet");
        assert!(held.take_newest(at(0)).is_none());
        for ms in [100, 200, 300, 400, 500] {
            assert!(held.take_newest(at(ms)).is_none());
            assert_eq!(held.notice(at(ms)), None);
        }
        assert_eq!(held.notice(at(501)), Some("Connecting to the server"));
        let lost = Status::Reconnecting {
            reason: "gone".into(),
            after: Duration::ZERO,
        };
        held.take_status(&lost);
        assert!(
            held.notice(at(501))
                .is_some_and(|text| text.contains("lost"))
        );
        held.say(Some("The secret is wrong".into()));
        assert_eq!(held.notice(at(1)), Some("The secret is wrong"));
    }

    #[test]
    fn whoever_puts_the_headset_on_again_is_not_told_of_a_stall_at_once() {
        let (_sender, receiver) = frame_channel();
        let mut held = Held::new(receiver);
        let at = |ms: u64| ClientTime(ms * 1_000_000);
        held.take_newest(at(0));
        held.take_newest(at(60_000));
        assert_eq!(held.notice(at(60_000)), None);
        assert!(held.notice(at(60_501)).is_some());
    }
}
