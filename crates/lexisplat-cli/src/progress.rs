//! Progress on standard error. On a terminal a bar moves as long as the command works. Otherwise a line is printed every
//! ten seconds.

use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use lexisplat::{Progress, Stage};
use lexisplat_eval::format;

use crate::bar::{self, lock};
use crate::terminal::note;

/// Duration of the longest command without a bar.
const PATIENCE: Duration = Duration::from_secs(1);
/// Time between two updates of the bar.
const TICK: Duration = Duration::from_millis(100);
/// Time between two lines if standard error is not a terminal.
const LINE_INTERVAL: Duration = Duration::from_secs(10);
/// Width of a bar, in characters.
const WIDTH: usize = 24;
/// Width of the moving block for work that is not counted, in characters.
const BLOCK: usize = 4;
const FULL: &str = "█";
const EMPTY: &str = "░";
/// Shortest time from which a rate is computed. The first units of a step may be faster than the others.
const LEAST_TIMED: Duration = Duration::from_millis(500);

/// The current work of the command.
static WORK: Mutex<Work> = Mutex::new(Work { outer: None, steps: Vec::new() });
/// The current work of a command: steps within one another, which may be part of larger work with several parts.
#[derive(Debug)]
struct Work {
    outer: Option<Step>,
    /// The current steps. Each is a part of the one before.
    steps: Vec<Step>,
}

/// Work that is counted.
#[derive(Debug)]
struct Step {
    label: String,
    unit: String,
    /// Number of units; 0 if it is not known.
    total: u64,
    done: u64,
    /// The PSNR of pictures so far, in dB, if it is told.
    quality: Option<f64>,
    start: Instant,
}

impl Step {
    fn new(label: &str, unit: &str, total: u64) -> Self {
        let label = format::escape(label).into_owned();
        Self { label, unit: unit.to_owned(), total, done: 0, quality: None, start: Instant::now() }
    }

    /// Returns the work and how much of it is done, as text.
    fn text(&self) -> String {
        let (label, unit) = (&self.label, &self.unit);
        let done = format::count(self.done);
        let text = match self.total {
            0 => format!("{label}, {done} {unit}"),
            total => format!("{label}, {done} of {} {unit}", format::count(total)),
        };
        match self.quality {
            Some(decibels) => format!("{text}, {decibels:.1} dB"),
            None => text,
        }
    }

    /// Returns the time for the remaining units, at the mean rate during `elapsed`.
    fn left(&self, elapsed: Duration) -> Option<Duration> {
        let rest = self.total.checked_sub(self.done).filter(|_| self.total > 0)?;
        if self.done == 0 || elapsed < LEAST_TIMED {
            return None;
        }
        Duration::try_from_secs_f64(elapsed.as_secs_f64() * rest as f64 / self.done as f64).ok()
    }

    /// Returns the share that is done, if it is known.
    fn share(&self) -> Option<f64> {
        (self.total > 0).then(|| (self.done as f64 / self.total as f64).min(1.0))
    }
}

impl Work {
    /// Returns all current work, the largest first.
    fn all(&self) -> impl Iterator<Item = &Step> {
        self.outer.iter().chain(&self.steps)
    }

    /// Returns the work and how much of it is done, as text.
    fn text(&self) -> String {
        let steps: Vec<String> = self.all().map(Step::text).collect();
        if steps.is_empty() { "working".to_owned() } else { steps.join("; ") }
    }

    /// Returns the line on a terminal at the time `now`, for a command that started at `start`: a bar, the work that is
    /// done, and the time left.
    fn line(&self, start: Instant, now: Instant) -> String {
        let since = |from: Instant| now.saturating_duration_since(from);
        let left = self.all().find_map(|step| step.left(since(step.start)));
        let left = match left {
            Some(left) => format!("about {} left", seconds(left)),
            None => "time left not known yet".to_owned(),
        };
        let whole = if self.outer.is_none() && !self.steps.is_empty() { " of this step" } else { "" };
        let bar = self.all().next().and_then(Step::share).map_or_else(|| moving(since(start)), filled);
        format!("{bar} {}, {left}{whole}, {} so far", self.text(), seconds(since(start)))
    }
}

/// Returns a bar that is filled to `share`.
fn filled(share: f64) -> String {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to the width")]
    let full = (share.clamp(0.0, 1.0) * WIDTH as f64) as usize;
    format!("{}{}", FULL.repeat(full), EMPTY.repeat(WIDTH - full))
}

/// Returns a bar with a block that moves to and fro.
fn moving(elapsed: Duration) -> String {
    let columns = WIDTH - BLOCK;
    let step = usize::try_from(elapsed.as_millis() / TICK.as_millis()).unwrap_or(0) % (2 * columns);
    let at = if step < columns { step } else { 2 * columns - step };
    format!("{}{}{}", EMPTY.repeat(at), FULL.repeat(BLOCK), EMPTY.repeat(columns - at))
}

/// Returns a time in whole seconds, or in minutes and hours, as text.
fn seconds(time: Duration) -> String {
    let all = time.as_secs();
    match (all / 3600, all / 60 % 60, all % 60) {
        (0, 0, s) => format!("{s} s"),
        (0, m, s) => format!("{m} min {s:02} s"),
        (h, m, _) => format!("{h} h {m:02} min"),
    }
}

/// Starts to show the work of the command: on a terminal as a bar, otherwise as a line every ten seconds.
pub(crate) fn show() {
    let start = Instant::now();
    let terminal = std::io::stderr().is_terminal();
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden());
    bar.set_style(
        ProgressStyle::with_template("{wide_msg}").unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    if terminal {
        bar::set(bar.clone());
    }
    // If the thread cannot be started, nothing is shown, and everything else works. The thread ends with the program.
    let _ = std::thread::Builder::new().name("progress".to_owned()).spawn(move || {
        if !terminal {
            loop {
                std::thread::sleep(LINE_INTERVAL);
                let what = lock(&WORK).text();
                note(&format!("progress: {what}, {} s since the start", start.elapsed().as_secs()));
            }
        }
        std::thread::sleep(PATIENCE);
        bar.set_draw_target(ProgressDrawTarget::stderr());
        while !bar.is_finished() {
            let line = lock(&WORK).line(start, Instant::now());
            bar.set_message(line);
            bar.tick();
            std::thread::sleep(TICK);
        }
    });
}

/// Reports the steps of a command, unless the command is quiet.
#[derive(Debug)]
pub(crate) struct Bars {
    quiet: bool,
}

impl Bars {
    pub(crate) fn new(quiet: bool) -> Self {
        Self { quiet }
    }

    /// Starts a step of `total` units called `unit`; 0 if the number is not known. It is a part of the current step, if there is one.
    pub(crate) fn start(&self, label: &str, unit: &str, total: u64) {
        if !self.quiet {
            lock(&WORK).steps.push(Step::new(label, unit, total));
        }
    }

    /// Starts `total` parts called `unit`. Steps follow within each part.
    pub(crate) fn start_parts(&self, label: &str, unit: &str, total: u64) {
        if !self.quiet {
            *lock(&WORK) = Work { outer: Some(Step::new(label, unit, total)), steps: Vec::new() };
        }
    }

    /// Changes the label of the parts.
    pub(crate) fn say(&self, label: &str) {
        if let Some(outer) = lock(&WORK).outer.as_mut() {
            outer.label = format::escape(label).into_owned();
        }
    }

    /// Reports that one more part is done.
    pub(crate) fn part_done(&self) {
        let mut work = lock(&WORK);
        work.steps.clear();
        if let Some(outer) = work.outer.as_mut() {
            outer.done += 1;
        }
    }

    /// Reports the end of all parts.
    pub(crate) fn end_parts(&self) {
        *lock(&WORK) = Work { outer: None, steps: Vec::new() };
    }
}

impl Progress for Bars {
    fn begin(&self, stage: Stage, total: u64) {
        let (label, unit) = match stage {
            Stage::Read => ("reading", "bytes"),
            Stage::Learn => ("learning", "rounds"),
            Stage::Look => ("looking", "Gaussians"),
            Stage::Refine => ("refining", "steps"),
            Stage::Draw => ("drawing", "views"),
            Stage::Code => ("coding", "Gaussians"),
            Stage::Write => ("writing", "bytes"),
            Stage::Score => ("scoring", "views"),
            _ => ("working", "steps"),
        };
        self.start(label, unit, total);
    }

    fn advance(&self, units: u64) {
        if let Some(step) = lock(&WORK).steps.last_mut() {
            step.done += units;
        }
    }

    fn quality(&self, decibels: f64) {
        if let Some(step) = lock(&WORK).steps.last_mut() {
            step.quality = Some(decibels);
        }
    }

    fn end(&self) {
        lock(&WORK).steps.pop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_say_what_is_done_of_what() {
        let text = || lock(&WORK).text();
        let bars = Bars::new(false);
        bars.begin(Stage::Code, 90_000);
        bars.advance(1234);
        assert_eq!(text(), "coding, 1,234 of 90,000 Gaussians");
        bars.quality(41.96);
        assert_eq!(text(), "coding, 1,234 of 90,000 Gaussians, 42.0 dB");
        bars.end();
        bars.begin(Stage::Read, 0);
        assert_eq!(text(), "reading, 0 bytes");
        bars.end();
        assert_eq!(text(), "working");
        bars.begin(Stage::Look, 2000);
        bars.begin(Stage::Refine, 800);
        bars.advance(30);
        bars.quality(38.0);
        assert_eq!(text(), "looking, 0 of 2,000 Gaussians; refining, 30 of 800 steps, 38.0 dB");
        bars.end();
        bars.advance(1000);
        assert_eq!(text(), "looking, 1,000 of 2,000 Gaussians");
        bars.end();
        bars.start_parts("sweeping", "parts", 12);
        bars.say("scene\u{1b}");
        bars.begin(Stage::Draw, 100);
        bars.advance(3);
        assert_eq!(text(), r"scene\u001b, 0 of 12 parts; drawing, 3 of 100 views");
        bars.part_done();
        assert_eq!(text(), r"scene\u001b, 1 of 12 parts");
        bars.end_parts();
        assert_eq!(text(), "working");
    }

    #[test]
    fn a_bar_moves_and_tells_the_time_left_whatever_is_done() {
        let start = Instant::now();
        let at = |seconds| start + Duration::from_secs(seconds);
        let step = |done, total| Step { done, start, ..Step::new("drawing", "views", total) };
        let nothing = Work { outer: None, steps: Vec::new() };
        let idle = [at(5), at(5) + TICK].map(|now| nothing.line(start, now));
        assert_ne!(idle[0], idle[1], "it moves");
        assert!(idle[0].ends_with(" working, time left not known yet, 5 s so far"), "{}", idle[0]);
        let one = Work { outer: None, steps: vec![step(25, 100)] };
        let line = one.line(start, at(20));
        assert!(line.starts_with(&format!("{}{}", FULL.repeat(6), EMPTY.repeat(18))), "{line}");
        assert!(
            line.ends_with("drawing, 25 of 100 views, about 1 min 00 s left of this step, 20 s so far"),
            "{line}"
        );
        // While no outer unit is done, the time left is that of the step.
        let both = |done| Work { outer: Some(step(done, 4)), steps: vec![step(50, 100)] };
        assert!(
            both(0).line(start, at(20)).contains(", about 20 s left, "),
            "{}",
            both(0).line(start, at(20))
        );
        assert!(both(1).line(start, at(20)).contains(", about 1 min 00 s left, "));
        assert_eq!(seconds(Duration::from_secs(7384)), "2 h 03 min");
        assert_eq!(filled(2.0).chars().count(), WIDTH);
        let widths: Vec<usize> = (0..99).map(|k| moving(TICK * k).chars().count()).collect();
        assert!(widths.iter().all(|width| *width == WIDTH), "{widths:?}");
    }
}
