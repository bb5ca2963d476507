//! Events, and times on the system's clock.

use openxr_sys as sys;
use sys::{Result as R, SessionState};

use super::{api, output, place};
use crate::world::{Event, Then, World};

api! {
    fn poll_event(world, instance: sys::Instance, buffer: *mut sys::EventDataBuffer) {
        let it = world.instance.as_ref().filter(|it| it.handle == instance);
        it.ok_or(R::ERROR_HANDLE_INVALID)?;
        // SAFETY: the arguments are those of the function.
        let out = unsafe { output(buffer, sys::EventDataBuffer::TYPE) }?;
        wake(world);
        let session = world.session.as_ref().map_or(0, |session| session.handle);
        let session = sys::Session::from_raw(session);
        let Some(event) = world.events.pop_front() else {
            return Ok(R::EVENT_UNAVAILABLE);
        };
        let out = std::ptr::from_mut(out);
        let now = sys::Time::from_nanos(world.clock.now());
        // SAFETY: every event fits into the buffer, which is made for all of them.
        unsafe {
            match event {
                Event::State(state) => {
                    out.cast::<sys::EventDataSessionStateChanged>().write(sys::EventDataSessionStateChanged {
                        ty: sys::EventDataSessionStateChanged::TYPE,
                        next: std::ptr::null(),
                        session,
                        state,
                        time: now,
                    });
                }
                Event::Recentred(at, pose) => {
                    out.cast::<sys::EventDataReferenceSpaceChangePending>().write(sys::EventDataReferenceSpaceChangePending {
                        ty: sys::EventDataReferenceSpaceChangePending::TYPE,
                        next: std::ptr::null(),
                        session,
                        reference_space_type: sys::ReferenceSpaceType::LOCAL,
                        change_time: sys::Time::from_nanos(at),
                        pose_valid: sys::TRUE,
                        pose_in_previous_space: pose,
                    });
                }
                Event::Rate(from, to) => {
                    out.cast::<sys::EventDataDisplayRefreshRateChangedFB>().write(sys::EventDataDisplayRefreshRateChangedFB {
                        ty: sys::EventDataDisplayRefreshRateChangedFB::TYPE,
                        next: std::ptr::null(),
                        from_display_refresh_rate: from,
                        to_display_refresh_rate: to,
                    });
                }
                Event::InstanceLost(at) => {
                    out.cast::<sys::EventDataInstanceLossPending>().write(sys::EventDataInstanceLossPending {
                        ty: sys::EventDataInstanceLossPending::TYPE,
                        next: std::ptr::null(),
                        loss_time: sys::Time::from_nanos(at),
                    });
                }
            }
        }
        Ok(R::SUCCESS)
    }

    fn time_from_timespec(
        world,
        instance: sys::Instance,
        timespec: *const libc::timespec,
        time: *mut sys::Time,
    ) {
        world.instance(instance)?;
        // SAFETY: the arguments are those of the function.
        let timespec = unsafe { place(timespec.cast_mut()) }?;
        let nanos = timespec.tv_sec * 1_000_000_000 + timespec.tv_nsec;
        // SAFETY: the arguments are those of the function.
        *unsafe { place(time) }? = sys::Time::from_nanos(nanos);
        Ok(R::SUCCESS)
    }

    fn timespec_from_time(
        world,
        instance: sys::Instance,
        time: sys::Time,
        timespec: *mut libc::timespec,
    ) {
        world.instance(instance)?;
        let nanos = time.as_nanos();
        // SAFETY: the arguments are those of the function.
        *unsafe { place(timespec) }? = libc::timespec {
            tv_sec: nanos / 1_000_000_000,
            tv_nsec: nanos % 1_000_000_000,
        };
        Ok(R::SUCCESS)
    }
}

/// The headset is put on again when its time has come.
fn wake(world: &mut World) {
    let now = world.clock.now();
    let Some(session) = &mut world.session else {
        return;
    };
    if let Then::Ready(at) = session.then
        && session.state == SessionState::IDLE
        && !session.running
        && now >= at
    {
        session.then = Then::Stay;
        session.last_shown = 0;
        world.announce(SessionState::READY);
    }
}
