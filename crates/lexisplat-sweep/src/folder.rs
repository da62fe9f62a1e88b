//! The folder that a sweep leaves behind.

use std::path::{Path, PathBuf};

use super::cache::write_whole;
use super::figures::figures;
use super::long_csv::long_csv;
use super::markdown::sweep_markdown;
use super::page::sweep_html;
use super::survey::survey;
use super::{PictureFiles, Results, Setting, SweepPicture, paper, tables};
use lexisplat::output::OutputGroup;
use lexisplat_compress::{Error, Result};

/// Most bytes of pictures on the page; browsers grow slow with more. All pictures stay in their folder.
const PICTURE_BYTES: usize = 24 << 20;

/// Writes everything that follows from `results` into `folder`: `report.html`, `report.md`, `results.json`,
/// `all.csv`, `tables/`, `figures/`, and `survey/` if there were photos. `pictures` are those to show. `date` is
/// printed as it is. The files are members of `outputs`. Returns their paths.
///
/// # Errors
/// If a figure cannot be drawn, a picture cannot be read, or a file cannot be written.
pub fn write_report(
    folder: &Path,
    results: &Results,
    pictures: &[PictureFiles],
    date: Option<&str>,
    outputs: &OutputGroup,
) -> Result<Vec<PathBuf>> {
    let json = serde_json::to_string_pretty(results)
        .map_err(|e| Error::format(folder.join("results.json"), e.to_string()))?;
    let mut files: Vec<(String, Vec<u8>)> = vec![
        ("results.json".to_owned(), format!("{json}\n").into_bytes()),
        ("all.csv".to_owned(), long_csv(results).into_bytes()),
    ];
    for table in tables::all(results) {
        for (extension, text) in
            [("md", table.to_markdown()), ("csv", table.to_csv()), ("tex", table.to_latex())]
        {
            files.push((format!("tables/{}.{extension}", table.name), text.into_bytes()));
        }
    }
    let figures = figures(results)?;
    let html = sweep_html(results, &figures, &shown(pictures)?, date);
    let markdown = sweep_markdown(results, &figures, date);
    for figure in figures {
        files.push((format!("figures/{}.svg", figure.name), figure.svg.into_bytes()));
        files.push((format!("figures/{}.png", figure.name), figure.png));
        files.push((format!("figures/{}.pdf", figure.name), figure.pdf));
    }
    files.extend(
        survey(results).into_iter().map(|(path, text)| (format!("survey/{path}"), text.into_bytes())),
    );
    files.push(("report.md".to_owned(), markdown.into_bytes()));
    files.push(("report.html".to_owned(), html.into_bytes()));
    let write = |(name, bytes): (String, Vec<u8>)| {
        let path = folder.join(name);
        let parent = path.parent().unwrap_or(folder);
        std::fs::create_dir_all(parent).map_err(|e| Error::io(parent, e))?;
        write_whole(outputs, &path, &bytes)?;
        Ok(path)
    };
    files.into_iter().map(write).collect()
}

/// The pictures that fit into a page, in the order of scenes and settings. Those of the paper's main tolerance
/// are taken before others.
fn shown(files: &[PictureFiles]) -> Result<Vec<SweepPicture>> {
    let first = Setting::Tolerance(paper::TOLERANCE).label();
    let mut order: Vec<usize> = (0..files.len()).collect();
    order.sort_by_key(|&i| files[i].setting != first);
    let mut bytes = 0;
    let mut shown = Vec::new();
    for i in order {
        let picture = files[i].read()?;
        let parts =
            [&picture.original, &picture.compressed, &picture.difference].into_iter().chain(&picture.photo);
        bytes += parts.map(Vec::len).sum::<usize>();
        if bytes > PICTURE_BYTES {
            break;
        }
        shown.push((i, picture));
    }
    shown.sort_by_key(|(i, _)| *i);
    Ok(shown.into_iter().map(|(_, picture)| picture).collect())
}
