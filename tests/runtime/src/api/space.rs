//! Spaces, and where things are in them.

use openxr_sys as sys;
use sys::{Posef, Result as R, SpaceLocationFlags, SpaceVelocityFlags, Vector3f};

use super::instance::stereo;
use super::{api, input, list, output, place};
use crate::pose::{add, conjugate, inverse, is_valid, product, rotate, then};
use crate::world::{Space, World};

/// Height of the eyes that LOCAL begins at, metres.
const EYES: f32 = 1.6;
/// Velocities are central differences over this long, seconds.
const STEP: f64 = 0.002;

api! {
    fn reference_spaces(
        world,
        session: sys::Session,
        capacity: u32,
        count: *mut u32,
        kinds: *mut sys::ReferenceSpaceType,
    ) {
        world.session(session)?;
        let all = kinds_of(world);
        // SAFETY: the arguments are those of the function.
        unsafe { list(&all, capacity, count, kinds, |out, kind| *out = *kind) }
    }

    fn create_reference_space(
        world,
        session: sys::Session,
        info: *const sys::ReferenceSpaceCreateInfo,
        space: *mut sys::Space,
    ) {
        world.session(session)?;
        // SAFETY: the arguments are those of the function.
        let info = unsafe { input(info, sys::ReferenceSpaceCreateInfo::TYPE) }?;
        if !kinds_of(world).contains(&info.reference_space_type) {
            return Err(R::ERROR_REFERENCE_SPACE_UNSUPPORTED);
        }
        if !is_valid(&info.pose_in_reference_space) {
            return Err(R::ERROR_POSE_INVALID);
        }
        let kind = Space::Reference(info.reference_space_type, info.pose_in_reference_space);
        let handle = world.handle();
        world.spaces.insert(handle, kind);
        // SAFETY: the arguments are those of the function.
        *unsafe { place(space) }? = sys::Space::from_raw(handle);
        Ok(R::SUCCESS)
    }

    fn bounds_rect(
        world,
        session: sys::Session,
        _kind: sys::ReferenceSpaceType,
        bounds: *mut sys::Extent2Df,
    ) {
        world.session(session)?;
        // SAFETY: the arguments are those of the function.
        *unsafe { place(bounds) }? = sys::Extent2Df::default();
        Ok(R::SPACE_BOUNDS_UNAVAILABLE)
    }

    fn create_action_space(
        world,
        session: sys::Session,
        info: *const sys::ActionSpaceCreateInfo,
        space: *mut sys::Space,
    ) {
        world.session(session)?;
        // SAFETY: the arguments are those of the function.
        let info = unsafe { input(info, sys::ActionSpaceCreateInfo::TYPE) }?;
        let action = world.actions.get(&info.action.into_raw()).ok_or(R::ERROR_HANDLE_INVALID)?;
        if action.kind != sys::ActionType::POSE_INPUT {
            return Err(R::ERROR_ACTION_TYPE_MISMATCH);
        }
        let side = world.side(info.subaction_path)?;
        let handle = world.handle();
        world.spaces.insert(handle, Space::Hand(side, info.pose_in_action_space));
        // SAFETY: the arguments are those of the function.
        *unsafe { place(space) }? = sys::Space::from_raw(handle);
        Ok(R::SUCCESS)
    }

    fn destroy_space(world, space: sys::Space) {
        match world.spaces.remove(&space) {
            Some(_) => Ok(R::SUCCESS),
            None => Err(R::ERROR_HANDLE_INVALID),
        }
    }

    fn locate_space(
        world,
        space: sys::Space,
        base: sys::Space,
        time: sys::Time,
        location: *mut sys::SpaceLocation,
    ) {
        world.any_session()?;
        let time = valid_time(time)?;
        let space = *world.spaces.get(&space).ok_or(R::ERROR_HANDLE_INVALID)?;
        let base = base.into_raw();
        let base = *world.spaces.get(&base).ok_or(R::ERROR_HANDLE_INVALID)?;
        // SAFETY: the arguments are those of the function.
        let out = unsafe { output(location, sys::SpaceLocation::TYPE) }?;
        let velocity = out.next.cast::<sys::SpaceVelocity>();
        // SAFETY: a struct in the chain, or null.
        let velocity = unsafe { output(velocity, sys::SpaceVelocity::TYPE) }.ok();
        let at = |seconds: f64| {
            let time = time + (seconds * 1e9) as i64;
            Some(then(inverse(in_room(world, base, time)?), in_room(world, space, time)?))
        };
        let blind = world.session.as_ref().is_some_and(|session| session.blind > 0);
        let Some(pose) = at(0.0).filter(|_| !blind) else {
            out.location_flags = SpaceLocationFlags::EMPTY;
            if let Some(velocity) = velocity {
                velocity.velocity_flags = SpaceVelocityFlags::EMPTY;
            }
            return Ok(R::SUCCESS);
        };
        out.pose = pose;
        out.location_flags = SpaceLocationFlags::POSITION_VALID
            | SpaceLocationFlags::ORIENTATION_VALID
            | SpaceLocationFlags::ORIENTATION_TRACKED;
        if let (Some(velocity), Some(before), Some(after)) = (velocity, at(-STEP), at(STEP)) {
            let per_second = (0.5 / STEP) as f32;
            let way = add(after.position, before.position, -1.0);
            let turn = product(after.orientation, conjugate(before.orientation));
            let scale = |v: Vector3f, s: f32| add(Vector3f::default(), v, s);
            velocity.velocity_flags =
                SpaceVelocityFlags::LINEAR_VALID | SpaceVelocityFlags::ANGULAR_VALID;
            velocity.linear_velocity = scale(way, per_second);
            // Of a small turn, twice the vector part.
            let axis = Vector3f { x: turn.x, y: turn.y, z: turn.z };
            velocity.angular_velocity = scale(axis, 2.0 * per_second * turn.w.signum());
        }
        Ok(R::SUCCESS)
    }

    fn locate_views(
        world,
        session: sys::Session,
        info: *const sys::ViewLocateInfo,
        state: *mut sys::ViewState,
        capacity: u32,
        count: *mut u32,
        views: *mut sys::View,
    ) {
        world.session(session)?;
        // SAFETY: the arguments are those of the function.
        let (info, state) = unsafe {
            (input(info, sys::ViewLocateInfo::TYPE)?, output(state, sys::ViewState::TYPE)?)
        };
        stereo(info.view_configuration_type)?;
        let time = valid_time(info.display_time)?;
        let base = *world.spaces.get(&info.space.into_raw()).ok_or(R::ERROR_HANDLE_INVALID)?;
        let (blind, untracked) = world
            .session
            .as_ref()
            .map_or((false, false), |session| (session.blind > 0, session.untracked > 0));
        let valid = sys::ViewStateFlags::POSITION_VALID | sys::ViewStateFlags::ORIENTATION_VALID;
        state.view_state_flags = match (blind, untracked) {
            (true, _) => sys::ViewStateFlags::EMPTY,
            (_, true) => valid,
            _ => {
                valid
                    | sys::ViewStateFlags::POSITION_TRACKED
                    | sys::ViewStateFlags::ORIENTATION_TRACKED
            }
        };
        let mut eyes = eyes_in(world, base, time);
        if capacity > 0 {
            world.measurements += 1;
            // What is measured later is known better, and differs.
            let noise = (world.measurements % 97) as f32 * 1e-5;
            for eye in &mut eyes {
                eye.position.y += noise;
            }
            world.log.located.push((time, [eyes[0], eyes[1]]));
        }
        let fov = world.script.headset.eyes.fov;
        let all: Vec<_> = eyes.into_iter().zip(fov).collect();
        // SAFETY: the arguments are those of the function.
        unsafe {
            list(&all, capacity, count, views, |out, (pose, fov)| {
                out.pose = *pose;
                out.fov = *fov;
            })
        }
    }
}

fn kinds_of(world: &World) -> Vec<sys::ReferenceSpaceType> {
    use sys::ReferenceSpaceType as Kind;
    let mut kinds = vec![Kind::VIEW, Kind::LOCAL, Kind::STAGE];
    if world
        .log
        .extensions
        .iter()
        .any(|name| name == "EXT_local_floor")
    {
        kinds.push(Kind::LOCAL_FLOOR_EXT);
    }
    kinds
}

fn valid_time(time: sys::Time) -> Result<i64, R> {
    let nanos = time.as_nanos();
    if nanos > 0 {
        Ok(nanos)
    } else {
        Err(R::ERROR_TIME_INVALID)
    }
}

/// Both eyes in a space.
fn eyes_in(world: &World, base: Space, time: i64) -> [Posef; 2] {
    let base = in_room(world, base, time).unwrap_or(crate::pose::IDENTITY);
    let head = (world.script.head)(time as f64 * 1e-9);
    let offset = world.script.headset.eyes.offset;
    [-offset, offset].map(|x| {
        let aside = rotate(head.orientation, Vector3f { x, y: 0.0, z: 0.0 });
        let eye = Posef {
            position: add(head.position, aside, 1.0),
            ..head
        };
        then(inverse(base), eye)
    })
}

/// A space in the room, which is where the head's trace is.
fn in_room(world: &World, space: Space, time: i64) -> Option<Posef> {
    let (outer, inner) = match space {
        Space::Reference(sys::ReferenceSpaceType::VIEW, inner) => {
            ((world.script.head)(time as f64 * 1e-9), inner)
        }
        Space::Reference(kind, inner) => {
            let mut outer = if kind == sys::ReferenceSpaceType::STAGE {
                crate::pose::IDENTITY
            } else {
                match world.next_centre {
                    Some((at, centre)) if time >= at => centre,
                    _ => world.centre,
                }
            };
            if kind == sys::ReferenceSpaceType::LOCAL {
                outer.position.y += EYES;
            }
            (outer, inner)
        }
        Space::Hand(side, inner) => (world.script.controllers[side]?.aim, inner),
    };
    Some(then(outer, inner))
}
