//! One turn of the mock headset: take what is new, say where the head is, draw.

use std::sync::Arc;

use anyhow::{Context, Result};
use shadecast_client::network::{Event, Network};
use shadecast_client::render::{EyeCamera, FrameReceiver, frame_channel};
use shadecast_client::{ClientFrame, Clock, Drawn, HeadView, Input, Latency, OpenH264Decoder};
use shadecast_protocol::{ClientTime, EyeView, Motion, Pose};

use crate::args::Args;
use crate::drawing::Drawing;
use crate::interrupt::Interrupt;
use crate::status::StatusLine;

/// Largest atlas that the software decoder is trusted with, texels a side.
pub(crate) const MAX_ATLAS_SIDE: u32 = 4096;

/// The client of one run, whatever its display is.
#[derive(Debug)]
pub(crate) struct Headset {
    pub(crate) clock: Clock,
    pub(crate) network: Network,
    pub(crate) drawing: Drawing,
    pub(crate) measured: Measured,
    status: StatusLine,
    frames: FrameReceiver,
    interrupt: Interrupt,
    eyes: [EyeView; 2],
    eye_size: u16,
    world_from_play: Pose,
    shown: Option<Arc<ClientFrame>>,
}

/// What a run adds up to, from its first picture on.
#[derive(Debug, Default)]
pub(crate) struct Measured {
    /// When the first picture was drawn.
    pub(crate) first_picture: Option<ClientTime>,
    /// Duration of our work in each display frame, milliseconds.
    pub(crate) frame_ms: Vec<f64>,
    /// Where the time of the updates went.
    pub(crate) latency: Latency,
}

/// What became of a turn.
#[derive(Debug)]
pub(crate) struct Turn {
    /// When its light leaves the display.
    pub(crate) display_at: ClientTime,
    /// Where the eyes were.
    pub(crate) cameras: [EyeCamera; 2],
    /// What was drawn.
    pub(crate) frame: Option<Arc<ClientFrame>>,
    /// The user wants to leave.
    pub(crate) interrupted: bool,
}

impl Headset {
    /// Starts everything but the display.
    pub(crate) fn start(args: &Args, clock: Clock, drawing: Drawing) -> Result<Self> {
        let (sender, frames) = frame_channel();
        let device_limit = drawing.gpu().device.limits().max_texture_dimension_2d;
        let max_atlas_side = device_limit.min(MAX_ATLAS_SIDE) as u16;
        Ok(Self {
            network: Network::start(
                args.line.clone(),
                max_atlas_side,
                clock,
                OpenH264Decoder::new(),
                sender,
            )
            .context("cannot start the threads of network and decoder")?,
            interrupt: Interrupt::watch()?,
            clock,
            drawing,
            measured: Measured::default(),
            status: StatusLine::new(clock.now()),
            frames,
            eyes: args.eyes(),
            eye_size: args.eye_size,
            world_from_play: Pose::IDENTITY,
            shown: None,
        })
    }

    /// Draws the newest frame for a head that will be at `head` in the play
    /// space when the light leaves the display.
    ///
    /// # Errors
    /// When the session cannot go on, or the GPU stops.
    pub(crate) fn turn(
        &mut self,
        display_at: ClientTime,
        head: Motion,
        finish: impl FnOnce(&mut wgpu::CommandEncoder),
    ) -> Result<Turn> {
        let began = self.clock.now();
        self.hear()?;
        let fresh = self.take_newest();
        let head = head.seen_from(self.world_from_play);
        self.network.tell(Input::View(HeadView {
            sampled_at: began,
            display_at,
            world_from_head: head.pose,
            linear_velocity: head.linear_velocity,
            angular_velocity: head.angular_velocity,
            eyes: self.eyes,
            eye_resolution: [self.eye_size; 2],
            hands: [None; 2],
        }));
        let cameras = self.cameras(head.pose);
        let seconds_of_motion = self
            .shown
            .as_ref()
            .map_or(0.0, |frame| frame.seconds_of_motion(display_at));
        self.drawing.draw(cameras, seconds_of_motion, finish)?;
        self.measure(began, fresh);
        Ok(Turn {
            display_at,
            cameras,
            frame: self.shown.clone(),
            interrupted: self.interrupt.came(),
        })
    }

    /// The eyes of a head.
    pub(crate) fn cameras(&self, world_from_head: Pose) -> [EyeCamera; 2] {
        EyeCamera::pair(world_from_head, &self.eyes)
    }

    /// Takes what the network's thread has to say.
    fn hear(&mut self) -> Result<()> {
        while let Ok(event) = self.network.events.try_recv() {
            match event {
                Event::Welcomed(welcome) => {
                    self.world_from_play = welcome.world_from_play;
                    self.drawing.set_sky(&welcome.sky);
                }
                Event::Status(status) => self.status.say(&status),
                Event::Failed(failure) => return Err(failure.into()),
            }
        }
        Ok(())
    }

    /// True when another frame is shown from now on.
    fn take_newest(&mut self) -> bool {
        let Some(frame) = self.frames.take_newest() else {
            return false;
        };
        match self.drawing.upload(&frame) {
            Ok(()) => {
                self.shown = Some(frame);
                true
            }
            Err(error) => {
                self.status.warn(&format!("a frame is not shown: {error}"));
                false
            }
        }
    }

    fn measure(&mut self, began: ClientTime, fresh: bool) {
        let now = self.clock.now();
        let Some(frame) = &self.shown else {
            self.status.wait(now);
            return;
        };
        self.measured.first_picture.get_or_insert(began);
        let work = now.0.saturating_sub(began.0);
        self.measured.frame_ms.push(work as f64 / 1e6);
        if fresh {
            let drawn = Drawn::new(frame, began, now);
            self.measured.latency.record(frame, &drawn);
            self.network.tell(Input::Drawn(drawn));
        }
        self.status
            .show(now, &self.measured, &self.network.traffic, frame.patches);
    }
}
