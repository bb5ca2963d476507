//! The server's line: from the intent that started the activity, from a file in
//! the app's folder, or as it was the last time.
//!
//! ```text
//! adb shell am start -S -n org.shadecast.client/android.app.NativeActivity --es server "'shadecast://…'"
//! adb push server.txt /sdcard/Android/data/org.shadecast.client/files/server.txt
//! ```

use std::path::PathBuf;

use android_activity::AndroidApp;
use jni::objects::{JObject, JString};
use jni::refs::Global;
use jni::{JavaVM, jni_sig, jni_str};
use shadecast_client::settings::{NoServer, Place, server_line};
use shadecast_transport::ServerLine;

/// Its name in either folder.
const FILE: &str = "server.txt";

/// Finds the line, and remembers it for the next start.
pub(crate) fn find(app: &AndroidApp) -> Result<ServerLine, NoServer> {
    let file = app.external_data_path().map(|folder| folder.join(FILE));
    let memory = app.internal_data_path().map(|folder| folder.join(FILE));
    let read = |path: &Option<PathBuf>| std::fs::read_to_string(path.as_ref()?).ok();
    let line = server_line(&[
        Place {
            name: "the extra \"server\" of the intent".into(),
            text: from_intent(app),
        },
        Place {
            name: file.as_ref().map_or_else(
                || FILE.into(),
                |path| format!("the file {}", path.display()),
            ),
            text: read(&file),
        },
        Place {
            name: "what was remembered".into(),
            text: read(&memory),
        },
    ])?;
    if let Some(memory) = memory
        && let Err(error) = std::fs::write(&memory, line.to_string())
    {
        tracing::warn!("the server will not be remembered: {error}");
    }
    Ok(line)
}

/// `getIntent().getStringExtra("server")`.
fn from_intent(app: &AndroidApp) -> Option<String> {
    let activity = app.activity_as_ptr() as jni::sys::jobject;
    // SAFETY: android-activity gives the virtual machine of this process.
    let vm = unsafe { JavaVM::from_raw(app.vm_as_ptr().cast()) };
    let extra = vm.attach_current_thread(|env| -> jni::errors::Result<Option<String>> {
        // SAFETY: the reference to the activity lives as long as `app`.
        let activity = unsafe { env.as_cast_raw::<Global<JObject>>(&activity)? };
        let intent = env
            .call_method(
                activity.as_ref(),
                jni_str!("getIntent"),
                jni_sig!("()Landroid/content/Intent;"),
                &[],
            )?
            .l()?;
        if intent.is_null() {
            return Ok(None);
        }
        let name = env.new_string("server")?;
        let extra = env
            .call_method(
                &intent,
                jni_str!("getStringExtra"),
                jni_sig!("(Ljava/lang/String;)Ljava/lang/String;"),
                &[(&name).into()],
            )?
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
