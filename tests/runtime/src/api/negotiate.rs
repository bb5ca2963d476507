//! What a loader calls first.

use openxr_sys as sys;
use sys::Result as R;

/// The interface between loader and runtime that this is written for.
const INTERFACE: u32 = 1;

/// Tells the loader which API this runtime is of.
///
/// # Safety
/// The pointers are those of a loader.
#[unsafe(no_mangle)]
pub unsafe extern "system" fn xrNegotiateLoaderRuntimeInterface(
    loader: *const sys::NegotiateLoaderInfo,
    runtime: *mut sys::NegotiateRuntimeRequest,
) -> R {
    // SAFETY: as the caller says, or null.
    let (Some(loader), Some(runtime)) = (unsafe { loader.as_ref() }, unsafe { runtime.as_mut() })
    else {
        return R::ERROR_INITIALIZATION_FAILED;
    };
    let versions = loader.min_interface_version..=loader.max_interface_version;
    if !versions.contains(&INTERFACE) {
        return R::ERROR_INITIALIZATION_FAILED;
    }
    runtime.runtime_interface_version = INTERFACE;
    runtime.runtime_api_version = sys::Version::new(1, 0, 20);
    runtime.get_instance_proc_addr = Some(super::table::get_instance_proc_addr);
    R::SUCCESS
}
