//! Progress bars: on a terminal, for work over a second, unless asked to be quiet.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use lexisplat::{Progress, Stage};

use crate::files::note;

/// Work shorter than this shows no bar.
const PATIENCE: Duration = Duration::from_secs(1);

/// The bar on the screen.
static SHOWN: Mutex<Option<ProgressBar>> = Mutex::new(None);

/// Takes the bar off the screen, for a program that is about to end.
pub(crate) fn clear() {
    if let Some(bar) = SHOWN.lock().unwrap_or_else(PoisonError::into_inner).take() {
        bar.finish_and_clear();
    }
}

/// A bar that appears when the work turns out to be long.
#[derive(Debug, Default)]
pub(crate) struct Bars {
    quiet: bool,
    current: Mutex<Option<Bar>>,
}

#[derive(Debug)]
struct Bar {
    bar: ProgressBar,
    start: Instant,
    shown: bool,
}

impl Bars {
    pub(crate) fn new(quiet: bool) -> Self {
        Self { quiet, current: Mutex::default() }
    }

    /// Starts a bar over `total` units called `unit`.
    pub(crate) fn start(&self, label: &str, unit: &str, total: u64) {
        if self.quiet {
            return;
        }
        let template =
            format!("{{msg:>10}} {{bar:32}} {{human_pos}}/{{human_len}} {unit} ({{per_sec}}, {{eta}} left)");
        let style = ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::hidden());
        bar.set_style(style);
        bar.set_message(label.to_owned());
        self.set(Some(Bar { bar, start: Instant::now(), shown: false }));
    }

    /// Says what is being done now, in front of the bar.
    pub(crate) fn say(&self, what: &str) {
        let current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(bar) = current.as_ref() {
            bar.bar.set_message(what.to_owned());
        }
    }

    /// Prints a line to standard error, above the bar if it is shown.
    pub(crate) fn aside(&self, line: &str) {
        let current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        match current.as_ref() {
            Some(bar) if bar.shown => bar.bar.suspend(|| note(line)),
            _ => note(line),
        }
    }

    fn set(&self, new: Option<Bar>) {
        // A thread that panicked while holding the lock leaves at worst a bar on the screen.
        let mut current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(old) = current.take() {
            clear();
            old.bar.finish_and_clear();
        }
        *current = new;
    }
}

impl Progress for Bars {
    fn begin(&self, stage: Stage, total: u64) {
        let (label, unit) = match stage {
            Stage::Learn => ("learning", "rounds"),
            Stage::Look => ("looking", "Gaussians"),
            Stage::Draw => ("looking", "views"),
            Stage::Code => ("coding", "Gaussians"),
            Stage::Read => ("reading", "bytes"),
            Stage::Write => ("writing", "bytes"),
            _ => ("working", "steps"),
        };
        self.start(label, unit, total);
    }

    fn advance(&self, units: u64) {
        let mut current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(bar) = current.as_mut() {
            bar.bar.inc(units);
            if !bar.shown && bar.start.elapsed() > PATIENCE {
                // Indicatif itself stays silent when standard error is no terminal.
                bar.bar.set_draw_target(ProgressDrawTarget::stderr());
                bar.shown = true;
                *SHOWN.lock().unwrap_or_else(PoisonError::into_inner) = Some(bar.bar.clone());
            }
        }
    }

    fn end(&self) {
        self.set(None);
    }
}
