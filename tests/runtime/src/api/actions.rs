//! Actions: what the controllers of the script do.

use openxr_sys as sys;
use sys::{ActionType, Handle as _, Result as R, SessionState};

use super::{api, input, output, place};
use crate::script::Controller;
use crate::world::{Action, ActionSet, World};

/// Controllers that the runtime knows.
const PROFILES: [&str; 2] = [
    "/interaction_profiles/khr/simple_controller",
    "/interaction_profiles/oculus/touch_controller",
];

api! {
    fn create_action_set(
        world,
        instance: sys::Instance,
        info: *const sys::ActionSetCreateInfo,
        set: *mut sys::ActionSet,
    ) {
        world.instance(instance)?;
        // SAFETY: the arguments are those of the function.
        let info = unsafe { input(info, sys::ActionSetCreateInfo::TYPE) }?;
        if info.action_set_name[0] == 0 {
            return Err(R::ERROR_NAME_INVALID);
        }
        let handle = world.handle();
        world.sets.insert(handle, ActionSet { attached: false });
        // SAFETY: the arguments are those of the function.
        *unsafe { place(set) }? = sys::ActionSet::from_raw(handle);
        Ok(R::SUCCESS)
    }

    fn destroy_action_set(world, set: sys::ActionSet) {
        match world.sets.remove(&set) {
            Some(_) => Ok(R::SUCCESS),
            None => Err(R::ERROR_HANDLE_INVALID),
        }
    }

    fn create_action(
        world,
        set: sys::ActionSet,
        info: *const sys::ActionCreateInfo,
        action: *mut sys::Action,
    ) {
        // SAFETY: the arguments are those of the function.
        let info = unsafe { input(info, sys::ActionCreateInfo::TYPE) }?;
        let owner = world.sets.get(&set).ok_or(R::ERROR_HANDLE_INVALID)?;
        if owner.attached {
            return Err(R::ERROR_ACTIONSETS_ALREADY_ATTACHED);
        }
        if info.action_name[0] == 0 {
            return Err(R::ERROR_NAME_INVALID);
        }
        let kind = info.action_type;
        let handle = world.handle();
        world.actions.insert(handle, Action { set, kind });
        // SAFETY: the arguments are those of the function.
        *unsafe { place(action) }? = sys::Action::from_raw(handle);
        Ok(R::SUCCESS)
    }

    fn destroy_action(world, action: sys::Action) {
        match world.actions.remove(&action) {
            Some(_) => Ok(R::SUCCESS),
            None => Err(R::ERROR_HANDLE_INVALID),
        }
    }

    fn suggest_bindings(
        world,
        instance: sys::Instance,
        info: *const sys::InteractionProfileSuggestedBinding,
    ) {
        world.instance(instance)?;
        // SAFETY: the arguments are those of the function.
        let info = unsafe { input(info, sys::InteractionProfileSuggestedBinding::TYPE) }?;
        if !PROFILES.contains(&world.path(info.interaction_profile)?) {
            return Err(R::ERROR_PATH_UNSUPPORTED);
        }
        if info.count_suggested_bindings == 0 {
            return Err(R::ERROR_VALIDATION_FAILURE);
        }
        for index in 0..info.count_suggested_bindings as usize {
            // SAFETY: there are as many as the struct says.
            let binding = unsafe { place(info.suggested_bindings.cast_mut().add(index)) }?;
            let action = world.actions.get(&binding.action.into_raw());
            let set = action.ok_or(R::ERROR_HANDLE_INVALID)?.set;
            if world.sets.get(&set).is_some_and(|set| set.attached) {
                return Err(R::ERROR_ACTIONSETS_ALREADY_ATTACHED);
            }
            if !world.path(binding.binding)?.starts_with("/user/hand/") {
                return Err(R::ERROR_PATH_UNSUPPORTED);
            }
        }
        Ok(R::SUCCESS)
    }

    fn attach_sets(
        world,
        session: sys::Session,
        info: *const sys::SessionActionSetsAttachInfo,
    ) {
        // SAFETY: the arguments are those of the function.
        let info = unsafe { input(info, sys::SessionActionSetsAttachInfo::TYPE) }?;
        if world.session(session)?.attached.is_some() {
            return Err(R::ERROR_ACTIONSETS_ALREADY_ATTACHED);
        }
        let mut attached = Vec::new();
        for index in 0..info.count_action_sets as usize {
            // SAFETY: there are as many as the struct says.
            let handle = unsafe { *info.action_sets.add(index) }.into_raw();
            let set = world.sets.get_mut(&handle).ok_or(R::ERROR_HANDLE_INVALID)?;
            set.attached = true;
            attached.push(handle);
        }
        world.session(session)?.attached = Some(attached);
        Ok(R::SUCCESS)
    }

    fn current_profile(
        world,
        session: sys::Session,
        _hand: sys::Path,
        state: *mut sys::InteractionProfileState,
    ) {
        world.session(session)?;
        // SAFETY: the arguments are those of the function.
        let out = unsafe { output(state, sys::InteractionProfileState::TYPE) }?;
        out.interaction_profile = sys::Path::NULL;
        Ok(R::SUCCESS)
    }

    fn sync_actions(world, session: sys::Session, info: *const sys::ActionsSyncInfo) {
        // SAFETY: the arguments are those of the function.
        let info = unsafe { input(info, sys::ActionsSyncInfo::TYPE) }?;
        let session = world.session(session)?;
        let attached = session.attached.as_ref().ok_or(R::ERROR_ACTIONSET_NOT_ATTACHED)?;
        for index in 0..info.count_active_action_sets as usize {
            // SAFETY: there are as many as the struct says.
            let active = unsafe { *info.active_action_sets.add(index) };
            if !attached.contains(&active.action_set.into_raw()) {
                return Err(R::ERROR_ACTIONSET_NOT_ATTACHED);
            }
        }
        let focused = session.state == SessionState::FOCUSED;
        Ok(if focused { R::SUCCESS } else { R::SESSION_NOT_FOCUSED })
    }

    fn state_boolean(
        world,
        session: sys::Session,
        info: *const sys::ActionStateGetInfo,
        state: *mut sys::ActionStateBoolean,
    ) {
        let controller = asked(world, session, info, ActionType::BOOLEAN_INPUT)?;
        // SAFETY: the arguments are those of the function.
        let out = unsafe { output(state, sys::ActionStateBoolean::TYPE) }?;
        out.is_active = controller.is_some().into();
        out.current_state = controller.is_some_and(|it| it.pressed).into();
        out.changed_since_last_sync = sys::FALSE;
        out.last_change_time = sys::Time::from_nanos(0);
        Ok(R::SUCCESS)
    }

    fn state_vector(
        world,
        session: sys::Session,
        info: *const sys::ActionStateGetInfo,
        state: *mut sys::ActionStateVector2f,
    ) {
        let controller = asked(world, session, info, ActionType::VECTOR2F_INPUT)?;
        // SAFETY: the arguments are those of the function.
        let out = unsafe { output(state, sys::ActionStateVector2f::TYPE) }?;
        out.is_active = controller.is_some().into();
        out.current_state = controller.map_or_else(Default::default, |it| it.stick);
        out.changed_since_last_sync = sys::FALSE;
        out.last_change_time = sys::Time::from_nanos(0);
        Ok(R::SUCCESS)
    }

    fn state_pose(
        world,
        session: sys::Session,
        info: *const sys::ActionStateGetInfo,
        state: *mut sys::ActionStatePose,
    ) {
        let controller = asked(world, session, info, ActionType::POSE_INPUT)?;
        // SAFETY: the arguments are those of the function.
        let out = unsafe { output(state, sys::ActionStatePose::TYPE) }?;
        out.is_active = controller.is_some().into();
        Ok(R::SUCCESS)
    }
}

/// The controller that an action of this type is asked for.
fn asked(
    world: &mut World,
    session: u64,
    info: *const sys::ActionStateGetInfo,
    kind: ActionType,
) -> Result<Option<Controller>, R> {
    // SAFETY: the arguments are those of the function.
    let info = unsafe { input(info, sys::ActionStateGetInfo::TYPE) }?;
    let action = *world
        .actions
        .get(&info.action.into_raw())
        .ok_or(R::ERROR_HANDLE_INVALID)?;
    if action.kind != kind {
        return Err(R::ERROR_ACTION_TYPE_MISMATCH);
    }
    let attached = world.session(session)?.attached.as_ref();
    if !attached.is_some_and(|sets| sets.contains(&action.set)) {
        return Err(R::ERROR_ACTIONSET_NOT_ATTACHED);
    }
    Ok(world.script.controllers[world.side(info.subaction_path)?])
}
