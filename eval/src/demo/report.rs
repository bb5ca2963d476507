//! `report.md`: the run for a person.

use std::{fmt::Write as _, path::Path};

use anyhow::Result;

use super::{
    errors::SampleError,
    pictures,
    summary::Summary,
    targets::{Target, verdict},
};

pub(super) fn markdown(
    out: &Path,
    summary: &Summary,
    targets: &[Target],
    errors: &[SampleError],
) -> Result<String> {
    let mut text = String::new();
    head(&mut text, summary)?;
    target_table(&mut text, targets)?;
    rates(&mut text, summary)?;
    latency(&mut text, summary)?;
    stages(&mut text, summary)?;
    comparison(&mut text, out, summary)?;
    sample_table(&mut text, errors)?;
    moments(&mut text, out)?;
    Ok(text)
}

fn head(text: &mut String, summary: &Summary) -> Result<()> {
    let (settings, machine) = (&summary.settings, &summary.machine);
    writeln!(text, "# A run of shadecast\n")?;
    writeln!(
        text,
        "A server and a client, two processes on one machine, streamed `{}` for {:.1} s over \
         QUIC on the loopback interface.\n",
        summary.scene, summary.seconds
    )?;
    writeln!(text, "| | |\n|---|---|")?;
    writeln!(
        text,
        "| processor | {}, {} cores |",
        machine.processor, machine.cores
    )?;
    writeln!(
        text,
        "| driver of the server | {} |",
        machine.server_adapter
    )?;
    writeln!(
        text,
        "| driver of the client | {} |",
        machine.client_adapter
    )?;
    writeln!(text, "| stereo | {} |", machine.stereo)?;
    writeln!(
        text,
        "| atlas | {0} x {0} texels by {1}, {2} Mbit/s for its video |",
        settings.atlas, settings.method, settings.bitrate
    )?;
    writeln!(
        text,
        "| display | two eyes of {0} x {0} pixels at {1} Hz |",
        settings.eye_size, settings.display_rate
    )?;
    writeln!(text, "| seed | {} |", settings.seed)?;
    let patches = summary.patches;
    writeln!(
        text,
        "| patches of the scene | {:.1} % of one triangle, {:.1} % of two, {:.1} % of three |",
        patches.solo * 100.0,
        patches.pair * 100.0,
        patches.triple * 100.0
    )?;
    for reason in &summary.left_out {
        writeln!(text, "| left out | {reason} |")?;
    }
    Ok(())
}

fn target_table(text: &mut String, targets: &[Target]) -> Result<()> {
    writeln!(text, "\n## Targets\n")?;
    writeln!(
        text,
        "The targets are for two cores without a GPU, the built-in scene at its default size, an \
         atlas of 512² and eyes of 256²; elsewhere they are a yardstick only.\n"
    )?;
    writeln!(text, "| | target | measured | |\n|---|---|---|---|")?;
    for target in targets {
        writeln!(
            text,
            "| {} | {} | {} | {} |",
            target.what,
            target.wanted,
            target.measured,
            verdict(target)
        )?;
    }
    Ok(())
}

fn rates(text: &mut String, summary: &Summary) -> Result<()> {
    let megabits = |bytes: u64| bytes as f64 * 8e-6 / summary.seconds;
    let frame = summary.client_frame_ms;
    writeln!(text, "\n## Rates\n\n| | | |\n|---|---|---|")?;
    for (what, figure, meaning) in [
        (
            "server updates",
            format!("{:.2} /s", summary.server_updates_per_second),
            "pictures with their geometry that the server sent in a second",
        ),
        (
            "client frames",
            format!("{:.2} /s", summary.client_frames_per_second),
            "stereo pictures that the client drew in a second, each at its own newest pose",
        ),
        (
            "client frame time",
            format!("{:.1} / {:.1} / {:.1} ms", frame.p50, frame.p95, frame.p99),
            "upload, drawing and waiting for the GPU: 50th, 95th and 99th percentile",
        ),
        (
            "missed ticks",
            summary.missed_ticks.to_string(),
            "ticks of the display at which no new picture was ready",
        ),
        (
            "video",
            format!(
                "{} bytes, {:.2} Mbit/s",
                summary.video_bytes,
                megabits(summary.video_bytes)
            ),
            "H.264 that the client received",
        ),
        (
            "updates",
            format!(
                "{} bytes, {:.2} Mbit/s",
                summary.update_bytes,
                megabits(summary.update_bytes)
            ),
            "geometry and placement that the client received, compressed",
        ),
        (
            "atlas in use",
            format!("{:.1} %", summary.atlas_used_fraction * 100.0),
            "share of the atlas that belongs to a patch",
        ),
        (
            "atlas resets",
            summary.atlas_resets.to_string(),
            "times that all placement was dropped and begun anew on an IDR picture",
        ),
        (
            "visible patches",
            summary.visible_patches.to_string(),
            "patches in the potentially visible set",
        ),
        (
            "texels per update",
            summary.texels_per_update.to_string(),
            "texels that got a path in one update",
        ),
    ] {
        writeln!(text, "| {what} | {figure} | {meaning} |")?;
    }
    Ok(())
}

fn latency(text: &mut String, summary: &Summary) -> Result<()> {
    let Some(phases) = &summary.latency_ms else {
        return Ok(());
    };
    writeln!(
        text,
        "\n## Latency\n\nMedians of the phases of figure 2 of the shading atlas paper (SAS 2018).\n"
    )?;
    writeln!(text, "| phase | ms | from ... to |\n|---|---|---|")?;
    for (phase, milliseconds, meaning) in [
        (
            "1 pose to server",
            phases.pose_to_server,
            "the client samples a pose ... the server has it",
        ),
        (
            "2 wait at server",
            phases.wait_at_server,
            "... the server begins the frame that answers it",
        ),
        (
            "3 server processing",
            phases.server_processing,
            "... picture and update go to the network",
        ),
        ("4 transfer", phases.transfer, "... the client has both"),
        ("5 decode", phases.decode, "... the picture is decoded"),
        (
            "6 wait at client",
            phases.wait_at_client,
            "... the next frame of the client begins",
        ),
        ("7 draw", phases.draw, "... that frame is drawn"),
        (
            "8 shown",
            phases.shown,
            "... the next update takes its place",
        ),
        (
            "total, 1 to 7",
            phases.total,
            "a pose is sampled ... light computed for it is drawn",
        ),
    ] {
        writeln!(text, "| {phase} | {milliseconds:.1} | {meaning} |")?;
    }
    Ok(())
}

fn stages(text: &mut String, summary: &Summary) -> Result<()> {
    writeln!(
        text,
        "\n## Stages of the server\n\n| stage | median ms |\n|---|---|"
    )?;
    for (stage, milliseconds) in &summary.server_stages_ms {
        writeln!(text, "| {stage} | {milliseconds:.2} |")?;
    }
    Ok(())
}

fn comparison(text: &mut String, out: &Path, summary: &Summary) -> Result<()> {
    let error = &summary.error;
    writeln!(text, "\n## Error\n")?;
    if error.window < summary.settings.eye_size {
        writeln!(
            text,
            "One square window of {0} x {0} pixels in each of {1} pictures of one eye, before the \
             lens. The windows stand on a grid, each sample at another place, so that together \
             they cover the picture evenly. It is windows because a reference is worth something \
             only with many samples a pixel, and whole pictures of that many would take minutes \
             on a software driver; `--whole` renders them.\n",
            error.window, error.frames
        )?;
    } else {
        writeln!(
            text,
            "{} whole pictures of one eye, before the lens.\n",
            error.frames
        )?;
    }
    writeln!(
        text,
        "The references were path-traced with {} samples a pixel and as many bounces as the \
         server's light, at the very poses at which the client drew. Noise of their own, measured \
         as the difference of two halves of the samples, puts them at {:.1} dB: no picture can be \
         measured to be much better than that.\n",
        error.reference_samples, error.psnr_reference_ceiling_db
    )?;
    writeln!(text, "| | | |\n|---|---|---|")?;
    for (what, figure, meaning) in [
        (
            "PSNR",
            format!("{:.2} dB", error.psnr_db),
            "of 8-bit sRGB, mean over the windows; higher is better",
        ),
        (
            "PSNR of the mean square",
            format!("{:.2} dB", error.psnr_of_mean_square_db),
            "the same from the mean squared error over all windows, which the worst ones decide",
        ),
        (
            "PSNR without noise",
            format!("{:.2} dB", error.psnr_without_reference_noise_db),
            "the same, the squared error that is the references' own noise taken off",
        ),
        (
            "SSIM",
            format!("{:.4}", error.ssim),
            "of luma, mean; window of 11 pixels, sigma 2, C1 = 0.0001, C2 = 0.0009; 1 is equal",
        ),
        (
            "FLIP",
            format!("{:.4}", error.flip),
            "mean, at 67 pixels a degree; 0 is equal",
        ),
        (
            "FLIP unwarped",
            format!("{:.4}", error.flip_unwarped),
            "the same windows, had the last server view been shown as it is",
        ),
        (
            "pose age",
            format!("{:.0} ms", error.pose_age_ms),
            "from the sampling of the server's pose to the drawing of the client's picture",
        ),
    ] {
        writeln!(text, "| {what} | {figure} | {meaning} |")?;
    }
    writeln!(
        text,
        "\nClient, reference, and FLIP from black (equal) to pale yellow, enlarged where they are \
         small, for samples from the first to the last:\n"
    )?;
    embed(text, out, "compare_")
}

fn sample_table(text: &mut String, errors: &[SampleError]) -> Result<()> {
    writeln!(
        text,
        "\n| picture | eye | s | pose age ms | window | PSNR dB | SSIM | FLIP | FLIP unwarped |"
    )?;
    writeln!(text, "|---|---|---|---|---|---|---|---|---|")?;
    for error in errors {
        writeln!(
            text,
            "| [{0}]({0}) | {1} | {2:.2} | {3:.0} | {4}, {5} | {6:.2} | {7:.4} | {8:.4} | {9:.4} |",
            error.picture,
            error.eye,
            error.seconds,
            error.pose_age_ms,
            error.window.x,
            error.window.y,
            error.psnr_db(),
            error.ssim,
            error.flip,
            error.flip_unwarped
        )?;
    }
    Ok(())
}

fn moments(text: &mut String, out: &Path) -> Result<()> {
    writeln!(
        text,
        "\n## What the client showed\n\nLeft and right eye, after the lens:\n"
    )?;
    embed(text, out, "eyes_")?;
    writeln!(text, "\nThe decoded atlas at the same moments:\n")?;
    embed(text, out, "atlas_")
}

/// The numbered pictures whose names begin with `prefix`.
fn embed(text: &mut String, out: &Path, prefix: &str) -> Result<()> {
    for path in pictures(out, prefix)? {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        writeln!(text, "![{name}]({name})\n")?;
    }
    Ok(())
}
