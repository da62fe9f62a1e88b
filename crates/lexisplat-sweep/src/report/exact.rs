//! The parts of the page about the file in an exact layout: the paper's method, and the bound on its error.

use lexisplat::{CodeLayout, Layout, Pursuit, Record};
use lexisplat_eval::format;
use maud::{Markup, PreEscaped, html};

use super::atoms::{self, Usage};
use super::{Report, packed, smaller};
use crate::numbers;
use crate::page::{card, section};

/// Facts that several parts need.
pub(super) struct Facts<'a> {
    report: &'a Report<'a>,
    record: &'a Record,
    gaussians: u64,
    /// Number of SH-rest values of a Gaussian.
    dim: usize,
    mean_nonzeros: f64,
}

impl<'a> Facts<'a> {
    pub(super) fn new(report: &'a Report<'a>) -> Self {
        let model = report.model;
        let gaussians = model.len() as u64;
        let mean_nonzeros = model.codes().nonzeros() as f64 / gaussians.max(1) as f64;
        Self { report, record: model.record(), gaussians, dim: model.degree().rest(), mean_nonzeros }
    }

    pub(super) fn summary(&self) -> Markup {
        let (before, after) =
            (packed::ply_groups(self.report)[0], packed::lexi_groups(&self.report.exact)[0]);
        let content = html! {
            p {
                "The second file, " (self.report.exact.name) ", rewrites view-dependent colour alone. Places, \
                 sizes, rotations, opacities and base colours are bit for bit those of the original."
            }
            dl.cards {
                (card(smaller(self.report.ply_bytes, self.report.exact.bytes), "smaller: the whole file"))
                (card(numbers::ratio(before, after), "smaller: view-dependent colour alone, dictionary and indices counted"))
                (card(
                    html! { (format!("{:.1} ", self.mean_nonzeros)) small { "of " (self.dim) } },
                    "numbers that remain to describe a Gaussian\u{2019}s view-dependent colour, on average",
                ))
                (packed::quality(self.report.exact.comparison))
            }
            p.note {
                "Papers often count coefficients alone, without indices and without the rest of the file: "
                (format!("{} / {:.2} = {}", self.dim, self.mean_nonzeros, numbers::ratio(self.dim as f64, self.mean_nonzeros)))
                " here."
            }
        };
        section("exact", "When geometry must not change: the exact layout", &content)
    }

    pub(super) fn steps(&self) -> Markup {
        let (model, report) = (self.report.model, self.report);
        let within = |tolerance| format!(" until the rest is within {tolerance}");
        let stop = self.record.tolerance.map(within).unwrap_or_default();
        let seconds = |s: f64| if s.is_finite() { format!(" It took {s:.1}\u{a0}s.") } else { String::new() };
        let content = html! {
            ol.steps {
                li {
                    strong { "Look" } "Each Gaussian has " (self.dim) " numbers (spherical harmonics of degree "
                    (model.degree()) ") that say how its colour changes with direction"
                    @if packed::ply_groups(report)[0] > report.ply_bytes as f64 / 2.0 { ": most of the PLY" } "."
                }
                li {
                    strong { "Learn" } "From a sample of them, " (format::count(model.dictionary().len() as u64))
                    " typical patterns were learnt: the dictionary\u{2019}s atoms." (seconds(report.learn_seconds))
                }
                li {
                    strong { "Code" }
                    @match self.record.pursuit { Some(Pursuit::Omp) => "Orthogonal matching pursuit", _ => "Orthogonal least squares" }
                    " picked a few atoms and their amounts for every Gaussian, one by one," (stop) "."
                    (seconds(report.code_seconds))
                }
                li {
                    strong { "Check" } "Every Gaussian was put together again from what the file holds, in double \
                     precision, and measured. "
                    @match model.codes().escapes().gaussians.len() {
                        0 => "All of them are within the bound.",
                        n => { (format::count(n as u64)) " that did not fit are stored exactly." }
                    }
                }
            }
        };
        section("how", "How the exact file is made", &content)
    }

    /// Returns the bound on the error, if every Gaussian is within it.
    pub(super) fn bound(&self) -> Markup {
        let record = self.record;
        let is_kept = |tolerance: &f64| record.over_tolerance == 0 && record.max_residual <= *tolerance;
        let Some(tolerance) = record.tolerance.filter(is_kept) else { return html! {} };
        let Record { max_residual: max, rms_residual: rms, .. } = *record;
        let share = |v: f64| if tolerance > 0.0 { (v / tolerance * 100.0).clamp(0.0, 100.0) } else { 100.0 };
        // These factors turn an SH error of length 1 into the root mean square error of the colour over the sphere
        // (docs/METHOD.md).
        let single = 1.0 / (4.0 * std::f64::consts::PI).sqrt();
        let all = 1.0 / (12.0 * std::f64::consts::PI).sqrt();
        let content = html! {
            .bound {
                p {
                    b { "Kept for all " (format::count(self.gaussians)) " Gaussians." }
                    " None is further than " (tolerance) " from its original, measured as the length of the difference of its "
                    (self.dim) " numbers. The furthest is at " (format!("{max:.8}")) ", the typical one (root mean square) at "
                    (format!("{rms:.4}")) "."
                }
            }
            .gauge role="img" aria-label=(format!("Largest error {max:.8} of {tolerance} allowed, root mean square {rms:.4}")) {
                i style=(format!("width:{:.2}%", share(max))) {}
                i style=(format!("width:{:.2}%", share(rms))) {}
            }
            p.note {
                "The whole width is the bound, " (tolerance) ". The bar ends at the largest error; its muted part ends at the \
                 root mean square."
            }
            p.note {
                "In colour, where 1 is the whole range and before blending: averaged over all directions a Gaussian is off \
                 by at most " (format!("{:.4}", tolerance * all)) " in the three channels together (root mean square), by at \
                 most " (format!("{:.4}", tolerance * single)) " in one channel alone. Blending many Gaussians into a pixel \
                 averages that down further."
            }
        };
        section("bound", "The bound on the error", &content)
    }

    pub(super) fn nonzeros(&self) -> Markup {
        let codes = self.report.model.codes();
        let mut counts = vec![0_u64; self.dim + 1];
        for &n in codes.counts() {
            if let Some(count) = counts.get_mut(usize::from(n)) {
                *count += 1;
            }
        }
        // Gaussians that are stored exactly have no code. They are counted as escapes.
        counts[0] -= (codes.escapes().gaussians.len() as u64).min(counts[0]);
        let used = counts.iter().rposition(|&n| n > 0).map_or(1, |last| last + 1);
        let tallest = counts.iter().copied().max().unwrap_or(0).max(1) as f64;
        let total = counts.iter().sum::<u64>().max(1) as f64;
        let mean = format!("mean {:.2}", self.mean_nonzeros);
        let mean_at = (self.mean_nonzeros + 0.5) / used as f64 * 100.0;
        let content = html! {
            p {
                "A matt surface takes an atom or two, a shiny one takes more. The height is the number of Gaussians that \
                 need that many atoms; the number of atoms grows from left to right."
            }
            .panel {
                .histogram role="img" aria-label=(format!("How many Gaussians need how many atoms; {mean}")) {
                    @for (k, &n) in counts[..used].iter().enumerate() {
                        span title=(format!("{k} atoms: {} Gaussians ({:.1}%)", format::count(n), n as f64 / total * 100.0)) {
                            i.g-codes style=(format!("height:{:.2}%", n as f64 / tallest * 100.0)) {}
                            small { @if k.is_multiple_of(5) { (k) } }
                        }
                    }
                    // The text is on the side that has more room.
                    b.mean.left[mean_at > 50.0] style=(format!("left:{mean_at:.2}%")) { (mean) }
                }
            }
        };
        section("need", "Each takes what it needs", &content)
    }

    pub(super) fn dictionary(&self) -> Markup {
        let model = self.report.model;
        let usage = Usage::of(model);
        let (shown, all) = (usage.shown().len(), usage.ranked.len());
        let which = if shown == all {
            format!("The {all} atoms")
        } else {
            format!("The {shown} most used of the {all} atoms")
        };
        let content = html! {
            p {
                (which) ", each drawn as a ball: every side shows the colour the atom adds when the Gaussian is seen from \
                 there, grey where it adds nothing. The share of Gaussians that use it stands below each. Drag, or use the \
                 arrow keys, to turn them all."
            }
            noscript { p.note { "The page\u{2019}s script draws the balls." } }
            .panel {
                #atoms tabindex="0" role="img" aria-label=(format!("{which} as balls")) {
                    @for (atom, users) in usage.shown() {
                        figure title=(format!("atom {atom}: {} Gaussians", format::count(*users))) {
                            canvas {}
                            figcaption { (format!("{:.1}%", *users as f64 / self.gaussians.max(1) as f64 * 100.0)) }
                        }
                    }
                }
            }
            script #atom-data type="application/json" { (PreEscaped(atoms::json(model, &usage))) }
        };
        section("atoms-title", "The dictionary", &content)
    }

    pub(super) fn footer(&self) -> Markup {
        html! {
            footer {
                p { "Make this again:" }
                pre { (self.report.command) }
                p {
                    "SH degree " (self.report.model.degree()) " \u{b7} exact values as " (Layout::of(CodeLayout::Compact, self.report.model.codes().values().value_type())) " \u{b7} "
                    @if let Some(pursuit) = self.record.pursuit { (pursuit) " pursuit \u{b7} " }
                    "seed " (self.record.seed)
                    ". This page holds everything it shows and asks nothing of the network."
                }
            }
        }
    }
}
