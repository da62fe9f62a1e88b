//! The sections of the page, from top to bottom.

use lexisplat_eval::format;
use lexisplat_eval::montage::AMPLIFICATION;
use maud::{Markup, html};

use super::cards::cards;
use super::{image, scores, section};
use crate::grid::Grid;
use crate::measure::Measure;
use crate::picture::Part;
use crate::table::Table;
use crate::{Figure, PictureFiles, Results, tables};

/// Largest number of rows of a table without a scroll bar of its own.
const TALL: usize = 24;
/// Prefix of the names of figures of single scenes.
const SCENE: &str = "scene-";

/// Returns the differences between the paper's way of counting and ours: titles and texts.
pub(super) fn notes() -> impl Iterator<Item = (&'static str, &'static str)> {
    let notes = include_str!("../notes.md").split("\n## ").skip(1);
    notes.filter_map(|note| note.split_once('\n')).map(|(title, text)| (title, text.trim()))
}

/// Returns a count with its noun: `1 scene`, `3 scenes`.
fn plural(count: usize, one: &str) -> String {
    let s = if count == 1 { "" } else { "s" };
    format!("{} {one}{s}", format::count(count as u64))
}

pub(super) fn header(grid: &Grid<'_>, date: Option<&str>) -> Markup {
    let scenes = plural(grid.headings.len(), "scene");
    let methods = plural(grid.methods.len(), "method");
    let photos = if grid.scores(Measure::ToPhotos).is_empty() { "" } else { ", and with photos" };
    html! {
        header {
            p class="mark" { "lexisplat sweep" }
            @if grid.headings.is_empty() {
                h1 { "Nothing was evaluated" }
            } @else {
                h1 { (scenes) " by " (methods) ", compressed in " em { (plural(grid.settings.len(), "way")) } }
                p class="lede" {
                    "Each trained model was compressed, drawn straight from its codes, and compared with the original\u{2019}s \
                     pictures from the same cameras" (photos) ". "
                    @if let Some(date) = date { "Made " (date) "." }
                }
                (cards(grid))
            }
        }
        "\n"
    }
}

/// Returns one view of one model at one setting.
fn view(results: &Results, files: &PictureFiles, parts: &[Part]) -> Option<Markup> {
    let scene = results.scenes.get(files.scene)?;
    let model = format!("{}, {}", scene.name, scene.method.title());
    let (setting, name) = (&files.setting, format!("{model}, {}", files.view));
    let point = scene.points.iter().find(|point| point.setting.label() == *setting);
    let score = point.map(|point| scores(&point.to_original, &files.view));
    Some(html! {
        figure class="view" data-scene=(model) data-setting=(setting) data-view=(files.view) {
            div class="stage" {
                @for Part { class, what, png } in parts { (image("png", class, &format!("{name}: {what}"), png)) }
                span class="tag left" { "original" }
                span class="tag right" { (setting) }
            }
            figcaption { (name) " \u{b7} " (setting) (score.unwrap_or_default()) }
        }
        "\n"
    })
}

pub(super) fn pictures(results: &Results, pictures: &[(&PictureFiles, Vec<Part>)]) -> Markup {
    if pictures.is_empty() {
        return html! {};
    }
    let content = html! {
        p class="scripted" {
            "Left of the line is the original, right of it the compressed scene, drawn straight from its codes. Drag the line."
        }
        p class="unscripted" {
            "From the left: the original, the photo if there is one, the compressed scene drawn straight from its codes, and \
             their amplified difference."
        }
        div class="panel" {
            div class="controls pick" {
                @for (id, label) in [("scene", "Scene"), ("setting", "Setting"), ("view", "View")] {
                    label { (label) " " select id=(id) {} }
                }
            }
            @for view in pictures.iter().filter_map(|(files, parts)| view(results, files, parts)) { (view) }
            div class="controls" {
                label for="at" { "Line " input id="at" type="range" min="0" max="100" step="0.5" value="50"; }
                button id="differ" type="button" aria-pressed="false" { "Difference, \u{d7}" (AMPLIFICATION) " brighter" }
                button id="photo" type="button" aria-pressed="false" { "Photo instead of the original" }
            }
        }
    };
    section("see", "Can you tell?", &content)
}

/// Returns a figure as SVG in the page. It follows the theme.
fn figure(figure: &Figure) -> Markup {
    html! {
        figure class="panel chart" id={ "figure-" (figure.name) } {
            div class="scroll" { (figure.svg()) }
            figcaption { (figure.caption) }
        }
        "\n"
    }
}

/// Returns the figures over all scenes.
pub(super) fn figures(figures: &[Figure]) -> Markup {
    let over_all = figures.iter().filter(|f| !f.name.starts_with(SCENE));
    section("figures", "At a glance", &html! { @for f in over_all { (figure(f)) } })
}

/// Returns a table with its title and caption. A large table has a scroll bar of its own.
fn table(table: &Table) -> Markup {
    let id = format!("table-{}", table.name);
    let class = if table.rows.len() > TALL { "panel scroll grid tall" } else { "panel scroll grid" };
    html! {
        @if !table.rows.is_empty() {
            h3 id=(id) { (table.title) }
            @if !table.caption.is_empty() { p class="note" { (table.caption) } }
            div class=(class) tabindex="0" role="region" aria-labelledby=(id) { (table.to_html()) }
            "\n"
        }
    }
}

/// Returns the means beside those of the paper, and what to know before comparing them.
pub(super) fn means(results: &Results) -> Markup {
    let content = html! {
        (table(&tables::means(results)))
        h3 { "How things are counted" }
        p { "The paper is arXiv 2605.30396v1. Its numbers are as printed, its means recomputed from its columns." }
        dl class="notes" { @for (title, text) in notes() { dt { (title) } dd { (text) } } }
    };
    section("tables", "In numbers", &content)
}

pub(super) fn details(results: &Results, figures: &[Figure]) -> Markup {
    let scenes: Vec<&Figure> = figures.iter().filter(|f| f.name.starts_with(SCENE)).collect();
    let fold = |title: &str, content: &Markup| html! { details { summary { (title) } "\n" (content) } "\n" };
    let content = html! {
        (fold("Models", &table(&tables::models(results))))
        @if !scenes.is_empty() { (fold("Charts of each scene", &html! { @for f in scenes { (figure(f)) } })) }
        (fold("Scene by scene", &table(&tables::scenes(results))))
    };
    section("more", "All of it", &content)
}

pub(super) fn skipped(results: &Results) -> Markup {
    html! {
        @if !results.skipped.is_empty() { (section("left", "What was left out", &table(&tables::skipped(results)))) }
    }
}

pub(super) fn footer(results: &Results) -> Markup {
    let rounded = if results.eight_bit { "rounded to 8 bits" } else { "not rounded" };
    html! {
        footer {
            @if !results.command.is_empty() { p { "Make this again:" } pre { (results.command) } }
            p {
                "lexisplat " (results.version) " \u{b7} pictures " (rounded) " before scoring. This page holds everything it \
                 shows and asks nothing of the network."
            }
        }
        "\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_note_has_a_title_and_one_paragraph() {
        assert_eq!(notes().count(), 8);
        for (title, text) in notes() {
            assert!(title.len() > 10 && text.ends_with('.') && !text.contains('\n'), "{title}: {text}");
        }
    }
}
