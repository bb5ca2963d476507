//! What only Java tells: the intent, and what the screen is like.

use android_activity::AndroidApp;
use jni::errors::Result;
use jni::objects::{JObject, JString};
use jni::refs::Global;
use jni::{Env, JavaVM, jni_sig, jni_str};
use shadecast_client::render::PhoneScreen;

/// Calls a method that wants nothing and returns an object.
macro_rules! object {
    ($env:ident, $on:expr, $method:literal, $class:literal) => {
        $env.call_method($on, jni_str!($method), jni_sig!($class), &[])?
            .l()?
    };
}

/// `getIntent().getStringExtra("server")`.
pub(crate) fn server_of_intent(app: &AndroidApp) -> Option<String> {
    let extra = ask(app, |env, activity| {
        let intent = object!(env, activity, "getIntent", "()Landroid/content/Intent;");
        if intent.is_null() {
            return Ok(None);
        }
        let name = env.new_string("server")?;
        let (method, signature) = (
            jni_str!("getStringExtra"),
            jni_sig!("(Ljava/lang/String;)Ljava/lang/String;"),
        );
        let extra = env
            .call_method(&intent, method, signature, &[(&name).into()])?
            .l()?;
        if extra.is_null() {
            return Ok(None);
        }
        let extra = env.cast_local::<JString>(extra)?;
        Ok(Some(extra.try_to_string(env)?))
    });
    extra
        .inspect_err(|error| tracing::warn!("the intent cannot be read: {error}"))
        .ok()
        .flatten()
}

/// Of `getWindowManager().getDefaultDisplay()` and `getResources().getDisplayMetrics()`.
pub(crate) fn screen(app: &AndroidApp) -> Result<PhoneScreen> {
    ask(app, |env, activity| {
        let manager = object!(
            env,
            activity,
            "getWindowManager",
            "()Landroid/view/WindowManager;"
        );
        let display = object!(
            env,
            &manager,
            "getDefaultDisplay",
            "()Landroid/view/Display;"
        );
        let quarters = env.call_method(&display, jni_str!("getRotation"), jni_sig!("()I"), &[])?;
        let rate = env.call_method(&display, jni_str!("getRefreshRate"), jni_sig!("()F"), &[])?;
        let resources = object!(
            env,
            activity,
            "getResources",
            "()Landroid/content/res/Resources;"
        );
        let metrics = object!(
            env,
            &resources,
            "getDisplayMetrics",
            "()Landroid/util/DisplayMetrics;"
        );
        let x = env.get_field(&metrics, jni_str!("xdpi"), jni_sig!("F"))?;
        let y = env.get_field(&metrics, jni_str!("ydpi"), jni_sig!("F"))?;
        Ok(PhoneScreen {
            pixels_an_inch: [x.f()?, y.f()?],
            rate: rate.f()?,
            quarters: quarters.i()? as u8,
        })
    })
}

/// Asks the activity.
fn ask<T>(
    app: &AndroidApp,
    question: impl FnOnce(&mut Env<'_>, &JObject<'_>) -> Result<T>,
) -> Result<T> {
    let activity = app.activity_as_ptr() as jni::sys::jobject;
    // SAFETY: android-activity gives the virtual machine of this process.
    let vm = unsafe { JavaVM::from_raw(app.vm_as_ptr().cast()) };
    vm.attach_current_thread(|env| {
        // SAFETY: the reference to the activity lives as long as `app`.
        let activity = unsafe { env.as_cast_raw::<Global<JObject>>(&activity)? };
        question(env, activity.as_ref())
    })
}
