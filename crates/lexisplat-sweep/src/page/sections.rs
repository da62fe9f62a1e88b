//! The page's sections, from top to bottom.

use lexisplat_eval::format;
use lexisplat_eval::montage::AMPLIFICATION;
use maud::{Markup, html};

use super::cards::cards;
use super::{image, scores, section};
use crate::grid::Grid;
use crate::measure::Measure;
use crate::table::Table;
use crate::{Figure, NOTES, Results, SweepPicture, tables};

/// Tables with more rows than this scroll by themselves.
const TALL: usize = 24;
/// Start of the names of figures of single scenes.
const SCENE: &str = "scene-";

/// `1 scene`, `3 scenes`.
fn plural(count: usize, one: &str) -> String {
    let s = if count == 1 { "" } else { "s" };
    format!("{} {one}{s}", format::count(count as u64))
}

pub(super) fn header(grid: &Grid<'_>, date: Option<&str>) -> Markup {
    let as_trained = grid.settings.is_empty();
    let methods = grid.methods.iter().filter(|method| as_trained || !method.is_competitor()).count();
    let photos = if grid.scores(Measure::ToPhotos).is_empty() { "" } else { ", and with photos" };
    html! {
        header {
            p class="mark" { "lexisplat sweep" }
            @if grid.headings.is_empty() {
                h1 { "Nothing was evaluated" }
            } @else {
                h1 {
                    (plural(grid.headings.len(), "scene")) " by " (plural(methods, "method")) ", "
                    @if as_trained { "as trained" } @else { "compressed in " em { (plural(grid.settings.len(), "way")) } }
                }
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

/// One view of one model at one setting.
fn view(results: &Results, picture: &SweepPicture) -> Option<Markup> {
    let scene = results.scenes.get(picture.scene)?;
    let model = format!("{}, {}", scene.name, scene.method.title());
    let (setting, name) = (&picture.setting, format!("{model}, {}", picture.view));
    let point = scene.points.iter().find(|point| point.setting.label() == *setting);
    let score = point.map(|point| scores(&point.to_original, &picture.view));
    let image = |class, alt: &str, png: &[u8]| image("png", class, &format!("{name}: {alt}"), png);
    Some(html! {
        figure class="view" data-scene=(model) data-setting=(setting) data-view=(picture.view) {
            div class="stage" {
                (image("before", "original", &picture.original))
                @if let Some(photo) = &picture.photo { (image("photo", "photo", photo)) }
                (image("after", &format!("compressed, {setting}"), &picture.compressed))
                (image("difference", "amplified difference", &picture.difference))
                span class="tag left" { "original" }
                span class="tag right" { (setting) }
            }
            figcaption { (name) " \u{b7} " (setting) (score.unwrap_or_default()) }
        }
        "\n"
    })
}

pub(super) fn pictures(results: &Results, pictures: &[SweepPicture]) -> Markup {
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
            @for view in pictures.iter().filter_map(|picture| view(results, picture)) { (view) }
            div class="controls" {
                label for="at" { "Line " input id="at" type="range" min="0" max="100" step="0.5" value="50"; }
                button id="differ" type="button" aria-pressed="false" { "Difference, \u{d7}" (AMPLIFICATION) " brighter" }
                button id="photo" type="button" aria-pressed="false" { "Photo instead of the original" }
            }
        }
    };
    section("see", "Can you tell?", &content)
}

/// A figure as SVG within the page, which follows the theme.
fn figure(figure: &Figure) -> Markup {
    html! {
        figure class="panel chart" id={ "figure-" (figure.name) } {
            div class="scroll" { (figure.svg()) }
            figcaption { (figure.caption) }
        }
        "\n"
    }
}

/// Figures over all scenes.
pub(super) fn figures(figures: &[Figure]) -> Markup {
    let over_all: Vec<&Figure> = figures.iter().filter(|f| !f.name.starts_with(SCENE)).collect();
    if over_all.is_empty() {
        return html! {};
    }
    section("figures", "At a glance", &html! { @for f in over_all { (figure(f)) } })
}

/// A table with its title and caption. A large one scrolls by itself.
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

/// The means, beside the paper's, and what to know before comparing.
pub(super) fn means(results: &Results) -> Markup {
    let content = html! {
        (table(&tables::means(results)))
        h3 { "How things are counted" }
        p { "The paper is arXiv 2605.30396v1. Its numbers are as printed, its means recomputed from its columns." }
        dl class="notes" { @for note in NOTES.iter() { dt { (note.title) } dd { (note.text) } } }
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

pub(super) fn footer(results: &Results, date: Option<&str>) -> Markup {
    let mut devices: Vec<&str> = results.scenes.iter().map(|scene| scene.device.as_str()).collect();
    devices.dedup();
    let rounded = if results.eight_bit { "pictures rounded to 8 bits" } else { "pictures not rounded" };
    let devices = devices.join(", ");
    let facts = [
        ("lexisplat ", &*results.version),
        ("pursuit ", &*results.pursuit),
        ("values as ", &*results.layout),
        ("", rounded),
        ("drawn on ", &*devices),
        ("", date.unwrap_or_default()),
    ];
    let facts = facts.iter().filter(|fact| !fact.1.is_empty()).map(|(what, fact)| format!("{what}{fact}"));
    let facts: Vec<String> = facts.collect();
    html! {
        footer {
            @if !results.command.is_empty() { p { "Make this again:" } pre { (results.command) } }
            p {
                (facts.join(" \u{b7} ")) ". A megabyte is 10" sup { "6" }
                " bytes. This page holds everything it shows and asks nothing of the network."
            }
        }
        "\n"
    }
}
