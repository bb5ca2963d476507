//! How far a measurement has come, on stderr.

use std::{cell::Cell, time::Duration};

use indicatif::{ProgressBar, ProgressStyle};

/// Ticks of the bar in a step.
const TICKS: u64 = 100;

/// A bar of steps; a line for each step where stderr is a file.
pub(crate) struct Progress {
    bar: ProgressBar,
    begun: Cell<u64>,
}

impl Progress {
    pub(crate) fn new(steps: u64) -> Self {
        let bar = ProgressBar::new(steps * TICKS);
        let style =
            ProgressStyle::with_template("{elapsed_precise} {wide_bar} {percent:>3} % {msg}");
        // The template is one that indicatif knows, as every run shows.
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.enable_steady_tick(Duration::from_millis(250));
        Self {
            bar,
            begun: Cell::new(0),
        }
    }

    /// A step begins; the one before it is done.
    pub(crate) fn step(&self, what: &str) {
        self.bar.set_position(self.begun.get() * TICKS);
        self.begun.set(self.begun.get() + 1);
        self.bar.set_message(what.to_owned());
        if self.bar.is_hidden() {
            eprintln!("{what}");
        }
    }

    /// How much of the step is done.
    pub(crate) fn within(&self, share: f32) {
        let done = self.begun.get().saturating_sub(1) * TICKS;
        self.bar
            .set_position(done + (share.clamp(0.0, 1.0) * TICKS as f32) as u64);
    }

    /// Something to remember.
    pub(crate) fn say(&self, what: &str) {
        if self.bar.is_hidden() {
            eprintln!("{what}");
        } else {
            self.bar.println(what);
        }
    }

    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
