//! The command `shadecast-eval`.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use shadecast_eval::{convergence, demo, leave_out, packing, sequence, speed, stress, visibility};

/// Measures what shadecast shows against what it should show.
#[derive(Parser)]
#[command(version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Streams a scene from a server to a client over loopback, and reports on it.
    ///
    /// Starts `shadecast` and `shadecast-desktop`, which must lie beside this
    /// program, renders path-traced references at the poses at which the client
    /// drew, and writes pictures, summary.json, error.csv and report.md.
    Demo(demo::Options),
    /// Measures error against run time of a still view.
    ///
    /// Path tracing, whole and with one part of the integrator switched off, and the
    /// atlas as it accumulates, with and without smoothing. Writes convergence.csv,
    /// .md, .svg and .png, and keeps its references.
    Convergence(convergence::Options),
    /// Measures what specialisation to a scene is worth.
    ///
    /// Draws each scene with kernels from which what it does not use is compiled
    /// away, and with everything in. Fails where the pictures differ. Writes
    /// leave-out.csv and .md.
    LeaveOut(leave_out::Options),
    /// Measures how fast and how well the atlas is managed.
    ///
    /// The allocator on the GPU, its twin on the CPU and a quadtree along the same
    /// walk, and what columns, block stacks and resets are worth. Fails where GPU and
    /// twin differ. Writes packing.md, packing-stage.csv, packing-speed.csv,
    /// packing-kernels.csv and packing-strategies.csv.
    Packing(packing::Options),
    /// Measures the error of what is displayed while a head or a lamp moves.
    ///
    /// Fresh frames, screen-space filtering (SVGF) and ours get the same time for
    /// each update. Writes sequence.csv, .md, .svg and .png, and keeps its references.
    Sequence(sequence::Options),
    /// Measures where the time of the light goes.
    ///
    /// Traversal, shading and smoothing at one path a texel, told apart by running
    /// them more than once. Writes speed.csv and .md.
    Speed(speed::Options),
    /// Measures what must hold in extreme and stiff cases.
    ///
    /// Writes stress.csv and .md, and fails where something does not hold.
    Stress(stress::Options),
    /// Measures what is found to be visible against what is seen.
    ///
    /// How far predicted heads are off, coverage and overestimation of visible sets,
    /// and pixels that a client would miss, by predictor, horizon, speed of the head and
    /// choice of viewpoints. Writes visibility.csv, .md, .svg and .png,
    /// visibility-missing.csv and visibility-prediction.csv.
    Visibility(visibility::Options),
}

fn main() -> ExitCode {
    let done = match Arguments::parse().command {
        Command::Demo(options) => demo::run(&options),
        Command::Convergence(options) => convergence::run(&options),
        Command::LeaveOut(options) => leave_out::run(&options),
        Command::Packing(options) => packing::run(&options),
        Command::Sequence(options) => sequence::run(&options),
        Command::Speed(options) => speed::run(&options),
        Command::Stress(options) => stress::run(&options),
        Command::Visibility(options) => visibility::run(&options),
    };
    match done {
        Ok(table) => {
            print!("{table}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
