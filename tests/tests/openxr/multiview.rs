//! Both eyes in one pass, as headsets with a GPU of their own draw them.

use shadecast_client::openxr::HeadsetConfig;
use shadecast_client::render::Stereo;
use shadecast_simulated_runtime::{Image, Script};

use crate::rig::{Rig, pixel, red_square, still_head};

/// Colours and depths of both eyes, drawn in a mode.
fn drawn(stereo: Stereo) -> [[Image; 2]; 2] {
    let mut script = Script {
        keep: vec![10],
        head: still_head(),
        ..Script::default()
    };
    script.headset.eyes.size = [96; 2];
    // Far enough apart that the eyes' pictures differ by many pixels.
    script.headset.eyes.offset = 0.2;
    let config = HeadsetConfig {
        stereo: Some(stereo),
        ..HeadsetConfig::default()
    };
    let mut rig = Rig::with(script, config).expect("the headset opens");
    // Wholly within what both eyes see: software drivers get multiview wrong
    // where geometry is clipped.
    rig.sender.send(red_square(0.5));
    rig.run_to(12);
    let log = rig.runtime.log();
    assert_eq!(log.broken_rules(), []);
    let [(_, colors)] = &log.images[..] else {
        panic!("one frame was kept");
    };
    let [(_, depths)] = &log.depths[..] else {
        panic!("its depth was kept");
    };
    [colors.clone(), depths.clone()]
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn one_pass_draws_what_two_passes_draw_in_colour_and_depth() {
    let [one, two] = [Stereo::Multiview, Stereo::TwoPass].map(drawn);
    for (one, two) in one.iter().zip(&two) {
        for (eye, (one, two)) in one.iter().zip(two).enumerate() {
            assert!(one.bytes == two.bytes, "eye {eye}");
        }
    }
    let [colors, depths] = &one;
    assert_ne!(colors[0].bytes, colors[1].bytes, "the eyes are apart");
    let red = |image: &Image| {
        let all = (0..96).flat_map(|y| (0..96).map(move |x| (x, y)));
        all.filter(|(x, y)| pixel(image, *x, *y)[0] > 150).count()
    };
    assert!(
        red(&colors[0]) > 200 && red(&colors[1]) > 200,
        "both see it"
    );
    for depth in depths {
        let near = depth.bytes.chunks_exact(4).filter(|bytes| {
            let depth = f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
            // The head is 0.3 m ahead of the middle of the play space.
            (0.02 / depth - 1.7).abs() < 0.01
        });
        assert!(near.count() > 800, "and it is where it is");
    }
}
