//! What the command line says.

use std::{ffi::OsString, net::SocketAddr, path::PathBuf};

use clap::{Args, Parser, Subcommand};
use glam::Vec3;
use shadecast_protocol::Method;
use shadecast_server::encode::OpenH264;

/// Name of the built-in scene.
pub(crate) const BUILT_IN: &str = "courtyard";

/// Streams path-traced scenes to a headset that draws the geometry itself.
#[derive(Debug, Parser)]
#[command(
    version,
    after_help = "\
Examples:
  shadecast serve courtyard            serve the built-in scene; start a client with the line it prints
  shadecast serve castle.glb --atlas 2048 --bitrate 40 --method snake
  shadecast render castle.glb --out castle.exr --spp 256
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
    /// Render a still picture by the server's own light
    Render(RenderArguments),
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
#[command(after_help = "\
Examples:
  shadecast render courtyard --out courtyard.png
  shadecast render castle.glb --out castle.exr --seconds 60 --bounces 4 --fovy 75
  shadecast render plane.glb --out plane.exr --env const:1,1,1 --view 1,0,0,0,0,1,0,0,0,0,1,-3,0,0,0,1

Lists of numbers are separated by commas or spaces. Spaces are right-handed, a camera
looks along -Z and +Y is up.")]
pub(crate) struct RenderArguments {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    /// FILE.exr for linear Rec.709 radiance in 32-bit floats, and FILE.png beside it; or FILE.png alone
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,
    /// World-to-camera matrix, 16 numbers row by row [default: the scene's camera or spawn]
    #[arg(long, value_name = "NUMBERS", value_parser = numbers::<16>, allow_hyphen_values = true)]
    pub(crate) view: Option<[f64; 16]>,
    /// Angle from the lower to the upper side of the picture, degrees
    #[arg(long, value_name = "DEGREES", default_value_t = 60.0, value_parser = field_of_view)]
    pub(crate) fovy: f64,
    /// Tangents of the left, right, lower and upper sides instead; left and down are mostly negative
    #[arg(long, value_name = "L,R,D,U", value_parser = numbers::<4>, allow_hyphen_values = true, conflicts_with = "fovy")]
    pub(crate) tangents: Option<[f64; 4]>,
    /// Width in pixels
    #[arg(long, default_value_t = 512, value_parser = clap::value_parser!(u32).range(1..=8192))]
    pub(crate) width: u32,
    /// Height in pixels
    #[arg(long, default_value_t = 512, value_parser = clap::value_parser!(u32).range(1..=8192))]
    pub(crate) height: u32,
    /// Samples a pixel
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) spp: u32,
    /// Render for this long instead of a number of samples
    #[arg(long, value_parser = positive, conflicts_with = "spp")]
    pub(crate) seconds: Option<f64>,
    /// Indirect bounces; 0 is emission and direct light only
    #[arg(long, default_value_t = shadecast_server::still::DEFAULT_BOUNCES, value_parser = clap::value_parser!(u32).range(0..=64))]
    pub(crate) bounces: u32,
    /// Seed of all random choices: the same seed on the same driver gives the same picture
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u32,
    /// Light from all around instead of the scene's sky: none, const:R,G,B (radiance), or an equirectangular .hdr or .exr file (+X in its middle, +Z to the right of it)
    #[arg(long, value_parser = environment)]
    pub(crate) env: Option<Environment>,
    /// A sun instead of the scene's directional lights: the direction that it shines along, and its irradiance
    #[arg(long, value_name = "DX,DY,DZ,R,G,B", value_parser = sun, allow_hyphen_values = true)]
    pub(crate) sun: Option<[f64; 6]>,
    /// Factor from radiance to the brightness of the PNG [default: measured in the picture]
    #[arg(long, value_parser = positive)]
    pub(crate) exposure: Option<f64>,
}

/// What lights a scene from all around.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Environment {
    /// Nothing.
    None,
    /// The same radiance everywhere.
    Constant(Vec3),
    /// What a picture shows.
    Picture(PathBuf),
}

#[derive(Debug, Args)]
pub(crate) struct ServeArguments {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    /// How the light is placed in the atlas: sas (patches in blocks that stay), snake (triangles by their shape, in slots that stay) or tss (triangles by themselves, anew for every picture)
    #[arg(long, default_value_t)]
    pub(crate) method: Method,
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
    /// Most heads that are predicted while an update is on display: one each 33 ms, as latency and rate are measured; each is two more pictures to draw
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

/// Options that take a list of numbers.
const LISTS: [&str; 3] = ["--view", "--tangents", "--sun"];

/// The command line with each list of numbers as one argument, however it was
/// written: `--sun -1,-2,0 5 5 5` becomes `--sun=-1,-2,0,5,5,5`.
pub(crate) fn joined_lists(arguments: impl Iterator<Item = OsString>) -> Vec<OsString> {
    let is_list = |text: &str| {
        let mut parts = text.split([',', ' ']).filter(|part| !part.is_empty());
        parts.all(|part| part.parse::<f64>().is_ok())
    };
    let mut joined: Vec<OsString> = Vec::new();
    // What stands before the next number, while a list is open.
    let mut separator = None;
    for argument in arguments {
        let text = argument.to_str().unwrap_or_default();
        match (separator, joined.last_mut()) {
            (Some(before), Some(list)) if is_list(text) => {
                list.push(before);
                list.push(text);
                separator = Some(",");
            }
            _ => {
                separator = LISTS.contains(&text).then_some("=");
                joined.push(argument);
            }
        }
    }
    joined
}

fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let parts = text.split([',', ' ']).filter(|part| !part.is_empty());
    let found: Vec<f64> = parts
        .map(|part| match part.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err(format!("\"{part}\" is no finite number")),
        })
        .collect::<Result<_, _>>()?;
    let count = found.len();
    found
        .try_into()
        .map_err(|_| format!("{N} numbers are expected, there are {count}"))
}

fn environment(text: &str) -> Result<Environment, String> {
    if text == "none" {
        return Ok(Environment::None);
    }
    let Some(radiance) = text.strip_prefix("const:") else {
        let path = PathBuf::from(text);
        let extension = path.extension().map(std::ffi::OsStr::to_ascii_lowercase);
        return match extension.as_deref().and_then(std::ffi::OsStr::to_str) {
            Some("hdr" | "exr") => Ok(Environment::Picture(path)),
            _ => {
                Err("none, const:R,G,B or a file that ends in .hdr or .exr is expected".to_owned())
            }
        };
    };
    let radiance = numbers::<3>(radiance)?;
    if radiance
        .iter()
        .any(|channel| !(0.0..=1e6).contains(channel))
    {
        return Err("radiance from 0 to 1e6 is expected".to_owned());
    }
    Ok(Environment::Constant(Vec3::from(
        radiance.map(|channel| channel as f32),
    )))
}

fn sun(text: &str) -> Result<[f64; 6], String> {
    let sun = numbers::<6>(text)?;
    if sun[..3].iter().all(|part| part.abs() < 1e-12) {
        return Err("the direction is zero".to_owned());
    }
    if sun[3..]
        .iter()
        .any(|channel| !(0.0..=1e9).contains(channel))
    {
        return Err("irradiance from 0 to 1e9 is expected".to_owned());
    }
    Ok(sun)
}

fn field_of_view(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(degrees) if degrees > 0.1 && degrees < 179.0 => Ok(degrees),
        _ => Err("an angle from 0.1 to 179 degrees is expected".to_owned()),
    }
}

fn triangles(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(count @ 1_000..=8_000_000) => Ok(count),
        _ => Err("a number from 1000 to 8000000 is expected".to_owned()),
    }
}

/// What the video can be: whole macroblocks, and no more than the encoder takes.
fn atlas_side(text: &str) -> Result<u16, String> {
    const MOST: u16 = OpenH264::LARGEST_SQUARE;
    match text.parse::<u16>() {
        Ok(side @ 64..=MOST) if side.is_multiple_of(16) => Ok(side),
        _ => Err(format!(
            "a multiple of 16 from 64 to {MOST} is expected: the video encoder takes no larger pictures"
        )),
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

#[cfg(test)]
mod tests {
    use super::*;

    fn render(arguments: &str) -> Result<RenderArguments, clap::Error> {
        let words = ["shadecast", "render", "courtyard", "--out", "a.png"].into_iter();
        let words = words.chain(arguments.split(' ').filter(|word| !word.is_empty()));
        let cli = Cli::try_parse_from(joined_lists(words.map(OsString::from)))?;
        match cli.command {
            Command::Render(arguments) => Ok(arguments),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn lists_of_numbers_may_be_written_in_any_way() {
        for list in [
            "-1,-2,0,5,6,7",
            "-1 -2 0 5 6 7",
            "-1,-2,0 5,6,7",
            "-1, -2, 0, 5, 6, 7",
        ] {
            let found = render(&format!("--sun {list} --spp 3")).unwrap();
            assert_eq!(found.sun, Some([-1.0, -2.0, 0.0, 5.0, 6.0, 7.0]), "{list}");
            assert_eq!(found.spp, 3);
        }
        let found = render("--tangents=-1,1,-0.5,0.5").unwrap();
        assert_eq!(found.tangents, Some([-1.0, 1.0, -0.5, 0.5]));
        let found = render("--env const:1,0.5,0").unwrap();
        assert_eq!(
            found.env,
            Some(Environment::Constant(Vec3::new(1.0, 0.5, 0.0)))
        );
    }

    #[test]
    fn what_cannot_be_is_refused() {
        for arguments in [
            "--view 1,0,0",
            "--sun 0,0,0,1,1,1",
            "--sun 0,-1,0,1,1,nan",
            "--sun 0,-1,0,-1,1,1",
            "--env const:1,1",
            "--env const:-1,1,1",
            "--env sky",
            "--env sky.png",
            "--fovy 180",
            "--fovy nan",
            "--spp 0",
            "--width 0",
            "--bounces 65",
            "--seconds 1 --spp 2",
            "--fovy 60 --tangents -1,1,-1,1",
        ] {
            assert!(render(arguments).is_err(), "{arguments}");
        }
    }
}
