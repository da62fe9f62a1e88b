//! What differs between the paper's way of counting and ours.

use std::sync::LazyLock;

/// Every note under a heading of its own.
const TEXT: &str = include_str!("notes.md");
/// What headings of notes begin with.
const HEADING: &str = "\n## ";

/// One thing to know before comparing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Note {
    /// In a few words.
    pub(crate) title: &'static str,
    /// The whole, as plain text.
    pub(crate) text: &'static str,
}

/// What differs between the paper's way of counting and ours.
pub(crate) static NOTES: LazyLock<Vec<Note>> = LazyLock::new(|| {
    let notes = TEXT.split(HEADING).skip(1).filter_map(|note| note.split_once('\n'));
    notes.map(|(title, text)| Note { title, text: text.trim() }).collect()
});

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_note_has_a_title_and_one_paragraph() {
        assert_eq!(NOTES.len(), 8);
        for note in NOTES.iter() {
            assert!(
                note.title.len() > 10 && note.text.ends_with('.') && !note.text.contains('\n'),
                "{note:?}"
            );
        }
    }
}
