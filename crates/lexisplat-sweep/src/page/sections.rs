//! The page's sections, from top to bottom.

use lexisplat_eval::format;
use lexisplat_eval::montage::AMPLIFICATION;
use maud::{Markup, PreEscaped, html};

use super::cards::cards;
use super::{image, scores, section};
use crate::grid::Grid;
use crate::measure::Measure;
use crate::saturation::saturation as paragraphs;
use crate::table::Table;
use crate::{Figure, NOTES, Results, SweepPicture, tables};

/// Most rows of the table of single views on the page.
const MOST_VIEW_ROWS: usize = 1500;
/// Tables with more rows than this scroll by themselves.
const TALL: usize = 24;
/// Figures that show whether quality levels off.
const SATURATION: [&str; 2] = ["levels-psnr", "levels-fps"];
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
    let label = html! { (figure.title) }.into_string();
    let svg = figure.svg.replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1);
    let svg = svg.replacen("<svg ", &format!("<svg class=\"plot\" role=\"img\" aria-label=\"{label}\" "), 1);
    html! {
        figure class="panel chart" id={ "figure-" (figure.name) } {
            div class="scroll" { (PreEscaped(svg)) }
            figcaption { (figure.caption) }
        }
        "\n"
    }
}

/// Figures over all scenes.
pub(super) fn figures(figures: &[Figure]) -> Markup {
    let over_all = |f: &&Figure| !SATURATION.contains(&f.name.as_str()) && !f.name.starts_with(SCENE);
    if !figures.iter().any(|f| over_all(&f)) {
        return html! {};
    }
    section("figures", "At a glance", &html! { @for f in figures.iter().filter(over_all) { (figure(f)) } })
}

pub(super) fn saturation(results: &Results, figures: &[Figure]) -> Markup {
    let paragraphs = paragraphs(results);
    let drawn: Vec<&Figure> = figures.iter().filter(|f| SATURATION.contains(&f.name.as_str())).collect();
    if paragraphs.is_empty() && drawn.is_empty() {
        return html! {};
    }
    let content = html! {
        @for paragraph in paragraphs { p { (paragraph) } "\n" }
        @for f in drawn { (figure(f)) }
    };
    section("levels", "Does quality level off?", &content)
}

/// A table with its title and caption. A large one scrolls by itself.
fn table(table: &Table) -> Markup {
    let id = format!("table-{}", table.name);
    let class = if table.rows.len() > TALL { "panel scroll grid tall" } else { "panel scroll grid" };
    let bare = Table { caption: String::new(), ..table.clone() };
    html! {
        @if !table.is_empty() {
            h3 id=(id) { (table.title) }
            @if !table.caption.is_empty() { p class="note" { (table.caption) } }
            div class=(class) tabindex="0" role="region" aria-labelledby=(id) { (PreEscaped(bare.to_html())) }
            "\n"
        }
    }
}

pub(super) fn tables(results: &Results) -> Markup {
    if results.scenes.is_empty() {
        return html! {};
    }
    let all = [
        tables::summary(results),
        tables::main(results, None),
        tables::vs_photos(results),
        tables::drops(results),
        tables::bytes(results),
    ];
    section("tables", "In numbers", &html! { @for one in &all { (table(one)) } })
}

/// Our numbers beside the paper's, and what to know before comparing.
pub(super) fn paper(results: &Results) -> Markup {
    if results.scenes.is_empty() {
        return html! {};
    }
    let content = html! {
        p { "The paper is arXiv 2605.30396v1. Its numbers are as printed, its means recomputed from its columns." }
        (table(&tables::psnr(results)))
        (table(&tables::nonzeros(results)))
        h3 { "How things are counted" }
        dl class="notes" { @for note in NOTES.iter() { dt { (note.title) } dd { (note.text) } } }
    };
    section("paper", "Beside the paper", &content)
}

pub(super) fn details(results: &Results, figures: &[Figure]) -> Markup {
    let skipped = tables::skipped(results);
    let scenes: Vec<&Figure> = figures.iter().filter(|f| f.name.starts_with(SCENE)).collect();
    let (settings, views) = (tables::settings(results), tables::views(results));
    let fold = |title: &str, content: &Markup| html! { details { summary { (title) } "\n" (content) } "\n" };
    let content = html! {
        (fold("Models", &table(&tables::models(results))))
        @if !scenes.is_empty() { (fold("Scene by scene", &html! { @for f in scenes { (figure(f)) } })) }
        @if !settings.is_empty() { (fold("Every setting", &table(&settings))) }
        @if views.rows.len() > MOST_VIEW_ROWS {
            p class="note" {
                "The table of single views has " (format::count(views.rows.len() as u64))
                " rows, too long for this page. It is among the CSV files."
            }
        } @else if !views.is_empty() {
            (fold("View by view", &table(&views)))
        }
    };
    html! {
        @if !skipped.is_empty() { (section("left", "What was left out", &table(&skipped))) }
        @if !results.scenes.is_empty() { (section("more", "All of it", &content)) }
    }
}

pub(super) fn footer(results: &Results, date: Option<&str>) -> Markup {
    let mut devices: Vec<&str> = results.scenes.iter().map(|scene| scene.device.as_str()).collect();
    devices.dedup();
    let rounded = if results.eight_bit { "pictures rounded to 8 bits" } else { "pictures not rounded" };
    let mut facts = results.facts();
    facts.push(rounded.to_owned());
    facts.extend((!devices.is_empty()).then(|| format!("drawn on {}", devices.join(", "))));
    facts.extend(date.map(str::to_owned));
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
