//! Elements that the page of a sweep and the page of the demo share.
//!
//! A page contains its styles, script and pictures, and its security policy forbids every request.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use lexisplat_eval::Comparison;
use maud::{Markup, PreEscaped, Render, html};

/// Style sheet of all pages.
const STYLE: &str = include_str!("../report/page.css");
/// Security policy, which forbids every request. A page contains everything that it needs.
const POLICY: &str =
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'";

/// Script of all pages. It moves the line between two pictures.
const SCRIPT: &str = include_str!("wipe.js");

/// Returns a whole page as UTF-8 text. `style` and `script` are added to those of all pages.
pub(crate) fn document(title: &str, style: &str, body: &Markup, script: &str) -> String {
    let page = html! {
        (PreEscaped("<!doctype html>\n"))
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                title { (title) " \u{b7} lexisplat" }
                style { "\n" (PreEscaped(STYLE)) (PreEscaped(style)) }
            }
            "\n"
            body { (body) script { "\n" (PreEscaped(SCRIPT)) (PreEscaped(script)) } }
        }
        "\n"
    };
    page.into_string()
}

/// Returns a section with a heading. `id` is the id of the heading.
pub(crate) fn section(id: &str, heading: &str, content: &Markup) -> Markup {
    html! { section aria-labelledby=(id) { h2 id=(id) { (heading) } "\n" (content) } "\n" }
}

/// Returns a card with one number of a summary.
pub(crate) fn card(value: impl Render, what: &str) -> Markup {
    html! { div class="card" { dt { (what) } dd { (value) } } }
}

/// Returns a value in decibels for a card.
pub(crate) fn decibels(value: &str) -> Markup {
    html! { (value) " " small { "dB" } }
}

/// Returns an image. Its file, of the kind `png` or `jpeg`, is part of the page.
pub(crate) fn image(kind: &str, class: &str, alt: &str, file: &[u8]) -> Markup {
    html! { img class=(class) alt=(alt) src={ "data:image/" (kind) ";base64," (BASE64_STANDARD.encode(file)) }; }
}

/// Returns the scores of a view as text after its name. The text is empty if the view has no scores.
pub(crate) fn scores(comparison: &Comparison, view: &str) -> String {
    match comparison.views.iter().find(|score| score.name == view) {
        Some(score) => match score.psnr {
            Some(psnr) => format!(" \u{b7} PSNR {psnr:.2}\u{a0}dB \u{b7} SSIM {:.4}", score.ssim),
            None => " \u{b7} identical".to_owned(),
        },
        None => String::new(),
    }
}
