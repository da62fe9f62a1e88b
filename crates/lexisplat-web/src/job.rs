//! Jobs: the data that a worker needs to decode a chunk, as bytes that can be passed from thread to thread.
//!
//! All numbers are little-endian. A job has the number of the chunk (u32), the number of chunks whose base has come
//! (u32), the numbers of these chunks (u32 each), the number of ranges (u32), the offset in the file (u64) and length
//! (u32) of each range, and the bytes of the ranges.

use lexisplat::lexi::LexiFeed;
use lexisplat::{Error, Result};

/// Returns the job of decoding chunk `chunk` of `feed` as if the bases of the chunks `bases`, and no others, had come.
pub(crate) fn write(feed: &LexiFeed, chunk: usize, bases: &[usize]) -> Vec<u8> {
    let ranges = feed.ranges(chunk);
    let mut job = Vec::new();
    // A file numbers chunks and ranges by 32 bits.
    let mut number = |n: usize| job.extend(u32::try_from(n).unwrap_or(u32::MAX).to_le_bytes());
    number(chunk);
    number(bases.len());
    bases.iter().copied().for_each(&mut number);
    number(ranges.len());
    for (at, bytes) in &ranges {
        job.extend(at.to_le_bytes());
        job.extend(u32::try_from(bytes.len()).unwrap_or(u32::MAX).to_le_bytes());
    }
    ranges.iter().for_each(|(_, bytes)| job.extend_from_slice(bytes));
    job
}

/// Passes the contents of `job` to `feed`. Returns the number of its chunk.
///
/// # Errors
/// [`Error::Parameter`] for bytes that are not a job, and errors of [`LexiFeed::feed`].
pub(crate) fn take(feed: &mut LexiFeed, job: &[u8]) -> Result<usize> {
    let wrong = || Error::parameter("job", format!("{} bytes", job.len()), "what Feed.job gave");
    let Job { chunk, bases, ranges } = Job::read(job).ok_or_else(wrong)?;
    feed.note_bases(&bases);
    feed.want(chunk);
    for (at, bytes) in ranges {
        feed.feed(at, bytes)?;
    }
    Ok(chunk)
}

struct Job<'j> {
    chunk: usize,
    bases: Vec<usize>,
    ranges: Vec<(u64, &'j [u8])>,
}

impl<'j> Job<'j> {
    fn read(mut job: &'j [u8]) -> Option<Self> {
        let number = |from: &mut &'j [u8]| {
            let (number, rest) = from.split_first_chunk()?;
            *from = rest;
            Some(u32::from_le_bytes(*number) as usize)
        };
        let chunk = number(&mut job)?;
        let count = number(&mut job)?;
        let bases = job.split_off(..count.checked_mul(4)?)?;
        let bases = bases.as_chunks().0.iter().map(|&b| u32::from_le_bytes(b) as usize).collect();
        let count = number(&mut job)?;
        let entries = job.split_off(..count.checked_mul(12)?)?;
        let ranges = entries.as_chunks::<12>().0.iter().map(|entry| {
            let (at, length) = (entry.first_chunk()?, entry.last_chunk()?);
            let bytes = job.split_off(..u32::from_le_bytes(*length) as usize)?;
            Some((u64::from_le_bytes(*at), bytes))
        });
        let ranges: Option<Vec<_>> = ranges.collect();
        Some(Self { chunk, bases, ranges: ranges? }).filter(|_| job.is_empty())
    }
}
