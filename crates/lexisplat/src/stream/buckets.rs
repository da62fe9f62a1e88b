//! Records that are distributed over buckets in temporary files. Each bucket fits in memory.

use std::path::Path;

use crate::support::error::Result;
use crate::support::spill::{SpillTo, Temporary};

/// Number of bytes that a bucket collects before they are written.
const BLOCK: usize = 1 << 16;
/// Largest number of temporary files. Buckets share files, and a file is removed when its last bucket is taken.
const FILES: usize = 64;

/// Records of one length in buckets. Within a bucket they stay in the order in which they were pushed.
#[derive(Debug)]
pub(super) struct Buckets {
    files: Vec<Option<Temporary>>,
    /// Number of buckets that share a file.
    shared: usize,
    buckets: Vec<Bucket>,
}

#[derive(Debug, Default, Clone)]
struct Bucket {
    /// Bytes that are not written yet.
    pending: Vec<u8>,
    /// Start and length of each block in the file.
    written: Vec<(u64, usize)>,
}

impl Buckets {
    /// Creates `count` empty buckets with temporary files in `folder`.
    pub(super) fn new(folder: &Path, count: usize) -> Result<Self> {
        let shared = count.div_ceil(FILES).max(1);
        let files = (0..count.div_ceil(shared)).map(|_| Temporary::new(SpillTo::Folder(folder)).map(Some));
        Ok(Self { files: files.collect::<Result<_>>()?, shared, buckets: vec![Bucket::default(); count] })
    }

    /// Returns the number of buckets.
    pub(super) fn len(&self) -> usize {
        self.buckets.len()
    }

    /// Appends a record, given in parts, to bucket `bucket`.
    pub(super) fn push(&mut self, bucket: usize, record: &[&[u8]]) -> Result<()> {
        let pending = &mut self.buckets[bucket].pending;
        record.iter().for_each(|part| pending.extend_from_slice(part));
        if pending.len() >= BLOCK { self.flush(bucket) } else { Ok(()) }
    }

    fn flush(&mut self, bucket: usize) -> Result<()> {
        let Bucket { pending, written } = &mut self.buckets[bucket];
        let Some(file) = &mut self.files[bucket / self.shared] else { return Ok(()) };
        written.push((file.append(pending)?, pending.len()));
        pending.clear();
        Ok(())
    }

    /// Removes and returns all records of bucket `bucket`. Buckets must be taken in order.
    pub(super) fn take(&mut self, bucket: usize) -> Result<Vec<u8>> {
        let out = self.read(bucket)?;
        self.buckets[bucket] = Bucket::default();
        if (bucket + 1).is_multiple_of(self.shared) {
            self.files[bucket / self.shared] = None;
        }
        Ok(out)
    }

    /// Returns all records of bucket `bucket`, and keeps them.
    pub(super) fn read(&mut self, bucket: usize) -> Result<Vec<u8>> {
        let Bucket { pending, written } = &self.buckets[bucket];
        let mut out = vec![0; written.iter().map(|w| w.1).sum()];
        if let Some(file) = &mut self.files[bucket / self.shared] {
            let mut rest = out.as_mut_slice();
            for &(at, len) in written {
                let (block, tail) = std::mem::take(&mut rest).split_at_mut(len);
                file.read_at(at, block)?;
                rest = tail;
            }
        }
        out.extend_from_slice(pending);
        Ok(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_come_back_bucket_by_bucket_in_order() {
        let folder = tempfile::tempdir().unwrap();
        // There are more buckets than files. Some are larger than a block, and some are empty.
        let count = 3 * FILES - 1;
        let mut buckets = Buckets::new(folder.path(), count).unwrap();
        assert_eq!(buckets.len(), count);
        let mut expected = vec![Vec::new(); count];
        for i in 0..120_000_u32 {
            let bucket = if i % 3 == 0 { 5 } else { (i as usize * 7919) % (count - 1) };
            let record = [i.to_le_bytes(), (!i).to_le_bytes()];
            buckets.push(bucket, &[&record[0], &record[1]]).unwrap();
            expected[bucket].extend(record.concat());
        }
        for (bucket, expected) in expected.into_iter().enumerate() {
            assert!(buckets.read(bucket).unwrap() == expected, "{bucket}");
            assert!(buckets.take(bucket).unwrap() == expected, "{bucket}");
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
