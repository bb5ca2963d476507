//! What a run of the server was like, for people and for programs.

use std::{
    collections::VecDeque,
    path::Path,
    time::{Duration, Instant},
};

use anyhow::Context;
use glam::Vec3;
use serde_json::json;
use shadecast_protocol::Hand;
use shadecast_server::{Frame, Hands, Stages, patches::PatchedScene, scene::SceneFacts};
use shadecast_transport::SentBytes;

use crate::cli::ServeArguments;

/// The controllers in words.
const SIDES: [&str; 2] = ["left", "right"];

/// The live line looks back this far.
const WINDOW: Duration = Duration::from_secs(2);

pub(super) struct Stats {
    scene: String,
    method: &'static str,
    adapter: String,
    triangles: usize,
    patches: [f32; 3],
    left_out: Vec<String>,
    exposure: f32,
    first: Option<Instant>,
    last: Option<Instant>,
    updates: u64,
    stages: Vec<Stages>,
    visible: Vec<u32>,
    paths: Vec<u32>,
    used: Vec<f32>,
    biggest_bias: f32,
    unplaced: u64,
    resets: u32,
    sent: SentBytes,
    recent: VecDeque<(Instant, SentBytes)>,
    /// Of the left and the right button.
    presses: [u64; 2],
    pub(super) failures: u32,
}

impl Stats {
    pub(super) fn new(
        arguments: &ServeArguments,
        adapter: &str,
        scene: &PatchedScene,
        exposure: f32,
    ) -> Self {
        Self {
            scene: arguments.scene.scene.clone(),
            method: arguments.method.name(),
            adapter: adapter.to_owned(),
            triangles: scene.scene.triangles.len(),
            patches: scene.report.shares(),
            left_out: SceneFacts::of(&scene.scene).left_out(),
            exposure,
            first: None,
            last: None,
            updates: 0,
            stages: Vec::new(),
            visible: Vec::new(),
            paths: Vec::new(),
            used: Vec::new(),
            biggest_bias: 0.0,
            unplaced: 0,
            resets: 0,
            sent: SentBytes::default(),
            recent: VecDeque::new(),
            presses: [0; 2],
            failures: 0,
        }
    }

    pub(super) fn add(&mut self, frame: &Frame) {
        let now = Instant::now();
        self.first.get_or_insert(now);
        self.last = Some(now);
        self.updates += 1;
        self.stages.push(frame.stats.stages);
        self.visible.push(frame.stats.visible);
        self.paths.push(frame.stats.paths);
        self.used.push(frame.stats.atlas.used_fraction());
        self.biggest_bias = self.biggest_bias.max(frame.stats.bias);
        self.unplaced += u64::from(frame.stats.unplaced);
        self.resets = frame.stats.atlas.resets;
    }

    pub(super) fn sent(&mut self, sent: SentBytes) {
        let now = Instant::now();
        self.sent = sent;
        self.recent.push_back((now, sent));
        while self
            .recent
            .front()
            .is_some_and(|(then, _)| now - *then > WINDOW)
        {
            self.recent.pop_front();
        }
    }

    /// Counts what was pressed between two moments of a session; says where it was
    /// aimed, a line for each button.
    pub(super) fn pressed(&mut self, before: &Hands, now: &Hands) -> Vec<String> {
        let mut lines = Vec::new();
        for (side, name) in SIDES.into_iter().enumerate() {
            let new = now.presses[side].saturating_sub(before.presses[side]);
            self.presses[side] += new;
            if let (1.., Some(hand)) = (new, now.now[side]) {
                let aim = hand.world_from_aim;
                let towards = aim.orientation * Vec3::NEG_Z;
                lines.push(format!(
                    "the {name} button was pressed at {:.2} m, aiming along {towards:.2}",
                    aim.position
                ));
            }
        }
        lines
    }

    /// The live line.
    pub(super) fn line(&self, latency: Option<Duration>, hands: &Hands) -> String {
        let (Some((from, first)), Some((to, last))) = (self.recent.front(), self.recent.back())
        else {
            return String::new();
        };
        let seconds = (*to - *from).as_secs_f64().max(1e-3);
        let megabits = |bytes: u64| bytes as f64 * 8e-6 / seconds;
        format!(
            "{:.1} updates/s | video {:.2} Mbit/s | updates {:.2} Mbit/s | PVS {} patches | atlas {:.0} % | latency {}{}",
            (self.recent.len() - 1) as f64 / seconds,
            megabits(last.video.saturating_sub(first.video)),
            megabits(last.updates.saturating_sub(first.updates)),
            self.visible.last().unwrap_or(&0),
            self.used.last().unwrap_or(&0.0) * 100.0,
            latency.map_or("?".to_owned(), |latency| format!(
                "{:.0} ms",
                latency.as_secs_f64() * 1e3
            )),
            held(hands.now, hands.presses),
        )
    }

    pub(super) fn write(&self, path: &Path) -> anyhow::Result<()> {
        let seconds = match (self.first, self.last) {
            (Some(first), Some(last)) => (last - first).as_secs_f64(),
            _ => 0.0,
        };
        let stage = |of: fn(&Stages) -> Duration| {
            median(
                self.stages
                    .iter()
                    .map(|stages| of(stages).as_secs_f64() * 1e3),
            )
        };
        let report = json!({
            "scene": self.scene,
            "method": self.method,
            "triangles": self.triangles,
            "adapter": self.adapter,
            "patches": { "solo": self.patches[0], "pair": self.patches[1], "triple": self.patches[2] },
            "left_out": self.left_out,
            "exposure": self.exposure,
            "updates": self.updates,
            "seconds": seconds,
            "updates_per_second": self.updates.saturating_sub(1) as f64 / seconds.max(1e-9),
            "atlas_used_fraction": median(self.used.iter().map(|used| f64::from(*used))),
            "atlas_resets": self.resets,
            "visible_patches": median(self.visible.iter().map(|visible| f64::from(*visible))) as u64,
            "unplaced_patches": self.unplaced,
            "biggest_bias": self.biggest_bias,
            "texels_per_update": median(self.paths.iter().map(|paths| f64::from(*paths))) as u64,
            "video_bytes": self.sent.video,
            "update_bytes": self.sent.updates,
            "presses": { "left": self.presses[0], "right": self.presses[1] },
            "stages_ms": {
                "visibility": stage(|s| s.visibility),
                "atlas": stage(|s| s.atlas),
                "light": stage(|s| s.light),
                "picture": stage(|s| s.picture),
                "encode": stage(|s| s.encode),
            },
            "peak_memory_bytes": peak_memory(),
        });
        std::fs::write(path, serde_json::to_string_pretty(&report)?)
            .with_context(|| format!("cannot write {}", path.display()))
    }
}

/// The controllers that are there, for the end of the live line.
fn held(now: [Option<Hand>; 2], presses: [u64; 2]) -> String {
    let mut text = String::new();
    for (side, name) in SIDES.into_iter().enumerate() {
        if let Some(hand) = now[side] {
            text += if text.is_empty() { " | " } else { ", " };
            let state = if hand.pressed { " (pressed)" } else { "" };
            text += &format!("{name} hand {} presses{state}", presses[side]);
        }
    }
    text
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Largest resident size so far; `None` where the system does not tell.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kibibytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kibibytes * 1024)
}

#[cfg(test)]
mod tests {
    use shadecast_protocol::Pose;

    use super::*;

    #[test]
    fn the_live_line_tells_of_controllers_where_there_are_any() {
        assert_eq!(held([None; 2], [0; 2]), "");
        let pressed = |pressed: bool| {
            Some(Hand {
                world_from_aim: Pose::IDENTITY,
                pressed,
                presses: 7,
            })
        };
        assert_eq!(
            held([None, pressed(true)], [0, 3]),
            " | right hand 3 presses (pressed)"
        );
        assert_eq!(
            held([pressed(false), pressed(false)], [0, 3]),
            " | left hand 0 presses, right hand 3 presses"
        );
    }
}
