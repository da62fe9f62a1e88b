//! The folder that a sweep leaves behind.

use std::path::{Path, PathBuf};

use super::kept::write_whole;
use super::{
    Figure, Results, Saved, Setting, SweepPicture, figures, survey, sweep_html, sweep_markdown, tables,
    tidy_csv,
};
use lexisplat::output::OutputGroup;
use lexisplat_eval::{Error, Result};

/// The page holds pictures of at most so many bytes in all; browsers grow slow with more. All stay in their
/// folder.
const PICTURE_BYTES: u64 = 24 << 20;
/// The tolerance whose pictures go into the page before others: the paper's main one.
const SHOWN_FIRST: f64 = 0.1;

/// Writes everything that `results` give into `folder`: `report.html`, `report.md`, `results.json`, `all.csv`,
/// `tables/`, `figures/`, and `survey/` where there were photos. `saved` are the pictures to show; `date` is
/// printed as it is. Files are members of `outputs`. Returns what was written.
///
/// # Errors
/// If a figure cannot be drawn, a picture not be read, or a file not be written.
pub fn write_report(
    folder: &Path,
    results: &Results,
    saved: &[Saved],
    date: Option<&str>,
    outputs: &OutputGroup,
) -> Result<Vec<PathBuf>> {
    let mut out = Folder { root: folder, outputs, written: Vec::new() };
    let json = serde_json::to_string_pretty(results)
        .map_err(|e| Error::format(folder.join("results.json"), e.to_string()))?;
    out.write("results.json", format!("{json}\n").as_bytes())?;
    out.write("all.csv", tidy_csv(results).as_bytes())?;
    for table in tables::all(results) {
        out.write(&format!("tables/{}.md", table.name), table.to_markdown().as_bytes())?;
        out.write(&format!("tables/{}.csv", table.name), table.to_csv().as_bytes())?;
        out.write(&format!("tables/{}.tex", table.name), table.to_latex().as_bytes())?;
    }
    let figures = figures(results)?;
    for figure in &figures {
        out.write(&format!("figures/{}.svg", figure.name), figure.svg.as_bytes())?;
        out.write(&format!("figures/{}.png", figure.name), &figure.png)?;
    }
    for (path, text) in survey(results) {
        out.write(&format!("survey/{path}"), text.as_bytes())?;
    }
    let named: Vec<(String, &Figure)> =
        figures.iter().map(|figure| (format!("figures/{}.svg", figure.name), figure)).collect();
    out.write("report.md", sweep_markdown(results, &named, date).as_bytes())?;
    let shown = shown(saved)?;
    let pictures: Vec<SweepPicture<'_>> = shown.iter().filter_map(|shown| shown.picture(results)).collect();
    out.write("report.html", sweep_html(results, &figures, &pictures, date).as_bytes())?;
    Ok(out.written)
}

struct Folder<'a> {
    root: &'a Path,
    outputs: &'a OutputGroup,
    written: Vec<PathBuf>,
}

impl Folder<'_> {
    fn write(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        let path = self.root.join(name);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        }
        write_whole(self.outputs, &path, bytes)?;
        self.written.push(path);
        Ok(())
    }
}

/// A picture with its files' bytes.
struct Shown<'a> {
    saved: &'a Saved,
    original: Vec<u8>,
    compressed: Vec<u8>,
    difference: Vec<u8>,
    photo: Option<Vec<u8>>,
}

impl<'a> Shown<'a> {
    fn read(saved: &'a Saved) -> Result<Self> {
        let load = |path: &PathBuf| std::fs::read(path).map_err(|e| Error::io(path, e));
        Ok(Self {
            saved,
            original: load(&saved.original)?,
            compressed: load(&saved.compressed)?,
            difference: load(&saved.difference)?,
            photo: saved.photo.as_ref().map(load).transpose()?,
        })
    }

    fn bytes(&self) -> u64 {
        let parts = [&self.original, &self.compressed, &self.difference].into_iter().chain(&self.photo);
        parts.map(|part| part.len() as u64).sum()
    }

    fn picture<'b>(&'b self, results: &'b Results) -> Option<SweepPicture<'b>> {
        let scene = results.scenes.get(self.saved.scene)?;
        Some(SweepPicture {
            scene: &scene.name,
            method: scene.method,
            setting_label: &self.saved.setting,
            view: &self.saved.view,
            original_png: &self.original,
            compressed_png: &self.compressed,
            difference_png: &self.difference,
            photo_png: self.photo.as_deref(),
        })
    }
}

/// The pictures that fit into a page, in the order of scenes and settings.
fn shown(saved: &[Saved]) -> Result<Vec<Shown<'_>>> {
    let first = Setting::Tolerance(SHOWN_FIRST).label();
    let (before, after): (Vec<_>, Vec<_>) =
        saved.iter().enumerate().partition(|(_, picture)| picture.setting == first);
    let mut bytes = 0;
    let mut read = Vec::new();
    for (place, picture) in before.into_iter().chain(after) {
        let picture = Shown::read(picture)?;
        bytes += picture.bytes();
        if bytes > PICTURE_BYTES {
            break;
        }
        read.push((place, picture));
    }
    read.sort_by_key(|(place, _)| *place);
    Ok(read.into_iter().map(|(_, picture)| picture).collect())
}
