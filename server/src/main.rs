//! The `shadecast` command: serve a scene, render it, write the built-in one,
//! or tell what is in one.

mod cli;
mod render;
mod serve;
mod status;

use std::{fs::File, io::BufWriter, path::Path, process::ExitCode};

use anyhow::Context;
use clap::Parser;
use shadecast_server::scene::{self, Scene};

use cli::{Cli, Command, SceneArguments};

fn main() -> ExitCode {
    tracing_subscriber::fmt()
        .with_env_filter(
            tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| "warn".into()),
        )
        .with_writer(std::io::stderr)
        .init();
    match run(Cli::parse_from(cli::joined_lists(std::env::args_os()))) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(cli: Cli) -> anyhow::Result<()> {
    match cli.command {
        Command::Serve(arguments) => serve::serve(&arguments),
        Command::Render(arguments) => render::render(&arguments),
        Command::Scene {
            name,
            triangles,
            out,
        } => {
            let scene = load(&SceneArguments {
                scene: name,
                triangles,
            })?;
            write_glb(&scene, &out)?;
            eprintln!(
                "wrote {} ({} triangles)",
                out.display(),
                scene.triangles.len()
            );
            Ok(())
        }
        Command::Inspect { scene, json } => {
            let scene = load(&scene)?;
            if json {
                println!(
                    "{}",
                    serde_json::to_string_pretty(&scene::Inspection::of(&scene))?
                );
            } else {
                print!("{}", scene::inspection(&scene));
            }
            Ok(())
        }
    }
}

/// The built-in scene by its name, any other by its path.
fn load(arguments: &SceneArguments) -> anyhow::Result<Scene> {
    if arguments.scene == cli::BUILT_IN {
        return Ok(scene::courtyard(arguments.triangles));
    }
    let path = Path::new(&arguments.scene);
    scene::load(path).with_context(|| format!("cannot load {}", path.display()))
}

fn write_glb(scene: &Scene, out: &Path) -> anyhow::Result<()> {
    let file = File::create(out).with_context(|| format!("cannot write {}", out.display()))?;
    let mut writer = BufWriter::new(file);
    scene::write_glb(scene, &mut writer)
        .and_then(|()| std::io::Write::flush(&mut writer))
        .with_context(|| format!("cannot write {}", out.display()))
}
