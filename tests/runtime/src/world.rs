//! Everything that the runtime knows, and the way from a handle to it.
//!
//! A handle is the number of its runtime and the number of the object in it, so
//! that many runtimes live in one process of tests.

use std::cell::RefCell;
use std::collections::{HashMap, VecDeque};
use std::sync::atomic::{AtomicPtr, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use openxr_sys as sys;
use sys::{Posef, Result as R, SessionState};

use crate::clock::Clock;
use crate::images::{Gpu, Picture};
use crate::log::Log;
use crate::{Script, pose};

/// What a call answers: a success code, or the error that it earned.
pub(crate) type Answer = Result<R, R>;

pub(crate) struct World {
    number: u64,
    next: u64,
    pub(crate) script: Script,
    pub(crate) log: Log,
    pub(crate) clock: Clock,
    pub(crate) paths: Vec<String>,
    pub(crate) instance: Option<Instance>,
    pub(crate) session: Option<Session>,
    pub(crate) swapchains: HashMap<u64, Swapchain>,
    pub(crate) spaces: HashMap<u64, Space>,
    pub(crate) sets: HashMap<u64, ActionSet>,
    pub(crate) actions: HashMap<u64, Action>,
    pub(crate) events: VecDeque<Event>,
    /// Frames that were waited for, over all sessions.
    pub(crate) frame: u64,
    pub(crate) rate: f32,
    /// The headset is away until then.
    pub(crate) away_until: i64,
    /// Where the user is centred, in the room, and from when on.
    pub(crate) centre: Posef,
    pub(crate) next_centre: Option<(i64, Posef)>,
    /// Locations of views so far: each measurement differs a little from the one
    /// before, as a tracker's do.
    pub(crate) measurements: u64,
}

pub(crate) struct Instance {
    pub(crate) handle: u64,
    pub(crate) requirements_asked: bool,
    pub(crate) vulkan: Option<crate::images::Vulkan>,
    pub(crate) lost: bool,
}

pub(crate) struct Session {
    pub(crate) handle: u64,
    pub(crate) gpu: Gpu,
    pub(crate) state: SessionState,
    pub(crate) running: bool,
    pub(crate) lost: bool,
    pub(crate) attached: Option<Vec<u64>>,
    /// A frame that was waited for and not begun: when it is shown, and whether
    /// it is to be drawn.
    pub(crate) waited: Option<(i64, bool)>,
    pub(crate) begun: Option<(i64, bool)>,
    pub(crate) last_shown: i64,
    pub(crate) hidden: u32,
    pub(crate) blind: u32,
    pub(crate) untracked: u32,
    pub(crate) refuse: Option<R>,
    /// What follows the end of the session: nothing, the exit, or another begin.
    pub(crate) then: Then,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Then {
    Stay,
    Exit,
    /// Ready again at this time.
    Ready(i64),
}

pub(crate) struct Swapchain {
    pub(crate) format: i64,
    pub(crate) size: [u32; 2],
    pub(crate) layers: u32,
    pub(crate) pictures: Vec<Picture>,
    /// In order; the first may have been waited for.
    pub(crate) acquired: VecDeque<u32>,
    pub(crate) waited: bool,
    pub(crate) released: Option<u32>,
    pub(crate) next: u32,
}

#[derive(Clone, Copy)]
pub(crate) enum Space {
    Reference(sys::ReferenceSpaceType, Posef),
    Hand(usize, Posef),
}

pub(crate) struct ActionSet {
    pub(crate) attached: bool,
}

#[derive(Clone, Copy)]
pub(crate) struct Action {
    pub(crate) set: u64,
    pub(crate) kind: sys::ActionType,
}

pub(crate) enum Event {
    State(SessionState),
    Recentred(i64, Posef),
    Rate(f32, f32),
    InstanceLost(i64),
}

static WORLDS: Mutex<Vec<Arc<Mutex<World>>>> = Mutex::new(Vec::new());

thread_local! {
    static CURRENT: RefCell<Option<Arc<Mutex<World>>>> = const { RefCell::new(None) };
}

static HOOK: AtomicPtr<()> = AtomicPtr::new(std::ptr::null_mut());

pub(crate) fn set_hook(hook: fn(bool)) {
    HOOK.store(hook as *mut (), Ordering::Release);
}

fn cross(inwards: bool) {
    let hook = HOOK.load(Ordering::Acquire);
    if !hook.is_null() {
        // SAFETY: only `set_hook` stores here, and what it stores is such a function.
        let hook: fn(bool) = unsafe { std::mem::transmute(hook) };
        hook(inwards);
    }
}

pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

pub(crate) fn install(script: Script) -> Arc<Mutex<World>> {
    let mut worlds = lock(&WORLDS);
    let world = Arc::new(Mutex::new(World::new(worlds.len() as u64 + 1, script)));
    worlds.push(Arc::clone(&world));
    CURRENT.with_borrow_mut(|current| *current = Some(Arc::clone(&world)));
    world
}

/// Runs a call that names no handle yet in the thread's runtime; in a shared
/// library, in the one that the environment describes.
pub(crate) fn enter_current(
    name: &'static str,
    call: impl FnOnce(&mut World) -> Answer,
) -> sys::Result {
    let current = CURRENT.with_borrow(Clone::clone);
    let world = current.unwrap_or_else(|| install(Script::from_environment()));
    run(&world, name, call)
}

/// Runs a call in the runtime of a handle.
pub(crate) fn enter(
    handle: u64,
    name: &'static str,
    call: impl FnOnce(&mut World) -> Answer,
) -> sys::Result {
    let world = {
        let worlds = lock(&WORLDS);
        let index = (handle >> 32).wrapping_sub(1) as usize;
        worlds.get(index).cloned()
    };
    match world {
        Some(world) => run(&world, name, call),
        None => R::ERROR_HANDLE_INVALID,
    }
}

fn run(
    world: &Mutex<World>,
    name: &'static str,
    call: impl FnOnce(&mut World) -> Answer,
) -> sys::Result {
    cross(true);
    let answer = {
        let mut world = lock(world);
        let answer = call(&mut world);
        if let Err(error) = answer {
            world.log.misuse.push((name, error));
        }
        answer
    };
    cross(false);
    match answer {
        Ok(result) | Err(result) => result,
    }
}

impl World {
    fn new(number: u64, script: Script) -> Self {
        Self {
            number,
            next: 0,
            clock: Clock::new(script.clock),
            rate: script.rate,
            script,
            log: Log::default(),
            paths: Vec::new(),
            instance: None,
            session: None,
            swapchains: HashMap::new(),
            spaces: HashMap::new(),
            sets: HashMap::new(),
            actions: HashMap::new(),
            events: VecDeque::new(),
            frame: 0,
            away_until: 0,
            centre: pose::IDENTITY,
            next_centre: None,
            measurements: 0,
        }
    }

    /// A handle for a new object.
    pub(crate) fn handle(&mut self) -> u64 {
        self.next += 1;
        self.number << 32 | self.next
    }

    pub(crate) fn instance(&mut self, handle: u64) -> Result<&mut Instance, R> {
        let instance = self.instance.as_mut();
        let instance = instance.filter(|instance| instance.handle == handle);
        let instance = instance.ok_or(R::ERROR_HANDLE_INVALID)?;
        if instance.lost {
            return Err(R::ERROR_INSTANCE_LOST);
        }
        Ok(instance)
    }

    pub(crate) fn session(&mut self, handle: u64) -> Result<&mut Session, R> {
        if self.instance.as_ref().is_some_and(|instance| instance.lost) {
            return Err(R::ERROR_INSTANCE_LOST);
        }
        let session = self.session.as_mut();
        let session = session.filter(|session| session.handle == handle);
        let session = session.ok_or(R::ERROR_HANDLE_INVALID)?;
        if session.lost {
            return Err(R::ERROR_SESSION_LOST);
        }
        Ok(session)
    }

    /// The session that objects belong to.
    pub(crate) fn any_session(&mut self) -> Result<&mut Session, R> {
        let handle = self.session.as_ref().map(|session| session.handle);
        self.session(handle.ok_or(R::ERROR_HANDLE_INVALID)?)
    }

    /// Sends the session to a state, which it hears of.
    pub(crate) fn announce(&mut self, state: SessionState) {
        if let Some(session) = &mut self.session {
            session.state = state;
            self.log.states.push(state);
            self.events.push_back(Event::State(state));
        }
    }

    pub(crate) fn period(&self) -> i64 {
        (1e9 / f64::from(self.rate)) as i64
    }

    pub(crate) fn path(&self, path: sys::Path) -> Result<&str, R> {
        let index = path.into_raw().wrapping_sub(1) as usize;
        let path = self.paths.get(index).ok_or(R::ERROR_PATH_INVALID)?;
        Ok(path)
    }

    /// Left or right, of a path to a hand.
    pub(crate) fn side(&self, path: sys::Path) -> Result<usize, R> {
        match self.path(path)? {
            "/user/hand/left" => Ok(0),
            "/user/hand/right" => Ok(1),
            _ => Err(R::ERROR_PATH_UNSUPPORTED),
        }
    }
}
