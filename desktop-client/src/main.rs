//! `shadecast-desktop`: the mock headset, or a real one. Draws on the main thread at the
//! display's rate, while other threads talk to the server, decode its pictures
//! and write files.

mod args;
mod capture;
mod clock;
mod drawing;
mod headless;
mod headset;
mod interrupt;
#[cfg(all(feature = "openxr", not(target_vendor = "apple")))]
mod openxr;
#[cfg(feature = "window")]
mod pilot;
mod report;
mod status;
mod trace;
mod trace_file;
#[cfg(feature = "window")]
mod window;

use std::process::ExitCode;

use clap::Parser;
use tracing_subscriber::EnvFilter;

use crate::args::Args;

fn main() -> ExitCode {
    let args = Args::parse();
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("warn"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .init();
    match run(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: &Args) -> anyhow::Result<()> {
    #[cfg(feature = "window")]
    if args.window {
        return window::run(args);
    }
    #[cfg(all(feature = "openxr", not(target_vendor = "apple")))]
    if args.openxr {
        return openxr::run(args);
    }
    headless::run(args)
}
