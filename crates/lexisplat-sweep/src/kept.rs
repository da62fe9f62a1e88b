//! Finished parts of a sweep, kept on disk so that an interrupted one goes on where it stopped.

use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use lexisplat::output::{self, Output, OutputGroup};
use lexisplat_eval::{Error, Result};

/// Raised when kept parts mean something else than before: older ones are then made again.
const VERSION: u32 = 1;
/// Largest kept part, in bytes: ten thousand views.
const MAX_BYTES: u64 = 16 << 20;
/// FNV-1a's offset basis and prime, for 64 bits (Fowler, Noll, Vo).
const FNV_BASIS: u64 = 0xcbf2_9ce4_8422_2325;
const FNV_PRIME: u64 = 0x0100_0000_01b3;

/// The folder of kept parts.
#[derive(Debug)]
pub(super) struct Kept {
    folder: PathBuf,
    /// Whether what is there already counts.
    reuse: bool,
    outputs: OutputGroup,
}

#[derive(Serialize)]
struct Saved<'a, T> {
    version: u32,
    key: &'a str,
    value: &'a T,
}

#[derive(Deserialize)]
struct Loaded<T> {
    version: u32,
    key: String,
    value: T,
}

impl Kept {
    pub(super) fn new(folder: PathBuf, reuse: bool, outputs: &OutputGroup) -> Result<Self> {
        std::fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, e))?;
        Ok(Self { folder, reuse, outputs: outputs.clone() })
    }

    /// The part called `name` that was made from just what `key` says, if it is there and whole.
    pub(super) fn find<T: DeserializeOwned>(&self, name: &str, key: &str) -> Option<T> {
        let path = self.path(name, key);
        if !self.reuse || std::fs::metadata(&path).ok()?.len() > MAX_BYTES {
            return None;
        }
        let loaded: Loaded<T> = serde_json::from_slice(&std::fs::read(&path).ok()?).ok()?;
        // The name holds a hash of the key; the key itself rules out that two share it.
        (loaded.version == VERSION && loaded.key == key).then_some(loaded.value)
    }

    /// Keeps a part.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(super) fn keep<T: Serialize>(&self, name: &str, key: &str, value: &T) -> Result<()> {
        let path = self.path(name, key);
        let saved = Saved { version: VERSION, key, value };
        let text = serde_json::to_vec_pretty(&saved).map_err(|e| Error::format(&path, e.to_string()))?;
        write_whole(&self.outputs, &path, &text)
    }

    fn path(&self, name: &str, key: &str) -> PathBuf {
        self.folder.join(format!("{}-{:016x}.json", file_name(name), hash(key)))
    }
}

/// Writes `bytes` to `path`, whole or not at all, as one of `outputs`.
pub(super) fn write_whole(outputs: &OutputGroup, path: &Path, bytes: &[u8]) -> Result<()> {
    Ok(output::write_whole(Output::from(path).within(outputs), |writer| {
        std::io::Write::write_all(writer, bytes).map_err(|e| lexisplat::Error::io(path, e))
    })?)
}

/// `text` with all but letters, digits, points and dashes replaced.
pub(super) fn file_name(text: &str) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() || "-.".contains(c) { c } else { '_' };
    text.chars().map(safe).take(100).collect()
}

fn hash(text: &str) -> u64 {
    text.bytes().fold(FNV_BASIS, |sum, byte| (sum ^ u64::from(byte)).wrapping_mul(FNV_PRIME))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_found_by_their_key_alone() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path().join("points");
        let kept = Kept::new(at.clone(), true, &OutputGroup::default()).unwrap();
        assert_eq!(kept.find::<Vec<f64>>("a b/c", "key 1"), None);
        kept.keep("a b/c", "key 1", &vec![1.5, 0.1]).unwrap();
        assert_eq!(kept.find::<Vec<f64>>("a b/c", "key 1"), Some(vec![1.5, 0.1]));
        assert_eq!(kept.find::<Vec<f64>>("a b/c", "key 2"), None);
        assert_eq!(
            Kept::new(at, false, &OutputGroup::default()).unwrap().find::<Vec<f64>>("a b/c", "key 1"),
            None
        );
    }

    #[test]
    fn damaged_parts_are_made_again() {
        let folder = tempfile::tempdir().unwrap();
        let kept = Kept::new(folder.path().to_owned(), true, &OutputGroup::default()).unwrap();
        kept.keep("a", "key", &7_u32).unwrap();
        let path = kept.path("a", "key");
        let whole = std::fs::read(&path).unwrap();
        for end in 0..whole.len() {
            std::fs::write(&path, &whole[..end]).unwrap();
            assert_eq!(kept.find::<u32>("a", "key"), None, "{end}");
        }
        let other = String::from_utf8(whole).unwrap().replace("\"key\": \"key\"", "\"key\": \"yek\"");
        std::fs::write(&path, other).unwrap();
        assert_eq!(kept.find::<u32>("a", "key"), None);
    }

    #[test]
    fn the_hash_is_fnv1a() {
        // From the authors' test vectors.
        assert_eq!(hash(""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(hash("foobar"), 0x8594_4171_f739_67e8);
    }
}
