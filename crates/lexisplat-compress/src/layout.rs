//! The layout that the choices of a user need.

use lexisplat::Layout;

use crate::error::{Error, Result};

/// Returns the layout `asked` for, or else the layout that the other choices need. `exact` names a choice that only layouts
/// with exact geometry have, and `packed` one that only packed files have. A tolerance without other choices needs exact
/// geometry.
///
/// # Errors
/// [`Error::Parameter`] for a layout and a choice that do not go together.
pub fn choose_layout(
    asked: Option<Layout>,
    has_tolerance: bool,
    exact: Option<&'static str>,
    packed: Option<&'static str>,
) -> Result<Layout> {
    let layout = asked.unwrap_or(match (exact, packed) {
        (None, Some(_)) => Layout::Packed,
        (None, None) if !has_tolerance => Layout::Packed,
        _ => Layout::F16,
    });
    let (wrong, other) = match layout {
        Layout::Packed => (exact, "f16, f32 or paper"),
        _ => (packed, "packed"),
    };
    match wrong {
        None => Ok(layout),
        Some(choice) => Err(Error::parameter("layout", layout, format!("{other}, which {choice} is for"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_layout_follows_from_the_other_choices() {
        let chosen = |tol, exact, packed| choose_layout(None, tol, exact, packed).unwrap();
        assert_eq!(chosen(false, None, None), Layout::Packed);
        assert_eq!(chosen(true, None, None), Layout::F16);
        assert_eq!(chosen(true, None, Some("psnr")), Layout::Packed);
        assert_eq!(chosen(false, Some("pursuit"), None), Layout::F16);
        assert_eq!(choose_layout(Some(Layout::Packed), true, None, None).unwrap(), Layout::Packed);
        assert_eq!(choose_layout(Some(Layout::F32), false, None, None).unwrap(), Layout::F32);
        let refused =
            |asked, exact, packed| choose_layout(asked, false, exact, packed).unwrap_err().to_string();
        let expected = "layout = packed: f16, f32 or paper, which pursuit is for";
        assert_eq!(refused(Some(Layout::Packed), Some("pursuit"), None), expected);
        assert_eq!(refused(Some(Layout::F32), None, Some("psnr")), "layout = f32: packed, which psnr is for");
        assert_eq!(refused(None, Some("pursuit"), Some("psnr")), "layout = f16: packed, which psnr is for");
    }
}
