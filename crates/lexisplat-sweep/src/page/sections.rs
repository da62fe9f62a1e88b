//! The page's sections, from top to bottom.

use std::fmt::Write;

use base64::Engine;

use super::SweepPicture;
use super::facts::Facts;
use crate::report::text;
use crate::table::Table;
use crate::{Figure, Method, NOTES, SceneResult, level_off, tables};
use lexisplat_eval::montage::AMPLIFICATION;

/// Most rows of the table of single views that the page still shows.
const MOST_VIEW_ROWS: usize = 1500;
/// Tables with more rows than this scroll by themselves.
const TALL: usize = 24;
/// Figures that answer whether quality levels off.
const LEVELS: [&str; 2] = ["levels-psnr", "levels-fps"];
/// What names of figures of single scenes start with.
const SCENE: &str = "scene-";

/// `1 scene`, `3 scenes`.
fn plural(count: usize, one: &str) -> String {
    let s = if count == 1 { "" } else { "s" };
    format!("{} {one}{s}", text::count(count as u64))
}

pub(super) fn header(page: &mut String, facts: &Facts<'_>, date: Option<&str>) {
    page.push_str("<header><p class=\"mark\">lexisplat sweep</p>\n");
    if facts.results.scenes.is_empty() {
        page.push_str("<h1>Nothing was evaluated</h1>\n</header>\n");
        return;
    }
    let of_all = facts.grid.settings.is_empty();
    let methods = facts.grid.methods.iter().filter(|method| of_all || !method.is_competitor()).count();
    let ways = if of_all {
        "as trained".to_owned()
    } else {
        format!("compressed in <em>{}</em>", plural(facts.grid.settings.len(), "way"))
    };
    let _ = write!(
        page,
        "<h1>{} by {}, {ways}</h1>\n\
         <p class=\"lede\">Each trained model was compressed, drawn straight from its codes, and compared with the \
         original\u{2019}s pictures from the same cameras{}. {}</p>\n<dl class=\"cards\">",
        plural(facts.grid.columns.len(), "scene"),
        plural(methods, "method"),
        if facts.grid.metrics_to_photos().is_empty() { "" } else { ", and with photos" },
        text::escape(&date.map_or_else(String::new, |date| format!("Made {date}."))),
    );
    cards(page, facts);
    page.push_str("</dl></header>\n");
}

fn cards(page: &mut String, facts: &Facts<'_>) {
    let mut card = |value: String, what: String| {
        let _ = write!(page, "<div class=\"card\"><dt>{}</dt><dd>{value}</dd></div>", text::escape(&what));
    };
    let times = |value: f64| format!("{value:.2}\u{d7}");
    if let Some(main) = &facts.main {
        let label = main.setting.label();
        if let Some(psnr) = main.psnr {
            card(
                format!("{psnr:.1} <small>dB</small>"),
                format!("mean PSNR against the original\u{2019}s pictures at {label}; more is closer"),
            );
        }
        if let Some(whole) = main.whole {
            card(
                times(whole),
                format!("smaller at {label}: whole files, every byte counted, geometry exact"),
            );
        }
        if let Some(ratio) = main.coefficients {
            card(times(ratio), format!("fewer coefficients at {label}: the paper\u{2019}s way of counting"));
        }
        if let (Some(mean), Some(worst)) = (main.photos.mean, main.photos.min) {
            card(
                format!("{mean:+.2} <small>dB</small>"),
                format!("change of PSNR against photos at {label}; {worst:+.2} dB where it is worst"),
            );
        }
        if let Some(speedup) = main.speedup {
            card(
                times(speedup),
                format!("the frames a second of dense SH, from codes at {label} on {}", facts.grid.device()),
            );
        }
    }
    if let Some(packed) = &facts.packed
        && let (Some(whole), Some(psnr)) = (packed.whole, packed.psnr)
    {
        card(
            times(whole),
            format!(
                "smaller as packed files ({}), everything quantised, at {psnr:.1} dB",
                packed.setting.label()
            ),
        );
    }
}

fn image(page: &mut String, class: &str, alt: &str, png: &[u8]) {
    let _ = write!(page, "<img class=\"{class}\" alt=\"{}\" src=\"data:image/png;base64,", text::escape(alt));
    base64::engine::general_purpose::STANDARD.encode_string(png, page);
    page.push_str("\">");
}

/// The model that a picture is of.
fn model<'a>(facts: &Facts<'a>, scene: &str, method: Method) -> Option<&'a SceneResult> {
    facts.results.scenes.iter().find(|s| s.name == scene && s.method == method)
}

pub(super) fn pictures(page: &mut String, facts: &Facts<'_>, pictures: &[SweepPicture<'_>]) {
    if pictures.is_empty() {
        return;
    }
    page.push_str(
        "<section aria-labelledby=\"see\"><h2 id=\"see\">Can you tell?</h2>\n\
         <p class=\"scripted\">Left of the line is the original, right of it the compressed scene, drawn straight from its \
         codes. Drag the line.</p>\n\
         <p class=\"unscripted\">From the left: the original, the photo if there is one, the compressed scene drawn \
         straight from its codes, and their amplified difference.</p>\n<div class=\"panel\">\
         <div class=\"controls pick\"><label>Scene <select id=\"scene\"></select></label>\
         <label>Setting <select id=\"setting\"></select></label>\
         <label>View <select id=\"view\"></select></label></div>\n",
    );
    for picture in pictures {
        let SweepPicture { scene, method, setting_label, view, .. } = *picture;
        let scene_and_method = format!("{scene}, {}", method.title());
        let _ = write!(
            page,
            "<figure class=\"view\" data-scene=\"{}\" data-setting=\"{}\" data-view=\"{}\"><div class=\"stage\">",
            text::escape(&scene_and_method),
            text::escape(setting_label),
            text::escape(view),
        );
        let name = format!("{scene_and_method}, {view}");
        image(page, "before", &format!("{name}: original"), picture.original_png);
        if let Some(photo) = picture.photo_png {
            image(page, "photo", &format!("{name}: photo"), photo);
        }
        image(page, "after", &format!("{name}: compressed, {setting_label}"), picture.compressed_png);
        image(page, "difference", &format!("{name}: amplified difference"), picture.difference_png);
        let _ = write!(
            page,
            "<span class=\"tag left\">original</span><span class=\"tag right\">{}</span></div><figcaption>{} \u{b7} {}",
            text::escape(setting_label),
            text::escape(&name),
            text::escape(setting_label)
        );
        let score = model(facts, scene, method)
            .and_then(|scene| scene.points.iter().find(|point| point.setting.label() == setting_label))
            .and_then(|point| point.to_original.views.iter().find(|score| score.name == view));
        if let Some(score) = score {
            if score.identical {
                page.push_str(" \u{b7} identical");
            } else {
                let (psnr, ssim) = (text::number(score.psnr, 2), text::number(Some(score.ssim), 4));
                let _ = write!(page, " \u{b7} PSNR {psnr}\u{a0}dB \u{b7} SSIM {ssim}");
            }
        }
        page.push_str("</figcaption></figure>\n");
    }
    let _ = writeln!(
        page,
        "<div class=\"controls\"><label for=\"at\">Line <input id=\"at\" type=\"range\" min=\"0\" max=\"100\" \
         step=\"0.5\" value=\"50\"></label>\
         <button id=\"differ\" type=\"button\" aria-pressed=\"false\">Difference, \u{d7}{AMPLIFICATION} brighter</button>\
         <button id=\"photo\" type=\"button\" aria-pressed=\"false\">Photo instead of the original</button></div>\
         </div></section>"
    );
}

/// A figure within the page: as SVG that follows the theme.
fn figure(page: &mut String, figure: &Figure) {
    let opening = format!("<svg class=\"plot\" role=\"img\" aria-label=\"{}\" ", text::escape(&figure.title));
    let svg =
        figure.svg.replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1).replacen("<svg ", &opening, 1);
    let _ = writeln!(
        page,
        "<figure class=\"panel chart\" id=\"figure-{}\"><div class=\"scroll\">{svg}</div><figcaption>{}</figcaption></figure>",
        text::escape(&figure.name),
        text::escape(&figure.caption)
    );
}

/// Figures over all scenes.
pub(super) fn figures(page: &mut String, figures: &[Figure]) {
    let mut over_all = figures
        .iter()
        .filter(|f| !LEVELS.contains(&f.name.as_str()) && !f.name.starts_with(SCENE))
        .peekable();
    if over_all.peek().is_none() {
        return;
    }
    page.push_str("<section aria-labelledby=\"figures\"><h2 id=\"figures\">At a glance</h2>\n");
    over_all.for_each(|f| figure(page, f));
    page.push_str("</section>\n");
}

pub(super) fn levels(page: &mut String, facts: &Facts<'_>, figures: &[Figure]) {
    let paragraphs = level_off(facts.results);
    let drawn: Vec<&Figure> = figures.iter().filter(|f| LEVELS.contains(&f.name.as_str())).collect();
    if paragraphs.is_empty() && drawn.is_empty() {
        return;
    }
    page.push_str("<section aria-labelledby=\"levels\"><h2 id=\"levels\">Does quality level off?</h2>\n");
    for paragraph in &paragraphs {
        let _ = writeln!(page, "<p>{}</p>", text::escape(paragraph));
    }
    drawn.into_iter().for_each(|f| figure(page, f));
    page.push_str("</section>\n");
}

/// A table with its title and caption, scrolling by itself where it is large.
fn table(page: &mut String, table: &Table) {
    if table.is_empty() {
        return;
    }
    let tall = if table.rows.len() > TALL { " tall" } else { "" };
    let bare = Table { caption: String::new(), ..table.clone() };
    let _ = write!(page, "<h3 id=\"table-{}\">{}</h3>", table.name, text::escape(&table.title));
    if !table.caption.is_empty() {
        let _ = write!(page, "<p class=\"note\">{}</p>", text::escape(&table.caption));
    }
    let _ = writeln!(
        page,
        "<div class=\"panel scroll grid{tall}\" tabindex=\"0\" role=\"region\" aria-labelledby=\"table-{}\">{}</div>",
        table.name,
        bare.to_html()
    );
}

pub(super) fn tables(page: &mut String, facts: &Facts<'_>) {
    let results = facts.results;
    if results.scenes.is_empty() {
        return;
    }
    page.push_str("<section aria-labelledby=\"tables\"><h2 id=\"tables\">In numbers</h2>\n");
    for one in [
        tables::summary(results),
        tables::main(results, None),
        tables::truth(results),
        tables::drops(results),
        tables::bytes(results),
    ] {
        table(page, &one);
    }
    page.push_str("</section>\n");
}

/// Ours beside the paper's, and what to know before comparing.
pub(super) fn paper(page: &mut String, facts: &Facts<'_>) {
    if facts.results.scenes.is_empty() {
        return;
    }
    page.push_str(
        "<section aria-labelledby=\"paper\"><h2 id=\"paper\">Beside the paper</h2>\n\
         <p>The paper is arXiv 2605.30396v1. Its numbers are as printed, its means recomputed from its columns.</p>\n",
    );
    table(page, &tables::psnr(facts.results));
    table(page, &tables::nonzeros(facts.results));
    page.push_str("<h3>How things are counted</h3><dl class=\"notes\">");
    for note in NOTES {
        let _ = write!(page, "<dt>{}</dt><dd>{}</dd>", text::escape(note.title), text::escape(note.text));
    }
    page.push_str("</dl></section>\n");
}

pub(super) fn details(page: &mut String, facts: &Facts<'_>, figures: &[Figure]) {
    let results = facts.results;
    let skipped = tables::skipped(results);
    if !skipped.is_empty() {
        page.push_str("<section aria-labelledby=\"left\"><h2 id=\"left\">What was left out</h2>\n");
        table(page, &skipped);
        page.push_str("</section>\n");
    }
    if results.scenes.is_empty() {
        return;
    }
    page.push_str("<section aria-labelledby=\"more\"><h2 id=\"more\">All of it</h2>\n");
    let fold = |page: &mut String, title: &str, fill: &dyn Fn(&mut String)| {
        let _ = writeln!(page, "<details><summary>{}</summary>", text::escape(title));
        fill(page);
        page.push_str("</details>\n");
    };
    fold(page, "Models", &|page| table(page, &tables::models(results)));
    let scenes: Vec<&Figure> = figures.iter().filter(|f| f.name.starts_with(SCENE)).collect();
    if !scenes.is_empty() {
        fold(page, "Scene by scene", &|page| scenes.iter().for_each(|f| figure(page, f)));
    }
    let settings = tables::settings(results);
    if !settings.is_empty() {
        fold(page, "Every setting", &|page| table(page, &settings));
    }
    let views = tables::views(results);
    if views.rows.len() > MOST_VIEW_ROWS {
        let _ = writeln!(
            page,
            "<p class=\"note\">The table of single views has {} rows, too long for this page. It is among the CSV files.</p>",
            text::count(views.rows.len() as u64)
        );
    } else if !views.is_empty() {
        fold(page, "View by view", &|page| table(page, &views));
    }
    page.push_str("</section>\n");
}

pub(super) fn footer(page: &mut String, facts: &Facts<'_>, date: Option<&str>) {
    let results = facts.results;
    page.push_str("<footer>");
    if !results.command.is_empty() {
        let _ = write!(page, "<p>Make this again:</p><pre>{}</pre>", text::escape(&results.command));
    }
    let mut devices: Vec<&str> = results.scenes.iter().map(|scene| scene.device.as_str()).collect();
    devices.dedup();
    let parts = [
        (!results.version.is_empty()).then(|| format!("lexisplat {}", results.version)),
        (!results.pursuit.is_empty()).then(|| format!("{} pursuit", results.pursuit)),
        (!results.layout.is_empty()).then(|| format!("values as {}", results.layout)),
        Some(
            if results.eight_bit { "pictures rounded to 8 bits" } else { "pictures not rounded" }.to_owned(),
        ),
        (!devices.is_empty()).then(|| format!("drawn on {}", devices.join(", "))),
        date.map(str::to_owned),
    ];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    let _ = write!(
        page,
        "<p>{}. A megabyte is 10<sup>6</sup> bytes. This page holds everything it shows and asks nothing of the \
         network.</p></footer>",
        text::escape(&parts.join(" \u{b7} "))
    );
}
