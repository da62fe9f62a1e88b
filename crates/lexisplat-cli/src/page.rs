//! The page of `lexisplat html`: the built viewer with scenes inserted.

use std::borrow::Cow;
use std::io::Read;
use std::sync::OnceLock;

use anyhow::{Context, Result};
use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use flate2::read::GzDecoder;

/// The viewer, built by `web/build-page.mjs`, after gzip. It contains each of the texts below once.
const VIEWER: &[u8] = include_bytes!("../assets/viewer.html.gz");

const TITLE: &str = "<title>lexisplat</title>";
const POSTER: &str = "data-poster=\"\"";
const WORDS: &str = "data-words=\"\"";
const CONTROLS: &str = "data-controls=\"all\"";
/// Directive of the security policy for requests: in a page without a scene, and in a page with a scene.
const FETCHES: &str = "connect-src * blob: data:";
const FETCHES_NOTHING: &str = "connect-src 'none'";
const SCENES: [(&str, &str); 2] =
    [("id=\"scene\"", " data-name=\"\"></script>"), ("id=\"scene2\"", " data-name=\"\"></script>")];

/// A picture in a page.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Poster<'a> {
    /// Bytes of a PNG or JPEG.
    pub(crate) bytes: &'a [u8],
    /// `image/png` or `image/jpeg`.
    pub(crate) kind: &'static str,
}

/// The contents that are inserted into the page.
#[derive(Debug, Default)]
pub(crate) struct Page<'a> {
    pub(crate) title: &'a str,
    pub(crate) poster: Option<Poster<'a>>,
    /// Words of a script of the viewer.
    pub(crate) words: &'a str,
    /// Whether a page with a scene has the whole panel instead of the small bar.
    pub(crate) tools: bool,
    /// Whether the scene stays still instead of turning by itself.
    pub(crate) still: bool,
    /// Names and bytes of up to two scenes.
    pub(crate) scenes: Vec<(&'a str, &'a [u8])>,
}

impl Page<'_> {
    /// Returns the page as HTML, in consecutive pieces.
    ///
    /// # Errors
    /// An error if the viewer in the program is damaged.
    pub(crate) fn pieces(&self) -> Result<Vec<Cow<'static, str>>> {
        let viewer = viewer()?;
        let poster = self.poster.map(|poster| {
            format!("data-poster=\"data:{};base64,{}\"", poster.kind, BASE64.encode(poster.bytes))
        });
        let mut edits = vec![
            (TITLE.to_owned(), format!("<title>{}</title>", escaped(self.title))),
            (POSTER.to_owned(), poster.unwrap_or_else(|| POSTER.to_owned())),
            (WORDS.to_owned(), format!("data-words=\"{}\"", escaped(self.words))),
        ];
        if !self.scenes.is_empty() {
            let controls = if self.tools { CONTROLS } else { "data-controls=\"bar\"" };
            let still = if self.still { " data-still=\"\"" } else { "" };
            edits.push((CONTROLS.to_owned(), format!("{controls}{still}")));
            edits.push((FETCHES.to_owned(), FETCHES_NOTHING.to_owned()));
        }
        for ((name, bytes), (id, rest)) in self.scenes.iter().zip(SCENES) {
            let scene = BASE64.encode(bytes);
            edits.push((
                format!("{id}{rest}"),
                format!("{id} data-name=\"{}\">{scene}</script>", escaped(name)),
            ));
        }
        let mut placed: Vec<(usize, usize, String)> = edits
            .into_iter()
            .filter_map(|(text, by)| viewer.find(&text).map(|at| (at, at + text.len(), by)))
            .collect();
        placed.sort_unstable_by_key(|edit| edit.0);
        let mut pieces = Vec::new();
        let mut from = 0;
        for (start, end, by) in placed {
            pieces.push(Cow::Borrowed(viewer.get(from..start).unwrap_or_default()));
            pieces.push(Cow::Owned(by));
            from = end;
        }
        pieces.push(Cow::Borrowed(viewer.get(from..).unwrap_or_default()));
        Ok(pieces)
    }
}

/// Returns the page of the viewer.
fn viewer() -> Result<&'static str> {
    static PAGE: OnceLock<String> = OnceLock::new();
    if let Some(page) = PAGE.get() {
        return Ok(page);
    }
    let mut page = String::new();
    GzDecoder::new(VIEWER).read_to_string(&mut page).context("the viewer in this program is damaged")?;
    Ok(PAGE.get_or_init(|| page))
}

/// Returns `text` escaped for HTML text and for attribute values in double quotes.
fn escaped(text: &str) -> String {
    text.chars().fold(String::with_capacity(text.len()), |mut out, c| {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c => out.push(c),
        }
        out
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Most bytes of the viewer in the program.
    const MOST: usize = 1_000_000;

    #[test]
    fn the_viewer_is_small_and_has_each_place_once() {
        assert!(VIEWER.len() <= MOST, "{} bytes", VIEWER.len());
        let scenes = SCENES.map(|(id, rest)| format!("{id}{rest}"));
        let viewer = viewer().unwrap();
        for marker in
            [TITLE, POSTER, WORDS, CONTROLS, FETCHES].into_iter().chain(scenes.iter().map(String::as_str))
        {
            assert_eq!(viewer.matches(marker).count(), 1, "{marker}");
        }
    }

    #[test]
    fn what_is_put_in_is_there_and_the_rest_is_unchanged() {
        let poster = Poster { bytes: b"\x89PNG", kind: "image/png" };
        let page = Page {
            title: "a <b> & \"c\"",
            poster: Some(poster),
            words: "mode=wipe",
            tools: false,
            still: true,
            scenes: vec![("a\".lexi", b"first"), ("b.lexi", b"second")],
        };
        let html = page.pieces().unwrap().concat();
        for text in [
            "<title>a &lt;b&gt; &amp; &quot;c&quot;</title>",
            "data-poster=\"data:image/png;base64,iVBORw==\"",
            "data-words=\"mode=wipe\"",
            "data-controls=\"bar\" data-still=\"\"",
            "connect-src 'none'",
            "id=\"scene\" data-name=\"a&quot;.lexi\">Zmlyc3Q=</script>",
            "id=\"scene2\" data-name=\"b.lexi\">c2Vjb25k</script>",
        ] {
            assert_eq!(html.matches(text).count(), 1, "{text}");
        }
        assert!(!html.contains(FETCHES));
        let tools = Page { tools: true, scenes: vec![("a.lexi", b"first")], ..Page::default() };
        assert!(tools.pieces().unwrap().concat().contains(CONTROLS));
        let empty = Page { title: "lexisplat", ..Page::default() };
        assert_eq!(empty.pieces().unwrap().concat(), viewer().unwrap());
    }
}
