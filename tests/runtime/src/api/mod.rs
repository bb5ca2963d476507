//! The functions that an application calls.

mod actions;
mod events;
mod frame;
mod instance;
pub(crate) mod negotiate;
mod session;
mod space;
mod swapchain;
pub(crate) mod table;
mod vulkan;

use std::ffi::c_char;

use openxr_sys as sys;
use sys::{Result as R, StructureType};

/// Defines functions of the API that begin with a handle: each runs in the
/// runtime of that handle, and what it refuses is logged under its name.
macro_rules! api {
    ($($(#[$doc:meta])* fn $name:ident($world:ident, $handle:ident: $of:ty $(, $arg:ident: $kind:ty)* $(,)?) $body:block)*) => {$(
        $(#[$doc])*
        pub(super) unsafe extern "system" fn $name($handle: $of $(, $arg: $kind)*) -> openxr_sys::Result {
            use openxr_sys::Handle as _;
            let $handle = $handle.into_raw();
            $crate::world::enter($handle, stringify!($name), |$world| $body)
        }
    )*};
}
pub(crate) use api;

/// What a pointer from the application points to.
///
/// # Safety
/// The pointer is null, or of a struct that lives as long as the call.
unsafe fn input<'a, T>(pointer: *const T, ty: StructureType) -> Result<&'a T, R> {
    if pointer.is_null() {
        return Err(R::ERROR_VALIDATION_FAILURE);
    }
    // SAFETY: all structs of OpenXR begin with their type.
    let actual = unsafe { (*pointer.cast::<sys::BaseInStructure>()).ty };
    if actual != ty {
        return Err(R::ERROR_VALIDATION_FAILURE);
    }
    // SAFETY: of this type, as it says itself.
    Ok(unsafe { &*pointer })
}

/// Where the application wants an answer.
///
/// # Safety
/// As [`input`].
unsafe fn output<'a, T>(pointer: *mut T, ty: StructureType) -> Result<&'a mut T, R> {
    // SAFETY: as the caller says.
    unsafe {
        input(pointer, ty)?;
        Ok(&mut *pointer)
    }
}

/// Where the application wants a plain value.
///
/// # Safety
/// As [`input`].
unsafe fn place<'a, T>(pointer: *mut T) -> Result<&'a mut T, R> {
    // SAFETY: as the caller says.
    unsafe { pointer.as_mut() }.ok_or(R::ERROR_VALIDATION_FAILURE)
}

/// Answers by the rule of two calls: first how many, then those.
///
/// # Safety
/// `count` is writable, and `items` has room for `capacity` unless that is zero.
unsafe fn list<T, U>(
    values: &[T],
    capacity: u32,
    count: *mut u32,
    items: *mut U,
    mut write: impl FnMut(&mut U, &T),
) -> Result<R, R> {
    // SAFETY: as the caller says.
    *unsafe { place(count) }? = values.len() as u32;
    if capacity == 0 {
        return Ok(R::SUCCESS);
    }
    if (capacity as usize) < values.len() {
        return Err(R::ERROR_SIZE_INSUFFICIENT);
    }
    for (index, value) in values.iter().enumerate() {
        // SAFETY: within the capacity.
        write(unsafe { place(items.add(index)) }?, value);
    }
    Ok(R::SUCCESS)
}

/// Writes a text and its final zero.
fn write_text(out: &mut [c_char], text: &str) {
    let room = out.len() - 1;
    out.fill(0);
    for (place, byte) in out[..room].iter_mut().zip(text.bytes()) {
        *place = byte as c_char;
    }
}

/// # Safety
/// The pointer is null, or of a text that ends with zero.
unsafe fn text<'a>(pointer: *const c_char) -> Result<&'a str, R> {
    if pointer.is_null() {
        return Err(R::ERROR_VALIDATION_FAILURE);
    }
    // SAFETY: as the caller says.
    let text = unsafe { std::ffi::CStr::from_ptr(pointer) };
    text.to_str().map_err(|_| R::ERROR_VALIDATION_FAILURE)
}
