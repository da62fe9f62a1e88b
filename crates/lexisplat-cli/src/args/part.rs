//! The options by which a part of a packed file is read.

use clap::Args;

use super::values::{size, whole};

/// Form of the value of --first, for messages.
const FIRST: &str = "expected a share such as 20%, or a size such as 500kB";

/// The part of a packed file to read.
#[derive(Debug, Args)]
pub(crate) struct Part {
    /// Read only the first bytes of a packed file: a share such as 20%, or a size such as 500kB. Data beyond these
    /// bytes are left out. The first bytes hold the whole scene, coarser or with fewer Gaussians. Extra properties and
    /// a kept order are left out.
    #[arg(long, value_name = "PART", value_parser = first)]
    pub(crate) first: Option<First>,
    /// Read at most N of the SH parts of a packed file. The first has the largest SH values beyond the base colour. 0
    /// leaves view-dependent colour out. `info` lists the SH parts.
    #[arg(long, value_name = "N", value_parser = whole::<usize>(0..=u64::MAX))]
    pub(crate) sh_parts: Option<usize>,
}

impl Part {
    /// Returns whether one of these options is given.
    pub(crate) fn is_given(&self) -> bool {
        self.first.is_some() || self.sh_parts.is_some()
    }
}

/// The first bytes of a file, as the value of --first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum First {
    /// A share of the file, above 0 and at most 1.
    Share(f64),
    /// A number of bytes.
    Bytes(u64),
}

impl First {
    /// Returns the first bytes of `bytes`, at most all of them.
    pub(crate) fn of(self, bytes: &[u8]) -> &[u8] {
        let all = bytes.len();
        let count = match self {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most the length")]
            Self::Share(share) => (share * all as f64) as usize,
            Self::Bytes(count) => usize::try_from(count).unwrap_or(all),
        };
        bytes.get(..count).unwrap_or(bytes)
    }
}

/// Parses the value of --first: a share in per cent, or a [`size`].
fn first(text: &str) -> Result<First, String> {
    let Some(share) = text.strip_suffix('%') else {
        return size(text).map(First::Bytes).map_err(|_| FIRST.to_owned());
    };
    match share.trim().parse::<f64>() {
        Ok(share) if share > 0.0 && share <= 100.0 => Ok(First::Share(share / 100.0)),
        _ => Err("expected a share above 0% and at most 100%".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_parts_are_shares_or_sizes() {
        assert_eq!(first("20%"), Ok(First::Share(0.2)));
        assert_eq!(first("2.5 %"), Ok(First::Share(0.025)));
        assert_eq!(first("500000"), Ok(First::Bytes(500_000)));
        assert_eq!(first("2MB"), Ok(First::Bytes(2_000_000)));
        for bad in ["", "%", "0%", "-5%", "101%", "nan%", "inf%", "20 %%", "much", "-1"] {
            assert!(first(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn first_parts_end_with_the_file() {
        let bytes = [7; 10];
        let len = |text: &str| first(text).unwrap().of(&bytes).len();
        assert_eq!(
            [len("20%"), len("99%"), len("100%"), len("3"), len("11"), len("1GB")],
            [2, 9, 10, 3, 10, 10]
        );
    }
}
