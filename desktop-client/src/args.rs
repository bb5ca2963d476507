//! The command line.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Parser;
use glam::{Quat, Vec3};
use shadecast_client::render::{EyeLens, Eyes, LensProfile, Optics, PhoneScreen};
use shadecast_protocol::{EyeView, Fov, Pose};
use shadecast_transport::ServerLine;

use crate::trace::{HeadTrace, Sway};
use crate::trace_file::TraceFile;

/// A mock headset for shadecast: draws the streamed scene in stereo at its own
/// pose and rate, without a display or in a window; or in a real headset.
///
/// The head follows a built-in motion or a trace. The display ticks on its own
/// clock whether or not anything new came; when the server vanishes, the last
/// picture stays and the client connects again by itself.
#[derive(Clone, Debug, Parser)]
#[command(name = "shadecast-desktop", version, after_help = EXAMPLES, max_term_width = 100)]
pub(crate) struct Args {
    /// The line that `shadecast serve` printed
    #[arg(value_name = "LINE")]
    pub(crate) line: ServerLine,

    /// Head poses, one a line: time x y z qx qy qz qw (seconds, metres in the
    /// play space, unit quaternion; # begins a comment); starts over at its end
    #[arg(long, value_name = "FILE", conflicts_with = "seed")]
    trace: Option<PathBuf>,

    /// Which of the built-in head motions
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,

    /// Pictures a second of the display; of a headset, the nearest that it has
    /// [default: 30; a headset's own]
    #[arg(long, value_name = "HZ", value_parser = within(1.0, 1000.0))]
    display_rate: Option<f64>,

    /// Width and height of one eye's picture, pixels
    #[arg(long, value_name = "PIXELS", default_value_t = 256, value_parser = clap::value_parser!(u16).range(16..=4096))]
    pub(crate) eye_size: u16,

    /// Field of view of an eye, degrees, on both axes
    #[arg(long, value_name = "DEGREES", default_value_t = 90.0, value_parser = within(10.0, 170.0))]
    fov: f64,

    /// Distance between the eyes, metres
    #[arg(long, value_name = "METRES", default_value_t = 0.063, value_parser = within(0.0, 0.2))]
    ipd: f64,

    /// Ends this many seconds after the first picture; without, at Ctrl-C
    #[arg(long, value_name = "N", value_parser = within(0.1, 86_400.0))]
    pub(crate) seconds: Option<f64>,

    /// Distortion against the lenses: mild, none, those of a phone in a Cardboard, or a file
    #[arg(long, value_name = "mild|none|cardboard|FILE.json", default_value = "mild", long_help = LENS_HELP)]
    lens: String,

    /// Writes pictures and client.json into this folder
    #[arg(long, value_name = "DIR", requires = "seconds")]
    pub(crate) out: Option<PathBuf>,

    /// Moments of the run at which eyes_NN.png and atlas_NN.png are written
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u32).range(0..=100))]
    pub(crate) moments: u32,

    /// Single eyes written before the lens, from 5 s after the first picture,
    /// with the pose at which each was drawn
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(0..=1000))]
    pub(crate) samples: u32,

    /// Opens a window: click, then the mouse looks and W A S D Q E move; Esc quits
    #[cfg(feature = "window")]
    #[arg(long, conflicts_with_all = ["trace", "seed", "out"])]
    pub(crate) window: bool,

    /// Shows it in the headset of this machine's OpenXR runtime
    #[cfg(all(feature = "openxr", not(target_vendor = "apple")))]
    #[arg(long, conflicts_with_all = ["trace", "seed", "out", "eye_size", "fov", "ipd", "lens"])]
    #[cfg_attr(feature = "window", arg(conflicts_with = "window"))]
    pub(crate) openxr: bool,
}

const LENS_HELP: &str = r#"Distortion against the lenses: mild, none (the pass is skipped), cardboard, or a file:
{"centre": [x, y], "k": [[red, red], [green, green], [blue, blue]]}

Lengths are half heights of the picture; a pixel at distance r from the centre shows what is at
r (1 + k[0] r^2 + k[1] r^4). The centre is the left eye's; the right eye has it mirrored.

With cardboard the eyes are those behind a phone of 130x65 mm in a Cardboard of 2015: --fov and
--ipd are left aside."#;

const EXAMPLES: &str = "Examples:
  shadecast-desktop \"$LINE\" --seconds 20 --out run
  shadecast-desktop \"$LINE\" --trace walk.txt --display-rate 72 --eye-size 512
  shadecast-desktop \"$LINE\" --window --lens none
  shadecast-desktop \"$LINE\" --openxr";

impl Args {
    /// Of the mock headset's display, pictures a second.
    pub(crate) fn display_rate(&self) -> f64 {
        self.display_rate.unwrap_or(30.0)
    }

    /// What a headset's display is asked for.
    #[cfg(all(feature = "openxr", not(target_vendor = "apple")))]
    pub(crate) fn asked_display_rate(&self) -> Option<f32> {
        self.display_rate.map(|rate| rate as f32)
    }

    /// The head's path.
    pub(crate) fn head_trace(&self) -> Result<HeadTrace> {
        Ok(match &self.trace {
            Some(path) => HeadTrace::File(TraceFile::read(path)?),
            None => HeadTrace::BuiltIn(Box::new(Sway::new(self.seed))),
        })
    }

    /// Left and right eye.
    pub(crate) fn eyes(&self) -> [EyeView; 2] {
        if let Some(phone) = self.phone() {
            return phone.views;
        }
        [-0.5, 0.5].map(|side| EyeView {
            head_from_eye: Pose {
                position: Vec3::new(self.ipd as f32 * side, 0.0, 0.0),
                orientation: Quat::IDENTITY,
            },
            fov: Fov::symmetric((self.fov as f32).to_radians()),
        })
    }

    /// Of a phone in a viewer, whose screen is as wide as two pictures.
    fn phone(&self) -> Option<Eyes> {
        if self.lens != "cardboard" {
            return None;
        }
        let side = u32::from(self.eye_size);
        let screen = PhoneScreen {
            pixels_an_inch: [side as f32 / 0.065 * 0.0254; 2],
            rate: self.display_rate() as f32,
            quarters: 1,
        };
        Optics::CARDBOARD.eyes([2 * side, side], screen).ok()
    }

    /// None where the lens pass is skipped.
    pub(crate) fn lenses(&self) -> Result<Option<[EyeLens; 2]>> {
        if let Some(phone) = self.phone() {
            return Ok(Some(phone.lenses));
        }
        let profile = match self.lens.as_str() {
            "none" => return Ok(None),
            "mild" => LensProfile::mild(),
            file => read_lens(Path::new(file)).with_context(|| format!("lens profile {file}"))?,
        };
        Ok(Some(profile.eyes(1.0)))
    }
}

fn read_lens(path: &Path) -> Result<LensProfile> {
    let text = std::fs::read_to_string(path).context("cannot be read")?;
    let profile: LensProfile = serde_json::from_str(&text).context("is not a lens profile")?;
    Ok(profile.checked()?)
}

/// Parses a finite number in a range.
fn within(low: f64, high: f64) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| match text.parse::<f64>() {
        Ok(number) if (low..=high).contains(&number) => Ok(number),
        Ok(_) => Err(format!("it must lie between {low} and {high}")),
        Err(error) => Err(error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    fn line() -> String {
        format!(
            "shadecast://127.0.0.1:4433/?fingerprint={}&secret={}",
            "0".repeat(64),
            "0".repeat(32)
        )
    }

    fn parse(rest: &[&str]) -> Result<Args, clap::Error> {
        let line = line();
        let words = ["shadecast-desktop", &line];
        Args::try_parse_from(words.iter().chain(rest))
    }

    #[test]
    fn the_command_line_is_consistent() {
        Args::command().debug_assert();
    }

    #[test]
    fn defaults_are_those_of_the_demo() {
        assert!(parse(&["--openxr"]).is_ok());
        let args = parse(&[]).unwrap();
        let [left, right] = args.eyes();
        assert!(
            (right.head_from_eye.position.x - left.head_from_eye.position.x - 0.063).abs() < 1e-6
        );
        assert!(left.fov.is_valid());
        let mild = LensProfile::mild().eyes(1.0);
        assert_eq!(args.lenses().unwrap(), Some(mild));
        let phone = parse(&["--lens", "cardboard"]).unwrap();
        let [left, right] = phone.eyes();
        assert!(
            left.fov.left < left.fov.right * -1.01,
            "further to the outside"
        );
        assert_eq!(left.fov.left, -right.fov.right);
        assert!(phone.lenses().unwrap().is_some());
    }

    #[test]
    fn nonsense_is_refused() {
        for bad in [
            &["--fov", "NaN"][..],
            &["--fov", "180"],
            &["--display-rate", "0"],
            &["--eye-size", "1000000"],
            &["--seconds", "-1"],
            &["--out", "somewhere"],
            &["--trace", "file", "--seed", "3"],
            &["--openxr", "--window"],
            &["--openxr", "--eye-size", "512"],
        ] {
            assert!(parse(bad).is_err(), "{bad:?}");
        }
        assert!(Args::try_parse_from(["shadecast-desktop", "http://example.com"]).is_err());
        let missing = parse(&["--lens", "/nowhere.json"]).unwrap().lenses();
        assert!(format!("{:#}", missing.unwrap_err()).contains("/nowhere.json"));
    }
}
