//! The mock headset without a display: a clock that ticks, a head that follows
//! its trace, and a report at the end.

use anyhow::{Result, bail};
use shadecast_client::{Clock, render::Gpu};
use shadecast_protocol::{ClientTime, Motion};

use crate::args::Args;
use crate::capture::Capture;
use crate::clock::DisplayClock;
use crate::drawing::{Drawing, Panel};
use crate::headset::Headset;
use crate::report::{Percentiles, Report, Sample, peak_memory_bytes};

/// What a run of limited length waits for its first picture: a server that
/// builds its scene, on a slow machine.
const PATIENCE: f64 = 60.0;

/// What is read back and written as PNG, hence not sRGB: the bytes are encoded
/// for a display already.
const EYE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// Runs until the time is up or the user leaves.
pub(crate) fn run(args: &Args) -> Result<()> {
    let clock = Clock::start();
    let trace = args.head_trace()?;
    let lenses = args.lenses()?;
    let mut capture = match (&args.out, args.seconds) {
        (Some(folder), Some(seconds)) => {
            Some(Capture::new(folder, seconds, args.moments, args.samples)?)
        }
        _ => None,
    };
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let drawing = Drawing::new(Gpu::open(&instance, None)?, args.eye_size, EYE_FORMAT);
    let panel = lenses.map(|lenses| Panel::new(&drawing, lenses));
    let mut headset = Headset::start(args, clock, drawing)?;

    let began = clock.now();
    let mut display = DisplayClock::new(began, args.display_rate());
    let mut missed_before = 0;
    loop {
        clock.sleep_until(display.next_tick());
        let display_at = display.begin(clock.now());
        // The head waits for the first picture, so that runs can be compared.
        let head = match headset.measured.first_picture {
            Some(first) => trace.at(seconds(first, display_at)),
            None => Motion::still(trace.at(0.0).pose),
        };
        let turn = headset.turn(display_at, head, |encoder| {
            if let Some(panel) = &panel {
                panel.draw(encoder);
            }
        })?;
        if turn.interrupted {
            break;
        }
        let Some(first) = headset.measured.first_picture else {
            missed_before = display.missed();
            if args
                .seconds
                .is_some_and(|_| seconds(began, clock.now()) > PATIENCE)
            {
                bail!("no picture came from the server within {PATIENCE} s");
            }
            continue;
        };
        let since_first = seconds(first, clock.now());
        if let Some(capture) = &mut capture {
            capture.take(&headset, panel.as_ref(), &turn, since_first)?;
        }
        if args.seconds.is_some_and(|limit| since_first >= limit) {
            break;
        }
    }
    let ended = clock.now();
    if let (Some(folder), Some(capture)) = (&args.out, capture) {
        let missed = display.missed() - missed_before;
        report(&headset, ended, missed, capture.finish()?).write(folder)?;
    }
    Ok(())
}

fn report(headset: &Headset, ended: ClientTime, missed_ticks: u64, samples: Vec<Sample>) -> Report {
    let measured = &headset.measured;
    let seconds = measured
        .first_picture
        .map_or(0.0, |first| seconds(first, ended));
    let a_second = |count: u64| {
        if seconds > 0.0 {
            count as f64 / seconds
        } else {
            0.0
        }
    };
    let frames = measured.frame_ms.len() as u64;
    let traffic = &headset.network.traffic;
    let gpu = headset.drawing.gpu();
    Report {
        seconds,
        frames,
        frames_per_second: a_second(frames),
        frame_ms: Percentiles::of(&measured.frame_ms),
        missed_ticks,
        video_bytes: traffic.video_bytes(),
        update_bytes: traffic.update_bytes(),
        updates: traffic.frames(),
        updates_per_second: a_second(traffic.frames()),
        latency_ms: measured.latency.summary(),
        peak_memory_bytes: peak_memory_bytes(),
        stereo: gpu.stereo.name(),
        adapter: gpu.adapter.get_info().name,
        samples,
    }
}

fn seconds(start: ClientTime, end: ClientTime) -> f64 {
    end.0.saturating_sub(start.0) as f64 * 1e-9
}
