//! The page's sections, from top to bottom.

use std::fmt::Write;

use lexisplat::sh::CHANNELS;
use lexisplat::{CodeLayout, Layout, Pursuit};

use super::atoms::{self, Usage};
use super::charts::{self, Part};
use super::{Picture, Report, base64, text};

/// Bytes of a value in a PLY: every known trainer writes floats.
const PLY_VALUE: u64 = 4;

/// What several sections need.
pub(super) struct Facts<'a> {
    report: &'a Report<'a>,
    gaussians: u64,
    /// SH-rest values of a Gaussian.
    dim: usize,
    mean_nonzeros: f64,
    /// SH-rest bytes in the PLY and in the .lexi: codes, escapes and dictionary.
    sh_before: u64,
    sh_after: u64,
    parts: Vec<Part>,
}

/// Group of what is none of the others.
const OTHER: usize = 6;

/// The group of a part of either file.
fn group(name: &str) -> usize {
    match name.split('.').next().unwrap_or(name) {
        "codes" | "escapes" | "dictionary" => 0,
        "dc" => 1,
        "position" => 2,
        "rotation" => 3,
        "scale" => 4,
        "opacity" => 5,
        _ => OTHER,
    }
}

impl<'a> Facts<'a> {
    pub(super) fn new(report: &'a Report<'a>) -> Self {
        let model = report.model;
        let gaussians = model.len() as u64;
        let dim = model.degree().rest();
        let per_gaussian = [dim as u64, CHANNELS as u64, 3, 4, 3, 1];
        let names = [
            ("View-dependent colour (SH)", "g-codes"),
            ("Base colour", "g-base"),
            ("Positions", "g-position"),
            ("Rotations", "g-rotation"),
            ("Sizes", "g-scale"),
            ("Opacities", "g-opacity"),
            ("Headers, normals if any, extras", "g-other"),
        ];
        let mut parts = names.map(|(name, class)| Part { name, class, before: 0, after: 0 });
        for (part, values) in parts.iter_mut().zip(per_gaussian) {
            part.before = values * gaussians * PLY_VALUE;
        }
        let named: u64 = parts.iter().map(|part| part.before).sum();
        parts[OTHER].before = report.ply_bytes.saturating_sub(named);
        for (name, bytes) in report.attributes {
            parts[group(name)].after += bytes;
        }
        let mean_nonzeros = model.codes().nonzeros() as f64 / (gaussians.max(1)) as f64;
        let (sh_before, sh_after) = (parts[0].before, parts[0].after);
        Self { report, gaussians, dim, mean_nonzeros, sh_before, sh_after, parts: parts.into() }
    }

    /// Whether view-dependent colour is more than half of the PLY.
    fn sh_dominates(&self) -> bool {
        self.sh_before > self.report.ply_bytes / 2
    }

    /// Whether every Gaussian is within the tolerance, if there is one.
    fn kept(&self) -> Option<f64> {
        let record = self.report.model.record();
        record.tolerance.filter(|tolerance| record.over_tolerance == 0 && record.max_residual <= *tolerance)
    }
}

pub(super) fn header(page: &mut String, facts: &Facts<'_>) {
    let Facts { report, gaussians, .. } = facts;
    let (before, after) = (text::bytes(report.ply_bytes), text::bytes(report.file_bytes));
    let _ = write!(
        page,
        "<header><p class=\"mark\">lexisplat</p>\n<h1>{before} became <em>{after}</em></h1>\n\
         <p class=\"lede\"><strong>{}</strong> is a 3D scene made of {} soft coloured blobs, so-called \
         Gaussians, whose colour changes with the side you look from. lexisplat rewrote that colour in a \
         small vocabulary learnt from the scene itself. Nothing else was touched: places, sizes, \
         rotations, opacities and base colours are bit for bit those of the original.</p>\n<dl class=\"cards\">",
        text::escape(report.title),
        text::count(*gaussians),
    );
    let mut card = |value: String, what: &str| {
        let _ = write!(page, "<div class=\"card\"><dt>{what}</dt><dd>{value}</dd></div>");
    };
    card(
        text::ratio(report.ply_bytes as f64, report.file_bytes as f64),
        "smaller: the whole file against the whole PLY, everything counted",
    );
    if facts.dim > 0 {
        card(
            text::ratio(facts.sh_before as f64, facts.sh_after as f64),
            "smaller: the view-dependent colour alone, dictionary and indices counted",
        );
        card(
            format!("{:.1} <small>of {}</small>", facts.mean_nonzeros, facts.dim),
            "numbers that remain to describe a Gaussian\u{2019}s view-dependent colour, on average",
        );
    }
    if report.comparison.identical {
        card("identical".to_owned(), "every compared view");
    } else if let Some(psnr) = report.comparison.psnr.mean {
        card(
            format!("{psnr:.1} <small>dB</small>"),
            "mean PSNR against the original\u{2019}s pictures; more is closer",
        );
    }
    page.push_str("</dl></header>\n");
}

fn image(page: &mut String, class: &str, alt: &str, png: &[u8]) {
    let _ = write!(page, "<img class=\"{class}\" alt=\"{alt}\" src=\"data:image/png;base64,");
    base64::encode(png, page);
    page.push_str("\">");
}

pub(super) fn pictures(page: &mut String, facts: &Facts<'_>) {
    let report = facts.report;
    if report.pictures.is_empty() {
        return;
    }
    page.push_str(
        "<section aria-labelledby=\"see\"><h2 id=\"see\">Can you tell?</h2>\n\
         <p>Left of the line is the original, right of it the compressed scene, drawn straight from its \
         codes. Drag the line.</p>\n<div class=\"panel\">",
    );
    for Picture { name, original, compressed, difference } in report.pictures {
        let name = text::escape(name);
        let _ = write!(page, "<figure class=\"view\" data-name=\"{name}\"><div class=\"stage\">");
        image(page, "before", &format!("{name}, original"), original);
        image(page, "after", &format!("{name}, compressed"), compressed);
        image(page, "difference", &format!("{name}, amplified difference"), difference);
        page.push_str(
            "<span class=\"tag left\">original</span><span class=\"tag right\">compressed</span></div>\
             <figcaption>",
        );
        page.push_str(&name);
        if let Some(score) = report.comparison.views.iter().find(|view| text::escape(&view.name) == name) {
            if score.identical {
                page.push_str(" \u{b7} identical");
            } else {
                let psnr = text::number(score.psnr, 2);
                let _ = write!(page, " \u{b7} PSNR {psnr}\u{a0}dB \u{b7} SSIM {:.4}", score.ssim);
            }
        }
        page.push_str("</figcaption></figure>\n");
    }
    let _ = write!(
        page,
        "<div class=\"controls\"><label for=\"at\">Line <input id=\"at\" type=\"range\" min=\"0\" \
         max=\"100\" step=\"0.5\" value=\"50\"></label>\
         <button id=\"differ\" type=\"button\" aria-pressed=\"false\">Difference, \u{d7}{} brighter</button></div>\
         <div class=\"thumbs\" role=\"group\" aria-label=\"Views\"></div></div></section>",
        report.amplification
    );
}

pub(super) fn steps(page: &mut String, facts: &Facts<'_>) {
    let (model, report) = (facts.report.model, facts.report);
    if facts.dim == 0 {
        page.push_str(
            "<section><h2>What happened</h2><p>This scene has SH degree 0: its colour does not depend on \
             the view, so there was nothing to rewrite. Everything is stored as it was.</p></section>",
        );
        return;
    }
    let stop = match (model.record().tolerance, model.record().max_nonzeros) {
        (Some(tolerance), None) => format!("until the rest is within {tolerance}"),
        (Some(tolerance), Some(most)) => format!("until the rest is within {tolerance} or {most} are used"),
        (None, Some(most)) => format!("until {most} are used"),
        (None, None) => "until nothing is left".to_owned(),
    };
    let seconds = |s: f64| if s.is_finite() { format!(" It took {s:.1}\u{a0}s.") } else { String::new() };
    let _ = write!(
        page,
        "<section aria-labelledby=\"how\"><h2 id=\"how\">What happened</h2>\n<ol class=\"steps\">\
         <li><strong>Look</strong>Each Gaussian has {dim} numbers (spherical harmonics of degree {degree}) \
         that say how its colour changes with direction{most}.</li>\
         <li><strong>Learn words</strong>From a sample of them, {atoms} typical patterns were learnt: the \
         dictionary\u{2019}s atoms.{learn}</li>\
         <li><strong>Spell</strong>{pursuit} picked a few atoms and their amounts for every Gaussian, one by one, \
         {stop}.{code}</li>\
         <li><strong>Check</strong>Every Gaussian was put together again from what the file holds, in double \
         precision, and measured. {escapes}</li></ol></section>",
        dim = facts.dim,
        most = if facts.sh_dominates() { ": most of the file" } else { "" },
        degree = model.degree(),
        atoms = text::count(model.dictionary().len() as u64),
        learn = seconds(report.learn_seconds),
        pursuit = match model.record().pursuit {
            Some(Pursuit::Omp) => "Orthogonal matching pursuit",
            _ => "Orthogonal least squares",
        },
        code = seconds(report.code_seconds),
        escapes = match model.codes().escapes().gaussians.len() {
            0 => "All of them fit.".to_owned(),
            1 => "One that did not fit is stored exactly.".to_owned(),
            n => format!("{} that did not fit are stored exactly.", text::count(n as u64)),
        },
    );
}

pub(super) fn promise(page: &mut String, facts: &Facts<'_>) {
    let record = facts.report.model.record();
    if facts.dim == 0 {
        return;
    }
    page.push_str("<section aria-labelledby=\"promise\"><h2 id=\"promise\">The promise</h2>\n");
    if let Some(tolerance) = facts.kept() {
        let share = |v: f64| if tolerance > 0.0 { (v / tolerance * 100.0).clamp(0.0, 100.0) } else { 100.0 };
        let single = 1.0 / (4.0 * std::f64::consts::PI).sqrt();
        let all = 1.0 / (12.0 * std::f64::consts::PI).sqrt();
        let _ = write!(
            page,
            "<div class=\"promise\"><p><b>Kept for all {count} Gaussians.</b> None is further than \
             {tolerance} from its original, measured as the length of the difference of its {dim} numbers. \
             The furthest is at {max:.8}, the typical one (root mean square) at {rms:.4}.</p></div>\n\
             <div class=\"gauge\" role=\"img\" aria-label=\"Largest error {max:.8} of {tolerance} allowed, \
             root mean square {rms:.4}\"><i style=\"width:{max_share:.2}%\"></i>\
             <i style=\"width:{rms_share:.2}%\"></i></div>\
             <p class=\"note\">The whole width is the promise, {tolerance}. The bar ends at the largest error; its muted part ends \
             at the root mean square.</p>\n\
             <p class=\"note\">In colour, where 1 is the whole range and before blending: averaged over all directions \
             a Gaussian is off by at most {all_error:.4} in the three channels together (root mean \
             square), by at most {single_error:.4} in one channel alone. Blending many Gaussians into a \
             pixel averages that down further.</p>",
            count = text::count(facts.gaussians),
            dim = facts.dim,
            max = record.max_residual,
            rms = record.rms_residual,
            max_share = share(record.max_residual),
            rms_share = share(record.rms_residual),
            all_error = tolerance * all,
            single_error = tolerance * single,
        );
    } else {
        let over = match record.tolerance {
            Some(tolerance) => format!(
                "{} Gaussians are further than {tolerance} from their original",
                text::count(record.over_tolerance)
            ),
            None => "There is no bound on a Gaussian\u{2019}s error".to_owned(),
        };
        let cap = record.max_nonzeros.map_or_else(String::new, |n| {
            format!(": at most {n} numbers a Gaussian were asked for, whatever the error")
        });
        let _ = write!(
            page,
            "<div class=\"promise lifted\"><p><b>{over}{cap}.</b> The largest error is {:.8}, the root mean \
             square {:.4}.</p></div>",
            record.max_residual, record.rms_residual
        );
    }
    page.push_str("</section>\n");
}

pub(super) fn sizes(page: &mut String, facts: &Facts<'_>) {
    let report = facts.report;
    let _ = write!(
        page,
        "<section aria-labelledby=\"bytes\"><h2 id=\"bytes\">Where the bytes are</h2>\n\
         <p>{}</p>\n\
         <div class=\"panel\">{}<div class=\"scroll\"><table><thead><tr><th scope=\"col\">What</th>\
         <th scope=\"col\">PLY</th><th scope=\"col\">.lexi</th><th scope=\"col\">Ratio</th></tr></thead><tbody>",
        if facts.sh_dominates() {
            "View-dependent colour was most of the PLY. It shrank; the rest is as it was."
        } else {
            "View-dependent colour was the smaller part of the PLY. The rest is as it was."
        },
        charts::bars(&facts.parts, ("PLY", report.ply_bytes), (".lexi", report.file_bytes)),
    );
    for (k, part) in facts.parts.iter().enumerate() {
        // What holds no information has no ratio.
        let ratio = if k == OTHER { 0 } else { part.after };
        let _ = write!(
            page,
            "<tr><th scope=\"row\"><span class=\"key {}\"></span>{}</th><td>{}</td><td>{}</td><td>{}</td></tr>",
            part.class,
            part.name,
            text::bytes(part.before),
            text::bytes(part.after),
            text::ratio(part.before as f64, ratio as f64)
        );
    }
    let _ = write!(
        page,
        "</tbody><tfoot><tr><th scope=\"row\">Whole file</th><td>{}</td><td>{}</td><td>{}</td></tr></tfoot>\
         </table></div></div>",
        text::bytes(report.ply_bytes),
        text::bytes(report.file_bytes),
        text::ratio(report.ply_bytes as f64, report.file_bytes as f64)
    );
    if facts.dim > 0 {
        let _ = write!(
            page,
            "<p class=\"note\">Papers often count coefficients alone, without indices and without the rest \
             of the file: {} / {:.2} = {} here. The ratios above count every byte; a megabyte is 10<sup>6</sup> bytes.</p>",
            facts.dim,
            facts.mean_nonzeros,
            text::ratio(facts.dim as f64, facts.mean_nonzeros)
        );
    }
    page.push_str("</section>\n");
}

pub(super) fn nonzeros(page: &mut String, facts: &Facts<'_>) {
    if facts.dim == 0 || facts.gaussians == 0 {
        return;
    }
    let mut counts = vec![0_u64; facts.dim + 1];
    for &n in facts.report.model.codes().counts() {
        if let Some(count) = counts.get_mut(usize::from(n)) {
            *count += 1;
        }
    }
    // A Gaussian stored exactly has no code; it is told of elsewhere.
    counts[0] -= (facts.report.model.codes().escapes().gaussians.len() as u64).min(counts[0]);
    let _ = write!(
        page,
        "<section aria-labelledby=\"need\"><h2 id=\"need\">Each takes what it needs</h2>\n\
         <p>A dull surface is told in a word or two, a shiny one takes more: how many Gaussians (height) need \
         how many atoms (left to right).</p>\n<div class=\"panel\">{}</div></section>",
        charts::histogram(&counts, facts.mean_nonzeros)
    );
}

pub(super) fn dictionary(page: &mut String, facts: &Facts<'_>) {
    let model = facts.report.model;
    if model.dictionary().is_empty() {
        return;
    }
    let usage = Usage::of(model);
    let (shown, all) = (usage.shown().len(), usage.ranked.len());
    let which = if shown == all {
        format!("The {all} atoms")
    } else {
        format!("The {shown} most used of the {all} atoms")
    };
    let _ = write!(
        page,
        "<section aria-labelledby=\"words\"><h2 id=\"words\">The vocabulary</h2>\n<p>{which}, each drawn as a \
         ball: every side shows the colour the atom adds when the Gaussian is seen from there, grey where it \
         adds nothing. Below each stands the share of Gaussians that use it. Drag, or use the arrow keys, to turn \
         them all.</p>\n<noscript><p class=\"note\">The balls are drawn by the page\u{2019}s script.</p></noscript>\
         <div class=\"panel\"><div id=\"atoms\" tabindex=\"0\" role=\"img\" aria-label=\"{which} as balls\">",
    );
    for (atom, users) in usage.shown() {
        let share = *users as f64 / facts.gaussians.max(1) as f64 * 100.0;
        let _ = write!(
            page,
            "<figure title=\"atom {atom}: {} Gaussians\"><canvas></canvas><figcaption>{share:.1}%</figcaption></figure>",
            text::count(*users)
        );
    }
    let _ = write!(
        page,
        "</div></div><script type=\"application/json\" id=\"atom-data\">{}</script></section>",
        atoms::json(model, &usage)
    );
}

pub(super) fn views(page: &mut String, facts: &Facts<'_>) {
    let comparison = facts.report.comparison;
    if comparison.views.is_empty() {
        return;
    }
    let identical = comparison.views.iter().filter(|view| view.identical).count();
    page.push_str(
        "<section aria-labelledby=\"views\"><h2 id=\"views\">View by view</h2>\n\
         <p>Both scenes were drawn by the same renderer from the same cameras. PSNR and SSIM say how close the \
         pictures are: at 40\u{a0}dB they are off by 1\u{a0}% of the range (root mean square), at 50\u{a0}dB by 0.3\u{a0}%; an SSIM \
         of 1 is a perfect match.</p>\n<div class=\"panel scroll\"><table><thead><tr><th scope=\"col\">View</th>\
         <th scope=\"col\">Size</th><th scope=\"col\">PSNR, dB</th><th scope=\"col\">SSIM</th></tr></thead><tbody>",
    );
    for view in &comparison.views {
        let psnr = if view.identical { "identical".to_owned() } else { text::number(view.psnr, 2) };
        let _ = write!(
            page,
            "<tr><th scope=\"row\">{}</th><td>{}\u{d7}{}</td><td>{psnr}</td><td>{:.5}</td></tr>",
            text::escape(&view.name),
            view.width,
            view.height,
            view.ssim
        );
    }
    page.push_str("</tbody><tfoot>");
    let (psnr, ssim) = (&comparison.psnr, &comparison.ssim);
    for (name, psnr, ssim) in
        [("Mean", psnr.mean, ssim.mean), ("Lowest", psnr.min, ssim.min), ("Highest", psnr.max, ssim.max)]
    {
        let (psnr, ssim) = (text::number(psnr, 2), text::number(ssim, 5));
        let _ = write!(page, "<tr><th scope=\"row\">{name}</th><td></td><td>{psnr}</td><td>{ssim}</td></tr>");
    }
    page.push_str("</tfoot></table></div>\n");
    if identical > 0 {
        let _ = write!(
            page,
            "<p class=\"note\">{identical} of {} views are identical and have no PSNR; its mean is over the others.</p>",
            comparison.views.len()
        );
    }
    page.push_str("</section>\n");
}

pub(super) fn footer(page: &mut String, facts: &Facts<'_>) {
    let record = facts.report.model.record();
    let _ = write!(
        page,
        "<footer><p>Make this again:</p><pre>{}</pre>\
         <p>SH degree {} \u{b7} values as {} \u{b7} {} pursuit \u{b7} seed {}. This page holds everything it shows and \
         asks nothing of the network.</p></footer>",
        text::escape(facts.report.command),
        facts.report.model.degree(),
        Layout::of(CodeLayout::Compact, facts.report.model.codes().values().value_type()),
        record.pursuit.map_or("no", Pursuit::name),
        record.seed
    );
}
