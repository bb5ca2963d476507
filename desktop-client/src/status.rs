//! The live line on the terminal; where there is none, a line every few seconds.

use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use shadecast_client::{Status, network::Traffic};
use shadecast_protocol::ClientTime;

use crate::headset::Measured;

/// Between two lines on a terminal.
const LIVE: Duration = Duration::from_millis(500);
/// Between two lines in a log.
const LOGGED: Duration = Duration::from_secs(5);

/// Says on standard error how the run goes.
#[derive(Debug)]
pub(crate) struct StatusLine {
    bar: Option<ProgressBar>,
    session: String,
    last: Counts,
}

/// What had been counted when the last line was written.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    at: ClientTime,
    drawn: usize,
    frames: u64,
    video: u64,
    updates: u64,
}

impl StatusLine {
    pub(crate) fn new(now: ClientTime) -> Self {
        let bar = std::io::stderr()
            .is_terminal()
            .then(|| ProgressBar::no_length().with_style(ProgressStyle::default_spinner()));
        Self {
            bar,
            session: "starting".into(),
            last: Counts {
                at: now,
                ..Counts::default()
            },
        }
    }

    /// What the session is doing has changed.
    pub(crate) fn say(&mut self, status: &Status) {
        self.session = match status {
            Status::Connecting => "connecting".into(),
            Status::Filling => "waiting for the first picture".into(),
            Status::Streaming => "streaming".into(),
            Status::Recovering(_) => "recovering".into(),
            Status::Resting => "resting".into(),
            Status::Reconnecting { reason, after } => {
                format!("{reason}; again in {:.1} s", after.as_secs_f64())
            }
        };
        match &self.bar {
            Some(bar) => bar.set_message(self.session.clone()),
            None => eprintln!("{}", self.session),
        }
    }

    /// Something that the user should read.
    pub(crate) fn warn(&self, sentence: &str) {
        match &self.bar {
            Some(bar) => bar.println(sentence),
            None => eprintln!("{sentence}"),
        }
    }

    /// Nothing has been drawn yet.
    pub(crate) fn wait(&mut self, now: ClientTime) {
        self.last.at = now;
        if let Some(bar) = &self.bar {
            bar.tick();
        }
    }

    /// The figures since the last line, when one is due.
    pub(crate) fn show(
        &mut self,
        now: ClientTime,
        measured: &Measured,
        traffic: &Traffic,
        patches: u32,
    ) {
        let every = if self.bar.is_some() { LIVE } else { LOGGED };
        let elapsed = Duration::from_nanos(now.0.saturating_sub(self.last.at.0));
        if elapsed < every {
            return;
        }
        let counts = Counts {
            at: now,
            drawn: measured.frame_ms.len(),
            frames: traffic.frames(),
            video: traffic.video_bytes(),
            updates: traffic.update_bytes(),
        };
        let seconds = elapsed.as_secs_f64();
        let megabits = |bytes: u64| bytes as f64 * 8e-6 / seconds;
        let latency = measured
            .latency
            .summary()
            .map_or(String::new(), |median| format!(", {:.0} ms", median.total));
        let line = format!(
            "{}: display {:.1} fps, {:.1} updates/s, video {:.2} Mbit/s, updates {:.2} Mbit/s, {patches} patches{latency}",
            self.session,
            (counts.drawn - self.last.drawn) as f64 / seconds,
            (counts.frames - self.last.frames) as f64 / seconds,
            megabits(counts.video - self.last.video),
            megabits(counts.updates - self.last.updates),
        );
        match &self.bar {
            Some(bar) => {
                bar.set_message(line);
                bar.tick();
            }
            None => eprintln!("{line}"),
        }
        self.last = counts;
    }
}
