//! `--limit`: the most that files may ask for.

use lexisplat::Limits;

use super::values::size;

/// A limit from the command line: its name and its value.
pub(super) type Limit = (String, u64);

/// Returns the default limits with the values of `given` in their place.
///
/// # Errors
/// An unknown name, which [`limit`] refuses too.
pub(super) fn all(given: &[Limit]) -> Result<Limits, lexisplat::Error> {
    given.iter().try_fold(Limits::default(), |limits, (name, value)| limits.with(name, *value))
}

/// Parses a limit: `NAME=N`, where N is a [`size`] or 0.
pub(super) fn limit(text: &str) -> Result<Limit, String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=N, such as gaussians=1000000")?;
    let value = if value == "0" { 0 } else { size(value)? };
    Limits::default().with(name, value).map_err(|e| e.to_string())?;
    Ok((name.to_owned(), value))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::command;

    #[test]
    fn limits_have_names_and_numbers() {
        assert_eq!(limit("gaussians=5"), Ok(("gaussians".to_owned(), 5)));
        assert_eq!(limit("bytes=2GiB"), Ok(("bytes".to_owned(), 2 << 30)));
        assert_eq!(limit("expansion=0"), Ok(("expansion".to_owned(), 0)));
        for bad in ["gaussians", "gaussian=5", "bytes=", "bytes=-1", "=5"] {
            assert!(limit(bad).is_err(), "{bad}");
        }
        // The help names the defaults.
        let help = command().render_long_help().to_string();
        let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
        let Limits { gaussians, atoms, nonzeros, expansion, header_bytes, properties, .. } =
            Limits::default();
        assert_eq!((Limits::default().bytes, header_bytes), (u64::MAX, 4 << 20));
        for part in [
            format!(
                "`gaussians` ({gaussians}), `atoms` of a dictionary ({atoms}), `nonzeros` of one Gaussian ({nonzeros})"
            ),
            format!("each byte of a file ({expansion}), `header_bytes` (4MiB)"),
            format!("element of a PLY ({properties})"),
        ] {
            assert!(help.contains(&part), "{part}: {help}");
        }
    }
}
