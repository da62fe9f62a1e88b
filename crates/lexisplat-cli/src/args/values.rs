//! Values of options: names, numbers, sizes and colours.

use std::ops::RangeInclusive;
use std::str::FromStr;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use lexisplat::packed::Preset;
use lexisplat_compress::{SplitFilter, Viewpoints};
use lexisplat_render::Pose;
use lexisplat_render::gpu::ShPath;

/// Form of a size, for messages.
const SIZE: &str = "expected a size such as 800kB, 10MB or 1.5MiB";
/// Bound of sizes, in bytes. Below it `f64` does not overflow.
const MAX_SIZE: f64 = 1e18;

/// Returns the parser of a preset's name. The help lists the names.
pub(super) fn preset() -> impl TypedValueParser<Value = Preset> {
    PossibleValuesParser::new(Preset::ALL.map(Preset::name)).try_map(|name| name.parse::<Preset>())
}

/// Returns the parser of the name of a way of holding SH. The help lists the names.
pub(super) fn sh_path() -> impl TypedValueParser<Value = ShPath> {
    PossibleValuesParser::new(ShPath::ALL.map(ShPath::name)).try_map(|name| name.parse::<ShPath>())
}

/// Returns the parser of the viewpoints of generated views.
pub(super) fn viewpoints() -> impl TypedValueParser<Value = Viewpoints> {
    PossibleValuesParser::new(["auto", "object", "room"]).try_map(|name| name.parse::<Viewpoints>())
}

/// Returns the parser of a split of cameras.
pub(super) fn split() -> impl TypedValueParser<Value = SplitFilter> {
    PossibleValuesParser::new(["all", "train", "test"]).map(|name| match name.as_str() {
        "train" => SplitFilter::Train,
        "test" => SplitFilter::Test,
        _ => SplitFilter::All,
    })
}

/// Returns the parser of a whole number within `range`. Its message gives the range, also for a negative number.
pub(super) fn whole<T: TryFrom<u64>>(
    range: RangeInclusive<u64>,
) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static {
    move |text| {
        let number = text.parse().ok().filter(|number| range.contains(number));
        number.and_then(|number| T::try_from(number).ok()).ok_or_else(|| match (range.start(), range.end()) {
            (least, &u64::MAX) => format!("expected a whole number, at least {least}"),
            (least, most) => format!("expected a whole number from {least} to {most}"),
        })
    }
}

/// Returns the parser of a number. Its message shows the number `example`.
pub(super) fn real<T: FromStr>(
    example: &'static str,
) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static {
    move |text| text.trim().parse().map_err(|_| format!("expected a number such as {example}"))
}

/// Parses a number of bytes: plain, or with kB, MB, GB (powers of 1000) or KiB, MiB, GiB (powers of 1024).
pub(super) fn size(text: &str) -> Result<u64, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = match text[digits.len()..].to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "k" | "kb" => 1e3,
        "m" | "mb" => 1e6,
        "g" | "gb" => 1e9,
        "kib" => 1024.0,
        "mib" => 1024.0 * 1024.0,
        "gib" => 1024.0 * 1024.0 * 1024.0,
        _ => return Err(SIZE.to_owned()),
    };
    match digits.trim().parse::<f64>() {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
        Ok(v) if v.is_finite() && v > 0.0 && v * unit < MAX_SIZE => Ok((v * unit) as u64),
        _ => Err(SIZE.to_owned()),
    }
}

/// Parses a length: a finite number above 0.
pub(super) fn length(text: &str) -> Result<f32, String> {
    let length = text.trim().parse().ok().filter(|v: &f32| v.is_finite() && *v > 0.0);
    length.ok_or_else(|| "expected a length in the scene's units, above 0, such as 0.01".to_owned())
}

/// The choice of the view from which viewers show a scene first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum ViewChoice {
    Of(Pose),
    None,
}

impl ViewChoice {
    /// Returns the view; `None` if the file is to have none.
    pub(crate) fn pose(self) -> Option<Pose> {
        match self {
            Self::Of(pose) => Some(pose),
            Self::None => None,
        }
    }
}

/// Parses a first view: `none`, the text of a pose, or a link of a viewer, which has this text after `view=`.
pub(super) fn first_view(text: &str) -> Result<ViewChoice, String> {
    if text == "none" {
        return Ok(ViewChoice::None);
    }
    Pose::from_link(text)
        .map(ViewChoice::Of)
        .ok_or_else(|| "expected a link that a viewer copied, its part after view=, or none".to_owned())
}

/// Parses `N` finite numbers with commas between them.
pub(super) fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let parts: Vec<f64> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
    match <[f64; N]>::try_from(parts) {
        Ok(numbers) if text.split(',').count() == N && numbers.iter().all(|v| v.is_finite()) => Ok(numbers),
        _ => Err(format!("expected {N} numbers with commas between them, such as {}", ["0.5"; N].join(","))),
    }
}

/// Parses a colour: a name, or three numbers from 0 to 1.
pub(super) fn colour(text: &str) -> Result<[f32; 3], String> {
    match text {
        "black" => return Ok([0.0; 3]),
        "white" => return Ok([1.0; 3]),
        _ => {}
    }
    let parts: Vec<f32> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
    match <[f32; 3]>::try_from(parts) {
        Ok(c) if text.split(',').count() == 3 && c.iter().all(|v| (0.0..=1.0).contains(v)) => Ok(c),
        _ => Err("expected `black`, `white`, or three numbers from 0 to 1 such as 0.2,0.2,0.2".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_units() {
        assert_eq!(size("10MB"), Ok(10_000_000));
        assert_eq!(size("1.5KiB"), Ok(1536));
        assert_eq!(size("77"), Ok(77));
        for bad in ["", "MB", "-3kB", "10 furlongs", "1e30GB"] {
            assert!(size(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn whole_numbers_keep_to_their_range() {
        let small = whole::<u8>(1..=9);
        assert_eq!((small("1"), small("9")), (Ok(1), Ok(9)));
        for bad in ["0", "10", "-5", "300", "2.5", "", "x"] {
            assert_eq!(small(bad), Err("expected a whole number from 1 to 9".to_owned()), "{bad}");
        }
        assert_eq!(whole::<u64>(0..=u64::MAX)("-1"), Err("expected a whole number, at least 0".to_owned()));
        // The type has a range too.
        assert!(whole::<u8>(0..=u64::MAX)("256").is_err());
    }

    #[test]
    fn a_number_that_is_none_is_told_what_one_looks_like() {
        let tolerance = real::<f64>("0.1");
        assert_eq!((tolerance("0.25"), tolerance(" -1e-3 ")), (Ok(0.25), Ok(-1e-3)));
        for bad in ["", "x", "0,1", "4O", "1.2.3"] {
            assert_eq!(tolerance(bad), Err("expected a number such as 0.1".to_owned()), "{bad}");
        }
    }

    #[test]
    fn numbers_are_counted() {
        assert_eq!(numbers::<3>("1, -2.5,3e1"), Ok([1.0, -2.5, 30.0]));
        for bad in ["1,2", "1,2,3,4", "1,2,x", "1,2,inf", ""] {
            assert!(numbers::<3>(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn colours_are_names_or_numbers() {
        assert_eq!(colour("white"), Ok([1.0; 3]));
        assert_eq!(colour("0, 0.5,1"), Ok([0.0, 0.5, 1.0]));
        for bad in ["red", "0,0", "0,0,2", "0,0,0,0", "0,x,0", "nan,0,0"] {
            assert!(colour(bad).is_err(), "{bad}");
        }
    }
}
