//! Path-traced pictures to measure errors against, kept from run to run.
//!
//! A reference is the mean of two halves with different seeds. What differs
//! between the halves is noise alone, so that the difference says how noisy the
//! reference itself is. It is kept by its content: scene, camera, integrator and
//! the kernels' source make its name.

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use anyhow::{Context, Result};
use glam::Vec3;
use sha2::{Digest, Sha256};
use shadecast_server::{
    Integrator,
    scene::Scene,
    still::{Camera, Film, Still, StillRenderer},
};
use shadecast_shaders::light::STILL_SOURCE;

use crate::rmse;

/// Paths between two looks at the clock.
const PATHS_A_STEP: u32 = 1 << 17;

/// A picture, and how far it may be from the truth.
#[derive(Clone, Debug)]
pub(crate) struct Reference {
    pub(crate) still: Still,
    /// Root of the mean variance of its pixels.
    pub(crate) standard_error: f64,
    /// Samples a pixel.
    pub(crate) samples: u32,
    /// It was kept from an earlier run.
    pub(crate) kept: bool,
}

/// Of what, from where, and how.
pub(crate) struct Subject<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) camera: Camera,
    pub(crate) scene_time: Duration,
    pub(crate) integrator: Integrator,
}

/// Renders the reference, or takes the one that is kept in `folder`, until
/// `enough` is satisfied or `budget` is spent. `progress` hears of the share done.
pub(crate) fn render(
    subject: &Subject<'_>,
    folder: &Path,
    budget: Duration,
    enough: impl Fn(&Reference) -> bool,
    mut progress: impl FnMut(f32),
) -> Result<Reference> {
    let name = name_of(subject);
    if let Some(reference) = kept(folder, &name).filter(&enough) {
        return Ok(reference);
    }
    let Camera { width, height, .. } = subject.camera;
    let mut renderer = StillRenderer::new(subject.scene, subject.integrator, &mut |_| ())?;
    let film = || renderer.film([width, height]);
    let mut films: [Film; 2] = [film()?, film()?];
    let step = (PATHS_A_STEP / (width * height)).max(1);
    let began = Instant::now();
    let mut next_look = 4 * step;
    loop {
        for (seed, film) in (0x5eed_0001..).zip(&mut films) {
            renderer.expose(film, &subject.camera, subject.scene_time, step, seed)?;
        }
        let share = began.elapsed().as_secs_f32() / budget.as_secs_f32();
        progress(share.min(1.0));
        if films[0].samples() < next_look && share < 1.0 {
            continue;
        }
        next_look = films[0].samples().saturating_mul(5) / 4;
        let halves = [renderer.develop(&films[0])?, renderer.develop(&films[1])?];
        let reference = mean(&halves, films[0].samples(), false);
        if enough(&reference) || share >= 1.0 {
            keep(folder, &name, &halves, films[0].samples())
                .with_context(|| format!("cannot keep a reference in {}", folder.display()))?;
            return Ok(reference);
        }
    }
}

fn mean(halves: &[Still; 2], samples_of_half: u32, kept: bool) -> Reference {
    let [one, other] = halves;
    let pairs = one.radiance.iter().zip(&other.radiance);
    Reference {
        still: Still {
            radiance: pairs.map(|(a, b)| (*a + *b) * 0.5).collect(),
            ..*one
        },
        // The halves differ by twice the error of their mean.
        standard_error: rmse(&one.radiance, &other.radiance) * 0.5,
        samples: samples_of_half.saturating_mul(2),
        kept,
    }
}

/// Of everything that the picture depends on.
fn name_of(subject: &Subject<'_>) -> String {
    let Subject {
        scene,
        camera,
        scene_time,
        integrator,
    } = subject;
    let mut hash = Sha256::new();
    hash.update(STILL_SOURCE);
    for position in &scene.positions {
        for value in position.to_array() {
            hash.update(value.to_le_bytes());
        }
    }
    for image in &scene.images {
        hash.update(&image.rgba);
    }
    let rest = format!(
        "{:?} {:?} {:?} {:?} {:?} {:?} {camera:?} {scene_time:?} {integrator:?}",
        scene.triangles, scene.corners, scene.materials, scene.lights, scene.sky, scene.objects
    );
    hash.update(rest);
    let mut name = String::new();
    for byte in &hash.finalize()[..8] {
        // Writing to a String cannot fail.
        let _ = write!(name, "{byte:02x}");
    }
    name
}

/// `HASH-HALF-SAMPLES.exr`.
fn path_of(folder: &Path, name: &str, half: usize, samples: u32) -> PathBuf {
    folder.join(format!("{name}-{half}-{samples}.exr"))
}

fn keep(folder: &Path, name: &str, halves: &[Still; 2], samples: u32) -> Result<()> {
    std::fs::create_dir_all(folder)?;
    for (half, still) in halves.iter().enumerate() {
        still.save_exr(&path_of(folder, name, half, samples))?;
    }
    Ok(())
}

/// The one with most samples; what cannot be read is as if it were not there.
fn kept(folder: &Path, name: &str) -> Option<Reference> {
    let first_half = format!("{name}-0-");
    let samples = std::fs::read_dir(folder).ok()?.filter_map(|entry| {
        let file = entry.ok()?.file_name().into_string().ok()?;
        let samples = file.strip_prefix(&first_half)?.strip_suffix(".exr")?;
        samples.parse::<u32>().ok()
    });
    let samples = samples.max()?;
    let half = |half| {
        let picture = image::open(path_of(folder, name, half, samples))
            .ok()?
            .into_rgb32f();
        Some(Still {
            width: picture.width(),
            height: picture.height(),
            radiance: picture.pixels().map(|pixel| Vec3::from(pixel.0)).collect(),
        })
    };
    let halves = [half(0)?, half(1)?];
    let alike = (halves[0].width, halves[0].height) == (halves[1].width, halves[1].height);
    alike.then(|| mean(&halves, samples, true))
}
