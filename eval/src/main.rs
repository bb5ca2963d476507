//! The command `shadecast-eval`.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use shadecast_eval::demo;

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
}

fn main() -> ExitCode {
    let Command::Demo(options) = Arguments::parse().command;
    match demo::run(&options) {
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
