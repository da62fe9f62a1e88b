//! The output folder of a sweep.

use std::path::{Path, PathBuf};

use super::cache::write_whole;
use super::figures::figures;
use super::long_csv::long_csv;
use super::page::sweep_html;
use super::picture::Part;
use super::survey::survey;
use super::{PictureFiles, Results, Setting, paper, tables};
use lexisplat::output::OutputGroup;
use lexisplat_compress::{Error, Result};

/// Largest number of bytes of pictures on the page, because browsers become slow with more. All pictures stay in their
/// folder.
const PICTURE_BYTES: usize = 24 << 20;

/// Writes all outputs of `results` into `folder`: `report.html`, `all.csv`, `tables/`, `figures/`, and `survey/` if there
/// were photos. `pictures` are the pictures that the page may show. `date` is printed as it is. The files are members of
/// `outputs`. Returns the paths of the files.
///
/// # Errors
/// An error if a picture cannot be read, or a file cannot be written.
pub fn write_report(
    folder: &Path,
    results: &Results,
    pictures: &[PictureFiles],
    date: Option<&str>,
    outputs: &OutputGroup,
) -> Result<Vec<PathBuf>> {
    let mut files = vec![("all.csv".to_owned(), long_csv(results))];
    for table in
        [tables::means(results), tables::scenes(results)].iter().filter(|table| !table.rows.is_empty())
    {
        files.push((format!("tables/{}.tex", table.name), table.to_latex()));
    }
    files.extend(survey(results).into_iter().map(|(path, text)| (format!("survey/{path}"), text)));
    let figures = figures(results);
    files.push(("report.html".to_owned(), sweep_html(results, &figures, &shown(pictures)?, date)));
    let texts = files.into_iter().map(|(name, text)| (name, text.into_bytes()));
    let charts = figures.iter().map(|figure| (format!("figures/{}.pdf", figure.name), figure.pdf()));
    let write = |(name, bytes): (String, Vec<u8>)| {
        let path = folder.join(name);
        let parent = path.parent().unwrap_or(folder);
        std::fs::create_dir_all(parent).map_err(|e| Error::io(parent, e))?;
        write_whole(outputs, &path, &bytes)?;
        Ok(path)
    };
    texts.chain(charts).map(write).collect()
}

/// Returns the pictures that fit into a page, in the order of scenes and settings. Pictures of the paper's main tolerance
/// are chosen before others.
fn shown(files: &[PictureFiles]) -> Result<Vec<(&PictureFiles, Vec<Part>)>> {
    let first = Setting::Tolerance(paper::TOLERANCE).label();
    let mut order: Vec<usize> = (0..files.len()).collect();
    order.sort_by_key(|&i| files[i].setting != first);
    let mut bytes = 0;
    let mut shown = Vec::new();
    for i in order {
        let parts = files[i].read()?;
        bytes += parts.iter().map(|part| part.png.len()).sum::<usize>();
        if bytes > PICTURE_BYTES {
            break;
        }
        shown.push((i, parts));
    }
    shown.sort_by_key(|(i, _)| *i);
    Ok(shown.into_iter().map(|(i, parts)| (&files[i], parts)).collect())
}
