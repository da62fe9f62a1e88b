//! The command line, as typed. Nothing here reads a file or prints.

mod compress;
mod convert;
mod draw;
mod eval;
mod html;
mod limits;
mod part;
mod values;
mod views;

use std::path::PathBuf;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use lexisplat::Limits;

pub(crate) use self::compress::{Compress, Decompress};
pub(crate) use self::convert::Convert;
#[cfg(feature = "view")]
pub(crate) use self::draw::View;
pub(crate) use self::draw::{Bench, Compare, Render};
pub(crate) use self::eval::{Eval, Measures, Sweep};
pub(crate) use self::html::Html;
pub(crate) use self::part::Part;
pub(crate) use self::values::ViewChoice;
use self::values::whole;
pub(crate) use self::views::Views;
use crate::exit::AFTER_HELP;

/// Compress trained 3D Gaussian Splatting scenes within an error bound; draw and compare them.
#[derive(Debug, Parser)]
#[command(name = "lexisplat", version, after_help = AFTER_HELP, max_term_width = 100)]
pub(crate) struct Cli {
    #[command(flatten)]
    pub(crate) common: Common,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Options that every command has.
#[derive(Debug, Args)]
#[command(next_help_heading = "Options of every command")]
pub(crate) struct Common {
    /// Print one JSON object on standard output instead of text. On failure its member `error` has the exit code as
    /// `code`, the `kind`, a `message`, and `help` if there is advice.
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Print no progress and no summary. Warnings and errors are still printed.
    #[arg(long, short, global = true)]
    pub(crate) quiet: bool,
    /// Number of worker threads, at most 4 for each core; 0 means one for each core. Results do not depend on this
    /// number.
    #[arg(long, global = true, default_value_t = 0, value_name = "N", value_parser = whole::<usize>(0..=u64::MAX))]
    pub(crate) threads: usize,
    /// Replace outputs that exist. Without this option an existing output is refused with exit code 7.
    #[arg(long, global = true)]
    pub(crate) overwrite: bool,
    /// Refuse with exit code 6 a file that asks for more than N. N is a number, or a size such as 2GiB. Example:
    /// --limit bytes=2GiB. The option may be given once for each NAME. The names and their defaults: `gaussians`
    /// (4294967294), `atoms` of a dictionary (1024), `nonzeros` of one Gaussian (72), `bytes` that a file takes in
    /// memory or that a pipe carries (no limit), `expansion`, the bytes in memory for each byte of a file (256),
    /// `header_bytes` (4MiB), and `properties` of one element of a PLY (4096).
    #[arg(long = "limit", global = true, value_name = "NAME=N", value_parser = limits::limit)]
    limits: Vec<limits::Limit>,
}

impl Common {
    /// Returns the limits on what files may ask for.
    ///
    /// # Errors
    /// An unknown name, which the parser of the command line has refused already.
    pub(crate) fn limits(&self) -> Result<Limits, lexisplat::Error> {
        limits::all(&self.limits)
    }
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Compress(Compress),
    Decompress(Decompress),
    Convert(Box<Convert>),
    Info(Info),
    Render(Render),
    Compare(Compare),
    Eval(Eval),
    Sweep(Box<Sweep>),
    Html(Html),
    #[cfg(feature = "view")]
    View(View),
    Devices(Devices),
    Bench(Bench),
    Demo(Demo),
    Completions(Completions),
    Man(Man),
}

impl Command {
    /// Returns whether the command opens a window in which the user acts while it runs.
    pub(crate) fn is_interactive(&self) -> bool {
        match self {
            #[cfg(feature = "view")]
            Self::View(_) => true,
            _ => false,
        }
    }
}

/// Print what the file of a scene holds, and warn about values that look wrong.
#[derive(Debug, Args)]
pub(crate) struct Info {
    /// The scene file, of any format; `-` reads standard input.
    pub(crate) file: PathBuf,
    /// Print all details: ranges of all attributes and histograms, and for a .lexi its attributes, layers and atoms.
    #[arg(long)]
    pub(crate) all: bool,
    /// Leave out Gaussians with NaN or infinite values. Without this option a file with such values is refused. Sizes
    /// of zero (scales of -inf) and infinite opacities are always read.
    #[arg(long)]
    pub(crate) drop_invalid: bool,
    /// Also verify the checksums of all decoded numbers of a packed file. The checksums of its bytes are always
    /// verified.
    #[arg(long)]
    pub(crate) verify: bool,
}

/// List the GPUs that can draw, the best first, with the numbers that --device takes.
#[derive(Debug, Args)]
pub(crate) struct Devices {}

/// Make a sample scene, compress, draw and compare it, and write a report as a web page.
#[derive(Debug, Args)]
pub(crate) struct Demo {
    /// Folder for all output of the demo.
    #[arg(short, long, default_value = "lexisplat-demo", value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Number of Gaussians in the scene.
    #[arg(long, default_value_t = 60_000, value_name = "N", value_parser = whole::<usize>(0..=u64::MAX))]
    pub(crate) gaussians: usize,
    /// Seed of the scene, and of the random choice of Gaussians from which the dictionary is learned.
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = whole::<u64>(0..=u64::MAX))]
    pub(crate) seed: u64,
}

/// Print the shell completions of this program.
#[derive(Debug, Args)]
pub(crate) struct Completions {
    /// The shell to print completions for.
    #[arg(value_enum)]
    pub(crate) shell: clap_complete::Shell,
}

/// Print the manual page of this program, or of one of its commands, in roff. `lexisplat man | man -l -` shows it.
#[derive(Debug, Args)]
pub(crate) struct Man {
    /// The command to print the page of.
    pub(crate) command: Option<String>,
}

/// Parses the command line of this process.
pub(crate) fn parse() -> Result<Cli, clap::Error> {
    let words = std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned());
    let with_advice = |error| with_advice_on_outputs(error, words);
    Cli::from_arg_matches(&command().try_get_matches().map_err(with_advice)?)
}

/// Adds advice on naming the output to `error`, if the command line `words` has one file too many, or `-o` where the
/// output is the last file.
fn with_advice_on_outputs(mut error: clap::Error, mut words: impl Iterator<Item = String>) -> clap::Error {
    let all = command();
    let Some(ContextValue::String(extra)) = error.get(ContextKind::InvalidArg) else { return error };
    let Some(command) = words.find_map(|word| all.find_subcommand(word)) else { return error };
    let has = |id: &str| command.get_arguments().any(|arg| arg.get_id() == id);
    let advice = match extra.as_str() {
        _ if error.kind() != ErrorKind::UnknownArgument => return error,
        "-o" | "--output" if has("files") => "the output is the last file, without -o".to_owned(),
        extra if !extra.starts_with('-') && has("output") => {
            format!("if this is the output, write -o {extra}")
        }
        _ => return error,
    };
    error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![advice.into()]));
    error
}

/// Returns the definition of the command line.
pub(crate) fn command() -> clap::Command {
    // A negative number is a value that is out of range, not an unknown option.
    let take_negative = |arg: clap::Arg| {
        let is_option = !arg.is_positional() && arg.get_action().takes_values();
        arg.allow_negative_numbers(is_option)
    };
    Cli::command().mut_args(take_negative).mut_subcommands(|command| command.mut_args(take_negative))
}

/// Returns whether the command line of this process has `--json`, also if the command line cannot be parsed.
pub(crate) fn asks_for_json() -> bool {
    std::env::args_os().take_while(|argument| argument != "--").any(|argument| argument == "--json")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_is_consistent() {
        command().debug_assert();
    }

    #[test]
    fn a_file_too_many_is_advised_of_the_output() {
        for (words, advice) in [
            (&["decompress", "a.lexi", "b.ply"][..], "write -o b.ply"),
            (&["convert", "a.ply", "-o", "b.spz"], "the output is the last file, without -o"),
            (&["info", "a.ply", "b.ply"], ""),
        ] {
            let error = command().try_get_matches_from([&["lexisplat"], words].concat()).unwrap_err();
            let error = with_advice_on_outputs(error, words.iter().map(ToString::to_string));
            let text = error.render().to_string();
            assert_eq!(text.contains("output"), !advice.is_empty(), "{text}");
            assert!(text.contains(advice), "{text}");
        }
    }

    #[test]
    fn the_program_allows_as_much_memory_as_the_library() {
        let Cli { command, .. } = Cli::try_parse_from(["lexisplat", "compress", "a.ply"]).unwrap();
        let Command::Compress(args) = command else { panic!("another command") };
        assert_eq!(args.memory, lexisplat_compress::DEFAULT_MEMORY);
    }

    #[test]
    fn every_option_and_command_has_a_help() {
        let every = command();
        for command in every.get_subcommands() {
            assert!(command.get_about().is_some(), "{}", command.get_name());
            for argument in command.get_arguments() {
                assert!(argument.get_help().is_some(), "{} {}", command.get_name(), argument.get_id());
            }
        }
    }
}
