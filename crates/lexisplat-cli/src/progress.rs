//! Progress on standard error: a bar on a terminal, otherwise a line every ten seconds.

use std::io::IsTerminal;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use lexisplat::{Progress, Stage};
use lexisplat_eval::format;

use crate::terminal::note;

/// A stage shorter than this shows no bar.
const PATIENCE: Duration = Duration::from_secs(1);
/// Time between two lines where standard error is no terminal.
const LINE_INTERVAL: Duration = Duration::from_secs(10);

/// The stage that the command is in.
static CURRENT: Mutex<Option<Current>> = Mutex::new(None);

#[derive(Debug)]
struct Current {
    label: String,
    unit: String,
    /// Counts the units, also while it is not shown.
    bar: ProgressBar,
    start: Instant,
    shown: bool,
}

/// Locks [`CURRENT`]. A thread that panicked while it held the lock leaves at worst a bar on the screen.
fn current() -> MutexGuard<'static, Option<Current>> {
    CURRENT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Ends the current stage and takes its bar off the screen.
pub(crate) fn clear() {
    if let Some(stage) = current().take() {
        stage.bar.finish_and_clear();
    }
}

/// Prints a line every ten seconds from now on, if standard error is no terminal.
pub(crate) fn start_lines() {
    if std::io::stderr().is_terminal() {
        return;
    }
    let start = Instant::now();
    // Without the thread there are no lines, and everything else is as usual. The thread ends with the program.
    let _ = std::thread::Builder::new().name("progress".to_owned()).spawn(move || {
        loop {
            std::thread::sleep(LINE_INTERVAL);
            let seconds = start.elapsed().as_secs();
            let stage = current().as_ref().map_or_else(|| "working".to_owned(), Current::text);
            note(&format!("progress: {stage}, {seconds} s since the start"));
        }
    });
}

impl Current {
    /// What is being done, and how much of it is done.
    fn text(&self) -> String {
        let (label, unit) = (&self.label, &self.unit);
        let done = format::count(self.bar.position());
        match self.bar.length() {
            Some(total) if total > 0 => format!("{label}, {done} of {} {unit}", format::count(total)),
            _ => format!("{label}, {done} {unit}"),
        }
    }
}

/// Shows the stages of a command, unless it was asked to be quiet.
#[derive(Debug)]
pub(crate) struct Bars {
    quiet: bool,
}

impl Bars {
    pub(crate) fn new(quiet: bool) -> Self {
        Self { quiet }
    }

    /// Starts a stage of `total` units called `unit`; 0 if their number is not known.
    pub(crate) fn start(&self, label: &str, unit: &str, total: u64) {
        if self.quiet {
            return;
        }
        clear();
        let template =
            format!("{{msg:>10}} {{bar:32}} {{human_pos}}/{{human_len}} {unit} ({{per_sec}}, {{eta}} left)");
        let style = ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::hidden());
        bar.set_style(style);
        let stage =
            Current { label: String::new(), unit: unit.to_owned(), bar, start: Instant::now(), shown: false };
        *current() = Some(stage);
        self.say(label);
    }

    /// Changes the label of the current stage.
    pub(crate) fn say(&self, label: &str) {
        if let Some(stage) = current().as_mut() {
            stage.label = format::escape(label).into_owned();
            stage.bar.set_message(stage.label.clone());
        }
    }

    /// Prints a line to standard error, above the bar if it is shown.
    pub(crate) fn aside(&self, line: &str) {
        match current().as_ref() {
            Some(stage) if stage.shown => stage.bar.suspend(|| note(line)),
            _ => note(line),
        }
    }
}

impl Progress for Bars {
    fn begin(&self, stage: Stage, total: u64) {
        let (label, unit) = match stage {
            Stage::Read => ("reading", "bytes"),
            Stage::Learn => ("learning", "rounds"),
            Stage::Look => ("looking", "Gaussians"),
            Stage::Draw => ("drawing", "views"),
            Stage::Code => ("coding", "Gaussians"),
            Stage::Write => ("writing", "bytes"),
            _ => ("working", "steps"),
        };
        self.start(label, unit, total);
    }

    fn advance(&self, units: u64) {
        if let Some(stage) = current().as_mut() {
            stage.bar.inc(units);
            if !stage.shown && stage.start.elapsed() > PATIENCE {
                // Indicatif itself stays silent when standard error is no terminal.
                stage.bar.set_draw_target(ProgressDrawTarget::stderr());
                stage.shown = true;
            }
        }
    }

    fn end(&self) {
        clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_say_what_is_done_of_what() {
        let bars = Bars::new(false);
        bars.begin(Stage::Code, 90_000);
        bars.advance(1234);
        assert_eq!(current().as_ref().map(Current::text).unwrap(), "coding, 1,234 of 90,000 Gaussians");
        bars.say("scene\u{1b}");
        assert_eq!(current().as_ref().map(Current::text).unwrap(), r"scene\u001b, 1,234 of 90,000 Gaussians");
        bars.begin(Stage::Read, 0);
        assert_eq!(current().as_ref().map(Current::text).unwrap(), "reading, 0 bytes");
        bars.end();
        assert!(current().is_none());
    }
}
