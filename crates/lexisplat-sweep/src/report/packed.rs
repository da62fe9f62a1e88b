//! The parts of the page about the packed file, and the parts that show both files side by side.

use lexisplat::sh::CHANNELS;
use lexisplat_eval::montage::AMPLIFICATION;
use lexisplat_eval::{Comparison, Summary, format};
use maud::{Markup, html};

use super::{CompressedFile, Picture, Report, smaller};
use crate::numbers;
use crate::page::{card, decibels, image, scores, section};
use crate::table::{Row, Table};

/// Number of bytes of a value in a PLY. Every known trainer writes floats.
const PLY_VALUE: u64 = 4;
/// Smallest part of a bar with room for its share in digits, in percent of the longest bar.
const LABELLED: f64 = 6.0;

/// Groups of bytes: the name, the class of their colour, and the prefixes of the names of their parts in .lexi files. All
/// other parts belong to the last group.
const GROUPS: [(&str, &str, &[&str]); 7] = [
    ("View-dependent colour (SH)", "g-codes", &["codes", "escapes", "dictionary"]),
    ("Base colour", "g-base", &["dc"]),
    ("Positions", "g-position", &["position"]),
    ("Rotations", "g-rotation", &["rotation"]),
    ("Sizes", "g-scale", &["scale"]),
    ("Opacities", "g-opacity", &["opacity"]),
    ("Headers, tables, normals if any, extras", "g-other", &[]),
];
/// Index of the last group.
const OTHER: usize = GROUPS.len() - 1;

/// Number of bytes of each group.
pub(super) type Groups = [f64; GROUPS.len()];

/// Returns the groups of the PLY.
pub(super) fn ply_groups(report: &Report<'_>) -> Groups {
    let values = [report.model.degree().rest(), CHANNELS, 3, 4, 3, 1];
    let mut groups = [0.0; GROUPS.len()];
    for (group, values) in groups.iter_mut().zip(values) {
        *group = ((values * report.model.len()) as u64 * PLY_VALUE) as f64;
    }
    groups[OTHER] = (report.ply_bytes as f64 - groups.iter().sum::<f64>()).max(0.0);
    groups
}

/// Returns the groups of a .lexi file.
pub(super) fn lexi_groups(file: &CompressedFile<'_>) -> Groups {
    let mut groups = [0.0; GROUPS.len()];
    for (name, bytes) in file.attributes {
        let first = name.split('.').next().unwrap_or(name);
        let group = GROUPS.iter().position(|(.., names)| names.contains(&first));
        groups[group.unwrap_or(OTHER)] += bytes;
    }
    groups
}

pub(super) fn header(report: &Report<'_>) -> Markup {
    let Report { ply_bytes, packed, model, .. } = report;
    let gaussians = model.len() as u64;
    html! {
        header {
            p.mark { "lexisplat" }
            h1 { (format::bytes(*ply_bytes)) " became " em { (format::bytes(packed.bytes)) } }
            p.lede {
                strong { (report.title) }
                " is a 3D scene made of " (format::count(gaussians)) " soft coloured blobs, so-called Gaussians, whose \
                 colour changes with the side you look from. lexisplat rounded each of their numbers as finely as the \
                 pictures need it, and stored them in as few bits as possible. No photos, cameras or training were needed."
            }
            dl.cards {
                (card(smaller(*ply_bytes, packed.bytes), "smaller: the whole file against the whole PLY, everything counted"))
                (quality(packed.comparison))
                (card(
                    html! { (format!("{:.1} ", packed.bytes as f64 / gaussians as f64)) small { "bytes" } },
                    &format!("for each Gaussian, of {:.0} in the PLY", *ply_bytes as f64 / gaussians as f64),
                ))
            }
        }
    }
}

/// Returns the cards that tell how close the pictures of a file are to those of the original.
pub(super) fn quality(comparison: &Comparison) -> Markup {
    html! {
        @if comparison.identical {
            (card("identical", "every compared view"))
        } @else if let (Some(mean), Some(min)) = (comparison.psnr.mean, comparison.psnr.min) {
            (card(decibels(&format!("{mean:.1}")), "mean PSNR against the original\u{2019}s pictures; more is closer"))
            (card(decibels(&format!("{min:.1}")), "PSNR of the worst of the views"))
        }
    }
}

pub(super) fn pictures(report: &Report<'_>) -> Markup {
    let content = html! {
        p {
            "Left of the line is the original, right of it the packed file, drawn straight from its codes. Drag \
             the line. The pictures are JPEGs to keep this page small; the scores are of the exact pictures."
        }
        .panel {
            @for Picture { name, original, compressed, difference } in report.pictures {
                figure.view data-name=(name) {
                    .stage {
                        (image("jpeg", "before", &format!("{name}, original"), original))
                        (image("jpeg", "after", &format!("{name}, compressed"), compressed))
                        (image("jpeg", "difference", &format!("{name}, amplified difference"), difference))
                        span."tag left" { "original" }
                        span."tag right" { "compressed" }
                    }
                    figcaption { (name) (scores(report.packed.comparison, name)) }
                }
            }
            .controls {
                label for="at" { "Line " input #at type="range" min="0" max="100" step="0.5" value="50"; }
                button #differ type="button" aria-pressed="false" {
                    "Difference, \u{d7}" (AMPLIFICATION) " brighter"
                }
            }
            .thumbs role="group" aria-label="Views" {}
        }
    };
    section("see", "Can you tell?", &content)
}

pub(super) fn steps() -> Markup {
    let content = html! {
        ol.steps {
            li { strong { "Look" } "The scene is drawn from generated views, and for each number of each Gaussian it is \
                 measured how much the pictures change with it." }
            li { strong { "Round" } "Each number is rounded to a step that follows from that: fine where pictures \
                 depend on it, coarse where they do not." }
            li { strong { "Learn" } "View-dependent colour is written as a few atoms of a dictionary that is learnt \
                 from the scene." }
            li { strong { "Code" } "What is left is predicted from its neighbours and entropy-coded: what is likely \
                 takes few bits." }
        }
    };
    section("packing", "How the packed file is made", &content)
}

/// Returns a bar. Its length is its share of `longest`, and the lengths of its parts are in proportion to their bytes.
fn bar(name: &str, total: u64, groups: &Groups, longest: f64) -> Markup {
    html! {
        p.label { (name) ", " (format::bytes(total)) }
        .bar role="img" aria-label=(format!("Bytes of {name} by attribute")) {
            @for ((what, class, _), bytes) in GROUPS.iter().zip(groups).filter(|(_, bytes)| **bytes > 0.0) {
                @let width = bytes / longest * 100.0;
                span class=(class) style=(format!("width:{width:.2}%")) title=(format!("{what}: {}", format::bytes(whole(*bytes)))) {
                    @if width >= LABELLED { (format!("{:.0}%", bytes / total.max(1) as f64 * 100.0)) }
                }
            }
        }
    }
}

/// Returns `bytes` rounded to a whole number.
fn whole(bytes: f64) -> u64 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bytes of a part of a file")]
    let whole = bytes.max(0.0).round() as u64;
    whole
}

pub(super) fn sizes(report: &Report<'_>) -> Markup {
    let Report { ply_bytes, packed, exact, .. } = report;
    let columns = [ply_groups(report), lexi_groups(packed), lexi_groups(exact)];
    let longest = (*ply_bytes).max(packed.bytes).max(exact.bytes).max(1) as f64;
    let content = html! {
        p { "The packed file is " (packed.name) "; " (exact.name) " is the exact one described below." }
        .panel {
            (bar("PLY", *ply_bytes, &columns[0], longest))
            (bar("packed", packed.bytes, &columns[1], longest))
            (bar("exact", exact.bytes, &columns[2], longest))
            .scroll {
                table {
                    thead { tr { @for name in ["What", "PLY", "Packed", "Ratio", "Exact", "Ratio"] { th scope="col" { (name) } } } }
                    tbody {
                        @for (k, (what, class, _)) in GROUPS.iter().enumerate() {
                            @let before = columns[0][k];
                            tr {
                                th scope="row" { span class=(format!("key {class}")) {} (what) }
                                td { (format::bytes(whole(before))) }
                                @for after in [columns[1][k], columns[2][k]] {
                                    td { (format::bytes(whole(after))) }
                                    // Headers hold no numbers of the scene, so they have no ratio.
                                    td { (numbers::ratio(before, if k == OTHER { 0.0 } else { after })) }
                                }
                            }
                        }
                    }
                    tfoot {
                        tr {
                            th scope="row" { "Whole file" }
                            td { (format::bytes(*ply_bytes)) }
                            @for file in [packed, exact] {
                                td { (format::bytes(file.bytes)) }
                                td { (smaller(*ply_bytes, file.bytes)) }
                            }
                        }
                    }
                }
            }
        }
        p.note { "The ratios count every byte; a megabyte is 10" sup { "6" } " bytes." }
    };
    section("bytes", "Where the bytes are", &content)
}

pub(super) fn views(report: &Report<'_>) -> Markup {
    let files = [report.packed.comparison, report.exact.comparison];
    let mut table = Table::new("views", "", 2, &["View", "Size"]);
    table.add_columns(["Packed", "Exact"].into_iter().flat_map(|file| [(file, "PSNR, dB"), (file, "SSIM")]));
    table.push_block(files[0].views.iter().enumerate().map(|(i, view)| {
        let scores = files.iter().filter_map(|file| file.views.get(i)).flat_map(|score| {
            let psnr = if score.identical { "identical".to_owned() } else { numbers::number(score.psnr, 2) };
            [psnr, format!("{:.5}", score.ssim)]
        });
        Row::new(
            [view.name.clone(), format!("{}\u{d7}{}", view.width, view.height)].into_iter().chain(scores),
        )
    }));
    table.push_block(Summary::STATISTICS.map(|(name, part)| {
        let scores = files
            .iter()
            .flat_map(|file| [numbers::number(part(&file.psnr), 2), numbers::number(part(&file.ssim), 5)]);
        Row::new([name.to_owned(), String::new()].into_iter().chain(scores))
    }));
    let content = html! {
        p {
            "All scenes were drawn by the same renderer from the same cameras. PSNR and SSIM say how close the \
             pictures are to the original\u{2019}s: at 40\u{a0}dB they are off by 1\u{a0}% of the range (root mean \
             square), at 50\u{a0}dB by 0.3\u{a0}%; an SSIM of 1 is a perfect match."
        }
        .panel.scroll { (table.to_html()) }
        @if files.iter().any(|file| file.views.iter().any(|view| view.identical)) {
            p.note { "Identical views have no PSNR; means are over the others." }
        }
    };
    section("views", "View by view", &content)
}
