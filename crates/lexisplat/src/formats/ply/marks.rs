//! The anti-aliasing mark that trainers write into a comment.
//!
//! Brush writes `SplatRenderMode: mip` or `SplatRenderMode: default`. Postshot writes `antialiased 1` or
//! `antialiased 0`. The mark decides how a scene is drawn, so it must survive every conversion.

use crate::scene::splats::SceneMeta;

/// Postshot's mark. The writer adds it if no comment has a mark.
pub(super) const ANTIALIASED: &str = "antialiased 1";

/// Returns whether the scene is anti-aliased according to a comment; `None` if the comment has no mark.
pub(super) fn mark(comment: &str) -> Option<bool> {
    let lower = comment.to_ascii_lowercase();
    let mut words =
        lower.split(|c: char| c.is_whitespace() || c == ':' || c == '=').filter(|w| !w.is_empty());
    match (words.next()?, words.next()?, words.next()) {
        ("splatrendermode", "mip", None) | ("antialiased", "1" | "true", None) => Some(true),
        ("splatrendermode", "default", None) | ("antialiased", "0" | "false", None) => Some(false),
        _ => None,
    }
}

/// The marks of all comments together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Marks {
    /// Whether at least one comment says yes. A scene with both answers counts as anti-aliased, because a trainer writes
    /// yes only if it supports anti-aliasing, and writes no by default.
    pub(super) antialiased: bool,
    /// Whether one comment says yes and another says no.
    pub(super) contradict: bool,
}

/// Reads the marks of all comments.
pub(super) fn marks<S: AsRef<str>>(comments: &[S]) -> Marks {
    let (mut yes, mut no) = (false, false);
    for said in comments.iter().filter_map(|c| mark(c.as_ref())) {
        yes |= said;
        no |= !said;
    }
    Marks { antialiased: yes, contradict: yes && no }
}

/// Returns the metadata of a scene with these `comments`. It is for readers of further formats.
#[must_use]
pub fn meta_of(comments: Vec<String>) -> SceneMeta {
    let antialiased = marks(&comments).antialiased;
    SceneMeta { comments, antialiased, ..SceneMeta::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_trainers_mark_is_understood() {
        assert_eq!(mark("SplatRenderMode: mip"), Some(true));
        assert_eq!(mark("SplatRenderMode: default"), Some(false));
        assert_eq!(mark("antialiased 1"), Some(true));
        assert_eq!(mark("antialiased 0"), Some(false));
        assert_eq!(mark("antialiased 2"), None);
        assert_eq!(mark("not antialiased 1 at all"), None);
        assert_eq!(mark("Vertical axis: y"), None);
    }

    #[test]
    fn contradicting_marks_are_noticed() {
        let both = marks(&["SplatRenderMode: mip", "antialiased 0"]);
        assert_eq!(both, Marks { antialiased: true, contradict: true });
        assert_eq!(marks::<&str>(&[]), Marks { antialiased: false, contradict: false });
    }
}
