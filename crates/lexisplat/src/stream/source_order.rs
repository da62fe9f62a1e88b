//! The Gaussians of a .lexi file in the order of their source, a part at a time.

use std::path::Path;

use super::buckets::Buckets;
use super::rows::RowLayout;
use crate::formats::lexi::LexiReader;
use crate::packed::StreamBits;
use crate::scene::source::SplatSource;
use crate::scene::splats::Splats;
use crate::sparse::model::Model;
use crate::support::error::Result;

/// Number of Gaussians of a bucket.
const BUCKET: usize = 1 << 17;
/// Number of indices that are read at once. They are whole blocks of their column, so each block is decoded once.
const INDICES_AT_ONCE: usize = 1 << 16;
/// Number of bytes of a Gaussian's index, which comes before its values.
const INDEX_BYTES: usize = 4;

/// Calls `take` with the parts of the dense scene of `lexi`, one after the other. They are in the order of the source if
/// the file holds it, otherwise in the order of the file. Temporary files, if any are needed, are in `folder`.
///
/// # Errors
/// [`crate::Error::Format`] for damage that only decoding finds; [`crate::Error::Io`] for temporary files; the errors of
/// `take`.
pub fn in_source_order(
    lexi: &LexiReader<'_>,
    folder: &Path,
    take: &mut dyn FnMut(Splats) -> Result<()>,
) -> Result<()> {
    parts_and_source_order(lexi, folder, false, &mut |_| (), take)?;
    Ok(())
}

/// Does the same as [`in_source_order`], and calls `see` with every part as it is in the file. With `count_bits`, returns
/// the number of bits of each stream of a packed file.
pub(super) fn parts_and_source_order(
    lexi: &LexiReader<'_>,
    folder: &Path,
    count_bits: bool,
    see: &mut dyn FnMut(&Model),
    take: &mut dyn FnMut(Splats) -> Result<()>,
) -> Result<Vec<StreamBits>> {
    if !lexi.order_kept() {
        return lexi.parts(count_bits, &mut |_, model| {
            see(&model);
            take(model.into_splats())
        });
    }
    by_buckets(lexi, folder, BUCKET, count_bits, see, take)
}

fn by_buckets(
    lexi: &LexiReader<'_>,
    folder: &Path,
    bucket_len: usize,
    count_bits: bool,
    see: &mut dyn FnMut(&Model),
    take: &mut dyn FnMut(Splats) -> Result<()>,
) -> Result<Vec<StreamBits>> {
    let n = lexi.len();
    let rows = RowLayout::new(lexi.empty());
    let mut buckets = Buckets::new(folder, n.div_ceil(bucket_len))?;
    let mut bytes = Vec::new();
    // The indices of the Gaussians to come, and the number of indices that were read.
    let (mut indices, mut read) = (Vec::new(), 0);
    let bits = lexi.parts(count_bits, &mut |_, model| {
        see(&model);
        let mut splats = model.into_splats();
        rows.pack(&mut splats, &mut bytes);
        while indices.len() < splats.len() && read < n {
            let range = read..n.min(read + INDICES_AT_ONCE);
            read = range.end;
            indices.extend(lexi.order(range)?);
        }
        let own = indices.drain(..splats.len().min(indices.len()));
        for (row, index) in bytes.chunks_exact(rows.bytes()).zip(own) {
            buckets.push(index as usize / bucket_len, &[&index.to_le_bytes(), row])?;
        }
        Ok(())
    })?;
    for bucket in 0..buckets.len() {
        let start = bucket * bucket_len;
        let count = bucket_len.min(n - start);
        bytes.clear();
        bytes.resize(count * rows.bytes(), 0);
        for record in buckets.take(bucket)?.chunks_exact(INDEX_BYTES + rows.bytes()) {
            let (index, row) = record.split_at(INDEX_BYTES);
            let index = index.first_chunk().map_or(0, |p| u32::from_le_bytes(*p)) as usize - start;
            bytes[index * rows.bytes()..][..row.len()].copy_from_slice(row);
        }
        take(rows.unpack(&bytes))?;
    }
    Ok(bits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::packed::{MOST_CHUNK, PackOptions, Packer};
    use crate::{Extra, ExtraValues, Limits, Sensitivity, Silent, lexi, ply};

    #[test]
    fn small_buckets_undo_the_order_of_a_packed_file() {
        let n = MOST_CHUNK + 1000;
        let mut splats = crate::support::testing::scene(n, 2);
        splats = splats.with_degree_cut(crate::ShDegree::new(1).unwrap());
        // A name of one of the normals, which a PLY that lexisplat writes otherwise has.
        let values = ExtraValues::U32((0..u32::try_from(n).unwrap()).collect());
        splats.geometry.extras = vec![Extra { name: "nx".into(), values }];
        let options = PackOptions { keep_order: true, atoms: Some(8), ..PackOptions::default() };
        let sensitivity = Sensitivity::guess(&splats.geometry);
        let packer = Packer::new(&splats, &sensitivity, &options).unwrap();
        let (packed, _) = packer.pack(packer.step_for(30.0), &Silent).unwrap();
        let mut bytes = Vec::new();
        lexi::LexiWriter::packed(&packed).write(&mut bytes, &Silent).unwrap();
        let whole = lexi::read_bytes("t", &bytes, &Limits::default()).unwrap().into_splats();
        let chunks = LexiReader::open("t", &bytes, &Limits::default()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        for bucket in [4099, n, BUCKET] {
            let mut start = 0;
            let mut seen = 0;
            let bits = by_buckets(
                &chunks,
                folder.path(),
                bucket,
                true,
                &mut |model| seen += model.len(),
                &mut |part| {
                    let range = start..start + part.len();
                    assert_eq!(part.geometry.positions, whole.geometry.positions[range.clone()]);
                    assert_eq!(part.geometry.rotations, whole.geometry.rotations[range.clone()]);
                    assert_eq!(part.sh_rest, whole.sh_rest[9 * range.start..9 * range.end]);
                    let expected =
                        ExtraValues::U32(range.clone().map(|i| u32::try_from(i).unwrap()).collect());
                    assert_eq!(part.geometry.extras, [Extra { name: "nx".into(), values: expected }]);
                    assert_eq!(part.meta, whole.meta);
                    start = range.end;
                    Ok(())
                },
            )
            .unwrap();
            assert_eq!((start, seen), (n, n));
            assert_eq!(bits, packed.stream_bits().unwrap());
        }
        let (mut expected, mut found) = (Vec::new(), Vec::new());
        ply::write(&mut expected, &whole).unwrap();
        super::super::decompress(&chunks, &mut found, &Silent).unwrap();
        assert!(found == expected);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
