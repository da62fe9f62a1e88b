//! Streamed SOG: a `lod-meta.json` that names SOGs of parts of a scene in several levels of detail (specification: "The
//! Streamed SOG format", developer.playcanvas.com).
//!
//! A leaf of the tree states for each level which Gaussians of which SOG belong to the leaf. The finest level is read,
//! and so is the environment, which is shown at every level.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use lexisplat::ply::ReadOptions;
use lexisplat::sh::CHANNELS;
use lexisplat::{Error, Result, SceneMeta, ShDegree};
use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::json;

use super::{Sizes, SogRows, unit};
use crate::rows::{Described, Rows, RowsMut};
use crate::siblings::Siblings;

/// Version that is read. A file without a version has this version too.
const VERSION: u64 = 1;

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Index {
    #[serde(default)]
    version: Option<u64>,
    /// Number of Gaussians of each level.
    #[serde(default)]
    counts: Vec<u64>,
    #[serde(default)]
    environment: Option<String>,
    filenames: Vec<String>,
    tree: Node,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Node {
    children: Vec<Node>,
    /// References by level. Level 0 is the finest.
    lods: BTreeMap<u32, Reference>,
}

/// A run of Gaussians of a SOG.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
struct Reference {
    file: usize,
    offset: u64,
    count: u64,
}

impl Reference {
    fn end(&self) -> u64 {
        self.offset.saturating_add(self.count)
    }
}

/// Names in a `lod-meta.json` that distinguish it from other JSON files.
#[derive(Deserialize)]
struct Marks {
    filenames: Option<IgnoredAny>,
    tree: Option<IgnoredAny>,
}

/// Returns whether `bytes` are a `lod-meta.json`.
pub(super) fn is_index(bytes: &[u8]) -> bool {
    let marks = serde_json::from_slice::<Marks>(bytes);
    marks.is_ok_and(|marks| marks.filenames.is_some() && marks.tree.is_some())
}

/// Reads the finest level of the streamed SOG whose `lod-meta.json` has the content `bytes`. Messages call the file
/// `name`.
///
/// # Errors
/// As [`read`](super::read()).
pub(super) fn read<'a>(
    name: &'a str,
    bytes: &[u8],
    siblings: Siblings<'_>,
    options: &ReadOptions,
) -> Result<(Described<'a>, Sizes)> {
    let limits = &options.limits;
    limits.check_header(name, bytes.len() as u64)?;
    let malformed = |text: String| Error::malformed(name, text);
    let index: Index = serde_json::from_slice(bytes).map_err(|error| malformed(error.to_string()))?;
    if let Some(version) = index.version.filter(|version| *version != VERSION) {
        return Err(malformed(format!("version {version} of streamed SOG, and {VERSION} is read")));
    }
    let (level, references) = finest(&index.tree);
    let total = references.iter().fold(0_u64, |sum, reference| sum.saturating_add(reference.count));
    limits.check_gaussians(name, total)?;
    if let Some(&count) = index.counts.get(level as usize)
        && count != total
    {
        return Err(malformed(format!(
            "{count} Gaussians of level {level} by 'counts', and {total} by the tree"
        )));
    }
    let mut scene = Streamed { units: Vec::new(), segments: Vec::new(), degree: ShDegree::ZERO, len: 0 };
    let mut found = Found { sizes: Sizes::of(bytes.len()), ..Found::default() };
    let mut add = |path: &str, references: &[Reference]| -> Result<()> {
        let called = Path::new(name).with_file_name(path).display().to_string();
        let content = siblings.read_below(name, path, limits)?;
        let folder = path.rsplit_once('/').map_or(String::new(), |(folder, _)| format!("{folder}/"));
        let unit = unit(&called, &content, siblings, folder, limits)?;
        let whole = [Reference { file: 0, offset: 0, count: unit.len as u64 }];
        let references = if references.is_empty() { &whole } else { references };
        if let Some(odd) = references.iter().find(|reference| reference.end() > unit.len as u64) {
            let text = format!("Gaussians up to {} are named, and it has {}", odd.end(), unit.len);
            return Err(Error::malformed(called, text));
        }
        found.sizes.all = found.sizes.all.saturating_add(unit.sizes.all);
        found.sizes.counted = found.sizes.counted.saturating_add(unit.sizes.counted);
        found.antialiased |= unit.antialiased;
        for warning in unit.warnings {
            found.warnings.push(format!("{called}: {warning}"));
        }
        scene.add(unit.rows, unit.degree, references);
        Ok(())
    };
    for group in references.chunk_by(|a, b| a.file == b.file) {
        let path = group.first().and_then(|first| index.filenames.get(first.file));
        let path = path.ok_or_else(|| {
            let text = format!("the tree names more files than the {} of 'filenames'", index.filenames.len());
            Error::malformed(name, text)
        })?;
        if let Some(both) = group.windows(2).find(|pair| pair[0].end() > pair[1].offset) {
            let text = format!("two leaves have Gaussian {} of '{}'", both[1].offset, path.escape_debug());
            return Err(Error::malformed(name, text));
        }
        add(path, group)?;
    }
    if let Some(path) = &index.environment {
        add(path, &[])?;
    }
    limits.check_gaussians(name, scene.len as u64)?;
    let described = Described {
        len: scene.len,
        degree: scene.degree,
        meta: SceneMeta { antialiased: found.antialiased, ..SceneMeta::default() },
        warnings: found.warnings,
        facts: vec![
            ("version", json!(VERSION)),
            ("level", json!(level)),
            ("levels", json!(index.counts.len().max(level as usize + 1))),
            ("parts", json!(scene.units.len())),
            ("environment", json!(index.environment.is_some())),
        ],
        rows: Box::new(scene),
    };
    Ok((described, found.sizes))
}

/// Facts that were found besides the Gaussians.
#[derive(Debug, Default)]
struct Found {
    sizes: Sizes,
    antialiased: bool,
    warnings: Vec<String>,
}

/// Returns the finest level with Gaussians, and the references to these Gaussians, sorted by file and index.
fn finest(tree: &Node) -> (u32, Vec<Reference>) {
    let (mut level, mut references) = (u32::MAX, Vec::new());
    let mut left = vec![tree];
    while let Some(node) = left.pop() {
        left.extend(&node.children);
        for (&own, &reference) in node.lods.iter().filter(|(_, reference)| reference.count > 0) {
            if own < level {
                level = own;
                references.clear();
            }
            if own == level {
                references.push(reference);
            }
        }
    }
    references.sort_unstable();
    (if references.is_empty() { 0 } else { level }, references)
}

/// Gaussians of several SOGs, one run after the other.
#[derive(Debug)]
struct Streamed {
    units: Vec<SogRows>,
    segments: Vec<Segment>,
    /// Highest SH degree of all SOGs.
    degree: ShDegree,
    len: usize,
}

/// A run of Gaussians of a SOG.
#[derive(Debug)]
struct Segment {
    unit: usize,
    degree: ShDegree,
    /// The Gaussians within the SOG.
    range: Range<usize>,
    /// Number of the first Gaussian in the scene.
    start: usize,
}

impl Streamed {
    /// Adds the Gaussians `references` of a SOG, which must have them all.
    fn add(&mut self, rows: SogRows, degree: ShDegree, references: &[Reference]) {
        let unit = self.units.len();
        self.units.push(rows);
        self.degree = self.degree.max(degree);
        for reference in references {
            let [from, to] = [reference.offset, reference.end()].map(|at| usize::try_from(at).unwrap_or(0));
            self.segments.push(Segment { unit, degree, range: from..to, start: self.len });
            self.len += to - from;
        }
    }
}

impl Rows for Streamed {
    fn fill(&self, range: Range<usize>, mut out: RowsMut<'_>) {
        let first = self.segments.partition_point(|s| s.start + s.range.len() <= range.start);
        let mut at = range.start;
        for segment in &self.segments[first..] {
            let end = range.end.min(segment.start + segment.range.len());
            if at >= end {
                break;
            }
            let from = segment.range.start + (at - segment.start);
            let mut part = out.take(end - at, self.degree.rest());
            let rows = &self.units[segment.unit];
            if segment.degree == self.degree {
                rows.fill(from..from + (end - at), part);
            } else {
                let mut own = vec![0.0; segment.degree.rest() * (end - at)];
                rows.fill(from..from + (end - at), RowsMut { sh_rest: &mut own, ..part.reborrow() });
                raise(&own, segment.degree, part.sh_rest, self.degree);
            }
            at = end;
        }
    }

    fn is_finite(&self) -> bool {
        true
    }
}

/// Copies rows of SH-rest of degree `from` to rows of the higher degree `to`. Missing coefficients are 0.
fn raise(rows: &[f32], from: ShDegree, out: &mut [f32], to: ShDegree) {
    out.fill(0.0);
    let (short, long) = (from.rest_per_channel(), to.rest_per_channel());
    if short == 0 {
        return;
    }
    let channels = out.chunks_exact_mut(long).zip(rows.chunks_exact(short));
    debug_assert_eq!(rows.len() / short % CHANNELS, 0, "rows of three channels");
    channels.for_each(|(out, row)| out[..short].copy_from_slice(row));
}

#[cfg(test)]
mod tests {
    use lexisplat::Splats;
    use lexisplat_sample::{SampleOptions, scene};

    use super::super::tests::{GAUSSIANS, members, opened_at};
    use super::*;

    /// Writes the SOG of `splats` to the folder `name` of `root`.
    fn sog(root: &Path, name: &str, splats: &Splats) {
        std::fs::create_dir(root.join(name)).unwrap();
        for (member, content) in members(splats) {
            std::fs::write(root.join(name).join(member), content).unwrap();
        }
    }

    fn read_index(root: &Path, index: &serde_json::Value) -> Result<Splats> {
        std::fs::write(root.join("lod-meta.json"), index.to_string()).unwrap();
        opened_at(root)
    }

    #[test]
    fn the_finest_level_is_read_and_the_environment_with_it() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let [near, far, coarse] = [1, 2, 3].map(|seed| scene(&SampleOptions::new(GAUSSIANS, seed)));
        let sky = coarse.with_degree_cut(ShDegree::ONE);
        for (name, splats) in [("0_0", &near), ("0_1", &far), ("1_0", &coarse), ("env", &sky)] {
            sog(root, name, splats);
        }
        let [near, far, sky] = ["0_0", "0_1", "env"].map(|name| opened_at(&root.join(name)).unwrap());
        let lod = |file: usize, offset: usize, count: usize| json!({"file": file, "offset": offset, "count": count});
        let leaf = |fine: serde_json::Value| json!({"bound": {}, "lods": {"0": fine, "1": lod(2, 0, 100)}});
        let mut index = json!({
            "version": 1, "asset": {"generator": "by hand"}, "count": 500, "counts": [400, 300], "lodLevels": 2,
            "environment": "env/meta.json",
            "filenames": ["0_0/meta.json", "0_1/meta.json", "1_0/meta.json"],
            "tree": {"bound": {}, "children": [
                leaf(lod(1, 0, 150)),
                {"children": [leaf(lod(0, 200, 100)), leaf(lod(1, 150, 150))]},
            ]},
        });
        let found = read_index(root, &index).unwrap();
        assert_eq!((found.len(), found.degree), (400 + GAUSSIANS, ShDegree::THREE));
        assert_eq!(found.geometry.positions[..100], near.geometry.positions[200..300]);
        assert_eq!(found.geometry.positions[100..400], far.geometry.positions[..]);
        assert_eq!(found.rest(399), far.rest(299));
        assert_eq!(found.geometry.scales[400..], sky.geometry.scales[..]);
        let [long, short] = [found.rest(407), sky.rest(7)];
        for c in 0..CHANNELS {
            assert_eq!(long[15 * c..15 * c + 3], short[3 * c..3 * (c + 1)]);
            assert!(long[15 * c + 3..15 * (c + 1)].iter().all(|&v| v == 0.0));
        }
        index["version"] = 2.into();
        assert!(read_index(root, &index).unwrap_err().to_string().contains("version 2 of streamed SOG"));
    }

    #[test]
    fn indices_that_lie_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        sog(root, "0_0", &scene(&SampleOptions::new(GAUSSIANS, 1)));
        let refused = |filenames: serde_json::Value, lods: &[[u64; 3]], counts: serde_json::Value| {
            let leaf = |[file, offset, count]: &[u64; 3]| json!({"lods": {"0": {"file": file, "offset": offset, "count": count}}});
            let children: Vec<_> = lods.iter().map(leaf).collect();
            let index = json!({"counts": counts, "filenames": filenames, "tree": {"children": children}});
            read_index(root, &index).unwrap_err().to_string()
        };
        let good = || json!(["0_0/meta.json"]);
        for (said, expected) in [
            (refused(good(), &[[0, 1, 300]], json!([300])), "up to 301 are named, and it has 300"),
            (refused(good(), &[[0, 0, 9], [0, 8, 9]], json!([])), "two leaves have Gaussian 8"),
            (refused(good(), &[[1, 0, 9]], json!([])), "more files than the 1"),
            (refused(good(), &[[0, 0, 9]], json!([10])), "10 Gaussians of level 0 by 'counts', and 9"),
            (refused(good(), &[[0, 0, u64::MAX], [0, 0, u64::MAX]], json!([])), "over the limit"),
            (refused(json!(["../0_0/meta.json"]), &[[0, 0, 9]], json!([])), "plain name"),
            (refused(json!(["/etc/passwd"]), &[[0, 0, 9]], json!([])), "plain name"),
            (refused(json!(["none/meta.json"]), &[[0, 0, 9]], json!([])), "none/meta.json"),
        ] {
            assert!(said.contains(expected), "{expected}: {said}");
        }
        let deep = format!(
            "{{\"filenames\": [], \"tree\": {}{}}}",
            "{\"children\": [".repeat(9999),
            "]}".repeat(9999)
        );
        std::fs::write(root.join("lod-meta.json"), deep).unwrap();
        assert!(opened_at(root).is_err());
    }
}
