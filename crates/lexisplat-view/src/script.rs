//! Scripts: commands as text, which are carried out one after another.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::str::FromStr;

use lexisplat::{Error, Result, ShDegree};
use lexisplat_render::Pose;

use crate::command::{Command, Mode, Quality, Slot};
use crate::keys;

/// The words of a script and their meanings, for `--help`.
pub const WORDS: &str = "\
Words of a script, separated by commas. Each is carried out when the picture of the one before is complete:
  camera=N              choose camera N, from 0
  view=POSE             move the free camera to a place of a link, as report prints it
  orbit=RIGHT:DOWN      orbit by degrees
  frame                 look at the whole scene in the direction of the view
  mode=NAME             first, second, side, wipe or difference
  split=F               move the wipe's line to F: 0 is the left edge, 1 the right
  gain=F                multiply differences by F
  degree=N              draw with SH up to degree N; all: with all
  background=R:G:B      colour behind the scene, each 0 to 1
  key=K                 press a key, such as ] or P
  open=FILE, open2=FILE open a file as the first or second model
  drop=FILE             drop a file on the window
  compress=NAME         make the second model from the first with a preset: small, balanced, high, archive
  tolerance=F           the same with exact geometry and SH errors of at most F
  screenshot=FILE       save the picture; without =FILE under a generated name
  report                print what is shown as a JSON object on standard output
  quit                  close the window
An error ends the script and the program.";

/// The remaining commands of a script.
pub type Script = VecDeque<Command>;

/// Parses the commands of `text`, which are separated by commas.
///
/// # Errors
/// [`Error::Parameter`] with the word that is not valid.
pub fn parse(text: &str) -> Result<Script> {
    text.split(',').map(str::trim).filter(|word| !word.is_empty()).map(|text| word("actions", text)).collect()
}

/// Parses one word. Errors name `parameter` as the wrong parameter.
pub(crate) fn word(parameter: &'static str, word: &str) -> Result<Command> {
    let wrong = |expected: &str| Error::parameter(parameter, word, expected);
    let (name, value) = word.split_once('=').map_or((word, None), |(name, value)| (name, Some(value)));
    let file = || value.filter(|v| !v.is_empty()).map(PathBuf::from).ok_or_else(|| wrong("a file's name"));
    Ok(match name {
        "camera" => Command::Camera(number(value).ok_or_else(|| wrong("a camera's number, from 0"))?),
        "orbit" => Command::Orbit(numbers(value).ok_or_else(|| wrong("two numbers of degrees"))?),
        "view" => {
            let pose = value.and_then(Pose::parse);
            Command::View(pose.ok_or_else(|| wrong("the nine numbers of a view, as a link has them"))?)
        }
        "frame" => Command::Frame,
        "mode" => {
            let found = Mode::ALL.into_iter().find(|mode| Some(mode.name()) == value);
            Command::Mode(found.ok_or_else(|| wrong("first, second, side, wipe or difference"))?)
        }
        "split" => Command::Split(number(value).ok_or_else(|| wrong("a number from 0 to 1"))?),
        "gain" => Command::Gain(number(value).ok_or_else(|| wrong("a number"))?),
        "degree" if value == Some("all") => Command::Degree(None),
        "degree" => {
            let degree = number(value).and_then(|d: u8| ShDegree::new(d).ok());
            Command::Degree(Some(degree.ok_or_else(|| wrong("an SH degree"))?))
        }
        "background" => {
            Command::Background(numbers(value).ok_or_else(|| wrong("three numbers from 0 to 1"))?)
        }
        "key" => {
            let command = value.and_then(keys::command_of_key);
            command.ok_or_else(|| wrong("a key that has a command"))?
        }
        "open" => Command::Open(file()?, Slot::First),
        "open2" => Command::Open(file()?, Slot::Second),
        "drop" => Command::Drop { paths: vec![file()?], first: false },
        "compress" => {
            let preset = value.unwrap_or_default().parse();
            Command::Compress(Quality::Preset(preset.map_err(|_| wrong("a preset's name"))?))
        }
        "tolerance" => {
            Command::Compress(Quality::Tolerance(number(value).ok_or_else(|| wrong("a number above 0"))?))
        }
        "screenshot" => Command::Screenshot(if value.is_some() { Some(file()?) } else { None }),
        "report" => Command::Report,
        "quit" => Command::Quit,
        _ => return Err(wrong("one of the words that `lexisplat view --help` lists")),
    })
}

fn number<T: FromStr>(text: Option<&str>) -> Option<T> {
    text?.trim().parse().ok()
}

fn numbers<T: FromStr, const N: usize>(text: Option<&str>) -> Option<[T; N]> {
    let parts: Option<Vec<T>> = text?.split(':').map(|part| number(Some(part))).collect();
    parts?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use lexisplat::packed::Preset;

    use super::*;

    #[test]
    fn words_become_commands_in_order() {
        let script =
            parse("camera=3, mode=wipe,split=0.25,key=],screenshot=a/b=c.png,screenshot,quit,").unwrap();
        let expected = [
            Command::Camera(3),
            Command::Mode(Mode::Wipe),
            Command::Split(0.25),
            Command::StepCamera(1),
            Command::Screenshot(Some("a/b=c.png".into())),
            Command::Screenshot(None),
            Command::Quit,
        ];
        assert_eq!(script, expected);
        let script =
            parse("compress=small,tolerance=0.1,background=0:0.5:1,orbit=-3:4.5,drop=x.lexi").unwrap();
        let expected = [
            Command::Compress(Quality::Preset(Preset::Small)),
            Command::Compress(Quality::Tolerance(0.1)),
            Command::Background([0.0, 0.5, 1.0]),
            Command::Orbit([-3.0, 4.5]),
            Command::Drop { paths: vec!["x.lexi".into()], first: false },
        ];
        assert_eq!(script, expected);
        let script = parse("frame,view=1:2:-3:0:0:0:1:4:1.5:mirrored,degree=all").unwrap();
        let pose = Pose {
            position: [1.0, 2.0, -3.0],
            rotation: [0.0, 0.0, 0.0, 1.0],
            mirrored: true,
            distance: 4.0,
            focal: 1.5,
        };
        assert_eq!(script, [Command::Frame, Command::View(pose), Command::Degree(None)]);
        assert!(parse("").unwrap().is_empty());
    }

    #[test]
    fn nonsense_is_refused_by_word() {
        for bad in [
            "dance",
            "camera",
            "camera=-1",
            "camera=x",
            "view=1:2:3",
            "mode=best",
            "split=",
            "degree=9",
            "background=1:2",
            "key=hello",
            "key=W",
            "open",
            "compress=tiny",
            "screenshot=",
            "orbit=1:2:3",
            "tolerance",
        ] {
            let message = parse(&format!("report,{bad}")).unwrap_err().to_string();
            assert!(message.contains(bad), "{message}");
        }
    }

    #[test]
    fn every_word_is_listed() {
        for line in WORDS.lines().filter(|line| line.starts_with("  ")) {
            for name in line.split("  ").nth(1).unwrap_or_default().split(", ") {
                let name = name.split(['=', ' ']).next().unwrap_or_default();
                let refused = parse(&format!("{name}=\u{0}")).err().map(|e| e.to_string());
                assert!(refused.is_none_or(|e| !e.contains("--help")), "{name}");
            }
        }
    }
}
