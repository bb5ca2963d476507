//! The steady frame loop of a headset allocates no memory of its own.
//!
//! The simulated runtime keeps a log, and is not counted. wgpu allocates in every
//! frame whoever uses it: recording and submitting, which a turn does between its
//! second and its third look at the clock, is held against the bare drawing of the
//! same pictures. In all the rest of a turn there is not one allocation.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;

use glam::Vec3;
use shadecast_client::network::Network;
use shadecast_client::openxr::{Headset, HeadsetConfig, api};
use shadecast_client::render::vulkan::{DirectHost, Extras, VulkanGpu};
use shadecast_client::render::{EyeCamera, EyeImages, Renderer, RendererConfig, frame_channel};
use shadecast_client::worn::{Display, Turn};
use shadecast_client::{
    ClientFrame, ClientTiming, Clock, DecodedPicture, DrawVertex, HeadView, Input, OpenH264Decoder,
    YuvPicture,
};
use shadecast_protocol::{
    ClientTime, Codec, Epoch, EyeView, Fov, FrameId, Method, Motion, Pose, Sky, UpdateTiming,
    Welcome,
};
use shadecast_simulated_runtime::{Controller, Runtime, Script, on_crossing};

struct Counting;

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
    static WHILE_DRAWING: Cell<u64> = const { Cell::new(0) };
    /// Looks at the clock in this turn.
    static LOOKS: Cell<u32> = const { Cell::new(0) };
    static INSIDE_THE_RUNTIME: Cell<bool> = const { Cell::new(false) };
}

fn count() {
    if INSIDE_THE_RUNTIME.get() {
        return;
    }
    let counter = if LOOKS.get() == 2 {
        &WHILE_DRAWING
    } else {
        &COUNT
    };
    counter.set(counter.get() + 1);
}

// SAFETY: the system's allocator does the work.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: as the caller says.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: as the caller says.
        unsafe { System.dealloc(memory, layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: as the caller says.
        unsafe { System.realloc(memory, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const SIDE: u32 = 32;
/// Until wgpu's pools have grown.
const WARM_UP: usize = 60;
const MEASURED: usize = 200;

/// Allocations of `turn` while it draws and otherwise, in ascending order.
fn allocations(mut turn: impl FnMut()) -> [Vec<u64>; 2] {
    for _ in 0..WARM_UP {
        turn();
    }
    let mut counts = [(); 2].map(|()| Vec::with_capacity(MEASURED));
    for _ in 0..MEASURED {
        let before = [WHILE_DRAWING.get(), COUNT.get()];
        LOOKS.set(0);
        turn();
        LOOKS.set(0);
        let after = [WHILE_DRAWING.get(), COUNT.get()];
        for index in 0..2 {
            counts[index].push(after[index] - before[index]);
        }
    }
    counts.each_mut().map(|counts| {
        counts.sort_unstable();
        std::mem::take(counts)
    })
}

fn sky() -> Sky {
    Sky {
        width: 2,
        height: 1,
        rgb: vec![99; 6],
    }
}

fn frame() -> ClientFrame {
    let corners = [(-1.0, 0.0), (1.0, 0.0), (0.0, 2.0)];
    let vertices = corners.map(|(x, y)| DrawVertex {
        position: [x, y, -2.0],
        object: 0,
        texel: [8.0, 8.0, 1.0],
    });
    ClientFrame {
        frame: FrameId(1),
        epoch: Epoch(0),
        world_from_head: Pose::IDENTITY,
        scene_time: 0,
        server_timing: UpdateTiming::default(),
        timing: ClientTiming::default(),
        vertices: Arc::new(vertices.to_vec()),
        indices: Arc::new(vec![0, 1, 2]),
        opaque_indices: 3,
        foreshortened: false,
        objects_lead: 0,
        motions: Arc::new(vec![Motion::still(Pose::IDENTITY)]),
        picture: DecodedPicture::from(YuvPicture {
            width: 16,
            height: 16,
            y: vec![63; 256],
            u: vec![102; 64],
            v: vec![240; 64],
        }),
        masks: None,
        patches: 1,
    }
}

/// Of a turn in which nothing new came from the server.
fn of_a_turn() -> [Vec<u64>; 2] {
    let mut script = Script {
        controllers: [None, Some(Controller::AT_REST)],
        ..Script::default()
    };
    script.headset.eyes.size = [SIDE; 2];
    let runtime = Runtime::new(script);
    // SAFETY: the simulation answers as OpenXR says.
    let entry = unsafe { api::Entry::from_get_instance_proc_addr(runtime.entry(), &()) };
    let (mut sender, frames) = frame_channel();
    let config = HeadsetConfig::default();
    let mut headset = Headset::open(entry.expect("its functions"), (), config, frames)
        .expect("the headset opens");
    headset.welcome(&Welcome {
        codec: Codec::H264,
        method: Method::Sas,
        atlas_size: [64; 2],
        superblock: 16,
        world_from_play: Pose::IDENTITY,
        sky: sky(),
    });
    sender.send(Arc::new(frame()));
    let mut told = 0_u64;
    let allocations = allocations(|| {
        // Time stands still for the client, so that no notice comes.
        let now = || {
            LOOKS.set(LOOKS.get() + 1);
            ClientTime(1)
        };
        let turn = headset.turn(&now, &mut |_| told += 1);
        assert!(matches!(turn, Ok(Turn::Frame(_))));
    });
    assert!(told > MEASURED as u64, "views and hands were reported");
    assert_eq!(runtime.log().broken_rules(), []);
    allocations
}

/// Of drawing alone.
fn of_drawing() -> [Vec<u64>; 2] {
    let vulkan = VulkanGpu::open(&mut DirectHost, &Extras::default()).expect("a device");
    let gpu = &vulkan.gpu;
    let config = RendererConfig {
        eye_size: [SIDE; 2],
        eye_format: wgpu::TextureFormat::Rgba8UnormSrgb,
        stereo: gpu.stereo,
        antialias: true,
    };
    let mut renderer = Renderer::new(&gpu.device, &gpu.queue, config);
    renderer.set_sky(Some(&sky()));
    renderer.upload(&frame()).expect("a sound frame");
    let target = EyeImages::new(&gpu.device, config.eye_size, config.eye_format);
    let [width, height] = config.drawn_size();
    let depth = EyeImages::from_texture(gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d {
            width,
            height,
            depth_or_array_layers: 2,
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Depth32Float,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    }));
    let cameras = [-0.03, 0.03].map(|x| EyeCamera {
        world_from_eye: Pose {
            position: Vec3::new(x, 1.6, 0.0),
            ..Pose::IDENTITY
        },
        fov: Fov::symmetric(1.5),
    });
    allocations(|| {
        LOOKS.set(2);
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        renderer.draw_with_depth(&mut encoder, cameras, 0.0, &target, Some(&depth));
        gpu.queue.submit([encoder.finish()]);
        LOOKS.set(3);
    })
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_turn_allocates_nothing_and_drawing_no_more_than_wgpu_does() {
    on_crossing(|inwards| INSIDE_THE_RUNTIME.set(inwards));
    let ([in_a_turn, others], [alone, _]) = (of_a_turn(), of_drawing());
    let most = others[MEASURED - 1];
    assert_eq!(most, 0, "allocations in a turn besides drawing");
    let [in_a_turn, alone] = [in_a_turn, alone].map(|counts| counts[MEASURED / 2]);
    println!("{in_a_turn} allocations while a turn draws, {alone} in drawing alone");
    assert!(alone > 0, "wgpu's are counted");
    assert!(
        in_a_turn <= alone,
        "{in_a_turn} while a turn draws, {alone} in drawing alone"
    );
}

/// The way of a report to the network's thread is a list of blocks with room for many
/// reports each, which that thread gives back: only one that lags needs another.
#[test]
fn a_report_to_the_network_allocates_nothing_while_its_thread_keeps_up() {
    let (sender, _frames) = frame_channel();
    let (fingerprint, secret) = ("ab".repeat(32), "cd".repeat(16));
    // Nobody is there: the reports are taken, and go no further.
    let line = format!("shadecast://127.0.0.1:9/?fingerprint={fingerprint}&secret={secret}");
    let network = Network::start(
        line.parse().expect("a server's line"),
        4096,
        Clock::start(),
        OpenH264Decoder::new(),
        sender,
    )
    .expect("threads");
    let eye = EyeView {
        head_from_eye: Pose::IDENTITY,
        fov: Fov::symmetric(1.5),
    };
    let view = HeadView {
        sampled_at: ClientTime(1),
        display_at: ClientTime(2),
        world_from_head: Pose::IDENTITY,
        linear_velocity: Vec3::ZERO,
        angular_velocity: Vec3::ZERO,
        eyes: [eye; 2],
        eye_resolution: [256; 2],
        hands: [None; 2],
    };
    let tell = |reports: u32| {
        let before = COUNT.get();
        for _ in 0..reports {
            network.tell(Input::View(view));
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
        COUNT.get() - before
    };
    tell(100);
    let allocations = tell(640);
    println!("{allocations} allocations in 640 reports");
    assert!(allocations <= 4, "{allocations} in 640 reports");
}
