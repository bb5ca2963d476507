//! Where the time goes between a head's motion and its light.
//!
//! The eight phases of SAS 2018, figure 2, for every frame that was drawn.
//! Phases 1 and 4 lie between the two clocks and share the error of their
//! offset, with opposite signs; their sum, and so the total, is free of it.

use std::collections::VecDeque;
use std::time::Duration;

use serde::Serialize;
use shadecast_protocol::{ClientTime, FrameId, ServerTime};

use crate::ClientFrame;

/// Frames that the medians are taken over: a minute at 90 updates a second.
const FRAMES_KEPT: usize = 5_400;

const PHASES: usize = 8;

/// When a frame was drawn for the first time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Drawn {
    /// The frame.
    pub frame: FrameId,
    /// When the pose was sampled that the frame answers.
    pub view_sampled: ClientTime,
    /// When drawing it began.
    pub started: ClientTime,
    /// When drawing it ended.
    pub finished: ClientTime,
}

impl Drawn {
    /// `frame` was drawn for the first time between `started` and `finished`.
    #[must_use]
    pub fn new(frame: &ClientFrame, started: ClientTime, finished: ClientTime) -> Self {
        Self {
            frame: frame.frame,
            view_sampled: frame.server_timing.view_sampled,
            started,
            finished,
        }
    }

    /// From the sampling of the pose to the end of drawing.
    #[must_use]
    pub fn motion_to_photon(&self) -> Duration {
        Duration::from_nanos(self.finished.0.saturating_sub(self.view_sampled.0))
    }
}

/// Collects the phases of the frames that were drawn.
#[derive(Clone, Debug, Default)]
pub struct Latency {
    /// Phases in nanoseconds; a frame is complete once another replaced it.
    complete: VecDeque<[i64; PHASES]>,
    /// The frame on the display, and when drawing it ended.
    shown: Option<([i64; PHASES], ClientTime)>,
}

impl Latency {
    /// Takes a frame that was drawn for the first time.
    pub fn record(&mut self, frame: &ClientFrame, drawn: &Drawn) {
        if let Some((mut phases, finished)) = self.shown.take() {
            phases[7] = between(finished, drawn.finished);
            self.complete.push_back(phases);
            if self.complete.len() > FRAMES_KEPT {
                self.complete.pop_front();
            }
        }
        let server = &frame.server_timing;
        let client = &frame.timing;
        let on_client =
            |time: ServerTime| ClientTime(time.0.saturating_add_signed(client.client_minus_server));
        let moments = [
            server.view_sampled,
            on_client(server.view_received),
            on_client(server.started),
            on_client(server.finished),
            ClientTime(client.received),
            ClientTime(client.decoded),
            drawn.started,
            drawn.finished,
        ];
        let mut phases = [0; PHASES];
        for (phase, pair) in phases.iter_mut().zip(moments.windows(2)) {
            *phase = between(pair[0], pair[1]);
        }
        self.shown = Some((phases, drawn.finished));
    }

    /// Medians so far; none before a first frame was replaced by a second.
    #[must_use]
    pub fn summary(&self) -> Option<LatencySummary> {
        let phase = |index: usize| median(self.complete.iter().map(|phases| phases[index]));
        let totals = self.complete.iter();
        let total = totals.map(|phases| {
            let up_to_drawn = phases[..7].iter();
            up_to_drawn.fold(0_i64, |sum, &phase| sum.saturating_add(phase))
        });
        Some(LatencySummary {
            pose_to_server: phase(0)?,
            wait_at_server: phase(1)?,
            server_processing: phase(2)?,
            transfer: phase(3)?,
            decode: phase(4)?,
            wait_at_client: phase(5)?,
            draw: phase(6)?,
            shown: phase(7)?,
            total: median(total)?,
        })
    }
}

/// Medians in milliseconds, by phase of SAS 2018, figure 2.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LatencySummary {
    /// 1: the pose travels to the server.
    pub pose_to_server: f64,
    /// 2: it waits for the server's next frame.
    pub wait_at_server: f64,
    /// 3: the server makes the update and encodes the picture.
    pub server_processing: f64,
    /// 4: both travel to the client.
    pub transfer: f64,
    /// 5: the picture is decoded and the update applied.
    pub decode: f64,
    /// 6: they wait for the client's next frame.
    pub wait_at_client: f64,
    /// 7: the client draws.
    pub draw: f64,
    /// 8: shown until another update replaces it.
    pub shown: f64,
    /// Phases 1 to 7 of one frame together.
    pub total: f64,
}

fn between(start: ClientTime, end: ClientTime) -> i64 {
    let nanos = i128::from(end.0) - i128::from(start.0);
    i64::try_from(nanos).unwrap_or(if nanos < 0 { i64::MIN } else { i64::MAX })
}

/// In milliseconds; the lower one of an even count.
fn median(nanos: impl Iterator<Item = i64>) -> Option<f64> {
    let mut nanos: Vec<i64> = nanos.collect();
    let middle = nanos.len().checked_sub(1)? / 2;
    let (_, median, _) = nanos.select_nth_unstable(middle);
    Some(*median as f64 / 1e6)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use shadecast_protocol::{Epoch, Pose, UpdateTiming, ViewSeq};

    use super::*;
    use crate::{ClientTiming, DecodedPicture, YuvPicture};

    const MS: u64 = 1_000_000;

    fn frame(number: u32, sampled: u64, server_ahead: i64) -> ClientFrame {
        let on_server = |time: u64| ServerTime(time.saturating_add_signed(server_ahead));
        ClientFrame {
            frame: FrameId(number),
            epoch: Epoch(0),
            world_from_head: Pose::IDENTITY,
            scene_time: 0,
            server_timing: UpdateTiming {
                view: ViewSeq(number),
                view_sampled: ClientTime(sampled),
                view_received: on_server(sampled + MS),
                started: on_server(sampled + 3 * MS),
                finished: on_server(sampled + 6 * MS),
            },
            timing: ClientTiming {
                received: sampled + 10 * MS,
                decoded: sampled + 15 * MS,
                client_minus_server: -server_ahead,
            },
            vertices: Arc::default(),
            indices: Arc::default(),
            opaque_indices: 0,
            foreshortened: false,
            objects_lead: 0,
            motions: Arc::default(),
            picture: DecodedPicture::from(YuvPicture {
                width: 0,
                height: 0,
                y: vec![],
                u: vec![],
                v: vec![],
            }),
            masks: None,
            patches: 0,
        }
    }

    #[test]
    fn phases_are_told_apart_across_two_clocks() {
        let mut latency = Latency::default();
        for number in 0..5_u32 {
            let sampled = 1_000 * MS + u64::from(number) * 40 * MS;
            let frame = frame(number, sampled, 5_000 * MS as i64);
            let [started, finished] = [21, 28].map(|ms| ClientTime(sampled + ms * MS));
            let drawn = Drawn::new(&frame, started, finished);
            assert_eq!(drawn.motion_to_photon(), Duration::from_millis(28));
            assert_eq!(latency.summary().is_some(), number >= 2);
            latency.record(&frame, &drawn);
        }
        let summary = latency.summary().unwrap();
        let json = serde_json::to_value(summary).unwrap();
        let expected = serde_json::json!({
            "pose_to_server": 1.0, "wait_at_server": 2.0, "server_processing": 3.0,
            "transfer": 4.0, "decode": 5.0, "wait_at_client": 6.0, "draw": 7.0,
            "shown": 40.0, "total": 28.0,
        });
        assert_eq!(json, expected);
    }

    #[test]
    fn impossible_times_are_survived_and_memory_is_bounded() {
        let mut latency = Latency::default();
        for number in 0..2 * FRAMES_KEPT as u32 {
            let mut frame = frame(number, 0, 0);
            frame.server_timing.view_sampled = ClientTime(u64::MAX);
            frame.timing.client_minus_server = i64::MIN;
            let drawn = Drawn::new(&frame, ClientTime(0), ClientTime(0));
            assert_eq!(drawn.motion_to_photon(), Duration::ZERO);
            latency.record(&frame, &drawn);
        }
        assert_eq!(latency.complete.len(), FRAMES_KEPT);
        assert!(latency.summary().is_some());
    }
}
