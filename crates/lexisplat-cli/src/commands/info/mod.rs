//! `lexisplat info`.

mod codes;
mod histogram;
mod layers;

use std::collections::BTreeMap;
use std::fmt::Write as _;

use anyhow::Result;
use lexisplat::lexi::LexiReader;
use lexisplat::ply::{PlySummary, ReadOptions};
use lexisplat::stats::{Lint, NORM_BINS};
use lexisplat::{Error, FileKind, Offset, SplatSource as _, Splats, stream};
use lexisplat_eval::format;
use lexisplat_formats::{Opened, open};
use serde::Serialize;
use serde_json::Value;

use self::codes::LexiFacts;
use self::histogram::bars;
use crate::args::{Common, Info};
use crate::files::{input, siblings, tell, warn};
use crate::progress::Bars;

pub(crate) fn run(args: &Info, common: &Common) -> Result<()> {
    let (name, bytes) = input(&args.file, common)?;
    let bars = Bars::new(common.quiet || common.json);
    let limits = common.limits()?;
    let file = (name.as_str(), bytes.len() as u64);
    if FileKind::of(&name, &bytes) == FileKind::Lexi {
        let mut lexi = LexiReader::open(&name, &bytes, &limits)?;
        if args.verify {
            lexi = lexi.with_integers_verified()?;
        }
        let survey = stream::survey(&lexi, &std::env::temp_dir())?;
        let parts = codes::parts(&lexi, &survey);
        let lexi_facts = LexiFacts::new(&lexi, &survey, &parts, file.1, args.verify);
        return Facts::new(file, &lexi.empty(), &survey.lint, Kind::Lexi { lexi: Box::new(lexi_facts) })
            .print(args.all, common);
    }
    if args.verify {
        return Err(Error::parameter("verify", true, "only for packed .lexi files").into());
    }
    let read = ReadOptions::default().with_drop_invalid(args.drop_invalid).with_limits(limits);
    let opened = open(&name, &bytes, siblings(&name), &read, false, &bars)?;
    let source = opened.source();
    warn(&name, source.warnings());
    let lint = stream::lint(source, &bars)?;
    let kind = match &opened {
        Opened::Ply(ply) => Kind::Ply { ply: ply.summary(), warnings: ply.warnings() },
        Opened::Other(format, other) => Kind::Other {
            format: format.extension(),
            about: other.facts().iter().cloned().collect(),
            warnings: other.warnings(),
        },
        _ => return Err(Error::malformed(&*name, "the format is not known").into()),
    };
    Facts::new(file, &source.empty(), &lint, kind).print(args.all, common)
}

/// The facts about a scene's file.
#[derive(Serialize)]
struct Facts<'a> {
    file: &'a str,
    file_bytes: u64,
    gaussians: u64,
    sh_degree: u8,
    antialiased: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    offset: Option<Offset>,
    #[serde(skip_serializing_if = "Option::is_none")]
    view: Option<&'a str>,
    comments: &'a [String],
    extras: Vec<&'a str>,
    statistics: &'a Lint,
    norm_bins: &'static [f64],
    #[serde(flatten)]
    kind: Kind<'a>,
}

#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum Kind<'a> {
    Ply { ply: &'a PlySummary, warnings: &'a [String] },
    Lexi { lexi: Box<LexiFacts<'a>> },
    Other { format: &'static str, about: BTreeMap<&'static str, Value>, warnings: &'a [String] },
}

impl<'a> Facts<'a> {
    /// Returns the facts about the file `name` of `file_bytes` bytes. `like` is a scene without Gaussians that otherwise
    /// equals it.
    fn new(
        (file, file_bytes): (&'a str, u64),
        like: &'a Splats,
        statistics: &'a Lint,
        kind: Kind<'a>,
    ) -> Self {
        Self {
            file,
            file_bytes,
            gaussians: statistics.gaussians,
            sh_degree: like.degree.get(),
            antialiased: like.meta.antialiased,
            offset: like.meta.offset,
            view: like.meta.view.as_deref(),
            comments: &like.meta.comments,
            extras: like.geometry.extras.iter().map(|e| e.name.as_str()).collect(),
            statistics,
            norm_bins: &NORM_BINS,
            kind,
        }
    }

    fn print(&self, all: bool, common: &Common) -> Result<()> {
        if !common.json {
            warn(self.file, &self.statistics.warnings);
        }
        tell(common, self, || self.text(all))
    }

    /// Returns three lines for people, and the details if `all` is set.
    fn text(&self, all: bool) -> Result<String> {
        let mut out = String::new();
        let (bytes, count) = (format::bytes(self.file_bytes), format::count(self.gaussians));
        writeln!(out, "{}: {bytes}, {count} Gaussians, SH degree {}", self.file, self.sh_degree)?;
        if let Some(offset) = self.offset {
            writeln!(
                out,
                "offset {offset}: positions are relative to it, and decompress and convert put it back"
            )?;
        }
        match &self.kind {
            Kind::Ply { ply, .. } => {
                let name = |value: Value| value.as_str().unwrap_or_default().to_owned();
                let format = name(serde_json::to_value(ply.format)?);
                let dialect = name(serde_json::to_value(ply.dialect)?);
                let (properties, row_bytes) = (ply.properties.len(), ply.row_bytes);
                writeln!(
                    out,
                    "PLY, {format}, layout {dialect}, {properties} properties, {row_bytes} bytes a Gaussian"
                )?;
            }
            Kind::Lexi { lexi } => lexi.head(&mut out)?,
            Kind::Other { format, about, .. } => {
                write!(out, "{format}")?;
                for (name, value) in about {
                    write!(out, ", {} {value}", name.replace('_', " "))?;
                }
                writeln!(out, ", axes turned to those of a PLY where they differ")?;
            }
        }
        let lexi = match &self.kind {
            Kind::Lexi { lexi } => Some(lexi),
            _ => None,
        };
        match lexi.and_then(|lexi| lexi.quality()) {
            Some(quality) => writeln!(out, "{quality}")?,
            None => writeln!(out, "{}", self.extent())?,
        }
        if all {
            self.details(lexi.map(AsRef::as_ref), &mut out)?;
        }
        Ok(out)
    }

    /// Returns the extent of the centres of Gaussians, as text.
    fn extent(&self) -> String {
        let axis = |name: &str| self.statistics.attributes.iter().find(|a| a.name == name);
        match ["x", "y", "z"].map(axis) {
            [Some(x), Some(y), Some(z)] if self.gaussians > 0 => {
                let corner = |of: [f64; 3]| of.map(|v| format!("{v:.4}")).join(", ");
                let (least, most) = (corner([x.min, y.min, z.min]), corner([x.max, y.max, z.max]));
                format!("centres from {least} to {most}")
            }
            _ => "no centres".to_owned(),
        }
    }

    /// Writes all other facts.
    fn details(&self, lexi: Option<&LexiFacts<'_>>, out: &mut String) -> Result<()> {
        writeln!(out)?;
        if self.antialiased {
            writeln!(out, "trained with the anti-aliased dilation, and drawn with it")?;
        }
        for comment in self.comments {
            writeln!(out, "comment: {}", format::escape(comment))?;
        }
        if let Some(lexi) = lexi {
            lexi.details(out)?;
        }
        writeln!(out, "\n{:<12} {:>12} {:>12} {:>12}", "attribute", "minimum", "mean", "maximum")?;
        for a in &self.statistics.attributes {
            writeln!(
                out,
                "{:<12} {:>12.5} {:>12.5} {:>12.5}",
                format::escape(&a.name),
                a.min,
                a.mean,
                a.max
            )?;
        }
        if self.sh_degree > 0 {
            let mean = self.statistics.mean_rest_norm;
            writeln!(out, "\nnorm of a Gaussian's SH without DC, mean {mean:.4}")?;
            let labels = NORM_BINS.iter().map(|from| format!("{from} and up")).collect::<Vec<_>>();
            bars(out, &labels, &self.statistics.rest_norms)?;
        }
        Ok(())
    }
}
