//! The sensors that tell how a phone is turned.

use std::ffi::{CString, c_int};
use std::mem::MaybeUninit;
use std::ptr::{NonNull, null_mut};
use std::thread;

use anyhow::{Context, Result, ensure};
use ndk::looper::{ForeignLooper, ThreadLooper};
use ndk_sys as sys;
use shadecast_client::viewer::HeadTracker;
use shadecast_protocol::ClientTime;

/// Between two readings, microseconds: the least that needs no permission.
const INTERVAL: i32 = 5_000;

/// Of gravity and gyroscope together; how fast it turns.
const TURNED: c_int = sys::ASENSOR_TYPE_GAME_ROTATION_VECTOR as c_int;
const TURNS: c_int = sys::ASENSOR_TYPE_GYROSCOPE as c_int;

/// Readings that wait until they are asked for.
#[derive(Debug)]
pub(crate) struct Sensors {
    manager: NonNull<sys::ASensorManager>,
    queue: NonNull<sys::ASensorEventQueue>,
    // After the queue.
    _looper: ForeignLooper,
}

impl Sensors {
    /// Begins to read, for the app of that name.
    pub(crate) fn open(package: &str) -> Result<Self> {
        let package = CString::new(package)?;
        // A queue wakes a looper. The activity's own takes nothing but what it knows,
        // and nothing need be woken: this one's thread has ended.
        let looper = thread::spawn(|| ThreadLooper::prepare().into_foreign()).join();
        let looper = looper.ok().context("there is no looper")?;
        // SAFETY: the name ends; the looper outlives the queue; no callback is named.
        unsafe {
            let manager = sys::ASensorManager_getInstanceForPackage(package.as_ptr());
            let manager = NonNull::new(manager).context("this device has no sensors")?;
            let queue = sys::ASensorManager_createEventQueue(
                manager.as_ptr(),
                looper.ptr().as_ptr(),
                0,
                None,
                null_mut(),
            );
            let this = Self {
                manager,
                queue: NonNull::new(queue).context("the sensors give no queue")?,
                _looper: looper,
            };
            for (kind, name) in [(TURNED, "a rotation vector"), (TURNS, "a gyroscope")] {
                let sensor = sys::ASensorManager_getDefaultSensor(manager.as_ptr(), kind);
                ensure!(!sensor.is_null(), "this device lacks {name}");
                let on = sys::ASensorEventQueue_enableSensor(queue, sensor);
                ensure!(on >= 0, "{name} does not start ({on})");
                // It is slower where it cannot be set.
                sys::ASensorEventQueue_setEventRate(queue, sensor, INTERVAL);
            }
            Ok(this)
        }
    }

    /// Tells the tracker what has been read. It is `now`.
    pub(crate) fn read(&mut self, tracker: &mut HeadTracker, now: ClientTime) {
        let boot = since_boot();
        let mut event = MaybeUninit::<sys::ASensorEvent>::uninit();
        // SAFETY: there is room for one event.
        while unsafe {
            sys::ASensorEventQueue_getEvents(self.queue.as_ptr(), event.as_mut_ptr(), 1)
        } == 1
        {
            // SAFETY: it was written; both kinds tell floats.
            let (event, [x, y, z, w, ..]) = unsafe {
                let event = event.assume_init_ref();
                (event, event.__bindgen_anon_1.__bindgen_anon_1.data)
            };
            if event.type_ == TURNED {
                let age = boot.saturating_sub(event.timestamp).max(0) as u64;
                let at = ClientTime(now.0.saturating_sub(age));
                tracker.take_rotation(at, [x, y, z, w]);
            } else if event.type_ == TURNS {
                tracker.take_spin([x, y, z]);
            }
        }
    }
}

impl Drop for Sensors {
    fn drop(&mut self) {
        // SAFETY: the queue is the manager's, and is not used again.
        unsafe {
            sys::ASensorManager_destroyEventQueue(self.manager.as_ptr(), self.queue.as_ptr());
        }
    }
}

/// The clock of readings, nanoseconds: it goes on while the device sleeps.
fn since_boot() -> i64 {
    let mut time = libc::timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    // SAFETY: there is room for the time.
    unsafe { libc::clock_gettime(libc::CLOCK_BOOTTIME, &raw mut time) };
    time.tv_sec * 1_000_000_000 + time.tv_nsec
}
