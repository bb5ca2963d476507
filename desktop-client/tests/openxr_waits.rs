//! The frame loop of a headset waits for no lock that the network's or the
//! decoder's thread holds.
//!
//! Both threads are stopped in the middle of whatever they do, right after a view
//! was reported, when they are at work; the headset has to draw on. A lock that
//! they hold at that moment would stop it too. So that no allocator's lock is one of
//! them, memory comes from one that has none.
#![cfg(target_os = "linux")]

#[allow(dead_code, reason = "other tests need the rest of it")]
mod wall_server;

use std::alloc::{GlobalAlloc, Layout};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicU32, AtomicUsize, Ordering::SeqCst};
use std::time::{Duration, Instant};

use shadecast_client::network::{Event, Network};
use shadecast_client::openxr::{Headset, HeadsetConfig, api};
use shadecast_client::worn::{Display, IDLE, Turn};
use shadecast_client::{
    AccessUnit, Clock, Decoded, Decoder, Input, OpenH264Decoder, render::frame_channel,
};
use shadecast_simulated_runtime::{Runtime, Script};
use wall_server::{Mishap, WallServer};

/// Takes memory from one large reservation and never gives any back.
struct Endless {
    start: AtomicPtr<u8>,
    used: AtomicUsize,
}

/// Of addresses; pages are taken when they are first written.
const RESERVED: usize = 16 << 30;

// SAFETY: every piece is given out once, at its alignment.
unsafe impl GlobalAlloc for Endless {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let mut start = self.start.load(SeqCst);
        if start.is_null() {
            // SAFETY: a new mapping of nothing.
            let mapped = unsafe {
                libc::mmap(
                    std::ptr::null_mut(),
                    RESERVED,
                    libc::PROT_READ | libc::PROT_WRITE,
                    libc::MAP_PRIVATE | libc::MAP_ANONYMOUS | libc::MAP_NORESERVE,
                    -1,
                    0,
                )
            };
            if mapped == libc::MAP_FAILED {
                return std::ptr::null_mut();
            }
            let first = std::ptr::null_mut();
            start = match self
                .start
                .compare_exchange(first, mapped.cast(), SeqCst, SeqCst)
            {
                Ok(_) => mapped.cast(),
                // Another thread was faster; ours is only addresses.
                Err(theirs) => theirs,
            };
        }
        let room = layout.size() + layout.align();
        let at = self.used.fetch_add(room, SeqCst);
        if at + room > RESERVED {
            return std::ptr::null_mut();
        }
        // SAFETY: within the mapping.
        let piece = unsafe { start.add(at) };
        // SAFETY: there is room for the alignment.
        unsafe { piece.add(piece.align_offset(layout.align())) }
    }

    unsafe fn dealloc(&self, _: *mut u8, _: Layout) {}
}

#[global_allocator]
static ALLOCATOR: Endless = Endless {
    start: AtomicPtr::new(std::ptr::null_mut()),
    used: AtomicUsize::new(0),
};

/// While this is true, threads that get the signal stand still.
static STOP: AtomicBool = AtomicBool::new(false);
static STANDING: AtomicU32 = AtomicU32::new(0);

extern "C" fn stand_still(_: libc::c_int) {
    STANDING.fetch_add(1, SeqCst);
    while STOP.load(SeqCst) {
        std::hint::spin_loop();
        // SAFETY: a system call that may be made in a signal's handler.
        unsafe { libc::sched_yield() };
    }
    STANDING.fetch_sub(1, SeqCst);
}

/// The thread of this process with that name, which it gives itself as it begins.
fn thread_named(name: &str) -> i32 {
    let find = || {
        let tasks = std::fs::read_dir("/proc/self/task").expect("Linux tells of threads");
        tasks.into_iter().find_map(|task| {
            let path = task.ok()?.path();
            let called = std::fs::read_to_string(path.join("comm")).ok()?;
            let number = path.file_name()?.to_str()?.parse().ok()?;
            (called.trim() == name).then_some(number)
        })
    };
    for _ in 0..1_000 {
        if let Some(thread) = find() {
            return thread;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    panic!("there is no thread {name}");
}

/// Stops the threads wherever they are.
fn stop(threads: [i32; 2]) {
    STOP.store(true, SeqCst);
    for thread in threads {
        // SAFETY: the signal has a handler.
        unsafe { libc::syscall(libc::SYS_tgkill, libc::getpid(), thread, libc::SIGUSR1) };
    }
    while STANDING.load(SeqCst) < 2 {
        std::hint::spin_loop();
    }
}

fn let_go() {
    STOP.store(false, SeqCst);
    while STANDING.load(SeqCst) > 0 {
        std::thread::yield_now();
    }
}

/// Holds whatever may be held around a decoder for as long as the test wants.
struct Held(OpenH264Decoder, Arc<AtomicBool>);

impl Held {
    fn wait(&self) {
        while self.1.load(SeqCst) {
            std::thread::sleep(Duration::from_micros(100));
        }
    }
}

impl Decoder for Held {
    fn send(&mut self, unit: AccessUnit) {
        self.wait();
        self.0.send(unit);
    }

    fn poll(&mut self) -> Option<Decoded> {
        self.wait();
        self.0.poll()
    }

    fn flush(&mut self) {
        self.0.flush();
    }
}

/// Times that the threads are stopped, and frames that are drawn meanwhile.
const STOPS: u32 = 800;
const FRAMES: u32 = 2;
/// More than any frame takes on any machine.
const HANGS: Duration = Duration::from_secs(10);

#[test]
#[ignore = "needs a Vulkan driver"]
fn the_frame_loop_goes_on_while_network_and_decoder_stand_still() {
    // SAFETY: nothing reads the environment yet; and the handler does what a handler may.
    unsafe {
        // A backtrace takes more memory than there is where none is given back.
        std::env::set_var("RUST_BACKTRACE", "0");
        let mut action: libc::sigaction = std::mem::zeroed();
        action.sa_sigaction = stand_still as extern "C" fn(libc::c_int) as usize;
        action.sa_flags = libc::SA_RESTART;
        assert_eq!(
            libc::sigaction(libc::SIGUSR1, &action, std::ptr::null_mut()),
            0
        );
    }
    let server = WallServer::start(Mishap::HangsUp);
    let mut script = Script::default();
    script.headset.eyes.size = [32; 2];
    let runtime = Runtime::new(script);
    // SAFETY: the simulation answers as OpenXR says.
    let entry = unsafe { api::Entry::from_get_instance_proc_addr(runtime.entry(), &()) };
    let (sender, frames) = frame_channel();
    let mut headset = Headset::open(
        entry.expect("its functions"),
        (),
        HeadsetConfig::default(),
        frames,
    )
    .expect("the headset opens");
    let clock = Clock::start();
    let decoding = Arc::new(AtomicBool::new(false));
    let network = Network::start(
        server.line.parse().expect("a server's line"),
        4096,
        clock,
        Held(OpenH264Decoder::new(), Arc::clone(&decoding)),
        sender,
    )
    .expect("threads");
    let threads = ["network", "decoder"].map(thread_named);

    // If the loop hangs, the threads are let go, and the test fails instead of hanging.
    let since = Arc::new(AtomicUsize::new(usize::MAX));
    let hung = Arc::new(AtomicBool::new(false));
    let (watched, tells) = (Arc::clone(&since), Arc::clone(&hung));
    let began = Instant::now();
    std::thread::spawn(move || {
        loop {
            std::thread::sleep(Duration::from_millis(100));
            let now = began.elapsed().as_millis() as usize;
            if now.saturating_sub(watched.load(SeqCst)) > HANGS.as_millis() as usize {
                tells.store(true, SeqCst);
                STOP.store(false, SeqCst);
            }
        }
    });

    let (mut stops, mut fresh, mut longest) = (0, 0, Duration::ZERO);
    let mut left_standing = 0;
    while stops < STOPS || left_standing > 0 {
        for event in network.events.try_iter() {
            if let Event::Welcomed(welcome) = event {
                headset.welcome(&welcome);
            }
        }
        let mut wants_stop = left_standing == 0;
        let mut stopped = false;
        let turn_began = Instant::now();
        let turn = headset.turn(&|| clock.now(), &mut |input| {
            let is_view = matches!(input, Input::View(_));
            network.tell(input);
            if is_view && std::mem::take(&mut wants_stop) {
                // Later each time, over what it takes them to handle a view.
                let wait = Duration::from_micros(u64::from(stops % 100));
                let told = Instant::now();
                while told.elapsed() < wait {
                    std::hint::spin_loop();
                }
                // Every third time in the middle of decoding.
                decoding.store(stops % 3 == 0, SeqCst);
                since.store(began.elapsed().as_millis() as usize, SeqCst);
                stop(threads);
                stopped = true;
            }
        });
        assert!(
            !hung.load(SeqCst),
            "a frame waited for another thread, after {stops} stops"
        );
        match turn.expect("the headset goes on") {
            Turn::Frame(frame) => fresh += u32::from(frame.fresh),
            _ => {
                runtime.pass(IDLE);
                continue;
            }
        }
        if stopped {
            stops += 1;
            left_standing = FRAMES;
        } else if left_standing > 0 {
            longest = longest.max(turn_began.elapsed());
            left_standing -= 1;
            if left_standing == 0 {
                since.store(usize::MAX, SeqCst);
                decoding.store(false, SeqCst);
                let_go();
                // They catch up.
                std::thread::sleep(Duration::from_millis(5));
            }
        }
    }
    println!("{stops} stops, {fresh} new worlds, longest frame {longest:?}");
    assert!(fresh > 5, "the stream went on between: {fresh}");
    assert!(server.connections() >= 1);
    assert_eq!(runtime.log().broken_rules(), []);
}
