//! A thousand display frames while a real server makes the world, in virtual
//! time.

use std::sync::Arc;
use std::time::Duration;

use shadecast_client::worn::{Display, IDLE, Turn};
use shadecast_client::{ClientFrame, Input};
use shadecast_protocol::{ClientTime, Pose};
use shadecast_server::scene::courtyard;
use shadecast_simulated_runtime::{Log, Script};
use shadecast_tests::Loopback;

use crate::rig::{MockHeadset, Rig, cameras, psnr};

const FRAMES: u64 = 1_000;
/// Frames whose pictures are compared.
const COMPARED: [u64; 3] = [150, 540, 990];

/// Pixels of an eye's picture, each way: software drivers take long for more.
const SIDE: u32 = 128;

/// What was shown in a frame.
struct Shown {
    frame: Arc<ClientFrame>,
    display_at: ClientTime,
    world_from_play: Pose,
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_thousand_frames_show_the_servers_world_where_the_eyes_are() {
    let mut script = Script {
        keep: COMPARED.to_vec(),
        ..Script::default()
    };
    script.headset.eyes.size = [SIDE; 2];
    let mut rig = Rig::open(script).expect("the headset opens");
    let mut loopback = Loopback::new(courtyard(5_000), 3).expect("a GPU");
    loopback.set_frame_period(Duration::from_millis(90));
    let start = rig.runtime.now();
    let elapsed = move |runtime: i64| Duration::from_nanos((runtime - start) as u64);
    let mut welcome = None;
    let mut newest = None;
    let mut shown = Vec::new();
    let (mut drawn, mut fresh) = (0, 0);
    while rig.runtime.waited() < FRAMES {
        for frame in loopback.take_presented() {
            newest = Some(Arc::clone(&frame));
            rig.sender.send(frame);
        }
        if let Some(first) = loopback.take_welcome() {
            rig.headset.welcome(&first);
            welcome = Some(first);
        }
        let runtime = rig.runtime.clone();
        let mut told = Vec::new();
        let turn = rig
            .headset
            .turn(
                &|| Loopback::client_clock(elapsed(runtime.now())),
                &mut |input| told.push(input),
            )
            .expect("the headset goes on");
        if let Turn::Frame(frame) = turn {
            drawn += u32::from(frame.drawn);
            fresh += u32::from(frame.fresh);
            let number = rig.runtime.waited() - 1;
            if COMPARED.contains(&number) {
                shown.push(Shown {
                    frame: newest.clone().expect("the world has come"),
                    display_at: frame.display_at,
                    world_from_play: rig.headset.world_from_play(),
                });
            }
        } else {
            rig.runtime.pass(IDLE);
        }
        loopback
            .run_until(elapsed(rig.runtime.now()))
            .expect("both ends understand each other");
        for input in told {
            // The loopback's client tells by itself what it has presented.
            if !matches!(input, Input::Drawn(_)) {
                loopback.tell(input).expect("the client goes on");
            }
        }
    }
    let log = rig.runtime.log();
    assert_eq!(log.broken_rules(), []);
    assert_eq!(log.frames.len() as u64, FRAMES);
    assert!(u64::from(drawn) >= FRAMES - 3, "{drawn} were drawn");
    assert!(fresh > 80, "{fresh} worlds were shown");
    every_layer_carries_the_pose_located_for_its_frame(&log);
    depth_is_submitted_reversed(&log);
    the_server_knows_where_the_head_will_be(&loopback, &log);

    let welcome = welcome.expect("the server welcomed the client");
    // As the runtime shows it; and as the mock headset writes it to files, where
    // the means of antialiasing are taken by another curve.
    for (format, least) in [
        (wgpu::TextureFormat::Rgba8UnormSrgb, 45.0),
        (wgpu::TextureFormat::Rgba8Unorm, 36.0),
    ] {
        let mut mock = MockHeadset::new(SIDE, format, &welcome);
        for (shown, (number, images)) in shown.iter().zip(&log.images) {
            let submitted = &log.frames[*number as usize];
            let cameras = cameras(shown.world_from_play, &submitted.layers[0].views);
            let motion = shown.frame.seconds_of_motion(shown.display_at);
            let expected = mock.draw(&shown.frame, cameras, motion);
            for (eye, (image, expected)) in images.iter().zip(&expected).enumerate() {
                let psnr = psnr(image, expected);
                println!("frame {number}, eye {eye}, {format:?}: {psnr:.1} dB");
                assert!(psnr > least, "frame {number}, eye {eye}: {psnr:.1} dB");
                let lit = image.bytes.iter().filter(|byte| **byte > 60).count();
                assert!(lit > image.bytes.len() / 2, "there is something to see");
            }
        }
    }
}

fn every_layer_carries_the_pose_located_for_its_frame(log: &Log) {
    let mut located = log.located.iter();
    for submitted in &log.frames {
        let Some(layer) = submitted.layers.first() else {
            assert!(!submitted.should_render, "frame {}", submitted.frame);
            continue;
        };
        let (time, eyes) = located.next().expect("eyes are located for each frame");
        assert_eq!(*time, submitted.display_time);
        for (index, (view, eye)) in layer.views.iter().zip(eyes).enumerate() {
            assert_eq!(view.pose, *eye, "frame {}", submitted.frame);
            assert_eq!(view.array_index, index as u32);
            assert_eq!(view.size, [SIDE as i32; 2]);
        }
    }
    assert!(located.next().is_none(), "eyes are located once a frame");
}

fn depth_is_submitted_reversed(log: &Log) {
    let layers = log.frames.iter().flat_map(|frame| &frame.layers);
    for depth in layers.flat_map(|layer| layer.views).map(|view| view.depth) {
        let depth = depth.expect("the runtime offers it");
        assert!(depth.near_z.is_infinite());
        assert!((0.001..0.1).contains(&depth.far_z));
        assert_eq!(
            (depth.range, depth.size),
            ([0.0, 1.0], [2 * SIDE as i32; 2])
        );
    }
    for (_, depths) in &log.depths {
        for depth in depths {
            let depths = depth.bytes.chunks_exact(4);
            let metres = depths
                .map(|bytes| 0.02 / f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
            let seen = metres.filter(|metres| (0.3..60.0).contains(metres)).count();
            assert!(
                seen as u32 > SIDE * SIDE * 2,
                "{seen} pixels are at possible distances"
            );
        }
    }
}

fn the_server_knows_where_the_head_will_be(loopback: &Loopback, log: &Log) {
    let report = loopback.reported().expect("views were reported");
    assert!(report.display_at > report.sampled_at);
    let (linear, angular) = (report.linear_velocity, report.angular_velocity);
    assert!((0.001..1.0).contains(&linear.length()), "{linear}");
    assert!((0.01..1.0).contains(&angular.y.abs()), "{angular}");
    assert_eq!(report.eye_resolution, [SIDE as u16; 2]);
    assert!(log.frames.len() > 100);
    let latency = loopback.latency().expect("frames were acknowledged");
    assert!(latency > Duration::from_millis(20), "{latency:?}");
}
