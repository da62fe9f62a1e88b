//! The end of the program: messages about a failure, and exit codes that tell whose fault it was.

use std::borrow::Cow;
use std::io::ErrorKind;
use std::process::ExitCode;

use serde::Serialize;
use serde_json::{Value, json};

use crate::terminal::{note, print_json};

/// Text at the end of `--help`.
pub(crate) const AFTER_HELP: &str = "Exit codes:
  0  success
  1  unexpected failure
  2  wrong usage
  3  a file could not be read or written
  4  a file is damaged or of an unsupported kind
  5  an option or argument is out of range
  6  a size is over a limit
  7  an output exists and --overwrite was not given
  8  there is no GPU, the GPU failed, or there is no display for a window

A signal ends the program by the signal itself, for which a shell reports these codes:
  129  SIGHUP: the terminal was closed
  130  SIGINT: Ctrl-C was pressed
  143  SIGTERM: `kill` was used
After any code but 0 each output is either complete or missing. A file that was to be replaced is
as it was before.

Environment:
  LEXISPLAT_SIMD  The vector instructions to use: `plain`, `avx2` or `avx512` [default: the widest
                  that the CPU has]. Results do not depend on it.";

/// Advice for an output that exists.
const OVERWRITE: &str = "give --overwrite to replace it, or name another output";
/// Advice for work that a GPU cannot do.
const USE_CPU: &str = "--device cpu draws without a GPU";

/// The error for an output that exists.
#[derive(Debug, thiserror::Error)]
#[error("{0} exists")]
pub(crate) struct OutputExists(pub(crate) String);

/// The error for a folder in place of a scene's file.
#[derive(Debug, thiserror::Error)]
#[error("{folder}: this is a folder, not a file")]
pub(crate) struct IsFolder {
    pub(crate) folder: String,
    /// A file that may have been meant.
    pub(crate) example: String,
}

/// The error for files on the command line that cannot be used in this way.
#[derive(Debug, thiserror::Error)]
#[error("{problem}")]
pub(crate) struct Misuse {
    /// The fault, starting with the name of the file.
    pub(crate) problem: String,
    /// The probable intention, and the command line for it.
    pub(crate) help: String,
}

/// The kind of a failure: the cause of it. The number is the exit code. JSON has the name.
#[derive(Debug, Clone, Copy, Serialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Unexpected = 1,
    Usage,
    Io,
    Format,
    Parameter,
    Limit,
    Exists,
    Graphics,
}

/// The kind of an error, and advice against it.
type Blame = (Kind, Option<Cow<'static, str>>);

fn classify(error: &anyhow::Error) -> Blame {
    if error.is::<OutputExists>() {
        return (Kind::Exists, Some(OVERWRITE.into()));
    }
    if let Some(IsFolder { example, .. }) = error.downcast_ref() {
        return (Kind::Io, Some(format!("name a file in it, such as {example}").into()));
    }
    if let Some(misuse) = error.downcast_ref::<Misuse>() {
        return (Kind::Parameter, Some(misuse.help.clone().into()));
    }
    #[cfg(feature = "view")]
    if let Some(e) = error.downcast_ref::<lexisplat_view::Error>() {
        return view(e);
    }
    if let Some(e) = error.downcast_ref::<lexisplat_compress::Error>() {
        return compression(e);
    }
    if let Some(e) = error.downcast_ref::<lexisplat_render::Error>() {
        return render(e);
    }
    error.downcast_ref::<lexisplat::Error>().map_or((Kind::Unexpected, None), codec)
}

#[cfg(feature = "view")]
fn view(error: &lexisplat_view::Error) -> Blame {
    use lexisplat_view::Error;
    let advice = match error {
        Error::Codec(e) => return codec(e),
        Error::Render(e) => return render(e),
        Error::Eval(e) => return compression(e),
        Error::Exists(_) => return (Kind::Exists, Some(OVERWRITE.into())),
        Error::NoDisplay => {
            "a window needs X11 or Wayland (over ssh: `ssh -X`; without a display: `xvfb-run`); `lexisplat render` needs neither"
        }
        Error::NoAdapter => {
            "install drivers (Debian: apt install libegl1 libgl1-mesa-dri for OpenGL in software, libvulkan1 mesa-vulkan-drivers for Vulkan); `lexisplat render` needs none"
        }
        Error::Window(_) => {
            "a window on X11 also needs libxkbcommon-x11-0; `lexisplat render` draws without a window"
        }
        Error::Device(_) => USE_CPU,
        _ => return (Kind::Unexpected, None),
    };
    (Kind::Graphics, Some(advice.into()))
}

fn compression(error: &lexisplat_compress::Error) -> Blame {
    use lexisplat_compress::Error;
    match error {
        Error::Codec(e) => codec(e),
        Error::Render(e) => render(e),
        Error::Io { source, .. } => io(source),
        Error::Format { .. } => (Kind::Format, None),
        Error::Limit { .. } => (Kind::Limit, None),
        Error::Parameter { name, .. } => parameter(name),
        _ => (Kind::Parameter, None),
    }
}

/// Names that the library uses for values of scenes and cameras. No option has such a name, because these values come
/// from files.
const OF_FILES: [&str; 14] = [
    "values",
    "position",
    "rotation",
    "fx",
    "fy",
    "positions",
    "dc",
    "opacities",
    "scales",
    "rotations",
    "normals",
    "sh_rest",
    "extra",
    "geometry",
];

/// Returns the blame for the library's parameter `name`: a user's option or a file.
fn parameter(name: &str) -> Blame {
    match OF_FILES.contains(&name) {
        true => (
            Kind::Format,
            Some("this is of the scene or its cameras and not of an option: `lexisplat info` shows their ranges".into()),
        ),
        false => (Kind::Parameter, None),
    }
}

fn codec(error: &lexisplat::Error) -> Blame {
    use lexisplat::{Error, FileKind, FormatError};
    match error {
        Error::Io { source, .. } | Error::Writer { source } => io(source),
        Error::TemporaryFile { source, .. } if is_full(source) => (Kind::Io, Some(TEMPORARY_FILES.into())),
        Error::TemporaryFile { source, .. } => io(source),
        Error::Format { problem: FormatError::NotFinite { .. }, .. } => {
            (Kind::Format, Some("--drop-invalid leaves such Gaussians out".into()))
        }
        Error::Format { problem: FormatError::OtherKind { found, .. }, .. } => {
            let advice = match found {
                FileKind::Ply => Some("`lexisplat compress` makes a .lexi of a PLY".into()),
                FileKind::Lexi => Some("`lexisplat decompress` makes a PLY of a .lexi".into()),
                _ => Some("`lexisplat convert` reads and writes other formats".into()),
            };
            (Kind::Format, advice)
        }
        Error::Format { .. } => (Kind::Format, None),
        Error::Parameter { name, .. } => parameter(name),
        Error::Limit { name: Some(name), .. } => (
            Kind::Limit,
            Some(format!("if you trust the file, raise the limit with --limit {name}=N").into()),
        ),
        Error::Limit { .. } => (Kind::Limit, None),
        _ => (Kind::Unexpected, None),
    }
}

fn render(error: &lexisplat_render::Error) -> Blame {
    use lexisplat_render::Error;
    match error {
        Error::Codec(e) => codec(e),
        Error::Parameter { name: "device", .. } => {
            (Kind::Parameter, Some("`lexisplat devices` lists the devices".into()))
        }
        Error::Parameter { name, .. } => parameter(name),
        Error::GpuLimit { .. } => {
            (Kind::Limit, Some("--device cpu draws without the limits of a GPU".into()))
        }
        Error::Gpu { .. } => (Kind::Graphics, Some(USE_CPU.into())),
        _ => (Kind::Unexpected, None),
    }
}

/// The advice if there is no room for a temporary file.
const TEMPORARY_FILES: &str = "free space in that folder; temporary files lie beside the output, or in $TMPDIR if the output is standard output";

/// Returns whether the system found no space.
fn is_full(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded)
}

/// Returns the blame for an error of the system.
fn io(source: &std::io::Error) -> Blame {
    let advice = match source.kind() {
        // The output came into existence after the check.
        ErrorKind::AlreadyExists => return (Kind::Exists, Some(OVERWRITE.into())),
        _ if is_full(source) => "free space there, or name an output on another disk with -o",
        ErrorKind::FileTooLarge => {
            "the file system or a limit (`ulimit -f`) allows no file so large; name an output elsewhere with -o"
        }
        _ => return (Kind::Io, None),
    };
    (Kind::Io, Some(advice.into()))
}

/// Reports `error`, as a JSON object on standard output or as text on standard error. Returns its exit code.
pub(crate) fn report(error: &anyhow::Error, json: bool) -> ExitCode {
    // A reader that has closed the pipe needs no more output.
    if error.chain().any(|cause| {
        cause.downcast_ref::<std::io::Error>().is_some_and(|e| e.kind() == ErrorKind::BrokenPipe)
    }) {
        return ExitCode::SUCCESS;
    }
    let mut message = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        // Most errors already contain the text of their cause.
        if !message.contains(&cause) {
            message = format!("{message}: {cause}");
        }
    }
    let message = message.replace('\n', " ");
    let (kind, help) = classify(error);
    let help = help.as_deref();
    if !json || print_json(&object(kind, &message, help)).is_err() {
        note(&format!("error: {message}"));
        if let Some(help) = help {
            note(&format!("help: {help}"));
        }
    }
    ExitCode::from(kind as u8)
}

/// Reports an error of the command-line parser, or prints the help that was asked for. Returns the exit code.
pub(crate) fn report_usage(error: &clap::Error, json: bool) -> ExitCode {
    if !error.use_stderr() {
        let _ = error.print();
        return ExitCode::SUCCESS;
    }
    let text = error.render().to_string();
    // The paragraphs are: the error, a suggestion, and the usage.
    let mut paragraphs = text.split("\n\n").map(|part| part.split_whitespace().collect::<Vec<_>>().join(" "));
    let message = paragraphs.next().unwrap_or_default();
    let message = message.strip_prefix("error: ").unwrap_or(&message);
    let help = paragraphs.find_map(|part| part.strip_prefix("tip: ").map(str::to_owned));
    let help = help.unwrap_or_else(|| "--help lists the options".to_owned());
    if !json || print_json(&object(Kind::Usage, message, Some(&help))).is_err() {
        let _ = error.print();
    }
    ExitCode::from(Kind::Usage as u8)
}

fn object(kind: Kind, message: &str, help: Option<&str>) -> Value {
    let mut error = json!({ "code": kind as u8, "kind": kind, "message": message });
    if let Some(help) = help {
        error["help"] = help.into();
    }
    json!({ "error": error })
}
