//! Ctrl-C, as something to ask for once a display frame.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use anyhow::{Context, Result};

/// Whether the user wants to leave.
#[derive(Clone, Debug)]
pub(crate) struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Listens from now on.
    pub(crate) fn watch() -> Result<Self> {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .context("cannot listen for Ctrl-C")?;
        let interrupt = Self(Arc::default());
        let came = Arc::clone(&interrupt.0);
        std::thread::Builder::new()
            .name("interrupt".into())
            .spawn(move || {
                // Without a handler, Ctrl-C ends the program as it always does.
                while runtime.block_on(tokio::signal::ctrl_c()).is_ok() {
                    came.store(true, Relaxed);
                }
            })
            .context("cannot listen for Ctrl-C")?;
        Ok(interrupt)
    }

    /// True from the first Ctrl-C on.
    pub(crate) fn came(&self) -> bool {
        self.0.load(Relaxed)
    }
}
