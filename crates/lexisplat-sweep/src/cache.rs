//! Finished parts of a sweep on disk, so that an interrupted sweep continues where it stopped.

use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use lexisplat::output::{self, Output, OutputGroup};
use lexisplat_compress::{Error, Result};
use lexisplat_eval::format::file_name;

/// Version of the format of stored parts. Parts of other versions are made again.
const VERSION: u32 = 1;
/// Largest size of a part, in bytes: ten thousand views.
const MAX_BYTES: u64 = 16 << 20;
/// Offset basis and prime of FNV-1a, for 64 bits (Fowler, Noll, Vo).
const FNV_BASIS: u64 = 0xcbf2_9ce4_8422_2325;
const FNV_PRIME: u64 = 0x0100_0000_01b3;

/// A folder of finished parts.
#[derive(Debug)]
pub(super) struct Cache {
    folder: PathBuf,
    /// Whether parts from earlier runs are used.
    reuse: bool,
    outputs: OutputGroup,
}

/// The content of a part's file.
#[derive(Serialize, Deserialize)]
struct Stored<K, T> {
    version: u32,
    key: K,
    value: T,
}

impl Cache {
    pub(super) fn new(folder: PathBuf, reuse: bool, outputs: &OutputGroup) -> Result<Self> {
        std::fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, e))?;
        Ok(Self { folder, reuse, outputs: outputs.clone() })
    }

    /// Returns the stored part `name` that was made from exactly the values in `key`; `None` if it does not exist or is
    /// damaged.
    pub(super) fn find<T: DeserializeOwned>(&self, name: &str, key: &str) -> Option<T> {
        let path = self.path(name, key);
        if !self.reuse || std::fs::metadata(&path).ok()?.len() > MAX_BYTES {
            return None;
        }
        let stored: Stored<String, T> = serde_json::from_slice(&std::fs::read(&path).ok()?).ok()?;
        // The file name has a hash of the key. The comparison of the key itself excludes collisions.
        (stored.version == VERSION && stored.key == key).then_some(stored.value)
    }

    /// Stores a part.
    ///
    /// # Errors
    /// An error if the part cannot be written.
    pub(super) fn store<T: Serialize>(&self, name: &str, key: &str, value: &T) -> Result<()> {
        let path = self.path(name, key);
        let stored = Stored { version: VERSION, key, value };
        let text = serde_json::to_vec_pretty(&stored).map_err(|e| Error::format(&path, e.to_string()))?;
        write_whole(&self.outputs, &path, &text)
    }

    fn path(&self, name: &str, key: &str) -> PathBuf {
        self.folder.join(format!("{}-{:016x}.json", file_name(name), hash(key)))
    }
}

/// Writes `bytes` to `path`, completely or not at all. The file is a member of `outputs`.
pub(super) fn write_whole(outputs: &OutputGroup, path: &Path, bytes: &[u8]) -> Result<()> {
    Ok(output::write_whole(Output::from(path).within(outputs), |writer| {
        std::io::Write::write_all(writer, bytes).map_err(|e| lexisplat::Error::io(path, e))
    })?)
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
        let open = |reuse| Cache::new(at.clone(), reuse, &OutputGroup::default()).unwrap();
        let cache = open(true);
        assert_eq!(cache.find::<Vec<f64>>("a b/c", "key 1"), None);
        cache.store("a b/c", "key 1", &vec![1.5, 0.1]).unwrap();
        assert_eq!(cache.find::<Vec<f64>>("a b/c", "key 1"), Some(vec![1.5, 0.1]));
        assert_eq!(cache.find::<Vec<f64>>("a b/c", "key 2"), None);
        assert_eq!(open(false).find::<Vec<f64>>("a b/c", "key 1"), None);
    }

    #[test]
    fn damaged_parts_are_made_again() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::new(folder.path().to_owned(), true, &OutputGroup::default()).unwrap();
        cache.store("a", "key", &7_u32).unwrap();
        let path = cache.path("a", "key");
        let whole = std::fs::read(&path).unwrap();
        for end in 0..whole.len() {
            std::fs::write(&path, &whole[..end]).unwrap();
            assert_eq!(cache.find::<u32>("a", "key"), None, "{end}");
        }
        let other = String::from_utf8(whole).unwrap().replace("\"key\": \"key\"", "\"key\": \"yek\"");
        std::fs::write(&path, other).unwrap();
        assert_eq!(cache.find::<u32>("a", "key"), None);
    }

    #[test]
    fn the_hash_is_fnv1a() {
        // From the authors' test vectors.
        assert_eq!(hash(""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(hash("foobar"), 0x8594_4171_f739_67e8);
    }
}
