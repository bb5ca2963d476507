//! The line at the bottom of the terminal.

use std::{
    cell::Cell,
    io::IsTerminal,
    time::{Duration, Instant},
};

use indicatif::{ProgressBar, ProgressStyle};

/// Between two lines where stderr is a file.
const QUIET_INTERVAL: Duration = Duration::from_secs(5);
/// Between two renewals of the live line.
const LIVE_INTERVAL: Duration = Duration::from_millis(250);

/// What the program is doing, on stderr.
pub(crate) struct Status {
    bar: ProgressBar,
    terminal: bool,
    last: Cell<Option<Instant>>,
}

impl Status {
    pub(crate) fn new() -> Self {
        let bar = ProgressBar::new_spinner();
        bar.enable_steady_tick(Duration::from_millis(120));
        Self {
            bar,
            terminal: std::io::stderr().is_terminal(),
            last: Cell::new(None),
        }
    }

    /// Replaces the line.
    pub(crate) fn say(&self, what: &str) {
        self.bar.set_message(what.to_owned());
        if !self.terminal {
            eprintln!("{what}");
        }
    }

    /// A line that stays.
    pub(crate) fn print(&self, line: &str) {
        self.bar.suspend(|| eprintln!("{line}"));
    }

    /// Renews the live line, not more often than one can read it.
    pub(crate) fn live(&self, line: impl FnOnce() -> String) {
        let interval = if self.terminal {
            LIVE_INTERVAL
        } else {
            QUIET_INTERVAL
        };
        if self
            .last
            .get()
            .is_none_or(|last| last.elapsed() >= interval)
        {
            self.last.set(Some(Instant::now()));
            self.say(&line());
        }
    }

    /// A bar for something whose share done is known.
    pub(crate) fn progress(&self, what: &str) -> impl Fn(f32) + use<> {
        self.say(what);
        let style = ProgressStyle::with_template("{msg} [{bar:30}] {percent} %")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = ProgressBar::new(100)
            .with_style(style)
            .with_message(what.to_owned());
        move |share| {
            bar.set_position((share * 100.0) as u64);
            if share >= 1.0 {
                bar.finish_and_clear();
            }
        }
    }

    /// Leaves no line behind.
    pub(crate) fn clear(&self) {
        self.bar.finish_and_clear();
    }
}
