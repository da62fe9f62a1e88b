//! How the program ends: one line of error, one of help, and a code that says whose fault it was.

use std::borrow::Cow;
use std::io::ErrorKind;
use std::process::ExitCode;

use crate::files::note;

/// Shown at the end of `--help`.
pub(crate) const AFTER_HELP: &str = "Exit codes:
  0  done
  1  unexpected failure
  2  wrong usage
  3  a file could not be read or written
  4  a file is damaged, or not of a supported kind
  5  an option or argument is out of range
  6  a size is over a limit
  7  an output exists and --overwrite was not given
  8  no GPU, or it failed; or no display to open a window on

Stopped by a signal, as a shell counts (the program ends by the signal itself, as its caller can tell):
  129  SIGHUP, when its terminal is closed
  130  SIGINT, which is Ctrl-C
  143  SIGTERM, what `kill` sends
With any code but 0 an output is whole or not there, and one that was to be replaced is as it was.

Environment:
  LEXISPLAT_SIMD  vector instructions: `plain`, `avx2` or `avx512` [default: the widest that the
                  CPU has]; results do not depend on it";

/// What to do about an output that is already there.
const OVERWRITE: &str = "give --overwrite to replace it, or another name";

/// An output that is already there.
#[derive(Debug)]
pub(crate) struct OutputExists(pub(crate) String);

impl std::fmt::Display for OutputExists {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} exists", self.0)
    }
}

impl std::error::Error for OutputExists {}

/// What to do about an error.
type Help = Cow<'static, str>;

/// Exit code of an error, and what to do about it.
fn classify(error: &anyhow::Error) -> (u8, Option<Help>) {
    if error.is::<OutputExists>() {
        return (7, Some(OVERWRITE.into()));
    }
    #[cfg(feature = "view")]
    if let Some(e) = error.downcast_ref::<lexisplat_view::Error>() {
        return view(e);
    }
    if let Some(e) = error.downcast_ref::<lexisplat_eval::Error>() {
        return eval(e);
    }
    if let Some(e) = error.downcast_ref::<lexisplat_render::Error>() {
        return render(e);
    }
    error.downcast_ref::<lexisplat::Error>().map_or((1, None), codec)
}

#[cfg(feature = "view")]
fn view(error: &lexisplat_view::Error) -> (u8, Option<Help>) {
    use lexisplat_view::Error;
    match error {
        Error::Codec(e) => codec(e),
        Error::Render(e) => render(e),
        Error::Eval(e) => eval(e),
        Error::Exists(_) => (7, Some(OVERWRITE.into())),
        Error::NoDisplay => (
            8,
            Some(
                "a window needs X11 or Wayland (over ssh: ssh -X; without any: xvfb-run); `lexisplat render` needs neither"
                    .into(),
            ),
        ),
        Error::NoAdapter => (
            8,
            Some(
                "install a Vulkan driver (Debian: apt install libvulkan1 mesa-vulkan-drivers); `lexisplat render` works without"
                    .into(),
            ),
        ),
        Error::Window(_) => {
            (8, Some("a window on X11 needs libxkbcommon-x11-0 too; `lexisplat render` works without any".into()))
        }
        Error::Device(_) => (8, Some("--device cpu draws without a GPU".into())),
        _ => (1, None),
    }
}

fn eval(error: &lexisplat_eval::Error) -> (u8, Option<Help>) {
    match error {
        lexisplat_eval::Error::Codec(e) => codec(e),
        lexisplat_eval::Error::Render(e) => render(e),
        lexisplat_eval::Error::Io { source, .. } => (3, io(source)),
        lexisplat_eval::Error::Format { .. } => (4, None),
        lexisplat_eval::Error::Limit { .. } => (6, None),
        _ => (5, None),
    }
}

/// What to do where no temporary file can be written.
const TEMPORARY_FILES: &str = "free space in that folder: temporary files lie beside the output, or in $TMPDIR if that is standard output";

/// Whether the system found no room.
fn is_full(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded)
}

/// What to do where the system did not write.
fn io(source: &std::io::Error) -> Option<Help> {
    match source.kind() {
        _ if is_full(source) => Some("free space there, or name an output on another disk with -o".into()),
        ErrorKind::FileTooLarge => Some(
            "the file system or a limit (`ulimit -f`) allows no file so large; name an output elsewhere with -o"
                .into(),
        ),
        _ => None,
    }
}

fn codec(error: &lexisplat::Error) -> (u8, Option<Help>) {
    use lexisplat::{Error, FormatError};
    match error {
        // Outputs that came into being after they were looked for.
        Error::Io { source, .. } if source.kind() == ErrorKind::AlreadyExists => (7, Some(OVERWRITE.into())),
        Error::Io { source, .. } | Error::Writer { source } => (3, io(source)),
        Error::TemporaryFile { source, .. } if is_full(source) => (3, Some(TEMPORARY_FILES.into())),
        Error::TemporaryFile { source, .. } => (3, io(source)),
        Error::Format { problem: FormatError::NotFinite { .. }, .. } => {
            (4, Some("--drop-invalid leaves such Gaussians out".into()))
        }
        Error::Format { .. } => (4, Some("`lexisplat info FILE` says more about a file".into())),
        Error::Parameter { .. } => (5, None),
        Error::Limit { name: Some(name), .. } => {
            (6, Some(format!("if you trust the file, raise the limit with --limit {name}=N").into()))
        }
        Error::Limit { .. } => (6, None),
        _ => (1, None),
    }
}

fn render(error: &lexisplat_render::Error) -> (u8, Option<Help>) {
    match error {
        lexisplat_render::Error::Io { source, .. } => (3, io(source)),
        lexisplat_render::Error::Format { .. } => (4, None),
        lexisplat_render::Error::Parameter { name: "device", .. } => {
            (5, Some("`lexisplat devices` lists what there is".into()))
        }
        lexisplat_render::Error::Parameter { .. } => (5, None),
        lexisplat_render::Error::Limit { .. } => (6, None),
        lexisplat_render::Error::GpuLimit { .. } => {
            (6, Some("--device cpu draws without a GPU's limits".into()))
        }
        lexisplat_render::Error::Gpu { .. } => (8, Some("--device cpu draws without a GPU".into())),
        _ => (1, None),
    }
}

/// Prints `error` and gives its exit code.
pub(crate) fn report(error: &anyhow::Error) -> ExitCode {
    // A reader that closed the pipe has seen enough.
    if error.chain().any(|cause| {
        cause.downcast_ref::<std::io::Error>().is_some_and(|e| e.kind() == ErrorKind::BrokenPipe)
    }) {
        return ExitCode::SUCCESS;
    }
    let (code, help) = classify(error);
    let mut line = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        // Most errors already say what their cause said.
        if !line.contains(&cause) {
            line = format!("{line}: {cause}");
        }
    }
    note(&format!("error: {}", line.replace('\n', " ")));
    if let Some(help) = help {
        note(&format!("help: {help}"));
    }
    ExitCode::from(code)
}
