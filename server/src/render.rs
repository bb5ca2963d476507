//! `shadecast render`: a still picture by the kernels that light the atlas.

use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use anyhow::{Context, ensure};
use glam::{DMat3, DQuat, DVec3};
use shadecast_protocol::{Fov, Pose};
use shadecast_server::{
    Integrator,
    scene::{EnvironmentMap, Light, Scene, SkyModel},
    still::{Camera, StillRenderer},
};

use crate::{
    cli::{Environment, RenderArguments},
    status::Status,
};

/// How far a view's rows may be from unit vectors at right angles.
const RIGID: f64 = 1e-3;
/// Paths between two looks at the clock: half a second of a software driver. Always
/// the same, because the order of a sum of floats shows in its last digits.
const PATHS_A_STEP: u32 = 1 << 16;

pub(crate) fn render(arguments: &RenderArguments) -> anyhow::Result<()> {
    let (exr, png) = outputs(&arguments.out)?;
    let fov = field_of_view(arguments)?;
    let mut scene = crate::load(&arguments.scene)?;
    light(&mut scene, arguments)?;
    let camera = Camera {
        world_from_eye: match &arguments.view {
            Some(view) => pose_from_view(view).context("--view")?,
            None => scene.first_eye(),
        },
        fov,
        width: arguments.width,
        height: arguments.height,
    };

    let status = Status::new();
    let progress = status.progress("building the tree of triangles");
    let mut renderer = StillRenderer::new(
        &scene,
        Integrator::with_bounces(arguments.bounces),
        &mut |share| progress(share),
    )?;
    let progress = status.progress("rendering");
    let mut film = renderer
        .film([camera.width, camera.height])
        .with_context(|| format!("--width {} --height {}", camera.width, camera.height))?;
    let began = Instant::now();
    let step = (PATHS_A_STEP / (camera.width * camera.height)).max(1);
    loop {
        let share = match arguments.seconds {
            Some(seconds) => began.elapsed().as_secs_f64() / seconds,
            None => f64::from(film.samples()) / f64::from(arguments.spp),
        };
        progress(share.min(1.0) as f32);
        if share >= 1.0 {
            break;
        }
        let samples = match arguments.seconds {
            Some(_) => step,
            None => step.min(arguments.spp - film.samples()),
        };
        renderer.expose(&mut film, &camera, Duration::ZERO, samples, arguments.seed)?;
    }
    let seconds = began.elapsed().as_secs_f64();
    let still = renderer.develop(&film)?;
    let rays = renderer.rays()?;
    status.clear();

    let cannot_write = |path: &Path| format!("cannot write {}", path.display());
    if let Some(exr) = &exr {
        still.save_exr(exr).with_context(|| cannot_write(exr))?;
    }
    let exposure = arguments
        .exposure
        .map_or_else(|| still.automatic_exposure(), |exposure| exposure as f32);
    still
        .displayed(exposure)
        .save(&png)
        .with_context(|| cannot_write(&png))?;
    println!(
        "{}x{}, {} samples a pixel, {} bounces, in {seconds:.2} s: {:.3} Mrays/s on {}",
        still.width,
        still.height,
        film.samples(),
        arguments.bounces,
        rays as f64 / seconds / 1e6,
        renderer.adapter(),
    );
    for path in exr.iter().chain([&png]) {
        println!("wrote {}", path.display());
    }
    Ok(())
}

/// Of an EXR file also a PNG beside it.
fn outputs(out: &Path) -> anyhow::Result<(Option<PathBuf>, PathBuf)> {
    let folder = out.parent().filter(|folder| !folder.as_os_str().is_empty());
    ensure!(
        folder.is_none_or(Path::is_dir),
        "the folder of --out {} does not exist",
        out.display()
    );
    let extension = out.extension().and_then(|extension| extension.to_str());
    match extension.map(str::to_ascii_lowercase).as_deref() {
        Some("exr") => Ok((Some(out.to_owned()), out.with_extension("png"))),
        Some("png") => Ok((None, out.to_owned())),
        _ => anyhow::bail!(
            "--out {} must end in .exr (linear radiance, and a .png beside it) or in .png",
            out.display()
        ),
    }
}

/// Replaces what the command line replaces.
fn light(scene: &mut Scene, arguments: &RenderArguments) -> anyhow::Result<()> {
    match &arguments.env {
        None => {}
        Some(Environment::None) => scene.sky = SkyModel::BLACK,
        Some(Environment::Constant(radiance)) => scene.sky = SkyModel::constant(*radiance),
        Some(Environment::Picture(path)) => {
            let map =
                EnvironmentMap::load(path).with_context(|| format!("--env {}", path.display()))?;
            scene.environment = Some(map.into());
        }
    }
    if let Some([x, y, z, r, g, b]) = arguments.sun {
        scene
            .lights
            .retain(|light| !matches!(light, Light::Directional { .. }));
        let (direction, irradiance) = (DVec3::new(x, y, z), DVec3::new(r, g, b));
        if irradiance != DVec3::ZERO {
            scene.lights.push(Light::Directional {
                direction: direction.normalize().as_vec3(),
                irradiance: irradiance.as_vec3(),
                angular_radius: 0.0,
            });
        }
    }
    Ok(())
}

fn field_of_view(arguments: &RenderArguments) -> anyhow::Result<Fov> {
    let (width, height) = (arguments.width, arguments.height);
    let [left, right, down, up] = arguments.tangents.unwrap_or_else(|| {
        let up = (arguments.fovy.to_radians() * 0.5).tan();
        let right = up * f64::from(width) / f64::from(height);
        [-right, right, -up, up]
    });
    let fov = Fov {
        left: left.atan() as f32,
        right: right.atan() as f32,
        up: up.atan() as f32,
        down: down.atan() as f32,
    };
    ensure!(
        fov.is_valid(),
        "the field of view must open to less than 179 degrees, its left below its right \
         and its lower side below its upper one"
    );
    Ok(fov)
}

/// The camera's pose from a world-to-camera matrix, row by row.
fn pose_from_view(view: &[f64; 16]) -> anyhow::Result<Pose> {
    let row = |n: usize| DVec3::new(view[4 * n], view[4 * n + 1], view[4 * n + 2]);
    let rows = [row(0), row(1), row(2)];
    let last = &view[12..];
    ensure!(
        last.iter()
            .zip([0.0, 0.0, 0.0, 1.0])
            .all(|(a, b)| (a - b).abs() < RIGID),
        "the last row must be 0, 0, 0, 1 (the matrix is read row by row)"
    );
    let unit = rows.iter().all(|row| (row.length() - 1.0).abs() < RIGID);
    let right_handed = (rows[0].cross(rows[1]) - rows[2]).length() < RIGID;
    ensure!(
        unit && right_handed,
        "the upper left 3 by 3 numbers must be a rotation"
    );
    let world_from_camera = DMat3::from_cols(rows[0], rows[1], rows[2]);
    let translation = DVec3::new(view[3], view[7], view[11]);
    Ok(Pose {
        position: (-(world_from_camera * translation)).as_vec3(),
        orientation: DQuat::from_mat3(&world_from_camera).normalize().as_quat(),
    })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn a_view_is_where_it_says() {
        // From (1, 2, 3), looking along +X.
        let view = [
            0.0, 0.0, 1.0, -3.0, //
            0.0, 1.0, 0.0, -2.0, //
            -1.0, 0.0, 0.0, 1.0, //
            0.0, 0.0, 0.0, 1.0,
        ];
        let pose = pose_from_view(&view).unwrap();
        assert!(pose.position.abs_diff_eq(Vec3::new(1.0, 2.0, 3.0), 1e-6));
        assert!((pose.orientation * Vec3::NEG_Z).abs_diff_eq(Vec3::X, 1e-6));
        assert!((pose.orientation * Vec3::Y).abs_diff_eq(Vec3::Y, 1e-6));
    }

    #[test]
    fn views_that_are_no_pose_are_refused() {
        let identity = [
            1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0,
        ];
        assert_eq!(pose_from_view(&identity).unwrap(), Pose::IDENTITY);
        // Scaled, mirrored, transposed, not a number.
        for (index, value) in [(0, 2.0), (10, -1.0), (12, 5.0), (5, f64::NAN)] {
            let mut view = identity;
            view[index] = value;
            assert!(pose_from_view(&view).is_err(), "{index} {value}");
        }
    }

    #[test]
    fn an_exr_has_a_png_beside_it() {
        let (exr, png) = outputs(Path::new("b.EXR")).unwrap();
        assert_eq!(exr.unwrap(), Path::new("b.EXR"));
        assert_eq!(png, Path::new("b.png"));
        assert_eq!(outputs(Path::new("b.png")).unwrap().0, None);
        assert!(outputs(Path::new("b")).is_err() && outputs(Path::new("b.jpg")).is_err());
    }
}
