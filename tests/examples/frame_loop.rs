//! How much of a display frame the headset's client needs for itself.
//!
//! A stream of the built-in scene is recorded in virtual time. Then no server
//! runs: the stream comes from another thread at its own pace, and the headset
//! draws at 90 Hz of real time in the simulated runtime. Time inside of the
//! runtime, waiting for the display among it, is nobody's; of the rest, recording
//! and submitting commands is wgpu's and the driver's, and what is left is our own.
//! Handing a new world to the GPU counts as ours in processor time, and not in wall
//! time: a software driver lets a submission wait for the drawing before it.
//!
//! ```sh
//! cargo run --release -p shadecast-tests --example frame_loop
//! ```

use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use anyhow::Context;
use cpu_time::ThreadTime;
use shadecast_client::openxr::{Headset, HeadsetConfig, api};
use shadecast_client::worn::{Display, Turn};
use shadecast_client::{ClientFrame, Clock, render::frame_channel};
use shadecast_protocol::Welcome;
use shadecast_server::scene::courtyard;
use shadecast_simulated_runtime::{ClockKind, Runtime, Script, on_crossing};
use shadecast_tests::Loopback;

/// Recorded, and played in a circle.
const RECORDED: usize = 60;
/// Of the stream, a second.
const UPDATES: u32 = 30;
/// Of the display, a second.
const RATE: f32 = 90.0;
const SIDE: u32 = 256;
const FRAMES: usize = 1_800;

thread_local! {
    /// Wall and processor time inside of the runtime, nanoseconds.
    static INSIDE: Cell<[u64; 2]> = const { Cell::new([0; 2]) };
    /// When the headset last read the clock: when it woke, before drawing, after.
    static READ: Cell<[Option<(Instant, ThreadTime)>; 2]> = const { Cell::new([None; 2]) };
    static ENTERED: Cell<Option<(Instant, ThreadTime)>> = const { Cell::new(None) };
}

fn cross(inwards: bool) {
    if inwards {
        ENTERED.set(Some((Instant::now(), ThreadTime::now())));
    } else if let Some((wall, cpu)) = ENTERED.take() {
        let [wall_before, cpu_before] = INSIDE.get();
        INSIDE.set([
            wall_before + wall.elapsed().as_nanos() as u64,
            cpu_before + cpu.elapsed().as_nanos() as u64,
        ]);
    }
}

fn read(clock: Clock) -> shadecast_protocol::ClientTime {
    let [_, last] = READ.get();
    READ.set([last, Some((Instant::now(), ThreadTime::now()))]);
    clock.now()
}

/// Wall and processor time between the last two readings, nanoseconds.
fn drawing() -> [u64; 2] {
    let [Some((wall, cpu)), Some((wall_after, cpu_after))] = READ.get() else {
        return [0; 2];
    };
    [
        wall_after.duration_since(wall).as_nanos() as u64,
        cpu_after.duration_since(cpu).as_nanos() as u64,
    ]
}

fn main() -> anyhow::Result<()> {
    let (welcome, stream) = record()?;
    println!(
        "a stream of {} updates, {} patches in the last",
        stream.len(),
        stream.last().map_or(0, |frame| frame.patches)
    );
    for antialias in [false, true] {
        measure(&welcome, &stream, antialias)?;
    }
    Ok(())
}

fn record() -> anyhow::Result<(Welcome, Vec<Arc<ClientFrame>>)> {
    let mut loopback = Loopback::new(courtyard(10_000), 1)?;
    loopback.run_until_presented(RECORDED)?;
    let welcome = loopback.take_welcome().context("no welcome")?;
    Ok((welcome, loopback.take_presented()))
}

fn measure(welcome: &Welcome, stream: &[Arc<ClientFrame>], antialias: bool) -> anyhow::Result<()> {
    let mut script = Script {
        clock: ClockKind::System,
        rate: RATE,
        ..Script::default()
    };
    script.headset.eyes.size = [SIDE; 2];
    script.headset.extensions.push("KHR_convert_timespec_time");
    let runtime = Runtime::new(script);
    // SAFETY: the simulation answers as OpenXR says.
    let entry = unsafe { api::Entry::from_get_instance_proc_addr(runtime.entry(), &()) };
    let entry = entry.map_err(|error| anyhow::anyhow!("{error}"))?;
    let (mut sender, frames) = frame_channel();
    let config = HeadsetConfig {
        antialias,
        ..HeadsetConfig::default()
    };
    let mut headset = Headset::open(entry, (), config, frames)?;
    headset.welcome(welcome);
    on_crossing(cross);

    let playing = AtomicBool::new(true);
    let mut own = [(); 2].map(|()| Vec::with_capacity(FRAMES));
    let mut drawn = [(); 2].map(|()| Vec::with_capacity(FRAMES));
    let mut missed = 0;
    std::thread::scope(|scope| -> anyhow::Result<()> {
        scope.spawn(|| {
            for frame in stream.iter().cycle() {
                if !playing.load(Relaxed) {
                    break;
                }
                sender.send(Arc::clone(frame));
                std::thread::sleep(Duration::from_secs(1) / UPDATES);
            }
        });
        let clock = Clock::start();
        let mut last = None;
        let mut run = || -> anyhow::Result<()> {
            // The first second compiles pipelines.
            for number in 0..FRAMES + RATE as usize {
                let (began, began_cpu) = (Instant::now(), ThreadTime::now());
                let before = INSIDE.get();
                let turn = headset.turn(&|| read(clock), &mut |_| {})?;
                let after = INSIDE.get();
                let Turn::Frame(frame) = turn else { continue };
                if number >= RATE as usize {
                    let total = [began.elapsed(), began_cpu.elapsed()];
                    let drawing = drawing();
                    for index in 0..2 {
                        let mut inside = after[index] - before[index] + drawing[index];
                        if index == 0 {
                            inside += frame.uploading.as_nanos() as u64;
                        }
                        own[index].push((total[index].as_nanos() as u64).saturating_sub(inside));
                        drawn[index].push(drawing[index]);
                    }
                    if let Some(last) = last {
                        let passed = frame.display_at.0.saturating_sub(last) as f64;
                        let intervals = passed / frame.period.as_nanos() as f64;
                        missed += (intervals - 0.5).max(0.0) as u64;
                    }
                }
                last = Some(frame.display_at.0);
            }
            Ok(())
        };
        let ran = run();
        playing.store(false, Relaxed);
        ran
    })?;
    let vulkan = headset.vulkan().context("the session was lost")?;
    println!(
        "\n2x{SIDE}x{SIDE} at {RATE} Hz on {}, {}{}",
        vulkan.gpu.adapter.get_info().name,
        vulkan.gpu.stereo.name(),
        if antialias { ", 4 samples a pixel" } else { "" },
    );
    let period = (1e9 / f64::from(RATE)) as u64;
    let too_long = own[0].iter().filter(|time| **time > period).count();
    println!("time of a frame, ms               p50    p99    max");
    for (name, times) in [("our own", &mut own), ("drawing", &mut drawn)] {
        let [wall, cpu] = times;
        print_line(&format!("{name}, processor"), cpu);
        print_line(&format!("{name}, wall"), wall);
    }
    println!(
        "of {} frames {too_long} took longer than an interval by our own work; {missed} intervals passed without a frame, drawing included",
        own[0].len(),
    );
    Ok(())
}

fn print_line(name: &str, nanos: &mut [u64]) {
    nanos.sort_unstable();
    let at = |percent: usize| nanos[(nanos.len() * percent).div_ceil(100) - 1] as f64 * 1e-6;
    println!(
        "{name:<30} {:>6.2} {:>6.2} {:>6.2}",
        at(50),
        at(99),
        at(100)
    );
}
