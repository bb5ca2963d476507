//! A real headset, by the OpenXR runtime of this machine.

use std::time::Duration;

use anyhow::Result;
use cpu_time::ThreadTime;
use shadecast_client::network::Event;
use shadecast_client::openxr::{self, Headset, HeadsetConfig};
use shadecast_client::worn::{Frame, HeadsetClient, IDLE, Turn};
use shadecast_client::{OpenH264Decoder, Status};

use crate::args::Args;
use crate::headset::MAX_ATLAS_SIDE;
use crate::interrupt::Interrupt;

/// Runs until the user leaves the headset, or by Ctrl-C or the time that is set.
pub(crate) fn run(args: &Args) -> Result<()> {
    let config = HeadsetConfig {
        display_rate: args.asked_display_rate(),
        ..HeadsetConfig::default()
    };
    let entry = openxr::load()?;
    let mut client = HeadsetClient::open(|frames| Headset::open(entry, (), config, frames))?;
    let (decoder, largest) = (OpenH264Decoder::new(), MAX_ATLAS_SIDE as u16);
    client.connect(args.line.clone(), decoder, largest)?;
    let interrupt = Interrupt::watch()?;
    if let Some(headset) = client.display().description() {
        eprintln!("headset: {headset}");
    }
    let mut pace = Pace::default();
    loop {
        let before = ThreadTime::now();
        let turn = client.turn(&mut hear)?;
        match turn {
            Turn::Frame(frame) => {
                pace.count(&frame, before.elapsed());
                let limit = args.seconds.map(Duration::from_secs_f64);
                if interrupt.came() || limit.is_some_and(|limit| pace.shown_for(&frame) >= limit) {
                    client.leave()?;
                }
            }
            Turn::Idle | Turn::Lost => {
                if turn == Turn::Lost {
                    eprintln!("the headset is away; waiting for it");
                }
                if interrupt.came() {
                    client.leave()?;
                }
                std::thread::sleep(IDLE);
            }
            Turn::Exit => break,
        }
    }
    eprintln!("{}", pace.summary());
    Ok(())
}

fn hear(event: &Event) {
    let Event::Status(status) = event else { return };
    match status {
        Status::Connecting => eprintln!("connecting"),
        Status::Filling => eprintln!("waiting for the first picture"),
        Status::Streaming => eprintln!("streaming"),
        Status::Recovering(_) => eprintln!("recovering"),
        Status::Resting => eprintln!("resting until the headset is worn"),
        Status::Reconnecting { reason, after } => {
            eprintln!("{reason}; again in {:.1} s", after.as_secs_f64());
        }
    }
}

/// Widths of the histogram's classes.
const CLASS: Duration = Duration::from_micros(10);
/// Classes; the last one holds all that is longer.
const CLASSES: usize = 2_000;

/// How the display was kept up with. Counts without keeping, so that an evening
/// in the headset takes no more memory than a minute.
#[derive(Debug)]
struct Pace {
    frames: u64,
    drawn: u64,
    missed: u64,
    first: Option<Frame>,
    last: Option<Frame>,
    /// Processor time of this thread in a frame, all but waiting.
    cpu: Box<[u32; CLASSES]>,
}

impl Default for Pace {
    fn default() -> Self {
        Self {
            frames: 0,
            drawn: 0,
            missed: 0,
            first: None,
            last: None,
            cpu: Box::new([0; CLASSES]),
        }
    }
}

impl Pace {
    fn count(&mut self, frame: &Frame, cpu: Duration) {
        self.frames += 1;
        self.drawn += u64::from(frame.drawn);
        if let Some(last) = self.last {
            let passed = frame.display_at.0.saturating_sub(last.display_at.0) as f64;
            let intervals = passed / frame.period.as_nanos().max(1) as f64;
            // More than a second is a headset that was taken off.
            if passed < 1e9 {
                self.missed += (intervals - 0.5).max(0.0) as u64;
            }
        }
        self.first.get_or_insert(*frame);
        self.last = Some(*frame);
        let class = (cpu.as_nanos() / CLASS.as_nanos()) as usize;
        self.cpu[class.min(CLASSES - 1)] += 1;
    }

    /// From the first frame to this one.
    fn shown_for(&self, frame: &Frame) -> Duration {
        let first = self
            .first
            .map_or(frame.display_at, |first| first.display_at);
        Duration::from_nanos(frame.display_at.0.saturating_sub(first.0))
    }

    /// Of the processor times, in milliseconds: the end of its class.
    fn cpu_ms(&self, percent: u64) -> f64 {
        let rank = (self.frames * percent).div_ceil(100).max(1);
        let mut seen = 0;
        let class = self.cpu.iter().position(|count| {
            seen += u64::from(*count);
            seen >= rank
        });
        (class.unwrap_or(0) + 1) as f64 * CLASS.as_secs_f64() * 1e3
    }

    fn summary(&self) -> String {
        format!(
            "{} display frames, {} drawn, {} missed; processor time of a frame {:.2} ms (p50), {:.2} ms (p99)",
            self.frames,
            self.drawn,
            self.missed,
            self.cpu_ms(50),
            self.cpu_ms(99),
        )
    }
}

#[cfg(test)]
mod tests {
    use shadecast_protocol::ClientTime;

    use super::*;

    #[test]
    fn intervals_without_a_frame_are_missed_and_times_are_ranked() {
        let mut pace = Pace::default();
        let period = Duration::from_millis(10);
        for (number, at) in [0, 10, 20, 50, 60, 5_060].into_iter().enumerate() {
            let frame = Frame {
                began: ClientTime(0),
                display_at: ClientTime(at * 1_000_000),
                period,
                uploading: Duration::ZERO,
                drawing: Duration::ZERO,
                drawn: number > 0,
                fresh: false,
            };
            pace.count(&frame, Duration::from_micros(100 * (number as u64 + 1)));
        }
        assert_eq!((pace.frames, pace.drawn, pace.missed), (6, 5, 2));
        assert!((pace.cpu_ms(50) - 0.31).abs() < 1e-9);
        assert!((pace.cpu_ms(99) - 0.61).abs() < 1e-9);
        let last = pace.last.expect("frames were counted");
        assert_eq!(pace.shown_for(&last), Duration::from_millis(5_060));
        assert!(Pace::default().summary().starts_with("0 display frames"));
    }
}
