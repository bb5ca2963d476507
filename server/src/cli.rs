//! What the command line says.

use std::{net::SocketAddr, path::PathBuf};

use clap::{Args, Parser, Subcommand};

/// Name of the built-in scene.
pub(crate) const BUILT_IN: &str = "courtyard";

/// Streams path-traced scenes to a headset that draws the geometry itself.
#[derive(Debug, Parser)]
#[command(
    version,
    after_help = "\
Examples:
  shadecast serve courtyard            serve the built-in scene; start a client with the line it prints
  shadecast serve castle.glb --atlas 4096 --bitrate 40
  shadecast inspect castle.glb         what is in a scene, and what it lets the server leave out
  shadecast scene courtyard --out courtyard.glb --triangles 250000"
)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Serve a scene to a headset
    Serve(ServeArguments),
    /// Write the built-in scene as a binary glTF file
    Scene {
        /// Which scene: courtyard
        #[arg(default_value = BUILT_IN, value_parser = [BUILT_IN])]
        name: String,
        /// About how many triangles
        #[arg(long, default_value_t = 15_000, value_parser = triangles)]
        triangles: usize,
        /// The file to write
        #[arg(long)]
        out: PathBuf,
    },
    /// Tell what is in a scene and what it lets the server leave out
    Inspect {
        #[command(flatten)]
        scene: SceneArguments,
        /// For programs instead of people
        #[arg(long)]
        json: bool,
    },
}

#[derive(Debug, Args)]
pub(crate) struct SceneArguments {
    /// A .gltf or .glb file, or "courtyard" for the built-in scene
    pub(crate) scene: String,
    /// About how many triangles the built-in scene has
    #[arg(long, default_value_t = 15_000, value_parser = triangles)]
    pub(crate) triangles: usize,
}

#[derive(Debug, Args)]
pub(crate) struct ServeArguments {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    /// Address and port to listen on; port 0 takes a free one
    #[arg(long, default_value = "0.0.0.0:4433")]
    pub(crate) listen: SocketAddr,
    /// Side of the atlas in texels [default: 2048, or 512 where the GPU is a program on the CPU]
    #[arg(long, value_parser = atlas_side)]
    pub(crate) atlas: Option<u16>,
    /// Side of a superblock, and so of the largest block, in texels [default: at most an eighth of the atlas]
    #[arg(long, value_parser = superblock_side)]
    pub(crate) superblock: Option<u16>,
    /// Target bitrate of the video, Mbit/s
    #[arg(long, default_value_t = 20.0, value_parser = positive)]
    pub(crate) bitrate: f64,
    /// Most updates a second
    #[arg(long, default_value_t = 30.0, value_parser = positive)]
    pub(crate) rate: f64,
    /// Time for path tracing in each update, milliseconds [default: 15, or 140 where the GPU is a program on the CPU]
    #[arg(long, value_parser = positive)]
    pub(crate) light_ms: Option<f64>,
    /// Indirect bounces of light
    #[arg(long, default_value_t = shadecast_server::still::DEFAULT_BOUNCES, value_parser = clap::value_parser!(u32).range(0..=64))]
    pub(crate) bounces: u32,
    /// Factor from radiance to displayed brightness [default: measured when the scene is loaded]
    #[arg(long, value_parser = positive)]
    pub(crate) exposure: Option<f64>,
    /// Heads sampled between now and the end of the prediction horizon
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=8))]
    pub(crate) head_samples: u32,
    /// File with certificate and secret, made where it does not exist; a server restarted with it keeps its line
    #[arg(long)]
    pub(crate) identity: Option<PathBuf>,
    /// End when the first client leaves
    #[arg(long)]
    pub(crate) once: bool,
    /// Write what was measured to this JSON file at the end
    #[arg(long)]
    pub(crate) stats: Option<PathBuf>,
}

fn triangles(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(count @ 1_000..=8_000_000) => Ok(count),
        _ => Err("a number from 1000 to 8000000 is expected".to_owned()),
    }
}

/// What the video can be: whole macroblocks, and no more than decoders take.
fn atlas_side(text: &str) -> Result<u16, String> {
    match text.parse::<u16>() {
        Ok(side @ 64..=8192) if side.is_multiple_of(16) => Ok(side),
        _ => Err("a multiple of 16 from 64 to 8192 is expected".to_owned()),
    }
}

fn superblock_side(text: &str) -> Result<u16, String> {
    match text.parse::<u16>() {
        Ok(side @ 4..=8192) if side.is_power_of_two() => Ok(side),
        _ => Err("a power of two from 4 to 8192 is expected".to_owned()),
    }
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() && number > 0.0 && number < 1e6 => Ok(number),
        _ => Err("a positive number below a million is expected".to_owned()),
    }
}
