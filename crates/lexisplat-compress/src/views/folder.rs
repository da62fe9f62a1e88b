//! A folder of photos, and the search for the photo of a camera by its name.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use lexisplat::{file_inside, inside};
use lexisplat_render::Camera;

use crate::error::{Error, Result};

/// Extensions of photos, in lower case.
const ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];
/// Largest size of a photo that is found by the name in a file of cameras, in bytes.
const MAX_BYTES: u64 = super::photo::MAX_PHOTO_BYTES;
/// Largest depth of folders that are searched. Links could form a circle.
const MAX_DEPTH: usize = 8;
/// Largest number of files and folders that are searched.
const MAX_ENTRIES: usize = 1_000_000;
/// Name of the folder of full-size photos in the folder of a data set.
const IMAGES: &str = "images";

/// The photos of a folder and its sub-folders.
#[derive(Debug)]
pub(super) struct PhotoFolder {
    folder: PathBuf,
    /// Divisor by which the size of the photos is still to be divided.
    pub(super) divisor: u32,
    /// Paths in ascending order.
    photos: Vec<PathBuf>,
    /// Indices of photos by path within the folder, without extension.
    by_path: HashMap<String, Vec<usize>>,
    /// Indices of photos by file name, without extension.
    by_stem: HashMap<String, Vec<usize>>,
}

/// The photos that match a name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Found<'a> {
    One(&'a Path),
    Several(&'a Path, &'a Path),
    None,
}

impl<'a> Found<'a> {
    pub(super) fn one(self) -> Option<&'a Path> {
        match self {
            Self::One(path) => Some(path),
            Self::Several(..) | Self::None => None,
        }
    }
}

impl PhotoFolder {
    /// Opens the folder `images`, or its sub-folder named `images` if there is one. For a divisor above 1, opens the folder
    /// of smaller photos beside or inside that folder, if there is one.
    pub(super) fn open(images: &Path, divisor: u32) -> Result<Self> {
        let inner = images.join(IMAGES);
        let base = if inner.is_dir() { inner } else { images.to_path_buf() };
        let smaller = smaller(images, &base, divisor);
        let (folder, divisor) = smaller.map_or((base, divisor), |folder| (folder, 1));
        let mut photos = Vec::new();
        collect(&folder, &folder, 0, &mut 0, &mut photos)?;
        photos.sort();
        let mut by_path: HashMap<String, Vec<usize>> = HashMap::new();
        let mut by_stem: HashMap<String, Vec<usize>> = HashMap::new();
        for (index, path) in photos.iter().enumerate() {
            let within = path.strip_prefix(&folder).unwrap_or(path).with_extension("");
            let within = plain(&within.to_string_lossy());
            let stem = within.rsplit('/').next().unwrap_or_default().to_owned();
            by_stem.entry(stem).or_default().push(index);
            by_path.entry(within).or_default().push(index);
        }
        if photos.is_empty() {
            let value = folder.display();
            return Err(Error::parameter("images", value, "a folder with photos (png, jpg or jpeg)"));
        }
        Ok(Self { folder, divisor, photos, by_path, by_stem })
    }

    /// Finds the photo of the camera `name`. It is looked up by the path without extension, then by ever shorter ends of
    /// that path, then by the file name in any folder. The extension of `name`, if there is one, distinguishes several
    /// photos.
    pub(super) fn find(&self, name: &str) -> Found<'_> {
        let name = plain(name);
        let (stem, ending) = without_ending(&name);
        let mut tails = [name.as_str(), stem];
        loop {
            for tail in tails {
                if let Some(found) = self.by_path.get(tail) {
                    return self.choose(found, ending);
                }
            }
            match tails.map(|tail| tail.split_once('/').map(|(_, rest)| rest)) {
                [Some(a), Some(b)] => tails = [a, b],
                _ => break,
            }
        }
        let found = tails.into_iter().find_map(|tail| self.by_stem.get(tail));
        found.map_or(Found::None, |found| self.choose(found, ending))
    }

    fn choose(&self, found: &[usize], ending: Option<&str>) -> Found<'_> {
        let path = |index: &usize| self.photos.get(*index).map(PathBuf::as_path);
        let alike =
            |path: &&Path| ending.zip(path.extension()).is_some_and(|(a, b)| b.eq_ignore_ascii_case(a));
        let all: Vec<&Path> = found.iter().filter_map(path).collect();
        let same: Vec<&Path> = all.iter().copied().filter(alike).collect();
        match (all.as_slice(), same.as_slice()) {
            ([one], _) | (_, [one]) => Found::One(one),
            ([a, b, ..], _) => Found::Several(a, b),
            _ => Found::None,
        }
    }

    /// Returns the cameras that have a photo of their own, at least one, with the paths of the photos. Adds warnings about
    /// the other cameras.
    pub(super) fn matched(
        &self,
        cameras: Vec<Camera>,
        warnings: &mut Vec<String>,
    ) -> Result<Vec<(Camera, PathBuf)>> {
        let count = cameras.len();
        let first = cameras.first().map(|camera| camera.name.clone()).unwrap_or_default();
        let (mut lost, mut several, mut shared) = (Left::default(), Left::default(), Left::default());
        let mut pairs: Vec<(Camera, PathBuf)> = Vec::new();
        for camera in cameras {
            match self.find(&camera.name) {
                Found::One(path) => pairs.push((camera, path.to_path_buf())),
                Found::None => lost.add(|| format!("'{}'", camera.name)),
                Found::Several(a, b) => {
                    several.add(|| format!("'{}': {} and {}", camera.name, a.display(), b.display()));
                }
            }
        }
        let mut owners: HashMap<PathBuf, String> = HashMap::new();
        let mut contested: HashMap<PathBuf, String> = HashMap::new();
        for (camera, path) in &pairs {
            let owner = owners.entry(path.clone()).or_insert_with(|| camera.name.clone());
            if *owner != camera.name {
                contested.entry(path.clone()).or_insert_with(|| format!("'{owner}' and '{}'", camera.name));
            }
        }
        pairs.retain(|(_, path)| {
            let Some(both) = contested.get(path) else { return true };
            shared.add(|| format!("{both}: {}", path.display()));
            false
        });
        let folder = self.folder.display();
        warnings.extend(lost.tell(count, &format!("have no photo in {folder}")));
        warnings.extend(several.tell(count, &format!("match several photos in {folder}")));
        warnings.extend(shared.tell(count, "match a photo that another camera matches too"));
        if pairs.is_empty() {
            let photo = self.photos.first().and_then(|path| path.strip_prefix(&self.folder).ok());
            let photo = photo.unwrap_or(&self.folder).display();
            let why = warnings.last().map_or("", String::as_str);
            let expected =
                format!("photos named as the cameras are; a camera is '{first}', a photo '{photo}' ({why})");
            return Err(Error::parameter("images", folder, expected));
        }
        Ok(pairs)
    }
}

/// The number of cameras that were left out for one reason, and an example.
#[derive(Default)]
struct Left {
    count: usize,
    example: String,
}

impl Left {
    fn add(&mut self, example: impl FnOnce() -> String) {
        if self.count == 0 {
            self.example = example();
        }
        self.count += 1;
    }

    fn tell(&self, of: usize, why: &str) -> Option<String> {
        let Self { count, example } = self;
        (*count > 0).then(|| format!("{count} of {of} cameras {why} and are left out, such as {example}"))
    }
}

/// Finds the photo that a file of cameras calls `name`, in the folder of the file or below it. If no file has the name,
/// extensions of photos are appended. Files of cameras may come from anybody: names of files elsewhere, and of anything but
/// regular files, are ignored.
pub(super) fn beside(source: &Path, name: &str) -> Option<PathBuf> {
    let folder = if source.is_dir() { source } else { source.parent()? };
    let ended = |ending: &str| format!("{name}.{ending}");
    let names = ENDINGS.iter().flat_map(|ending| [ended(ending), ended(&ending.to_uppercase())]);
    let name = std::iter::once(name.to_owned())
        .chain(names)
        .find(|name| file_inside(folder, name, MAX_BYTES).is_ok());
    Some(folder.join(name?))
}

/// Finds the folder of photos that are smaller by `divisor`, such as `images_4`, beside the folder `base` of photos or in
/// the folder `given`.
fn smaller(given: &Path, base: &Path, divisor: u32) -> Option<PathBuf> {
    if divisor == 1 {
        return None;
    }
    let name = base.file_name()?.to_string_lossy();
    let beside = base.with_file_name(format!("{name}_{divisor}"));
    [beside, given.join(format!("{IMAGES}_{divisor}"))].into_iter().find(|folder| folder.is_dir())
}

/// Adds the photos of `folder` and its sub-folders to `photos`. All must lie in `root`.
fn collect(
    root: &Path,
    folder: &Path,
    depth: usize,
    seen: &mut usize,
    photos: &mut Vec<PathBuf>,
) -> Result<()> {
    let io = |e| Error::io(folder, e);
    for entry in fs::read_dir(folder).map_err(io)? {
        let entry = entry.map_err(io)?;
        *seen += 1;
        if *seen > MAX_ENTRIES {
            let problem =
                format!("over the limit of {MAX_ENTRIES} files and folders; name the photos' folder");
            return Err(Error::format(folder, problem));
        }
        // Names that begin with a dot belong to the system: macOS leaves one for each photo.
        if entry.file_name().to_string_lossy().starts_with('.') {
            continue;
        }
        let path = entry.path();
        // `metadata` follows links. A link that leads nowhere is not a photo, nor is a pipe or a device.
        let Ok(metadata) = fs::metadata(&path) else { continue };
        let is_folder = metadata.is_dir() && depth < MAX_DEPTH;
        if !(is_folder || metadata.is_file() && is_photo(&path)) {
            continue;
        }
        // Only links can lead out of the folder. Other files are not looked up once more, because there may be many.
        if entry.file_type().map_err(io)?.is_symlink() {
            inside(root, path.strip_prefix(root).unwrap_or(&path))?;
        }
        if is_folder {
            collect(root, &path, depth + 1, seen, photos)?;
        } else {
            photos.push(path);
        }
    }
    Ok(())
}

fn is_photo(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ENDINGS.iter().any(|known| ending.eq_ignore_ascii_case(known)))
}

/// Returns a path with forward slashes, without `./` or a slash at its start.
fn plain(path: &str) -> String {
    let path = path.replace('\\', "/");
    let mut rest = path.as_str();
    while let Some(after) = rest.strip_prefix("./").or_else(|| rest.strip_prefix('/')) {
        rest = after;
    }
    rest.to_owned()
}

/// Returns a path without its extension, and the extension.
fn without_ending(path: &str) -> (&str, Option<&str>) {
    match path.rsplit_once('.') {
        Some((stem, ending)) if !ending.contains('/') => (stem, Some(ending)),
        _ => (path, None),
    }
}
