//! Messages about a file of no known format.

/// The formats that are read.
pub(crate) const FORMATS: &str = "PLY (3DGS, 2DGS), compressed.ply, .lexi, SPZ, SOG (.sog, meta.json, lod-meta.json), .splat, .ksplat, glTF (.glb, .gltf)";
/// First bytes of a Git LFS pointer (git-lfs, `docs/spec.md`).
const GIT_LFS: &[u8] = b"version https://git-lfs.github.com/spec/";
/// Beginnings of web pages, in lower case.
const PAGES: [&str; 3] = ["<!doctype html", "<html", "<head"];

/// Returns why the file that begins with `bytes` cannot be read: its kind, if it can be told, and the formats that are
/// read.
pub(crate) fn unknown(bytes: &[u8]) -> String {
    let start = bytes.trim_ascii_start();
    let is_page =
        |page: &str| start.get(..page.len()).is_some_and(|start| start.eq_ignore_ascii_case(page.as_bytes()));
    if bytes.starts_with(GIT_LFS) {
        return "this is a pointer of Git LFS and not the file that it stands for: 'git lfs pull' fetches that".to_owned();
    }
    if PAGES.into_iter().any(is_page) {
        return "this is a page of HTML, perhaps the error or the login that a download gave in place of a scene".to_owned();
    }
    format!("the format is not known; these are read: {FORMATS}")
}

/// Returns why an archive with these members is not a SOG.
pub(crate) fn no_sog<'a>(members: impl Iterator<Item = &'a str> + Clone) -> String {
    let ends = |name: &str, end: &str| {
        name.len() >= end.len()
            && name.is_char_boundary(name.len() - end.len())
            && name[name.len() - end.len()..].eq_ignore_ascii_case(end)
    };
    let find = |end: &str| members.clone().find(|name| ends(name, end));
    let scene =
        [".ply", ".lexi", ".spz", ".splat", ".ksplat", ".glb", ".gltf", ".sog"].into_iter().find_map(find);
    match (find("/meta.json"), scene) {
        (Some(meta), _) => format!(
            "the zip archive has no 'meta.json' at its root, as a SOG has; there is '{}': unpack it and open that",
            meta.escape_debug()
        ),
        (None, Some(scene)) => format!(
            "a zip archive with '{}' in it, and no SOG, which has a 'meta.json': unpack it and open that",
            scene.escape_debug()
        ),
        (None, None) => "the zip archive has no 'meta.json', so it is no SOG".to_owned(),
    }
}
