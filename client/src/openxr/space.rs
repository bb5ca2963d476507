//! Between OpenXR's numbers and ours, which have the same axes and units.

use ::openxr as xr;
use glam::{Quat, Vec3};
use shadecast_protocol::{Fov, Pose};
use xr::sys;

/// As ours, with an orientation of unit length; none when it is no pose.
pub(super) fn pose_from_xr(pose: xr::Posef) -> Option<Pose> {
    let (p, q) = (pose.position, pose.orientation);
    let orientation = Quat::from_xyzw(q.x, q.y, q.z, q.w);
    let pose = Pose {
        position: Vec3::new(p.x, p.y, p.z),
        orientation: orientation.normalize(),
    };
    (pose.is_valid() && orientation.length_squared() > 0.25).then_some(pose)
}

pub(super) fn fov_from_xr(fov: xr::Fovf) -> Option<Fov> {
    let fov = Fov {
        left: fov.angle_left,
        right: fov.angle_right,
        up: fov.angle_up,
        down: fov.angle_down,
    };
    fov.is_valid().then_some(fov)
}

/// A velocity, or none where the runtime does not know it.
pub(super) fn velocity_from_xr(known: bool, velocity: xr::Vector3f) -> Vec3 {
    let velocity = Vec3::new(velocity.x, velocity.y, velocity.z);
    if known && velocity.is_finite() {
        velocity
    } else {
        Vec3::ZERO
    }
}

/// One eye as it was located, in both spellings: what is submitted is the very
/// pose and field of view that the runtime gave.
#[derive(Clone, Copy, Debug)]
pub(super) struct EyeLocation {
    pub(super) raw: (xr::Posef, xr::Fovf),
    pub(super) base_from_eye: Pose,
    pub(super) fov: Fov,
}

/// Both eyes at a time. None while the runtime does not know where they are;
/// that it tracks them is not asked for, because a headset that loses sight for
/// a moment still says where it believes to be.
///
/// The `openxr` crate's own function allocates, and this is called every frame.
pub(super) fn locate_eyes<G>(
    session: &xr::Session<G>,
    time: xr::Time,
    base: &xr::Space,
) -> xr::Result<Option<[EyeLocation; 2]>> {
    let info = sys::ViewLocateInfo {
        ty: sys::ViewLocateInfo::TYPE,
        next: std::ptr::null(),
        view_configuration_type: xr::ViewConfigurationType::PRIMARY_STEREO,
        display_time: time,
        space: base.as_raw(),
    };
    let mut state = sys::ViewState {
        ty: sys::ViewState::TYPE,
        next: std::ptr::null_mut(),
        view_state_flags: sys::ViewStateFlags::EMPTY,
    };
    let view = sys::View {
        ty: sys::View::TYPE,
        next: std::ptr::null_mut(),
        pose: xr::Posef::IDENTITY,
        fov: xr::Fovf::default(),
    };
    let mut views = [view; 2];
    let mut count = 0;
    // SAFETY: all structs are whole and outlive the call; there is room for
    // both views.
    let result = unsafe {
        (session.instance().fp().locate_views)(
            session.as_raw(),
            &info,
            &mut state,
            views.len() as u32,
            &mut count,
            views.as_mut_ptr(),
        )
    };
    if result.into_raw() < 0 {
        return Err(result);
    }
    let valid = sys::ViewStateFlags::POSITION_VALID | sys::ViewStateFlags::ORIENTATION_VALID;
    if count != 2 || !state.view_state_flags.contains(valid) {
        return Ok(None);
    }
    let eye = |view: &sys::View| {
        Some(EyeLocation {
            raw: (view.pose, view.fov),
            base_from_eye: pose_from_xr(view.pose)?,
            fov: fov_from_xr(view.fov)?,
        })
    };
    Ok(eye(&views[0])
        .zip(eye(&views[1]))
        .map(|(left, right)| [left, right]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_pose_or_no_field_of_view_is_told() {
        let mut pose = xr::Posef::IDENTITY;
        pose.orientation.w = 1.01;
        assert!(pose_from_xr(pose).is_some(), "nearly of unit length");
        pose.orientation.w = 0.0;
        assert!(pose_from_xr(pose).is_none());
        pose = xr::Posef::IDENTITY;
        pose.position.x = f32::NAN;
        assert!(pose_from_xr(pose).is_none());

        let fov = |left: f32, right: f32| xr::Fovf {
            angle_left: left,
            angle_right: right,
            angle_up: 0.8,
            angle_down: -0.9,
        };
        assert!(fov_from_xr(fov(-0.9, 0.6)).is_some(), "asymmetric");
        assert!(fov_from_xr(fov(0.6, -0.9)).is_none());
        assert!(fov_from_xr(fov(0.0, 0.0)).is_none());
        assert!(
            velocity_from_xr(
                true,
                xr::Vector3f {
                    x: f32::NAN,
                    y: 0.0,
                    z: 0.0
                }
            ) == Vec3::ZERO
        );
    }
}
