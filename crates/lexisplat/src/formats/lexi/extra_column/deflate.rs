//! Deflate streams whose contents have a length that the reader knows.

use miniz_oxide::deflate::core::{
    CompressionStrategy, CompressorOxide, TDEFLFlush, TDEFLStatus, compress_to_output,
};
use miniz_oxide::inflate::TINFLStatus;
use miniz_oxide::inflate::core::inflate_flags::TINFL_FLAG_USING_NON_WRAPPING_OUTPUT_BUF;
use miniz_oxide::inflate::core::{DecompressorOxide, decompress};
use miniz_oxide::{DataFormat, MZ_DEFAULT_WINDOW_BITS};

/// Level of `miniz_oxide`. On the columns measured, level 9 took 0.1 % fewer bytes than level 6, and level 10 took 0.03 %
/// fewer bytes than level 9 for a third more time.
const LEVEL: u8 = 9;
/// Strategies that an encoder tries. In noise, matches by chance cost more than literals.
const STRATEGIES: [CompressionStrategy; 2] = [CompressionStrategy::Default, CompressionStrategy::HuffmanOnly];
/// Number of bytes of a stream's length.
const LENGTH_BYTES: usize = size_of::<u32>();

/// Appends the length and the bytes of a raw deflate stream that holds `bytes`. They must be no more than a block has.
pub(super) fn put(bytes: &[u8], out: &mut Vec<u8>) {
    let streams = STRATEGIES.map(|strategy| deflate(bytes, strategy));
    let Some(best) = streams.into_iter().min_by_key(Vec::len) else { return };
    out.extend(length_bytes(best.len()));
    out.extend(best);
}

/// Takes the stream that [`put`] appended from the front of `from`, and fills `bytes` with its contents. Returns `None` if
/// the contents are longer or shorter than `bytes`, or if something follows the stream within its length.
pub(super) fn take(from: &mut &[u8], bytes: &mut [u8]) -> Option<()> {
    let stream = take_part(from)?;
    let mut state = Box::new(DecompressorOxide::new());
    let (status, used, found) =
        decompress(&mut state, stream, bytes, 0, TINFL_FLAG_USING_NON_WRAPPING_OUTPUT_BUF);
    (status == TINFLStatus::Done && used == stream.len() && found == bytes.len()).then_some(())
}

/// Returns the length in front of a stream or a block of `bytes` bytes. Both are far below 4 GiB.
pub(super) fn length_bytes(bytes: usize) -> [u8; LENGTH_BYTES] {
    debug_assert!(u32::try_from(bytes).is_ok(), "a stream or a block of {bytes} bytes");
    u32::try_from(bytes).unwrap_or(u32::MAX).to_le_bytes()
}

/// Takes a length, and as many bytes, from the front of `from`.
pub(super) fn take_part<'a>(from: &mut &'a [u8]) -> Option<&'a [u8]> {
    let (length, rest) = from.split_first_chunk::<LENGTH_BYTES>()?;
    let (bytes, rest) = rest.split_at_checked(usize::try_from(u32::from_le_bytes(*length)).ok()?)?;
    *from = rest;
    Some(bytes)
}

fn deflate(bytes: &[u8], strategy: CompressionStrategy) -> Vec<u8> {
    let window = u8::try_from(MZ_DEFAULT_WINDOW_BITS).unwrap_or(u8::MAX);
    let mut state = CompressorOxide::with_params(DataFormat::Raw, LEVEL, strategy, window);
    let mut out = Vec::new();
    let (status, _) = compress_to_output(&mut state, bytes, TDEFLFlush::Finish, |block| {
        out.extend_from_slice(block);
        true
    });
    debug_assert_eq!(status, TDEFLStatus::Done, "a vector takes all bytes");
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::support::rng::SplitMix64;

    /// Returns `len` bytes, each of which is one of `different` values.
    fn noise(len: usize, different: usize) -> Vec<u8> {
        let mut random = SplitMix64::new(1);
        (0..len).map(|_| random.below(different).to_le_bytes()[0]).collect()
    }

    /// Bits of a stream, the first ones first.
    #[derive(Default, Clone)]
    struct Bits(Vec<bool>);

    impl Bits {
        /// Adds a number of `count` bits, the lowest first.
        fn number(mut self, number: usize, count: usize) -> Self {
            self.0.extend((0..count).map(|k| number >> k & 1 == 1));
            self
        }

        /// Adds a code of `count` bits, the highest first.
        fn code(mut self, code: usize, count: usize) -> Self {
            self.0.extend((0..count).rev().map(|k| code >> k & 1 == 1));
            self
        }

        /// Adds the start of a dynamic block with `count` literals and lengths. Literals that are not in `literals` have no code.
        fn block(self, last: bool, literals: &[(usize, usize)], count: usize, distances: &[usize]) -> Self {
            let mut out = self.number(last.into(), 1).number(2, 2);
            out = out.number(count - 257, 5).number(distances.len() - 1, 5).number(15, 4);
            // Codes of 4 bits for the lengths from 0 to 15. Lengths 16 to 18 come first in the order of the standard.
            for length in [0; 3].into_iter().chain([4; 16]) {
                out = out.number(length, 3);
            }
            let mut lengths = vec![0; count];
            literals.iter().for_each(|&(symbol, length)| lengths[symbol] = length);
            lengths.extend(distances);
            lengths.into_iter().fold(out, |out, length| out.code(length, 4))
        }

        /// Adds 300 zeros, in literals and lengths of two bits, and the end of the block.
        fn zeros(self, distance: usize, count: usize) -> Self {
            let far = self.code(0, 2).code(3, 2).code(distance, count);
            far.code(2, 2).number(6, 3).code(distance, count).code(1, 2)
        }

        fn taken(&self) -> bool {
            let byte = |bits: &[bool]| (0..).zip(bits).map(|(k, &bit)| u8::from(bit) << k).sum::<u8>();
            let stream: Vec<u8> = self.0.chunks(8).map(byte).collect();
            let (mut found, stream) = ([1; 300], [&length_bytes(stream.len())[..], &stream].concat());
            let taken = take(&mut stream.as_slice(), &mut found).is_some();
            assert!(!taken || found == [0; 300]);
            taken
        }
    }

    /// Decoders of deflate differ in codes that are not complete (docs/FORMAT.md, "Coded columns").
    #[test]
    fn codes_are_taken_as_by_zlib() {
        const TWO: [(usize, usize); 4] = [(0, 2), (256, 2), (273, 2), (285, 2)];
        let distances = |lengths: &[usize], distance, count| {
            Bits::default().block(true, &TWO, 286, lengths).zeros(distance, count).taken()
        };
        assert!(distances(&[1, 1], 0, 1) && distances(&[1], 0, 1));
        assert!(distances(&[[1, 1].as_slice(), &[0; 28]].concat(), 0, 1));
        // More distances than there are, incomplete codes, too many codes, and a code that nothing has.
        assert!(!distances(&[[1, 1].as_slice(), &[0; 29]].concat(), 0, 1));
        assert!(!distances(&[2], 0, 2) && !distances(&[2, 2], 0, 2) && !distances(&[2, 2, 2], 0, 2));
        assert!(!distances(&[1, 1, 1], 0, 1) && !distances(&[1], 1, 1) && !distances(&[0], 0, 1));
        assert!(!Bits::default().block(true, &TWO, 287, &[1]).zeros(0, 1).taken());
        // Literals alone need no distances.
        let literals = |lengths: &[(usize, usize)], count: usize| {
            let block = Bits::default().block(true, lengths, 286, &[0]);
            (0..300).fold(block, |bits, _| bits.code(0, count)).code(1, count).taken()
        };
        assert!(literals(&[(0, 1), (256, 1)], 1));
        assert!(!literals(&[(0, 2), (256, 2)], 2) && !literals(&[(0, 1), (1, 1), (256, 1)], 1));
        // A block may hold nothing but its end, which is one code of one bit.
        let end = |length| Bits::default().block(false, &[(256, length)], 257, &[0]).code(0, length);
        assert!(end(1).block(true, &TWO, 286, &[1]).zeros(0, 1).taken());
        assert!(!end(2).block(true, &TWO, 286, &[1]).zeros(0, 1).taken());
    }

    #[test]
    fn a_stream_holds_what_was_put_and_its_size_is_checked() {
        for (len, different) in [(1, 1), (7, 256), (65_536, 1), (65_536, 5), (65_536, 256), (524_288, 256)] {
            let bytes = noise(len, different);
            let mut stream = Vec::new();
            put(&bytes, &mut stream);
            assert!(stream.len() <= len + len / 1000 + 16, "{} for {len} bytes", stream.len());
            stream.push(99);
            let mut found = vec![0; len];
            let mut rest = stream.as_slice();
            take(&mut rest, &mut found).unwrap();
            assert!(found == bytes && rest == [99]);
            // Neither fewer nor more bytes than the stream holds are taken.
            for wrong in [len - 1, len + 1] {
                assert_eq!(take(&mut stream.as_slice(), &mut vec![0; wrong]), None);
            }
            // A byte within the stream's length does not belong to the stream.
            let longer = length_bytes(stream.len() - LENGTH_BYTES);
            stream[..LENGTH_BYTES].copy_from_slice(&longer);
            assert_eq!(take(&mut stream.as_slice(), &mut found), None);
        }
    }
}
