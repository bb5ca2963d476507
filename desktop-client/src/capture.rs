//! Pictures of the run for people and for the evaluation.
//!
//! They are taken after a display frame is done and encoded on a thread of
//! their own, so that the display's timing hardly notices.

use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::thread::JoinHandle;

use anyhow::{Context, Result, anyhow};
use shadecast_client::ClientFrame;
use shadecast_client::render::{EyeCamera, Pixels};
use shadecast_protocol::ClientTime;

use crate::drawing::{Drawing, Panel};
use crate::headset::{Headset, Turn};
use crate::report::Sample;

/// First moment: by then the first patches have some light.
const FIRST_MOMENT: f64 = 1.5;
/// First sample: by then the scene has filled in.
const FIRST_SAMPLE: f64 = 5.0;
/// The last one is this long before the end, to be surely within the run.
const MARGIN: f64 = 0.25;

/// Takes pictures as the run goes.
#[derive(Debug)]
pub(crate) struct Capture {
    moments: Schedule,
    sampling: Schedule,
    samples: Vec<Sample>,
    writer: PictureWriter,
}

impl Capture {
    /// Takes so many in a run of `seconds` into `folder`.
    pub(crate) fn new(folder: &Path, seconds: f64, moments: u32, samples: u32) -> Result<Self> {
        Ok(Self {
            moments: Schedule::new(FIRST_MOMENT, seconds, moments),
            sampling: Schedule::new(FIRST_SAMPLE, seconds, samples),
            samples: Vec::new(),
            writer: PictureWriter::start(folder)?,
        })
    }

    /// Takes what is due `seconds` after the first picture; `turn` was drawn
    /// last.
    pub(crate) fn take(
        &mut self,
        headset: &Headset,
        panel: Option<&Panel>,
        turn: &Turn,
        seconds: f64,
    ) -> Result<()> {
        let Some(frame) = &turn.frame else {
            return Ok(());
        };
        if let Some(index) = self.moments.due(seconds) {
            let shown = displayed(&headset.drawing, panel)?;
            self.writer.write(format!("eyes_{index:02}.png"), shown);
            if let Some(atlas) = headset.drawing.atlas()? {
                self.writer.write(format!("atlas_{index:02}.png"), atlas);
            }
        }
        if let Some(index) = self.sampling.due(seconds) {
            self.sample(headset, turn, frame, seconds, index)?;
        }
        Ok(())
    }

    fn sample(
        &mut self,
        headset: &Headset,
        turn: &Turn,
        frame: &ClientFrame,
        seconds: f64,
        index: u32,
    ) -> Result<()> {
        let eye = index as usize % 2;
        let picture = format!("samples/{index:02}.png");
        let unwarped = format!("samples/{index:02}_unwarped.png");
        let pixels = headset.drawing.eye(eye)?;
        let (width, height) = (pixels.width, pixels.height);
        self.writer.write(picture.clone(), pixels);
        let servers_view = headset.cameras(frame.world_from_head);
        let pixels = headset.drawing.eye_from(servers_view, 0.0, eye)?;
        self.writer.write(unwarped.clone(), pixels);

        let EyeCamera {
            world_from_eye,
            fov,
        } = turn.cameras[eye];
        self.samples.push(Sample {
            picture,
            unwarped,
            eye: ["left", "right"][eye],
            position: world_from_eye.position.to_array(),
            orientation: world_from_eye.orientation.to_array(),
            fov: [fov.left, fov.right, fov.up, fov.down],
            width,
            height,
            seconds,
            pose_age_ms: seconds_between(frame.server_timing.view_sampled, turn.display_at) * 1e3,
            scene_time_s: frame.scene_seconds(turn.display_at),
            frame: frame.frame.0,
        });
        Ok(())
    }

    /// Waits until all pictures are written.
    pub(crate) fn finish(self) -> Result<Vec<Sample>> {
        self.writer.finish()?;
        Ok(self.samples)
    }
}

/// Both eyes side by side, after the lens if there is one.
fn displayed(drawing: &Drawing, panel: Option<&Panel>) -> Result<Pixels> {
    match panel {
        Some(panel) => drawing.read(panel.texture(), 0),
        None => Ok(side_by_side(&drawing.eye(0)?, &drawing.eye(1)?)),
    }
}

/// Two pictures of the same size as one.
fn side_by_side(left: &Pixels, right: &Pixels) -> Pixels {
    let row = left.width as usize * 4;
    let rows = left
        .rgba
        .chunks_exact(row)
        .zip(right.rgba.chunks_exact(row));
    Pixels {
        width: left.width * 2,
        height: left.height,
        rgba: rows
            .flat_map(|(left, right)| [left, right].concat())
            .collect(),
    }
}

/// Negative when `end` is before `start`.
fn seconds_between(start: ClientTime, end: ClientTime) -> f64 {
    (i128::from(end.0) - i128::from(start.0)) as f64 * 1e-9
}

/// Evenly spread times, each of which comes up once.
#[derive(Clone, Copy, Debug)]
struct Schedule {
    first: f64,
    step: f64,
    next: u32,
    count: u32,
}

impl Schedule {
    /// From `first` to the end of a run; of a run that is shorter than twice
    /// that, over its second half.
    fn new(first: f64, seconds: f64, count: u32) -> Self {
        let first = first.min(seconds / 2.0);
        let last = (seconds - MARGIN).max(first);
        Self {
            first,
            step: (last - first) / f64::from(count.saturating_sub(1).max(1)),
            next: 0,
            count,
        }
    }

    /// The number of the time that has come, if one has.
    fn due(&mut self, seconds: f64) -> Option<u32> {
        let time = self.first + self.step * f64::from(self.next);
        if self.next >= self.count || seconds < time {
            return None;
        }
        self.next += 1;
        Some(self.next - 1)
    }
}

/// Encodes and writes pictures on a thread of its own.
#[derive(Debug)]
struct PictureWriter {
    pictures: mpsc::Sender<(PathBuf, Pixels)>,
    folder: PathBuf,
    thread: JoinHandle<Result<()>>,
}

impl PictureWriter {
    fn start(folder: &Path) -> Result<Self> {
        let samples = folder.join("samples");
        std::fs::create_dir_all(&samples)
            .with_context(|| format!("cannot create the folder {}", samples.display()))?;
        let (pictures, receiver) = mpsc::channel::<(PathBuf, Pixels)>();
        let thread = std::thread::Builder::new()
            .name("pictures".into())
            .spawn(move || {
                receiver
                    .into_iter()
                    .try_for_each(|(path, pixels)| write_png(&path, &pixels))
            })
            .context("cannot start the thread that writes pictures")?;
        Ok(Self {
            pictures,
            folder: folder.to_owned(),
            thread,
        })
    }

    fn write(&self, name: String, pixels: Pixels) {
        // Fails only after the thread has failed, which `finish` reports.
        let _ = self.pictures.send((self.folder.join(name), pixels));
    }

    fn finish(self) -> Result<()> {
        drop(self.pictures);
        self.thread
            .join()
            .map_err(|_| anyhow!("the thread that writes pictures panicked"))?
    }
}

fn write_png(path: &Path, pixels: &Pixels) -> Result<()> {
    let rgb: Vec<u8> = pixels
        .rgba
        .chunks_exact(4)
        .flat_map(|pixel| [pixel[0], pixel[1], pixel[2]])
        .collect();
    image::save_buffer(
        path,
        &rgb,
        pixels.width,
        pixels.height,
        image::ExtendedColorType::Rgb8,
    )
    .with_context(|| format!("cannot write {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times at which a schedule came up, asked every 10 ms.
    fn times(first: f64, seconds: f64, count: u32) -> Vec<f64> {
        let mut schedule = Schedule::new(first, seconds, count);
        (0..(seconds * 100.0) as u32)
            .map(|tick| f64::from(tick) * 0.01)
            .filter(|time| schedule.due(*time).is_some())
            .collect()
    }

    #[test]
    fn pictures_are_spread_over_the_run() {
        let moments = times(1.5, 20.0, 6);
        assert_eq!(moments.len(), 6);
        assert!((moments[0] - 1.5).abs() < 0.011);
        assert!((moments[5] - 19.75).abs() < 0.011);
        assert_eq!(times(5.0, 2.0, 24).len(), 24);
        assert_eq!(times(1.5, 20.0, 1).len(), 1);
        assert!(times(1.5, 20.0, 0).is_empty());
    }

    #[test]
    fn the_left_eye_is_on_the_left() {
        let eye = |shade: u8| Pixels {
            width: 1,
            height: 2,
            rgba: vec![shade; 8],
        };
        let both = side_by_side(&eye(1), &eye(2));
        assert_eq!((both.width, both.height), (2, 2));
        assert_eq!(both.rgba, [[1; 4], [2; 4], [1; 4], [2; 4]].concat());
    }
}
