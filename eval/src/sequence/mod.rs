//! `shadecast-eval sequence`: error of what is displayed while things move.
//!
//! A head looks about, a lamp circles, a lamp jumps; at each update every method
//! gets the same time. Fresh frames remember nothing, screen-space filtering
//! remembers pixels, ours remembers surfaces. How much work fits the time is
//! measured beforehand, so that a run can be repeated; what the updates took is
//! measured besides. On a software driver time is that of the CPU: it is the device,
//! and whatever else runs on it must not count. Neither network nor video is in the
//! way: what is compared is light.

mod contenders;
mod moments;
mod page;

use std::{path::PathBuf, time::Duration};

use anyhow::{Result, ensure};
use clap::Args;
use image::RgbImage;
use serde::Serialize;
use shadecast_protocol::Fov;
use shadecast_server::{
    scene::Scene,
    still::{Camera, Still, StillRenderer},
};

use self::{
    contenders::{METHODS, Method, integrator},
    moments::{Motion, UPDATES, time_of},
};
use crate::{
    flip,
    progress::Progress,
    reference::{self, Reference, Subject},
    relmse,
    report::{Folder, Header, Spent, strip},
    scenes,
};

/// Pixels a radian of the view: the demo's.
const PIXELS_PER_RADIAN: f32 = 170.0;
/// Time for an update, in that of a fresh frame of one sample a pixel.
const BUDGETS: [f64; 3] = [2.0, 4.0, 8.0];
const QUICK_BUDGETS: [f64; 1] = [4.0];
/// Updates that the speed is measured over.
const TRIALS: u32 = 9;
/// Longest that a reference may take, however many samples it lacks.
const LONGEST_REFERENCE: Duration = Duration::from_secs(3600);

/// Measures the error of what is displayed while things move.
#[derive(Args, Debug)]
pub struct Options {
    /// `courtyard`, `lamps`, `plates`, or glTF files.
    #[arg(value_name = "SCENE", default_value = "courtyard")]
    pub scenes: Vec<String>,
    /// Folder for figures; references are kept in it from run to run.
    #[arg(long, value_name = "DIR", default_value = crate::OUT)]
    pub out: PathBuf,
    /// A rough run: a smaller picture, one budget, fewer references.
    #[arg(long)]
    pub quick: bool,
    /// Samples a pixel of a reference [default: 512, quick: 128].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=65_536))]
    pub reference_spp: Option<u32>,
}

/// A line of `sequence.csv`.
#[derive(Clone, Debug, Serialize)]
struct Row {
    scene: String,
    motion: &'static str,
    method: &'static str,
    budget_ms: f64,
    frame: u32,
    flip: f64,
    relmse: f64,
    server_ms: f64,
    server_cpu_ms: f64,
    work: u32,
}

/// What was found of a scene and a motion.
struct Measured {
    scene: String,
    motion: Motion,
    rows: Vec<Row>,
    /// The reference and each method's picture, in the middle of the trace and at
    /// its end.
    strip: RgbImage,
    /// Mean relMSE of the references themselves.
    reference_noise: f64,
}

/// Runs the measurement; the result is the page's tables.
///
/// # Errors
/// When a scene or a folder cannot be used, or the GPU fails.
pub fn run(options: &Options) -> Result<String> {
    ensure!(!options.scenes.is_empty(), "name at least one scene");
    let steps = options.scenes.len() * Motion::ALL.len() * 2;
    let progress = Progress::new(steps as u64);
    let mut driver = String::new();
    let mut measured = Vec::new();
    for name in &options.scenes {
        let scene = scenes::named(name)?;
        for motion in Motion::ALL {
            measured.push(measure(
                name,
                &scene,
                motion,
                options,
                &progress,
                &mut driver,
            )?);
        }
    }
    progress.finish();
    let header = Header::new("sequence", &driver, options.scenes.clone(), 0);
    let folder = Folder::new(&options.out, header)?;
    let rows: Vec<&Row> = measured.iter().flat_map(|found| &found.rows).collect();
    folder.csv(&rows)?;
    page::write(&folder, &measured)
}

fn measure(
    name: &str,
    scene: &Scene,
    motion: Motion,
    options: &Options,
    progress: &Progress,
    driver: &mut String,
) -> Result<Measured> {
    let side = if options.quick { 64 } else { 96 };
    let camera = |world_from_eye| Camera {
        world_from_eye,
        fov: Fov::symmetric(side as f32 / PIXELS_PER_RADIAN),
        width: side,
        height: side,
    };
    let first = camera(scene.first_eye());
    let mut renderer = StillRenderer::new(scene, integrator(), &mut |_| ())?;
    renderer.adapter().clone_into(driver);
    let exposure = renderer
        .render(&first, Duration::ZERO, 16, 1)?
        .automatic_exposure();
    // What the exposure shows as middle grey.
    let scene = motion.scene(scene, 0.2 / exposure);

    progress.step(&format!("{name}, {}: references", motion.name()));
    let compared = motion.compared(options.quick);
    let spp = options
        .reference_spp
        .unwrap_or(if options.quick { 128 } else { 512 });
    let mut references = Vec::new();
    for (index, &update) in compared.iter().enumerate() {
        let subject = Subject {
            scene: &scene,
            camera: camera(motion.eye(&scene, update)),
            scene_time: time_of(update),
            integrator: integrator(),
        };
        let is_enough = |reference: &Reference| reference.samples >= spp;
        let folder = options.out.join("references");
        let share = |within: f32| (index as f32 + within) / compared.len() as f32;
        references.push(reference::render(
            &subject,
            &folder,
            LONGEST_REFERENCE,
            is_enough,
            |_| {
                progress.within(share(0.0));
            },
        )?);
    }

    progress.step(&format!("{name}, {}: methods", motion.name()));
    let clock = if renderer.is_software() {
        |spent: Spent| spent.cpu
    } else {
        |spent: Spent| spent.wall
    };
    let one_sample = speed_of(&METHODS[0], &scene, &first, clock)?.per_work;
    let budgets: &[f64] = if options.quick {
        &QUICK_BUDGETS
    } else {
        &BUDGETS
    };
    let mut rows = Vec::new();
    let mut strips = Vec::new();
    for (index, method) in METHODS.iter().enumerate() {
        progress.within(index as f32 / METHODS.len() as f32);
        let speed = speed_of(method, &scene, &first, clock)?;
        for budget in budgets {
            let seconds = budget * one_sample;
            let work = speed.work_for(seconds);
            let mut contender = (method.make)(&scene, &first)?;
            for update in 0..UPDATES {
                let camera = camera(motion.eye(&scene, update));
                let spent = contender.update(&camera, time_of(update), work)?;
                let Some(at) = compared.iter().position(|compared| *compared == update) else {
                    continue;
                };
                let picture = contender.picture(&camera)?;
                let (flip, relmse) = errors(&picture, &references[at].still, exposure)?;
                let ms = |time: Duration| time.as_secs_f64() * 1e3;
                rows.push(Row {
                    scene: name.to_owned(),
                    motion: motion.name(),
                    method: method.name,
                    budget_ms: seconds * 1e3,
                    frame: update,
                    flip,
                    relmse,
                    server_ms: ms(spent.wall),
                    server_cpu_ms: ms(spent.cpu),
                    work,
                });
                if *budget == budgets[budgets.len() / 2]
                    && (at + 1 == compared.len() || at == compared.len() / 2)
                {
                    strips.push(picture.displayed(exposure));
                }
            }
        }
    }
    let shown = [compared.len() / 2, compared.len() - 1];
    let mut pictures: Vec<RgbImage> = shown
        .iter()
        .map(|at| references[*at].still.displayed(exposure))
        .collect();
    pictures.extend(strips);
    let noise = |reference: &Reference| {
        let squares = reference
            .still
            .radiance
            .iter()
            .map(|p| f64::from(p.length_squared()) / 3.0);
        let mean_square = squares.sum::<f64>() / reference.still.radiance.len() as f64;
        reference.standard_error.powi(2) / mean_square
    };
    Ok(Measured {
        scene: name.to_owned(),
        motion,
        rows,
        strip: strip(&pictures, shown.len()),
        reference_noise: references.iter().map(noise).sum::<f64>() / references.len() as f64,
    })
}

fn errors(picture: &Still, truth: &Still, exposure: f32) -> Result<(f64, f64)> {
    let perceived = flip(&truth.displayed(exposure), &picture.displayed(exposure))?.mean();
    Ok((perceived, relmse(&picture.radiance, &truth.radiance)))
}

/// Seconds of an update, as a line over its work.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Speed {
    fixed: f64,
    per_work: f64,
    /// Least work that makes sense.
    least: u32,
}

impl Speed {
    /// As much work as fits; the least, where not even that does.
    fn work_for(self, seconds: f64) -> u32 {
        let work = (seconds - self.fixed) / self.per_work.max(1e-12);
        (work.clamp(0.0, f64::from(u32::MAX)) as u32).max(self.least)
    }
}

/// Measured over the first updates of a still view, in turn with little and with much work.
fn speed_of(
    method: &Method,
    scene: &Scene,
    camera: &Camera,
    clock: fn(Spent) -> Duration,
) -> Result<Speed> {
    let pixels = camera.width * camera.height;
    let (little, much, least) = if method.per_pixel {
        (1, 4, 1)
    } else {
        (pixels / 2, pixels * 2, 256)
    };
    let mut contender = (method.make)(scene, camera)?;
    // Drivers compile at the first use.
    contender.update(camera, Duration::ZERO, much)?;
    let mut trial = |work| -> Result<f64> {
        let mut seconds = Vec::new();
        for update in 0..TRIALS {
            let spent = contender.update(camera, time_of(update), work)?;
            seconds.push(clock(spent).as_secs_f64());
        }
        seconds.sort_by(f64::total_cmp);
        Ok(seconds[seconds.len() / 2])
    };
    let (of_little, of_much) = (trial(little)?, trial(much)?);
    let per_work = ((of_much - of_little) / f64::from(much - little)).max(1e-9);
    Ok(Speed {
        fixed: (of_little - per_work * f64::from(little)).max(0.0),
        per_work,
        least,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_fits_the_time() {
        let speed = Speed {
            fixed: 0.1,
            per_work: 0.01,
            least: 1,
        };
        assert_eq!(speed.work_for(0.5001), 40);
        assert_eq!(speed.work_for(0.05), 1);
        assert_eq!(speed.work_for(f64::NAN), 1);
        let instant = Speed {
            per_work: 0.0,
            ..speed
        };
        assert_eq!(instant.work_for(1e9), u32::MAX);
    }

    #[test]
    fn lamps_move_as_their_motion_says() {
        let scene = scenes::named("plates").unwrap();
        for motion in [Motion::Lamp, Motion::Jump] {
            let with_lamp = motion.scene(&scene, 0.5);
            let lamp = with_lamp.objects.last().unwrap();
            let steps = (1..UPDATES).map(|update| {
                let [before, after] = [update - 1, update]
                    .map(|update| lamp.world_from_object(time_of(update)).position);
                before.distance(after)
            });
            let longest = steps.fold(0.0, f32::max);
            let expected = if motion == Motion::Jump {
                0.6..0.9
            } else {
                0.01..0.2
            };
            assert!(expected.contains(&longest), "{motion:?}: {longest}");
        }
    }
}
